"""The result of an inspection, as tables, as JSON and as a picture."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.analysis.inspect.inspection import NEAR_LIMIT, Inspection, TipError
from rmrc.analysis.inspect.words import direction
from rmrc.analysis.statics.balance import Balance
from rmrc.arm.inventory import Mechanism
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.support.spatial import AXES

# Loops that are open by more than this are not closed [m].
OPEN = 1e-6

ROUTE_NAMES = {
    "screws": "screws of the joint axes, product of exponentials",
    "propagation": "velocities propagated outward, link to link",
    "differences": "central differences of the pose",
}


KEYS = {
    "model": "the file",
    "site": "the end effector",
    "assumed": "assumptions in words: choice of the site, start, ignored parts of the file",
    "joints": "name, kind, unit, q, limits [lower, upper], room to the nearer one; null where there is none",
    "pose": "position [m] in the world; quaternion w x y z; zyz: Z-Y-Z angles [rad]",
    "frame": "frame of the axes of jacobian: world, site or base; its rotation in the world",
    "jacobian": "6 x n, rows v_x v_y v_z w_x w_y w_z of the site's origin",
    "disagreement": "largest entry of the difference from MuJoCo's J, by method",
    "task": "rows, reason, length [m]",
    "determinant": "of the task's rows of J along its axes; null if they are not square",
    "factors": "of the determinant: name, family, where, value, power, vanishes; empty if not known",
    "sigma": "singular values of the task's rows, falling",
    "rank": "by_singular_values; by_minors, null if not counted",
    "condition": "kappa; null where the rank is lost",
    "manipulability": "w",
    "lost": "twist: the task direction that cannot move; wrench: costs no torque; words",
    "nearly_lost": "sigma; joint_motion of norm 1 and the twist that it gives; words",
    "self_motions": "joint_motion that does not move the task; twist of the site; words",
    "ellipsoids": "rows; directions as rows of numbers; half axes of velocity and force, null if infinite",
    "euler_rates": "E with w = E (alpha', beta', gamma'); the analytic jacobian, null where singular; words",
    "tip_error": "joints, displacement J dq, deviation, covariance, worst translation and rotation; or null",
    "statics": "wrench, equilibrium and equivalent torques, reactions, their points, disagreement; or null",
    "mechanism": "actuators, their positions, gap, rows, inverse K with rates = K twist, freedom; or null",
    "warnings": "in words",
}
"""Meaning of each key: SI units and radians; vectors along world axes except `jacobian`; finite numbers."""


def report(*found: Inspection) -> Report:
    """Return the report of an arm at one configuration or at several.

    Args:
        *found: Inspections of one arm; the JSON of several is a list.

    Example:
        >>> from rmrc.analysis.inspect.inspection import inspect
        >>> shown = report(inspect("models/planar_2link.xml", [0.0, 0.0]))
        >>> shown.sheets[4].title, shown.json["rank"]
        ('The task, with a characteristic length of 1.000 m', {'by_singular_values': 1, 'by_minors': 1})
    """
    values = [plain(_values(one)) for one in found]
    return Report(
        sheets=[sheet for one in found for sheet in _sheets(one)],
        json=values[0] if len(values) == 1 else values,
        draw=partial(_draw, found),
    )


def _draw(found: tuple[Inspection, ...], path: Path) -> None:
    from rmrc.analysis.inspect.figure import draw_arm

    draw_arm(found, path)


# JSON -------------------------------------------------------------------------------------------


def _values(found: Inspection) -> dict[str, Any]:
    """Return an inspection by `KEYS`."""
    arm, task = found.arm, found.task
    return {
        "model": str(arm.path), "site": arm.site, "assumed": arm.notes,
        "joints": [_joint_values(found, i) for i in range(arm.n)],
        "pose": {"position": found.pose[:3], "quaternion": found.pose[3:], "zyz": found.angles},
        "frame": {"name": found.frame, "rotation": found.R_world_frame},
        "jacobian": found.jacobian, "disagreement": found.disagreement,
        "task": {"rows": task.axes, "frame": task.frame, "why": found.why, "length": task.length},
        "determinant": found.determinant, "factors": [vars(one) for one in found.factors],
        "sigma": found.sigma,
        "rank": {"by_singular_values": found.rank, "by_minors": found.rank_by_minors},
        "condition": found.condition, "manipulability": found.manipulability,
        "lost": [{"twist": one.twist, "wrench": one.wrench, "words": one.words} for one in found.lost],
        "nearly_lost": [
            {"sigma": one.sigma, "joint_motion": one.motion, "twist": one.twist, "words": one.words}
            for one in found.slow
        ],
        "self_motions": [
            {"joint_motion": one.motion, "twist": one.twist, "words": one.words} for one in found.standing
        ],
        "ellipsoids": [
            {"rows": one.rows, "directions": one.velocity.axes.T, "velocity": one.velocity.half_axes,
             "force": one.force.half_axes}
            for one in found.ellipsoids
        ],
        "euler_rates": {
            "E": found.E, "analytic_jacobian": found.analytic_jacobian, "words": found.angles_in_words,
        },
        "tip_error": found.tip_error and _error_values(found.tip_error),
        "statics": found.balance and _balance_values(found.balance),
        "mechanism": found.mechanism and vars(found.mechanism),
        "warnings": found.warnings,
    }  # fmt: skip


def _joint_values(found: Inspection, i: int) -> dict[str, Any]:
    arm = found.arm
    return {
        "name": arm.joints[i], "kind": arm.kinds[i], "unit": arm.units[i], "q": found.q[i],
        "limits": arm.position_limit[i], "room": found.room[i],
    }  # fmt: skip


def _error_values(error: TipError) -> dict[str, Any]:
    return {
        "joints": error.joints, "displacement": error.displacement, "deviation": error.deviation,
        "covariance": error.covariance,
        "worst_translation": error.worst_translation, "worst_rotation": error.worst_rotation,
    }  # fmt: skip


def _balance_values(balance: Balance) -> dict[str, Any]:
    return {
        "wrench": balance.wrench, "equilibrium": balance.equilibrium, "equivalent": balance.equivalent,
        "reactions": balance.reaction_world, "points": balance.frames[:, :3, 3],
        "disagreement": balance.disagreement,
    }  # fmt: skip


# Tables of at most 100 columns -------------------------------------------------------------------


def _sheets(found: Inspection) -> list[Sheet]:
    tables = [_joints(found), _site(found), _jacobian(found), _routes(found), _task(found)]
    tables += [_factors(found)] if found.factors else []
    tables += [_words(found), _ellipsoids(found), _angles(found)]
    if found.tip_error is not None:
        tables.append(_tip_error(found, found.tip_error))
    if found.balance is not None:
        tables += [_torques(found.balance), _reactions(found.balance)]
    if found.mechanism is not None:
        tables.append(_mechanism(found.mechanism))
    return tables


def _joints(found: Inspection) -> Sheet:
    arm = found.arm
    rows = []
    for i, (joint, unit) in enumerate(zip(arm.joints, found.arm.units, strict=True)):
        kind = arm.kinds[i]
        lower, upper = arm.position_limit[i]
        room, note = found.room[i], ""
        if room < 0.0:
            note = f"outside by {number(-room)} {unit}"
        elif room <= NEAR_LIMIT * (upper - lower) and np.isfinite(room):
            note = f"only {number(room)} {unit} to its limit"
        degrees = UNDEFINED if unit == "m" else number(np.degrees(found.q[i]))
        rows.append(
            (joint, kind, number(found.q[i]), unit, degrees, _limit(lower), _limit(upper), note)
        )  # fmt: skip
    title = f"{arm.path.name}, site {arm.site}"
    headings = ("joint", "kind", "q", "unit", "[deg]", "lower", "upper", "")
    return Sheet(title, headings, rows, frozenset({0, 1, 3, 7}))


def _limit(value: float) -> str:
    return number(value) if np.isfinite(value) else "none"


def _site(found: Inspection) -> Sheet:
    degrees = np.degrees(found.angles)
    rows = [
        ("position x, y, z [m]", _listed(found.pose[:3])),
        ("orientation, quaternion w, x, y, z", _listed(found.pose[3:])),
        ("orientation, Z-Y-Z angles alpha, beta, gamma [deg]", _listed(degrees)),
    ]
    return Sheet("Pose of the site in the world", ("", ""), rows)


def _jacobian(found: Inspection) -> Sheet:
    title = f"J of the site's origin along the axes of the {found.frame}: v [m] and w [rad] per rad or m"
    names = [f"v_{axis}" for axis in "xyz"] + [f"w_{axis}" for axis in "xyz"]
    rows = [
        (joint, *(number(_clean(value)) for value in column))
        for joint, column in zip(found.arm.joints, found.jacobian.T, strict=True)
    ]
    return Sheet(title, ("joint", *names), rows)


def _routes(found: Inspection) -> Sheet:
    rows = [(ROUTE_NAMES[name], number(most)) for name, most in found.disagreement.items()]
    return Sheet("J by other methods, the largest difference from MuJoCo's", ("method", "differs by"), rows)


def _task(found: Inspection) -> Sheet:
    task = found.task
    by_minors = "not counted: too many" if found.rank_by_minors is None else f"{found.rank_by_minors}"
    if found.rank_by_minors not in {None, found.rank}:
        by_minors += " (they disagree: sigma is at the threshold)"
    along = "" if task.frame == "world" else f" along the axes of the {task.frame}"
    rows = [("rows", f"{', '.join(task.axes)}{along}: {found.why}")]
    if found.determinant is not None:
        rows.append(("det of these rows of J", number(found.determinant)))
    rows += [
        ("sigma", "  ".join(number(value) for value in found.sigma)),
        ("rank by sigma; by minors", f"{found.rank} of {len(found.sigma)}; {by_minors}"),
        ("condition kappa", number(found.condition)),
        ("manipulability w", number(found.manipulability)),
    ]
    is_of_arm = task.length == task.arm.proportions.length(task.rows) != 1.0
    length = f"{number(task.length)} m{', that of the arm' if is_of_arm else ''}"
    title = f"The task, with a characteristic length of {length}"
    return Sheet(title, ("", ""), rows, frozenset({0, 1}))


def _factors(found: Inspection) -> Sheet:
    rows = [
        (one.term, number(_clean(one.value)), "vanishes" * one.vanishes, one.family, one.where)
        for one in found.factors
    ]
    title = f"det J = {' · '.join(one.term for one in found.factors)}"
    return Sheet(
        title, ("factor", "here", "", "singularity", "where it vanishes"), rows, frozenset({0, 2, 3, 4})
    )


def _words(found: Inspection) -> Sheet:
    rows = [("lost", lost.words) for lost in found.lost]
    rows += [("nearly lost", slow.words) for slow in found.slow]
    if not rows:
        rows = [("lost", "nothing: the arm can move and turn in all directions of the task")]
    rows += [("self-motion", motion.words) for motion in found.standing]
    rows.append(("Z-Y-Z angles", found.angles_in_words))
    return Sheet("Lost directions and self-motions", ("", ""), rows, frozenset({0, 1}))


def _ellipsoids(found: Inspection) -> Sheet:
    rows = []
    for pair in found.ellipsoids:
        at = [AXES.index(axis) % 3 for axis in pair.rows]
        units = ("m/s", "N") if pair.rows[0] in "xyz" else ("rad/s", "N m")
        for axis, speed, force in zip(
            pair.velocity.axes.T, pair.velocity.half_axes, pair.force.half_axes, strict=True
        ):
            whole = np.zeros(3)
            whole[at] = axis if axis[np.argmax(np.abs(axis))] > 0.0 else -axis
            rows.append(
                (
                    f"{'along' if units[0] == 'm/s' else 'about'} {direction(whole)}",
                    f"{number(speed)} {units[0]}",
                    "any" if np.isinf(force) else f"{number(force)} {units[1]}",
                )
            )
    slides = f", slides per {number(found.task.length)} m" if found.arm.is_slide.any() else ""
    title = f"Half axes of the ellipsoids of each kind alone, for unit-norm joint rates and torques{slides}"
    return Sheet(title, ("in the world", "velocity", "force"), rows)


def _angles(found: Inspection) -> Sheet:
    rows = [
        (f"w_{axis}", *(number(_clean(value)) for value in row))
        for axis, row in zip("xyz", found.E, strict=True)
    ]
    return Sheet(
        "Rates of the Z-Y-Z angles, w = E (alpha', beta', gamma')", ("E", "alpha'", "beta'", "gamma'"), rows
    )


def _tip_error(found: Inspection, error: TipError) -> Sheet:
    units = ("m", "m", "m", "rad", "rad", "rad")
    rows = [
        (axis, f"{number(_clean(displaced))} {unit}", f"{number(deviation)} {unit}")
        for axis, displaced, deviation, unit in zip(
            AXES, error.displacement, error.deviation, units, strict=True
        )
    ]
    for vector, unit, word in (
        (error.worst_translation, "m", "along"),
        (error.worst_rotation, "rad", "about"),
    ):
        size = float(np.linalg.norm(vector))
        where = f" {word} {direction(vector)}" if size > 0.0 else ""
        rows.append((f"most{where}", "", f"{number(size)} {unit}"))
    given = ", ".join(
        f"{number(size)} {unit}" for size, unit in zip(error.joints, found.arm.units, strict=True)
    )
    return Sheet(
        f"Errors of the site for joint errors dq of {given}",
        ("", "J dq", "standard deviation"),
        rows,
    )


def _torques(balance: Balance) -> Sheet:
    arm = balance.arm
    rows = [
        (joint, number(_clean(one)), number(_clean(other)), "N" if unit == "m" else "N m")
        for joint, one, other, unit in zip(
            arm.joints, balance.equilibrium, balance.equivalent, arm.units, strict=True
        )
    ]
    title = f"Torques for the wrench {_listed(balance.wrench)} on the arm at the site; gravity is left out"
    return Sheet(title, ("joint", "hold it", "equal it", "unit"), rows, frozenset({0, 3}))


def _reactions(balance: Balance) -> Sheet:
    rows = [
        (joint, *(number(_clean(value)) for value in reaction))
        for joint, reaction in zip(balance.arm.axis_names, balance.reaction_world, strict=True)
    ]
    return Sheet(
        "Force [N] and moment [N m] on the link behind each joint by the one before, there, in the world",
        ("joint", "f_x", "f_y", "f_z", "n_x", "n_y", "n_z"),
        rows,
    )


def _mechanism(found: Mechanism) -> Sheet:
    title, headings = "The mechanism, its loops closed", ("actuator", "at", *found.rows)
    rows: list[tuple[str, ...]] = []
    if found.gap > OPEN:
        title = f"The mechanism: its loops do not close here, with {number(found.gap)} m left"
    elif found.inverse is None:
        title += ": the twist of the site does not determine the rates of its actuators"
    else:
        rows = [
            (drive, number(length), *(number(_clean(value)) for value in row))
            for drive, length, row in zip(found.drives, found.lengths, found.inverse, strict=True)
        ]
        title += ": actuator rates per unit of each row, K"
        if len(found.drives) == len(found.rows):
            title += f"; det K {number(_clean(float(np.linalg.det(found.inverse))))}"
    if found.freedom:
        ways = "one way" if found.freedom == 1 else f"{found.freedom} ways"
        title += f"; singular: with all actuators locked it can still move, {ways}"
    return Sheet(title, headings, rows)


def _clean(value: float) -> float:
    """Return 0 for a value that is rounding beside lengths of meters and forces of newtons."""
    return 0.0 if abs(value) < 1e-12 else float(value)


def _listed(values: np.ndarray) -> str:
    return ", ".join(number(_clean(value)) for value in values)
