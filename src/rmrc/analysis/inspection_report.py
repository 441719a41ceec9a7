"""The result of an inspection, as tables, as JSON and as a picture."""

from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np

from rmrc.analysis.inspection import Inspection
from rmrc.analysis.singularities import direction
from rmrc.arm.inventory import Mechanism
from rmrc.show.sheets import UNDEFINED, Report, Sheet, number, plain
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


def report(found: Inspection) -> Report:
    """Return the report of an arm at one configuration; the keys of its JSON are those of `Inspection`.

    Example:
        >>> from rmrc.analysis.inspection import inspect
        >>> shown = report(inspect("models/planar_2link.xml", [0.0, 0.0]))
        >>> shown.sheets[0].rows[0][:3], shown.json["rank"]
        (('shoulder', '0', '2.000'), 1)
    """
    arm, task, mechanism = found.arm, found.task, found.mechanism
    values = vars(found) | {
        "model": str(arm.path), "site": arm.site, "assumed": arm.notes, "joints": arm.joints,
        "kinds": arm.kinds, "units": arm.units, "limits": arm.position_limit,
        "task": {"rows": task.axes, "frame": task.frame, "length": task.length},
        "lost": [vars(each) for each in found.lost],
        "self_motions": [vars(each) for each in found.self_motions],
        "mechanism": mechanism and vars(mechanism),
    }  # fmt: skip
    del values["arm"]
    routes = [(ROUTES[name], number(most)) for name, most in found.disagreement.items()]
    title = "J by other methods, the largest difference from MuJoCo's"
    sheets = [_jacobian(found), Sheet(title, ("method", "differs by"), routes), _task(found)]
    sheets += [_mechanism(mechanism)] if mechanism else []
    return Report(sheets, plain(values), partial(_draw, found))


def _draw(found: Inspection, path: Path) -> None:
    from rmrc.analysis.inspection_figure import draw_arm

    draw_arm(found, path)


# Tables of at most 100 columns -------------------------------------------------------------------


def _jacobian(found: Inspection) -> Sheet:
    arm, rows = found.arm, []
    for i, joint in enumerate(arm.joints):
        ends = (UNDEFINED if np.isinf(end) else number(end) for end in arm.position_limit[i])
        rows.append((joint, *_cells(found.jacobian[:, i]), number(found.q[i]), arm.units[i], *ends))
    headings = ("joint", "v_x", "v_y", "v_z", "w_x", "w_y", "w_z", "q", "", "lower", "upper")
    title = f"{arm.path.name}, site {arm.site}: J [m or rad per rad or m] along the axes of the {found.frame}"
    return Sheet(title, headings, rows, frozenset({0, 8}))


def _task(found: Inspection) -> Sheet:
    """Return what is known of the task, a line each by its name."""
    task, error = found.task, found.tip_error
    along = f" along the axes of the {task.frame}" if task.frame != "world" else ""
    angles = ", ".join(_cells(np.degrees(found.angles)))
    rows = [
        ("position x, y, z [m]", ", ".join(_cells(found.pose[:3]))),
        ("quaternion w, x, y, z", ", ".join(_cells(found.pose[3:]))),
        ("Z-Y-Z angles [deg]", f"{angles}; {found.angles_in_words}"),
        ("rows", ", ".join(task.axes) + along),
        ("sigma", "  ".join(map(number, found.sigma))),
        ("rank by sigma; by minors", f"{found.rank} of {len(found.sigma)}; {found.rank_by_minors}"),
        ("condition kappa", number(found.condition)),
        ("manipulability w", number(found.manipulability)),
    ]
    if found.determinant is not None:
        rows.append(("det of these rows of J", number(found.determinant)))
    rows += [("lost", each.words) for each in found.lost]
    rows += [("self-motion", each.words) for each in found.self_motions]
    if found.factors:
        rows.append(("det J", f"= {' · '.join(each['term'] for each in found.factors)}"))
    for each in found.factors:
        (value,), vanishes = _cells([each["value"]]), " vanishes" * each["vanishes"]
        rows.append((each["term"], f"{value}{vanishes} {each['family']}, where {each['where']}"))
    for part in found.ellipsoids:
        word, rate, load = ("along", "m/s", "N") if part["rows"][0] in "xyz" else ("about", "rad/s", "N m")
        for axis, velocity, force in zip(part["directions"], part["velocity"], part["force"], strict=True):
            where = direction(axis * np.sign(axis[np.argmax(np.abs(axis))]))
            sizes = f"{number(velocity)} {rate}  {number(force)} {load}"
            rows.append(("velocity, force", f"{word} {where} {sizes}"))
    if error:
        columns = zip(AXES, _cells(error["displacement"]), _cells(error["deviation"]), strict=True)
        for axis, moved, deviation in columns:
            unit = "m" if axis in "xyz" else "rad"
            text = f"{moved} {unit}, standard deviation {deviation} {unit}"
            rows.append((f"error of {axis}", text))
    title = f"The task, with a characteristic length of {number(task.length)} m; axes of the {found.frame}"
    return Sheet(title, ("", ""), rows, frozenset({0, 1}))


def _mechanism(mechanism: Mechanism) -> Sheet:
    inverse, title = (
        mechanism.inverse,
        "The mechanism, its loops closed: actuator rates per unit of each row, K",
    )
    if mechanism.gap > OPEN:
        return Sheet(f"The mechanism: its loops do not close here, with {number(mechanism.gap)} m left")
    if inverse is None:
        return Sheet("The mechanism: the twist of the site does not determine its actuators")
    if inverse.shape[0] == inverse.shape[1]:
        title += f"; det K {number(float(np.linalg.det(inverse)))}"
    if mechanism.freedom:
        title += f"; singular: {mechanism.freedom} motions remain with all actuators locked"
    columns = zip(mechanism.drives, _cells(mechanism.lengths), *map(_cells, inverse.T), strict=True)
    return Sheet(title, ("actuator", "at", *mechanism.rows), list(columns))


def _cells(values: Iterable[float]) -> list[str]:
    """Return numbers as texts, 0 where they are rounding."""
    return [number(0.0 if abs(value) < ROUNDING else float(value)) for value in values]
