"""What drives and links bear, which wrenches cost nothing, and what the physics says: tables and facts."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import RenderableType
from rich.text import Text

from rmrc.analysis.statics.balance import ROUNDING, Balance, Costs, Elsewhere
from rmrc.analysis.statics.hold import HoldResult
from rmrc.arm import Arm
from rmrc.show.sheets import Sheet, as_table, number
from rmrc.support.legible import visible

Array = NDArray[np.float64]

PLURALS = {"wrench": "wrenches", "force": "forces alone", "moment": "moments alone"}
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
ROWS = ("fx", "fy", "fz", "nx", "ny", "nz")


def render(
    borne: Balance,
    costs: Sequence[Costs],
    gravity: bool,
    held: HoldResult | None = None,
    other: Elsewhere | None = None,
) -> Iterator[RenderableType]:
    """Yield what to print, for a terminal of 100 columns or more.

    Args:
        borne: What drives and links bear.
        costs: What wrenches cost.
        gravity: Whether the drives bear the arm's weight.
        held: What it took to hold the wrench in the physics, if that was asked.
        other: The wrench at another site, if that was asked.
    """
    arm = borne.arm
    place = ", ".join(f"{name} {number(at)}" for name, at in zip(arm.joints, borne.q, strict=True))
    yield Text(
        f"{visible(arm.path.name)}: site {arm.site} at {_vector(arm.pose(borne.q)[:3])} m; {place}", "bold"
    )
    force, moment = borne.wrench[:3], borne.wrench[3:]
    yield Text(
        f"The wrench acts on the arm: force {_vector(force)} N, moment {_vector(moment)} N·m, world axes."
    )
    yield Text("The drives bear the arm's weight as well." if gravity else "The arm's weight is compensated.")
    if other is not None:
        yield from _elsewhere(other, arm.site)
    yield from _drives(borne, gravity)
    yield from _links(borne)
    yield from _free(costs)
    if held is not None:
        yield from _held(held)


def _elsewhere(other: Elsewhere, site: str) -> Iterator[RenderableType]:
    shown = _rounded(max(1.0, np.abs(other.wrench).max()))
    yield Text()
    yield Text(f"The same wrench at {other.site} {{A}}, along its axes, from {site} {{B}}", "bold")
    for name, inputs, transform in (
        ("force transform", ROWS, other.force_transform),
        ("velocity transform", TWIST, other.velocity_transform),
    ):
        result = [shown(value) for value in other.wrench] if inputs is ROWS else [""] * 6
        rows = [
            (row, *map(shown, values), value)
            for row, values, value in zip(inputs, transform, result, strict=True)
        ]
        last = "wrench at A" if inputs is ROWS else ""
        yield as_table(Sheet("", (name, *(f"{one} of B" for one in inputs), last), rows))
        yield Text()
    yield Text("The force transform is the inverse transpose of the velocity transform: power is the same.")


def _drives(borne: Balance, gravity: bool) -> Iterator[RenderableType]:
    arm, shown = borne.arm, _rounded(borne.size.max())
    columns = {"equivalent": borne.equivalent, "balancing": borne.equilibrium}
    if gravity:
        columns["gravity"] = borne.gravity
    if borne.springs.any():
        columns["springs"] = borne.springs
    if len(columns) > 2:
        columns["in all"] = borne.torque
    rows = [
        (
            _with_unit(arm, j),
            *(shown(column[j]) for column in columns.values()),
            number(arm.torque_limit[j]),
            shown(borne.margin[j]),
            _word(borne, j),
        )
        for j in range(arm.n)
    ]
    headings = ("drive", *columns, "limit", "margin", "")
    yield Text()
    yield Text("Drives", "bold")
    yield as_table(Sheet("", headings, rows, frozenset({0, len(headings) - 1})))
    yield Text("Equivalent, Jᵀ F: what they give for the site to press on the world with this wrench.")
    yield Text("Balancing, −Jᵀ F: what they give to hold still while this wrench acts on the arm.")
    for name in borne.exceeded:
        j = arm.joints.index(name)
        need, over, limit = (
            f"{number(abs(x))} {_unit(arm, j)}"
            for x in (borne.torque[j], borne.margin[j], arm.torque_limit[j])
        )
        yield Text(f"{name} needs {need}: {over} more than its limit of {limit}.")


def _links(borne: Balance) -> Iterator[RenderableType]:
    arm, shown = borne.arm, _rounded(np.abs(borne.reaction).max())
    units = [f"{name} [{'N' if i < 3 else 'N·m'}]" for i, name in enumerate(ROWS)]
    for title, table in (
        ("along its own axes, z along the joint", borne.reaction),
        ("along world axes", borne.reaction_world),
    ):
        yield Text()
        yield Text(f"What each link takes from the one before, at its joint; {title}", "bold")
        rows = [(name, *map(shown, row)) for name, row in zip(arm.joints, table, strict=True)]
        yield as_table(Sheet("", ("joint", *units), rows))
    yield Text()
    yield Text("Of that the drive gives one component, and bearings and links the rest", "bold")
    rows = []
    for j, (fx, fy, fz, nx, ny, nz) in enumerate(borne.structure):
        taken = (fz, np.hypot(fx, fy), nz, np.hypot(nx, ny))
        rows.append((_with_unit(arm, j), shown(borne.propagated[j]), *map(shown, taken)))
    headings = ("joint", "drive", "thrust [N]", "radial force [N]", "moment about [N·m]", "bending [N·m]")
    yield as_table(Sheet("", headings, rows))
    yield Text(
        f"Of the wrench alone. From link to link and by −Jᵀ F the drives give the same, to "
        f"{number(borne.disagreement)}."
    )


def _free(costs: Sequence[Costs]) -> Iterator[RenderableType]:
    yield Text()
    yield Text("What a wrench, a force or a moment of size 1 costs the drives", "bold")
    rows = []
    for group in costs:
        for i, one in enumerate(group.directions):
            kind = PLURALS[group.kind] if i == 0 else ""
            free = np.isinf(one.amplification)
            gain = "" if free else number(one.amplification)
            rows.append((kind, in_words(one.wrench), number(one.sigma), gain, one.cost.value))
    yield as_table(Sheet("", ("of all", "", "torque σ", "1/σ", "costs"), rows, frozenset({0, 1, 4})))
    for group in costs:
        if group.free_only_here:
            yield Text(
                f"Of {PLURALS[group.kind]}, {group.free} cost{'s' * (group.free == 1)} no torque here and "
                f"{group.free_anywhere} at almost every configuration: the arm is singular."
            )


def _held(held: HoldResult) -> Iterator[RenderableType]:
    arm, shown = held.wanted.arm, _rounded(held.ended.size.max())
    rows = [
        (
            _with_unit(arm, j),
            *(shown(v[j]) for v in (held.wanted.torque, held.ended.torque, held.measured)),
            number(held.difference[j]),
            number(held.allowed[j] if held.is_still else np.nan),
            "at its limit" if held.at_limit[j] else "",
        )
        for j in range(arm.n)
    ]
    headings = ("drive", "statics", "where it rests", "measured", "difference", "allowed", "")
    yield Text()
    yield Text("Held in the physics", "bold")
    yield as_table(Sheet("", headings, rows, frozenset({0, 6})))
    way, turn = map(float, np.linalg.norm(held.drift.reshape(2, 3), axis=1))
    yield Text(
        f"After {number(len(held.run) * held.run.period)} s the site is {number(1e3 * way)} mm and "
        f"{number(np.degrees(turn))} deg from where it should stay."
    )
    yield Text(verdict(held))


def verdict(held: HoldResult) -> str:
    """Say how the holding went."""
    names = [name for name, is_there in zip(held.wanted.arm.joints, held.at_limit, strict=True) if is_there]
    reached = f"{', '.join(names)} came to the torque limit" if names else "no drive came to its torque limit"
    if held.run.divergence:
        return f"MISSED: {held.run.divergence}; {reached}."
    if not held.is_still:
        return f"MISSED: not still, the fastest joint does {number(held.rate)} rad/s or m/s; {reached}."
    if not held.agrees:
        return f"MISSED: still, but the actuators give something else; {reached}."
    return f"met: still, and the actuators give what statics says; {reached}."


def in_words(wrench: Array) -> str:
    """Return a wrench of size 1 in words, such as `a force along x`."""
    force, moment = wrench[:3], wrench[3:]
    if not moment.any():
        return f"a force along {_axis(force)}"
    if not force.any():
        return f"a moment about {_axis(moment)}"
    return f"force {_short(force)} and moment {_short(moment)}"


def _axis(v: Array) -> str:
    if np.count_nonzero(v) == 1:
        return "xyz"[int(np.flatnonzero(v)[0])]
    # an axis that is nearly met is not called by its name
    return f"({', '.join(f'{x:.3g}' for x in np.round(v / np.linalg.norm(v), 6) + 0.0)})"


def _short(v: Array) -> str:
    return f"({', '.join(f'{x:g}' for x in np.round(v, 2) + 0.0)})"


def _vector(v: Array) -> str:
    return f"({', '.join(f'{x:.6g}' for x in np.round(v, 9) + 0.0)})"


def _rounded(size: float) -> Callable[[float], str]:
    """Return how to show numbers that come from sums of some size."""
    return lambda value: number(0.0 if abs(value) <= ROUNDING * size else float(value))


def _unit(arm: Arm, j: int) -> str:
    return "N" if arm.is_slide[j] else "N·m"


def _with_unit(arm: Arm, j: int) -> str:
    return f"{arm.joints[j]} [{_unit(arm, j)}]"


def _word(borne: Balance, j: int) -> str:
    if np.isinf(borne.arm.torque_limit[j]):
        return "no limit"
    return "EXCEEDED" if borne.arm.joints[j] in borne.exceeded else "ok"


def facts(
    borne: Balance,
    costs: Sequence[Costs],
    length: float,
    held: HoldResult | None,
    other: Elsewhere | None = None,
) -> dict[str, object]:
    """Return all of it for strict JSON; an infinite number is null.

    Args:
        borne: What drives and links bear.
        costs: What wrenches cost.
        length: That made meters and radians comparable in `costs` [m].
        held: What it took to hold the wrench in the physics, or None.
        other: The wrench at another site, or None.
    """
    arm = borne.arm
    return {
        "model": str(arm.path),
        "site": arm.site,
        "joints": list(arm.joints),
        "q": _list(borne.q),
        "wrench_on_arm": _list(borne.wrench),
        "at": None
        if other is None
        else {
            "site": other.site,
            "wrench": _list(other.wrench),
            "force_transform": other.force_transform.tolist(),
            "velocity_transform": other.velocity_transform.tolist(),
        },
        "torque": {
            "unit": [_unit(arm, j) for j in range(arm.n)],
            "equivalent": _list(borne.equivalent),
            "equilibrium": _list(borne.equilibrium),
            "gravity": _list(borne.gravity),
            "springs": _list(borne.springs),
            "in_all": _list(borne.torque),
            "limit": _list(arm.torque_limit),
            "margin": _list(borne.margin),
            "exceeded": list(borne.exceeded),
        },
        "links": [
            {
                "joint": name,
                "frame": borne.frames[j].tolist(),
                "reaction": _list(borne.reaction[j]),
                "reaction_world": _list(borne.reaction_world[j]),
                "drive": float(borne.propagated[j]),
                "structure": _list(borne.structure[j]),
            }
            for j, name in enumerate(arm.joints)
        ],
        "disagreement": borne.disagreement,
        "length": length,
        "costs": {
            group.kind: {
                "free": group.free,
                "free_anywhere": group.free_anywhere,
                "free_only_here": group.free_only_here,
                "directions": [
                    {
                        "wrench": _list(one.wrench),
                        "words": in_words(one.wrench),
                        "sigma": one.sigma,
                        "amplification": _finite(one.amplification),
                        "costs": one.cost.value,
                    }
                    for one in group.directions
                ],
            }
            for group in costs
        },
        "held": None if held is None else _held_facts(held),
    }


def _held_facts(held: HoldResult) -> dict[str, object]:
    return {
        "agrees": held.agrees,
        "still": held.is_still,
        "seconds": len(held.run) * held.run.period,
        "statics": _list(held.wanted.torque),
        "where_it_rests": _list(held.ended.torque),
        "measured": _list(held.measured),
        "difference": _list(held.difference),
        "allowed": _list(held.allowed),
        "at_limit": [bool(one) for one in held.at_limit],
        "drift": _list(held.drift),
        "rate": _finite(held.rate),
        "verdict": verdict(held),
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _list(values: Array) -> list[float | None]:
    return [_finite(value) for value in values]
