"""The result of inverse kinematics as tables and as JSON."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from rmrc.analysis.ik import IkResult, Postures
from rmrc.law.task import Array, Task
from rmrc.show.sheets import Report, Sheet, number, plain
from rmrc.support.spatial import pose_error


def report(answer: IkResult) -> Report:
    """Return the report of a goal and the joint positions for it; its condition is met if they reach it.

    Args:
        answer: The result of `ik`.

    Example:
        >>> from rmrc.analysis.ik import ik
        >>> shown = report(ik("models/planar_2link.xml", [3.0, 0.0]))
        >>> shown.met, shown.problem
        (False, 'not reached: 1 m and 0 rad are left at the nearest of 201 starts')
    """
    task, postures = answer.task, answer.postures
    names = (
        "goal", "start", "found", "method", "limits", "tolerance", "pose", "error", "position_error",
        "orientation_error", "at_limit", "steps", "tries",
    )  # fmt: skip
    values: dict[str, Any] = {
        "model": str(task.arm.path), "site": task.arm.site, "axes": task.axes, "length": task.length,
        "q": dict(zip(task.arm.joints, answer.q, strict=True)),
    }  # fmt: skip
    values |= {name: getattr(answer, name) for name in names}
    sheets = _solution(answer)
    if answer.iterates is not None:
        f, J = linearized(task, answer.goal, answer.iterates)
        values["iterates"] = {"q": answer.iterates, "h": -np.diff(answer.iterates, axis=0), "f": f, "J": J}
        sheets = [*_iterates(task, answer.iterates, f, J), *sheets]
    if postures is not None:
        values |= {"continuum": postures.is_continuum, "starts": postures.starts}
        values["postures"] = [
            {"q": dict(zip(task.arm.joints, q, strict=True)), "starts": hits, "freedom": freedom}
            for q, hits, freedom in zip(postures.q, postures.hits, postures.freedom, strict=True)
        ]
        sheets = [_postures(task, postures)] if len(postures.q) else sheets
    return Report(sheets, plain(values), met=answer.found, problem="" if answer.found else _problem(answer))


def linearized(task: Task, goal: Array, q: Array) -> tuple[Array, Array]:
    """Return the equations of Newton's method at k + 1 iterates: J(q) h = f(q), q⁺ = q − h [Selig92, §6.3].

    Args:
        task: The arm and the m rows that count, along world axes.
        goal: Pose of the site, (7,).
        q: The iterates, (k + 1, n).

    Returns:
        f, the site's excess over the goal, (k + 1, m) [m, rad], and J, (k + 1, m, n).
    """
    poses, J = np.array([task.arm.pose(row) for row in q]), np.array([task.arm.jacobian(row) for row in q])
    return -pose_error(goal, poses)[:, task.rows], J[:, task.rows]


def _solution(answer: IkResult) -> list[Sheet]:
    """Return the joints, with the limits that were kept, the site, and the errors."""
    arm, rows = answer.task.arm, []
    for joint, q, unit, ends in zip(arm.joints, answer.q, arm.units, arm.position_limit, strict=True):
        degrees = _decimals([np.degrees(q)], 3) if unit == "rad" else ("",)
        shown = (number(end) if answer.limits and np.isfinite(end) else "none" for end in ends)
        rows.append((joint, *_decimals([q]), unit, *degrees, *shown, answer.at_limit.get(joint, "")))
    title = "Reached" if answer.found else "Not reached; the nearest"
    headings = ("joint", "q", "", "deg", "lower", "upper", "at limit")
    axes = ("", "x", "y", "z", "qw", "qx", "qy", "qz")
    poses = [("goal", *_decimals(answer.goal)), ("reached", *_decimals(answer.pose))]
    errors = f"{number(answer.position_error)} m, {number(answer.orientation_error)} rad"
    note = f"Error: {errors}; starts: {answer.tries}; steps: {answer.steps}"
    return [
        Sheet(f"{title}: {arm.path.stem}, {arm.site}", headings, rows, frozenset({0, 2, 6})),
        Sheet(f"Site; task rows: {', '.join(answer.task.axes)}", axes, poses, notes=(note,)),
    ]


def _postures(task: Task, postures: Postures) -> Sheet:
    """Return the postures side by side."""
    count, freedom = len(postures.q) - postures.is_continuum, int(postures.freedom.max())
    isolated = f"{count} posture{'s' * (count != 1)}"
    notes = []
    if freedom:
        isolated = f"{isolated} and a continuum" if count else "a continuum"
        rank = f"the Jacobian has rank {task.arm.n - freedom} with {task.arm.n} joints"
        notes = [f"A continuum: {rank}; shown is its posture nearest to the start."]
    rows = [
        (f"{joint} {unit}", *_decimals(values, 4))
        for joint, unit, values in zip(task.arm.joints, task.arm.units, postures.q.T, strict=True)
    ]
    rows.append(("starts that led there", *map(str, postures.hits)))
    title = f"{task.arm.path.stem}, {task.arm.site}: {isolated}; {postures.starts} starts"
    return Sheet(title, ("joint", *(str(i + 1) for i in range(len(postures.q)))), rows, notes=tuple(notes))


def _iterates(task: Task, q: Array, f: Array, J: Array) -> list[Sheet]:
    """Return q, h of q⁺ = q − h, and f and J of J h = f, for every step."""
    joints = range(1, task.arm.n + 1)
    errors = np.linalg.norm(task.row_scale * f, axis=1)
    iterates = [(str(i), number(errors[i]), *_decimals(q[i])) for i in range(len(q))]
    steps = [(str(i), *_decimals(h)) for i, h in enumerate(-np.diff(q, axis=0))]
    equations = [
        (f"{i} {axis}" if row == 0 else axis, *_decimals([f[i, row], *J[i, row]], 4))
        for i in range(len(q))
        for row, axis in enumerate(task.axes)
    ]
    return [
        Sheet("Iterates", ("", "|e|", *(f"q{j}" for j in joints)), iterates),
        Sheet("Steps, next q = q − h", ("", *(f"h{j}" for j in joints)), steps),
        Sheet("Equations J h = f", ("", "f", *(f"J{j}" for j in joints)), equations),
    ]


def _decimals(values: Iterable[float], digits: int = 6) -> tuple[str, ...]:
    """Return this many decimals, and no sign for values that round to 0."""
    return tuple(
        f"{round(value, digits) + 0.0:.{digits}f}" if abs(value) < 1e3 else number(value) for value in values
    )


def _problem(answer: IkResult) -> str:
    """Return why a goal was not reached, in one line."""
    where = f"the nearest of {answer.tries} starts"
    if answer.method == "newton":
        where = f"the last of {answer.steps} steps of Newton's method; --method damped has more starts"
    limits = ", ".join(f"{joint} ({side})" for joint, side in answer.at_limit.items())
    distance = f"{answer.position_error:.6g} m and {answer.orientation_error:.6g} rad"
    return f"not reached: {distance} are left at {where}" + (f"; at limits: {limits}" if limits else "")
