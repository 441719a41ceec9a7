"""The result of an inspection, as tables, as JSON and as a picture."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.analysis.directions import direction
from rmrc.analysis.inspect.inspection import Inspection
from rmrc.arm.inventory import Mechanism
from rmrc.law.task import Array
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.support.spatial import AXES

# Loops that are open by more than this are not closed [m].
OPEN = 1e-6
# Values below this are rounding beside lengths of meters.
ROUNDING = 1e-12
ROUTES = {
    "screws": "screws of the joint axes, product of exponentials",
    "propagation": "velocities propagated outward, link to link",
    "differences": "central differences of the pose",
}


def report(*found: Inspection) -> Report:
    """Return the report of an arm at one configuration or at several.

    Args:
        *found: Inspections of one arm; the JSON of several is a list. Its keys are the attributes of
            `Inspection`.

    Example:
        >>> from rmrc.analysis.inspect.inspection import inspect
        >>> shown = report(inspect("models/planar_2link.xml", [0.0, 0.0]))
        >>> shown.sheets[0].rows[0][:3], shown.json["rank"]
        (('shoulder', '0', '2.000'), 1)
    """
    values = [plain(_values(one)) for one in found]
    sheets = [sheet for one in found for sheet in _sheets(one)]
    return Report(sheets, values[0] if len(values) == 1 else values, partial(_draw, found))


def _draw(found: tuple[Inspection, ...], path: Path) -> None:
    from rmrc.analysis.inspect.figure import draw_arm

    draw_arm(found, path)


def _values(found: Inspection) -> dict[str, Any]:
    arm, task = found.arm, found.task
    values: dict[str, Any] = {field.name: getattr(found, field.name) for field in fields(found)}
    for name in ("lost", "nearly_lost", "self_motions"):
        values[name] = [vars(one) for one in values[name]]
    values["mechanism"] = found.mechanism and vars(found.mechanism)
    values["task"] = {"rows": task.axes, "frame": task.frame, "length": task.length}
    del values["arm"]
    return {
        "model": str(arm.path), "site": arm.site, "assumed": arm.notes, "joints": arm.joints,
        "kinds": arm.kinds, "units": arm.units, "limits": arm.position_limit, **values,
    }  # fmt: skip


# Tables of at most 100 columns -------------------------------------------------------------------


def _sheets(found: Inspection) -> list[Sheet]:
    arm, error = found.arm, found.tip_error
    routes = [(ROUTES[name], number(most)) for name, most in found.disagreement.items()]
    title = (
        f"The task, with a characteristic length of {number(found.task.length)} m; axes of the {found.frame}"
    )
    sheets = [
        _jacobian(found),
        Sheet("J by other methods, the largest difference from MuJoCo's", ("method", "differs by"), routes),
        Sheet(title, ("", ""), _task(found), frozenset({0, 1})),
        *([_factors(found.factors)] if found.factors else []),
        _ellipsoids(found),
    ]
    sheets += [_tip_error(error, arm.units)] if error else []
    return sheets + ([_mechanism(found.mechanism)] if found.mechanism else [])


def _jacobian(found: Inspection) -> Sheet:
    arm, rows = found.arm, []
    for i, joint in enumerate(arm.joints):
        ends = (UNDEFINED if np.isinf(end) else number(end) for end in arm.position_limit[i])
        rows.append((joint, *map(_number, found.jacobian[:, i]), number(found.q[i]), arm.units[i], *ends))
    headings = ("joint", "v_x", "v_y", "v_z", "w_x", "w_y", "w_z", "q", "", "lower", "upper")
    title = f"{arm.path.name}, site {arm.site}: J [m or rad per rad or m] along the axes of the {found.frame}"
    return Sheet(title, headings, rows, frozenset({0, 8}))


def _task(found: Inspection) -> list[tuple[str, str]]:
    task = found.task
    along = f" along the axes of the {task.frame}" if task.frame != "world" else ""
    rows = [
        ("position x, y, z [m]", _numbers(found.pose[:3])),
        ("quaternion w, x, y, z", _numbers(found.pose[3:])),
        ("Z-Y-Z angles [deg]", f"{_numbers(np.degrees(found.angles))}; {found.angles_in_words}"),
        ("rows", ", ".join(task.axes) + along),
        ("sigma", "  ".join(map(number, found.sigma))),
        ("rank by sigma; by minors", f"{found.rank} of {len(found.sigma)}; {found.rank_by_minors}"),
        ("condition kappa", number(found.condition)),
        ("manipulability w", number(found.manipulability)),
    ]
    if found.determinant is not None:
        rows.append(("det of these rows of J", number(found.determinant)))
    words = {"lost": found.lost, "nearly lost": found.nearly_lost, "self-motion": found.self_motions}
    return rows + [(name, each.words) for name, some in words.items() for each in some]


def _factors(factors: Sequence[Mapping[str, Any]]) -> Sheet:
    rows = [
        (each["term"], _number(each["value"]), "vanishes" * each["vanishes"], each["family"], each["where"])
        for each in factors
    ]
    headings = ("factor", "here", "", "singularity", "where it vanishes")
    return Sheet(
        f"det J = {' · '.join(each['term'] for each in factors)}", headings, rows, frozenset({0, 2, 3, 4})
    )


def _ellipsoids(found: Inspection) -> Sheet:
    rows = []
    for part in found.ellipsoids:
        word, *units = ("along", "m/s", "N") if part["rows"][0] in "xyz" else ("about", "rad/s", "N m")
        for axis, *sizes in zip(part["directions"], part["velocity"], part["force"], strict=True):
            where = direction(axis * np.sign(axis[np.argmax(np.abs(axis))]))
            cells = (f"{number(size)} {unit}" for size, unit in zip(sizes, units, strict=True))
            rows.append((f"{word} {where}", *cells))
    slides = f", slides per {number(found.task.length)} m" if found.arm.is_slide.any() else ""
    title = f"Half axes of the ellipsoids of each kind alone, for unit-norm joint rates and torques{slides}"
    return Sheet(title, ("in the world", "velocity", "force"), rows)


def _tip_error(error: Mapping[str, Array], units: Sequence[str]) -> Sheet:
    rows = [
        (axis, *(f"{_number(value)} {'m' if axis in 'xyz' else 'rad'}" for value in values))
        for axis, *values in zip(AXES, error["displacement"], error["deviation"], strict=True)
    ]
    joints = ", ".join(f"{number(size)} {unit}" for size, unit in zip(error["joints"], units, strict=True))
    title = f"Errors of the site for joint errors dq of {joints}"
    return Sheet(title, ("", "J dq", "standard deviation"), rows)


def _mechanism(mechanism: Mechanism) -> Sheet:
    title, headings = "The mechanism, its loops closed", ("actuator", "at", *mechanism.rows)
    if mechanism.freedom:
        title += f", singular: {mechanism.freedom} motions remain with all actuators locked"
    if mechanism.gap > OPEN:
        return Sheet(
            f"The mechanism: its loops do not close here, with {number(mechanism.gap)} m left", headings
        )
    if mechanism.inverse is None:
        return Sheet(f"{title}; the twist of the site does not determine its actuators", headings)
    rows = [
        (drive, number(length), *map(_number, row))
        for drive, length, row in zip(mechanism.drives, mechanism.lengths, mechanism.inverse, strict=True)
    ]
    title += ": actuator rates per unit of each row, K"
    if len(mechanism.drives) == len(mechanism.rows):
        title += f"; det K {_number(float(np.linalg.det(mechanism.inverse)))}"
    return Sheet(title, headings, rows)


def _number(value: float) -> str:
    return number(0.0 if abs(value) < ROUNDING else float(value))


def _numbers(values: Array) -> str:
    return ", ".join(map(_number, values))
