"""Actuator torques, link loads, free wrenches, and the result of the physics: tables and JSON."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.statics.balance import ROUNDING, Balance, Costs, Elsewhere
from rmrc.analysis.statics.causes import borne
from rmrc.analysis.statics.hold import HoldResult
from rmrc.analysis.statics.statics import WRENCH, Statics
from rmrc.arm import Arm
from rmrc.show.report import Report, plain
from rmrc.show.sheets import Sheet, number

Array = NDArray[np.float64]

PLURALS = {"wrench": "wrenches", "force": "forces alone", "moment": "moments alone"}
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")


def report(found: Statics) -> Report:
    """Return the report of an arm under a wrench; its condition fails if holding it did not agree.

    Args:
        found: The result of `statics`.

    Example:
        >>> from rmrc.analysis.statics.statics import statics
        >>> shown = report(statics("models/planar_2link.xml", [0, -1, 0], [0.0, np.pi / 3]))
        >>> shown.sheets[1].title, shown.sheets[1].rows[0][:3], shown.json["torque"]["exceeded"]
        ('Actuators', ('shoulder [N·m]', '-1.500', '1.500'), [])
    """
    balance, other, held = found.balance, found.elsewhere, found.held
    sheets = [
        _place(balance),
        *(() if other is None else _elsewhere(other, balance.arm.site)),
        _drives(balance),
        *_links(balance),
        _free(found.costs),
        *(() if held is None else [_held(held)]),
    ]
    diverged = None if held is None else held.run.divergence
    return Report(
        sheets=[*sheets[:-1], replace(sheets[-1], is_spaced=False)],
        json=plain(_values(found)),
        met=held is None or held.agrees,
        problem=f"error: {diverged}" if diverged else "",
    )


# JSON -------------------------------------------------------------------------------------------


def _values(found: Statics) -> dict[str, Any]:
    balance, other, held = found.balance, found.elsewhere, found.held
    return {
        "model": str(balance.arm.path), "site": balance.arm.site, "joints": balance.arm.joints,
        "q": balance.q, "wrench_on_arm": balance.wrench,
        "at": other and _elsewhere_values(other),
        "torque": _torque_values(balance),
        "links": [_link_values(balance, j) for j in range(len(balance.reaction))],
        "disagreement": balance.disagreement, "length": found.length,
        "costs": {group.kind: _cost_values(group) for group in found.costs},
        "held": held and _held_values(held),
    }  # fmt: skip


def _elsewhere_values(other: Elsewhere) -> dict[str, Any]:
    return {
        "site": other.site, "wrench": other.wrench, "force_transform": other.force_transform,
        "velocity_transform": other.velocity_transform,
    }  # fmt: skip


def _torque_values(balance: Balance) -> dict[str, Any]:
    return {
        "unit": [_unit(balance.arm, j) for j in range(balance.arm.n)], "equivalent": balance.equivalent,
        "equilibrium": balance.equilibrium, "gravity": balance.gravity, "springs": balance.springs,
        "in_all": balance.torque, "limit": balance.arm.torque_limit, "margin": balance.margin,
        "exceeded": balance.exceeded,
    }  # fmt: skip


def _link_values(balance: Balance, j: int) -> dict[str, Any]:
    return {
        "joint": balance.arm.axis_names[j], "frame": balance.frames[j], "reaction": balance.reaction[j],
        "reaction_world": balance.reaction_world[j], "drive": balance.driven[j],
        "structure": balance.structure[j],
    }  # fmt: skip


def _cost_values(group: Costs) -> dict[str, Any]:
    directions = [
        {"wrench": one.wrench, "words": in_words(one.wrench), "sigma": one.sigma,
         "amplification": one.amplification, "costs": one.cost.value}
        for one in group.directions
    ]  # fmt: skip
    return {
        "free": group.free, "free_anywhere": group.free_anywhere, "free_only_here": group.free_only_here,
        "directions": directions,
    }  # fmt: skip


def _held_values(held: HoldResult) -> dict[str, Any]:
    return {
        "agrees": held.agrees, "still": held.is_still, "seconds": len(held.run) * held.run.period,
        "statics": held.wanted.torque, "where_it_rests": held.ended.torque, "measured": held.measured,
        "difference": held.difference, "allowed": held.allowed, "at_limit": held.at_limit,
        "drift": held.drift, "rate": held.rate, "verdict": verdict(held),
    }  # fmt: skip


# Tables of at most 100 columns -------------------------------------------------------------------


def _place(balance: Balance) -> Sheet:
    arm, (force, moment) = balance.arm, balance.wrench.reshape(2, 3)
    place = ", ".join(f"{name} {number(at)}" for name, at in zip(arm.joints, balance.q, strict=True))
    title = f"{arm.path.name}: site {arm.site} at {_vector(arm.pose(balance.q)[:3])} m; {place}"
    wrench = f"force {_vector(force)} N, moment {_vector(moment)} N·m"
    weight = "The actuators also support the arm's weight."
    return Sheet(
        title,
        notes=(
            f"The wrench acts on the arm: {wrench}, world axes.",
            weight if balance.bears_weight else "The arm's weight is compensated.",
        ),
    )


def _elsewhere(other: Elsewhere, site: str) -> list[Sheet]:
    shown = _rounded(max(1.0, np.abs(other.wrench).max()))
    sheets = []
    for title, name, inputs, transform, last, result in (
        (
            f"The same wrench at {other.site} {{A}}, along its axes, from {site} {{B}}",
            "force transform", WRENCH, other.force_transform, "wrench at A", [*map(shown, other.wrench)],
        ),
        ("", "velocity transform", TWIST, other.velocity_transform, "", [""] * 6),
    ):  # fmt: skip
        rows = [
            (row, *map(shown, values), value)
            for row, values, value in zip(inputs, transform, result, strict=True)
        ]
        sheets.append(Sheet(title, (name, *(f"{one} of B" for one in inputs), last), rows))
    note = "The force transform is the inverse transpose of the velocity transform, which preserves power."
    return [*sheets, Sheet("", notes=(note,))]


def _drives(balance: Balance) -> Sheet:
    arm, shown = balance.arm, _rounded(balance.size.max())
    columns = {"equivalent": balance.equivalent, "balancing": balance.equilibrium}
    if balance.bears_weight:
        columns["gravity"] = balance.gravity
    if balance.springs.any():
        columns["springs"] = balance.springs
    if len(columns) > 2:
        columns["in all"] = balance.torque
    rows = [
        (
            _with_unit(arm, j),
            *(shown(column[j]) for column in columns.values()),
            number(arm.torque_limit[j]),
            shown(balance.margin[j]),
            _word(balance, j),
        )
        for j in range(arm.n)
    ]
    headings = ("actuator", *columns, "limit", "margin", "")
    notes = [
        "Equivalent, Jᵀ F: torques with which the site presses on the world with this wrench.",
        "Balancing, −Jᵀ F: torques that hold the arm still while this wrench acts on it.",
    ]
    for name in balance.exceeded:
        j = arm.joints.index(name)
        need, over, limit = (
            f"{number(abs(x))} {_unit(arm, j)}"
            for x in (balance.torque[j], balance.margin[j], arm.torque_limit[j])
        )
        notes.append(f"{name} needs {need}: {over} more than its limit of {limit}.")
    return Sheet("Actuators", headings, rows, frozenset({0, len(headings) - 1}), notes=tuple(notes))


def _links(balance: Balance) -> list[Sheet]:
    arm, shown = balance.arm, _rounded(np.abs(balance.reaction).max())
    units = [f"{name} [{'N' if i < 3 else 'N·m'}]" for i, name in enumerate(WRENCH)]
    sheets = []
    for axes, table in (
        ("along its own axes, z along the joint", balance.reaction),
        ("along world axes", balance.reaction_world),
    ):
        rows = [(name, *map(shown, row)) for name, row in zip(arm.axis_names, table, strict=True)]
        title = f"Load on each link from the previous one, at its joint; {axes}"
        sheets.append(Sheet(title, ("joint", *units), rows))
    rows = []
    for j, (fx, fy, fz, nx, ny, nz) in enumerate(balance.structure):
        taken = (fz, np.hypot(fx, fy), nz, np.hypot(nx, ny))
        unit = "N" if np.isinf(arm.chain.pitch[j]) else "N·m"
        rows.append((f"{arm.axis_names[j]} [{unit}]", shown(balance.driven[j]), *map(shown, taken)))
    title = "The actuator carries one component of the load, bearings and links the rest"
    headings = ("joint", "actuator", "thrust [N]", "radial force [N]", "moment about [N·m]", "bending [N·m]")
    note = (
        "For the wrench alone. Link by link and by −Jᵀ F the actuator torques agree to "
        f"{number(balance.disagreement)}."
    )
    return [*sheets, Sheet(title, headings, rows, notes=(note,))]


def _free(costs: Sequence[Costs]) -> Sheet:
    rows = []
    for group in costs:
        for i, one in enumerate(group.directions):
            kind = PLURALS[group.kind] if i == 0 else ""
            gain = "" if np.isinf(one.amplification) else number(one.amplification)
            rows.append((kind, in_words(one.wrench), number(one.sigma), gain, one.cost.value))
    notes = tuple(
        f"Of {PLURALS[group.kind]}, {group.free} cost{'s' * (group.free == 1)} no torque here and "
        f"{group.free_anywhere} at almost every configuration: the arm is singular."
        for group in costs
        if group.free_only_here
    )
    title = "Actuator torques for a wrench, a force or a moment of size 1"
    headings = ("of all", "", "torque σ", "1/σ", "costs")
    return Sheet(title, headings, rows, frozenset({0, 1, 4}), notes=notes)


def _held(held: HoldResult) -> Sheet:
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
    headings = ("actuator", "statics", "where it rests", "measured", "difference", "allowed", "")
    way, turn = map(float, np.linalg.norm(held.drift.reshape(2, 3), axis=1))
    where = (
        f"After {number(len(held.run) * held.run.period)} s the site is {number(1e3 * way)} mm and "
        f"{number(np.degrees(turn))} deg from its target."
    )
    return Sheet("Held in the physics", headings, rows, frozenset({0, 6}), notes=(where, verdict(held)))


# Words ------------------------------------------------------------------------------------------


def verdict(held: HoldResult) -> str:
    """Return how the holding went, in words."""
    names = [name for name, is_there in zip(held.wanted.arm.joints, held.at_limit, strict=True) if is_there]
    reached = (
        f"{', '.join(names)} reached its torque limit" if names else "no actuator reached its torque limit"
    )
    if held.run.divergence:
        return f"MISSED: {held.run.divergence}; {reached}."
    if not held.is_still:
        longer = "" if names else "; hold it for longer"
        rate = f"the fastest joint moves at {number(held.rate)} rad/s or m/s"
        return f"MISSED: not still, {rate}; {reached}{borne(held) or longer}."
    if not held.agrees:
        why = borne(held) or "; found no other support: run `rmrc check` for details"
        return f"MISSED: still, but the actuator torques differ; {reached}{why}."
    return f"met: still, and the actuator torques agree with statics; {reached}."


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
    # an axis that is only nearly met is not named
    return f"({', '.join(f'{x:.3g}' for x in np.round(v / np.linalg.norm(v), 6) + 0.0)})"


def _short(v: Array) -> str:
    return f"({', '.join(f'{x:g}' for x in np.round(v, 2) + 0.0)})"


def _vector(v: Array) -> str:
    return f"({', '.join(f'{x:.6g}' for x in np.round(v, 9) + 0.0)})"


def _rounded(size: float) -> Callable[[float], str]:
    """Return a format for numbers that are sums of terms of some size."""
    return lambda value: number(0.0 if abs(value) <= ROUNDING * size else float(value))


def _unit(arm: Arm, j: int) -> str:
    return "N" if arm.is_slide[j] else "N·m"


def _with_unit(arm: Arm, j: int) -> str:
    return f"{arm.joints[j]} [{_unit(arm, j)}]"


def _word(balance: Balance, j: int) -> str:
    if np.isinf(balance.arm.torque_limit[j]):
        return "no limit"
    return "EXCEEDED" if balance.arm.joints[j] in balance.exceeded else "ok"
