"""Actuator torques, link loads, free wrenches, and the result of the physics: JSON, and tables of it."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.statics import WRENCH, Balance, Statics, without_rounding
from rmrc.show.sheets import Report, Sheet, number, plain

TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")


def report(found: Statics) -> Report:
    """Return the report of an arm under a wrench; its condition fails if holding it did not agree.

    The tables show the values of the JSON, at most 100 columns wide. Its keys are model, site, joints, kinds,
    limit, the largest torque of each actuator, axes, the names of the joints on the chain; the attributes of
    `rmrc.analysis.statics.Balance`; and at, free and held, see `rmrc.analysis.statics`.

    Args:
        found: The result of `statics`.

    Example:
        >>> from rmrc.analysis.statics import statics
        >>> shown = report(statics("models/planar_2link.xml", [0, -1, 0], [0.0, np.pi / 3]))
        >>> shown.sheets[1].title, shown.sheets[1].rows[0][:3], shown.json["exceeded"]
        ('Actuators', ('shoulder [N·m]', '-1.500', '1.500'), [])
    """
    balance, held, arm = found.balance, found.held, found.balance.arm
    values = {
        "model": str(arm.path), "site": arm.site, "joints": arm.joints, "kinds": arm.kinds,
        "limit": arm.torque_limit, "axes": arm.axis_names,
        **{name: value for name, value in vars(balance).items() if name != "arm"},
        "at": found.elsewhere, "free": [vars(each) for each in found.free],
        "held": held and {name: value for name, value in held.items() if name != "run"},
    }  # fmt: skip
    sheets = [_place(balance), _actuators(balance), *_links(balance)]
    if found.elsewhere:
        sheets[1:1] = _elsewhere(found.elsewhere, arm.site)
    words = tuple(each.words for each in found.free)
    sheets += [Sheet("Wrenches that need no torque here", notes=words)] if words else []
    sheets += [_held(held, balance)] if held else []
    problem = f"error: {held['run'].divergence}" if held and held["run"].divergence else ""
    return Report(sheets, plain(values), met=held is None or held["agrees"], problem=problem)


def _sheet(title: str, headings: Sequence[str], rows: Iterable[Sequence[Any]], *notes: str) -> Sheet:
    """Return a table of rows of names, numbers and words; a column of words has no heading."""
    cells = [tuple(cell if isinstance(cell, str) else number(cell) for cell in row) for row in rows]
    words = frozenset({0} | {i for i, heading in enumerate(headings) if not heading})
    return Sheet(title, tuple(headings), cells, words, notes=notes)


def _place(balance: Balance) -> Sheet:
    arm = balance.arm
    place = ", ".join(f"{name} {number(q)}" for name, q in zip(arm.joints, balance.q, strict=True))
    force, moment = map(_vector, balance.wrench.reshape(2, 3))
    return Sheet(
        f"{arm.path.name}: site {arm.site} at {_vector(arm.pose(balance.q)[:3])} m; {place}",
        notes=(
            f"The wrench acts on the arm: force {force} N, moment {moment} N·m, world axes.",
            "The actuators also support the arm's weight." if balance.bears_weight
            else "The arm's weight is compensated.",
        ),
    )  # fmt: skip


def _elsewhere(there: dict[str, Any], site: str) -> Iterator[Sheet]:
    title = f"The same wrench at {there['site']} {{A}}, along its axes, from {site} {{B}}"
    rows = zip(WRENCH, *there["force_transform"].T, there["wrench"], strict=True)
    yield _sheet(title, ("force transform", *(f"{axis} of B" for axis in WRENCH), "wrench at A"), rows)
    rows = zip(TWIST, *there["velocity_transform"].T, strict=True)
    yield _sheet("", ("velocity transform", *(f"{axis} of B" for axis in TWIST)), rows)


def _actuators(balance: Balance) -> Sheet:
    limit = balance.arm.torque_limit
    columns = {"equivalent": balance.equivalent, "balancing": balance.equilibrium}
    columns |= {"gravity": balance.gravity} if balance.bears_weight else {}
    columns |= {"springs": balance.springs} if balance.springs.any() else {}
    columns |= {"in all": balance.torque} if len(columns) > 2 else {}
    columns |= {"limit": limit, "margin": balance.margin}
    words = np.where(np.isinf(limit), "no limit", np.where(balance.margin < 0.0, "EXCEEDED", "ok"))
    names = _with_units(balance.arm.joints, balance.arm.is_slide)
    rows = zip(names, *columns.values(), words.tolist(), strict=True)
    return _sheet(
        "Actuators", ("actuator", *columns, ""), rows,
        "Equivalent, Jᵀ F: torques with which the site presses on the world with this wrench.",
        "Balancing, −Jᵀ F: torques that hold the arm still while this wrench acts on it.",
    )  # fmt: skip


def _links(balance: Balance) -> Iterator[Sheet]:
    """Yield the loads along the links' axes, and beside the actuators' components what bearings carry."""
    names, slides = balance.arm.axis_names, np.isinf(balance.arm.chain.pitch)
    contents = "Of the wrench and of the weight." if balance.bears_weight else "Of the wrench alone."
    headings = ("joint", *(f"{name} [{'N' if i < 3 else 'N·m'}]" for i, name in enumerate(WRENCH)))
    title = "Load on each link from the previous one, at its joint; along the axes of the link's body"
    yield _sheet(title, headings, zip(names, *balance.reaction.T, strict=True), contents)
    halves, axis = balance.reaction.reshape(-1, 2, 3), balance.axis[:, None]
    along = (halves * axis).sum(axis=2)
    across = np.linalg.norm(halves - along[..., None] * axis, axis=2)
    along[np.arange(len(slides)), np.where(slides, 0, 1)] -= balance.driven
    size = np.abs(halves).max()
    along, across = (without_rounding(each, size) for each in (along, across))
    columns = (balance.driven, along[:, 0], across[:, 0], along[:, 1], across[:, 1])
    agree = f"Link by link and by −Jᵀ F the actuator torques agree to {number(balance.disagreement)}."
    yield _sheet(
        "The actuator carries one component of the load, bearings and links the rest",
        ("joint", "actuator", "thrust [N]", "radial force [N]", "moment about [N·m]", "bending [N·m]"),
        zip(_with_units(names, slides), *columns, strict=True), f"{contents} {agree}",
    )  # fmt: skip


def _held(held: dict[str, Any], balance: Balance) -> Sheet:
    allowed = held["allowed"] if held["still"] else np.full(balance.arm.n, np.nan)
    columns = balance.torque, held["where_it_rests"], held["measured"], held["difference"], allowed
    headings = ("actuator", "statics", "where it rests", "measured", "difference", "allowed")
    rows = zip(_with_units(balance.arm.joints, balance.arm.is_slide), *columns, strict=True)
    return _sheet("Held in the physics", headings, rows, held["verdict"])


def _with_units(names: Sequence[str], slides: NDArray[np.bool_]) -> list[str]:
    return [f"{name} [{'N' if slide else 'N·m'}]" for name, slide in zip(names, slides, strict=True)]


def _vector(v: NDArray[np.float64]) -> str:
    return f"({', '.join(f'{x:.6g}' for x in np.round(v, 9) + 0.0)})"
