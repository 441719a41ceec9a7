"""What an inspection found, as tables for people."""

import numpy as np

from rmrc.analysis.inspect.inspection import NEAR_LIMIT, Inspection
from rmrc.analysis.inspect.words import direction
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.support.spatial import AXES

ROUTE_NAMES = {
    "screws": "screws of the joint axes, product of exponentials",
    "propagation": "velocities propagated outward, link to link",
    "differences": "central differences of the pose",
}


def sheets(found: Inspection) -> list[Sheet]:
    """Return an inspection as tables of at most 100 columns, the most general first."""
    tables = [_joints(found), _site(found), _jacobian(found), _routes(found), _task(found), _words(found)]
    tables += [_ellipsoids(found), _angles(found)]
    if found.tip_error is not None:
        tables.append(_tip_error(found))
    if found.balance is not None:
        tables += [_torques(found), _reactions(found)]
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
    return Sheet("J by other routes, the largest difference from MuJoCo's", ("route", "differs by"), rows)


def _task(found: Inspection) -> Sheet:
    task = found.task
    by_minors = "not counted: too many" if found.rank_by_minors is None else f"{found.rank_by_minors}"
    if found.rank_by_minors not in {None, found.rank}:
        by_minors += " (they disagree: sigma is at the threshold)"
    rows = [("rows", f"{', '.join(task.axes)}: {found.why}")]
    if found.determinant is not None:
        rows.append(("det of these rows of J", number(found.determinant)))
    rows += [
        ("sigma", "  ".join(number(value) for value in found.sigma)),
        ("rank by sigma; by minors", f"{found.rank} of {len(found.sigma)}; {by_minors}"),
        ("condition kappa", number(found.condition)),
        ("manipulability w", number(found.manipulability)),
    ]
    return Sheet(
        f"The task, with a characteristic length of {number(task.length)} m",
        ("", ""),
        rows,
        frozenset({0, 1}),
    )


def _words(found: Inspection) -> Sheet:
    rows = [("lost", lost.words) for lost in found.lost]
    rows += [("nearly lost", slow.words) for slow in found.slow]
    if not rows:
        rows = [("lost", "nothing: the arm can move and turn in all directions of the task")]
    rows += [("self-motion", motion.words) for motion in found.standing]
    rows.append(("Z-Y-Z angles", found.angles_in_words))
    return Sheet("What it cannot do, and what moves nothing", ("", ""), rows, frozenset({0, 1}))


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
    title = f"Half axes of the ellipsoids of each kind alone, for joint rates and torques of norm 1{slides}"
    return Sheet(title, ("in the world", "velocity", "force"), rows)


def _angles(found: Inspection) -> Sheet:
    rows = [
        (f"w_{axis}", *(number(_clean(value)) for value in row))
        for axis, row in zip("xyz", found.E, strict=True)
    ]
    return Sheet(
        "Rates of the Z-Y-Z angles, w = E (alpha', beta', gamma')", ("E", "alpha'", "beta'", "gamma'"), rows
    )


def _tip_error(found: Inspection) -> Sheet:
    error = found.tip_error
    assert error is not None
    rows = [
        (axis, f"{number(deviation)} {'m' if i < 3 else 'rad'}")
        for i, (axis, deviation) in enumerate(zip(AXES, error.deviation, strict=True))
    ]
    for vector, unit, word in (
        (error.worst_translation, "m", "along"),
        (error.worst_rotation, "rad", "about"),
    ):
        size = float(np.linalg.norm(vector))
        where = f" {word} {direction(vector)}" if size > 0.0 else ""
        rows.append((f"most{where}", f"{number(size)} {unit}"))
    given = ", ".join(
        f"{number(size)} {unit}" for size, unit in zip(error.joints, found.arm.units, strict=True)
    )
    return Sheet(
        f"Errors of the site for errors of the joints of {given}, standard deviations",
        ("", "of the site"),
        rows,
    )


def _torques(found: Inspection) -> Sheet:
    balance = found.balance
    assert balance is not None
    rows = [
        (joint, number(_clean(one)), number(_clean(other)), "N" if unit == "m" else "N m")
        for joint, one, other, unit in zip(
            found.arm.joints, balance.equilibrium, balance.equivalent, found.arm.units, strict=True
        )
    ]
    title = f"Torques for the wrench {_listed(balance.wrench)} on the arm at the site; gravity is left out"
    return Sheet(title, ("joint", "hold it", "equal it", "unit"), rows, frozenset({0, 3}))


def _reactions(found: Inspection) -> Sheet:
    balance = found.balance
    assert balance is not None
    rows = [
        (joint, *(number(_clean(value)) for value in reaction))
        for joint, reaction in zip(found.arm.joints, balance.reaction_world, strict=True)
    ]
    return Sheet(
        "Force [N] and moment [N m] on the link behind each joint by the one before, there, in the world",
        ("joint", "f_x", "f_y", "f_z", "n_x", "n_y", "n_z"),
        rows,
    )


def _clean(value: float) -> float:
    """Return 0 for what is rounding beside lengths of meters and forces of newtons."""
    return 0.0 if abs(value) < 1e-12 else float(value)


def _listed(values: np.ndarray) -> str:
    return ", ".join(number(_clean(value)) for value in values)
