"""The result of inverse kinematics, as tables of at most 100 columns and as JSON."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from rmrc.analysis.ik.ik import IkResult
from rmrc.analysis.ik.postures import Postures
from rmrc.analysis.ik.solve import Solution, linearized
from rmrc.law.task import Task
from rmrc.show.report import Report, plain
from rmrc.show.sheets import Sheet, number

# Columns of numbers that fit beside the names of joints.
BESIDE = 8


def report(found: IkResult, iterates: bool = False) -> Report:
    """Return the report of a goal and the joint positions for it; its condition is met if they reach it.

    Args:
        found: The result of `ik`.
        iterates: Whether to show every step; those of Newton's method are shown anyway.

    Example:
        >>> from rmrc.analysis.ik.ik import ik
        >>> shown = report(ik("models/planar_2link.xml", [3.0, 0.0]))
        >>> shown.met, shown.problem
        (False, 'not reached: 1 m and 0 rad are left at the nearest of 201 starts')
    """
    task, solution, postures = found.task, found.solution, found.postures
    values: dict[str, Any] = {
        "model": str(task.arm.path), "site": task.arm.site, "axes": task.axes, "length": task.length,
        "limits": found.limits, "tolerance": found.tolerance, "goal": found.goal, "start": found.start,
    }  # fmt: skip
    if postures is None:
        iterates = iterates or solution.method == "newton"
        values |= {"method": solution.method, **_solution_values(task, solution, iterates)}
    else:
        values |= _posture_values(task, postures)
    if postures is None or not found.found:
        sheets = _solution_sheets(task, solution, found.limits, iterates)
    else:
        sheets = _posture_sheets(task, postures)
    problem = "" if found.found else _failure(task, solution)
    return Report(sheets, plain(values), met=found.found, problem=problem)


# JSON -------------------------------------------------------------------------------------------


def _solution_values(task: Task, solution: Solution, iterates: bool) -> dict[str, Any]:
    joints, path = task.arm.joints, solution.iterates
    values: dict[str, Any] = {
        "found": solution.found, "q": dict(zip(joints, solution.q, strict=True)), "pose": solution.pose,
        "error": solution.error, "position_error": solution.position_error,
        "orientation_error": solution.orientation_error,
        "at_limit": {joint: _side(side) for joint, side in _active(task, solution)},
        "beyond_limit": _beyond(task, solution), "steps": solution.steps, "tries": solution.tries,
    }  # fmt: skip
    if iterates:
        values["iterates"] = {"q": path.q, "h": path.step, "error": path.error, "damping": path.damping}
        if solution.method == "newton":
            values["iterates"] |= dict(zip(("f", "J"), linearized(task, solution), strict=True))
    return values


def _posture_values(task: Task, postures: Postures) -> dict[str, Any]:
    """Return all postures; `apart` is null if a continuum may be a part of another."""
    return {
        "found": postures.nearest is None,
        "postures": [
            {"q": dict(zip(task.arm.joints, q, strict=True)), "starts": hits, "freedom": freedom,
             "apart": True if decided else None}
            for q, hits, freedom, decided in zip(
                postures.q, postures.hits, postures.freedom, postures.decided, strict=True
            )
        ],
        "continuum": postures.is_continuum,
        "continua": np.count_nonzero(postures.freedom),
        "starts": postures.starts,
        "nearest": postures.nearest and _solution_values(task, postures.nearest, False),
    }  # fmt: skip


# Tables -----------------------------------------------------------------------------------------


def _solution_sheets(task: Task, solution: Solution, limits: bool, iterates: bool) -> list[Sheet]:
    """Return the joints, the errors, and the steps if wanted, with the limits that were kept."""
    arm = task.arm
    rows = []
    for j, (joint, position) in enumerate(zip(arm.joints, solution.q, strict=True)):
        lower, upper = arm.position_limit[j] if limits else (-np.inf, np.inf)
        rows.append(
            (
                joint,
                *_decimals([position]),
                *_unit(task, j, position),
                *(number(end) if np.isfinite(end) else "none" for end in (lower, upper)),
                _at(solution, j),
            )
        )
    nearest = "the nearest" if solution.method == "damped" else "the end of the steps"
    title = "Reached" if solution.found else f"Not reached; {nearest}"
    joints = Sheet(
        f"{title}: {arm.path.stem}, {arm.site}",
        ("joint", "q", "", "deg", "lower", "upper", ""), rows, frozenset({0, 2, 6}),
    )  # fmt: skip
    left = (
        ("position error", number(solution.position_error), "m"),
        ("orientation error", number(solution.orientation_error), "rad"),
        ("steps", str(solution.steps), ""),
        ("starts tried", str(solution.tries), ""),
    )
    rest = Sheet("", ("", "value", "unit"), left, frozenset({0, 2}))
    poses = (("goal", solution.goal), ("reached", solution.pose))
    site = Sheet(
        f"Site; task rows: {', '.join(task.axes)}",
        ("", "x", "y", "z", "qw", "qx", "qy", "qz"), [(name, *_decimals(pose)) for name, pose in poses],
    )  # fmt: skip
    steps = _iterates(solution) if iterates else []
    if solution.method == "newton":
        steps += _equations(task, solution)
    return [*steps, joints, site, rest]


def _posture_sheets(task: Task, postures: Postures) -> list[Sheet]:
    """Return the postures side by side."""
    count = len(postures.q)
    continua = int(np.count_nonzero(postures.freedom))
    isolated = count - continua
    found = [f"{isolated} posture{'s' * (isolated != 1)}"] if isolated or not continua else []
    if continua:
        one = "a continuum; the table shows its point nearest to the start"
        found.append(
            one
            if continua == 1
            else f"{continua} continua; the table shows the point of each nearest to the start"
        )
    title = f"{task.arm.path.stem}, {task.arm.site}: {' and '.join(found)}; {postures.starts} starts"
    sheets = []
    for first in range(0, count, BESIDE):
        part = range(first, min(first + BESIDE, count))
        rows = [
            (joint, task.arm.units[j], *_decimals(postures.q[list(part), j], 4))
            for j, joint in enumerate(task.arm.joints)
        ]
        rows.append(("starts that led there", "", *(str(postures.hits[p]) for p in part)))
        if postures.is_continuum:
            rows.append(("directions of self-motion", "", *(str(postures.freedom[p]) for p in part)))
        if not postures.decided.all():
            words = {True: "yes", False: "unknown"}
            rows.append(("apart from others", "", *(words[bool(postures.decided[p])] for p in part)))
        headings = ("joint", "", *(str(p + 1) for p in part))
        sheets.append(Sheet("" if first else title, headings, rows, frozenset({0, 1})))
    return sheets


def _iterates(solution: Solution) -> list[Sheet]:
    """Return q, and h of q⁺ = q − h, for every step, in blocks of joints."""
    path, sheets = solution.iterates, []
    damped = solution.method == "damped"
    for first in range(0, path.q.shape[1], BESIDE):
        part = range(first, min(first + BESIDE, path.q.shape[1]))
        rows = [
            (str(i), number(error), *_decimals(q[list(part)]))
            for i, (error, q) in enumerate(zip(path.error, path.q, strict=True))
        ]
        sheets.append(Sheet("Iterates", ("", "|e|", *(f"q{j + 1}" for j in part)), rows, frozenset({0})))
        rows = [
            (str(i), *([number(damping)] if damped else []), *_decimals(h[list(part)]))
            for i, (damping, h) in enumerate(zip(path.damping, path.step, strict=True))
        ]
        headings = ("", *(["λ"] if damped else []), *(f"h{j + 1}" for j in part))
        sheets.append(Sheet("Steps, next q = q − h", headings, rows, frozenset({0})))
    return sheets


def _equations(task: Task, solution: Solution) -> list[Sheet]:
    """Return f, and J of J h = f, for every step, in blocks of joints [Selig92, §6.3]."""
    sheets = []
    for first in range(0, task.arm.n, BESIDE - 1):
        part = slice(first, first + BESIDE - 1)
        rows = [
            (str(i) if row == 0 else "", axis, *_decimals([error], 4), *_decimals(line[part], 4))
            for i, (f, J) in enumerate(zip(*linearized(task, solution), strict=True))
            for row, (axis, error, line) in enumerate(zip(task.axes, f, J, strict=True))
        ]
        headings = ("", "", "f", *(f"J{j + 1}" for j in range(task.arm.n)[part]))
        sheets.append(Sheet("Equations J h = f", headings, rows, frozenset({0, 1})))
    return sheets


def _decimals(values: Iterable[float], digits: int = 6) -> tuple[str, ...]:
    """Return this many decimals, and no sign for values that round to 0."""
    return tuple(
        f"{round(value, digits) + 0.0:.{digits}f}" if abs(value) < 1e3 else number(value) for value in values
    )


def _unit(task: Task, joint: int, position: float) -> tuple[str, ...]:
    """Return the unit of a joint, and its position in degrees if it has any."""
    return ("m", "") if task.arm.is_slide[joint] else ("rad", *_decimals([np.degrees(position)], 3))


# Words ------------------------------------------------------------------------------------------


def _failure(task: Task, solution: Solution) -> str:
    """Return why a goal was not reached, in one line."""
    beyond = _beyond(task, solution)
    if solution.method == "newton":
        if beyond:
            return (
                f"not reached: Newton's method ends beyond the limits of {', '.join(beyond)}; "
                "try --method damped, or --no-limits"
            )
        return (
            f"not reached: {_distance(solution)} left after {solution.steps} of Newton's steps; "
            "try another start or --method damped"
        )
    active = [f"{joint} at its {_side(side)} limit" for joint, side in _active(task, solution)]
    return (
        f"not reached: {_distance(solution)} left at the nearest of {solution.tries} "
        f"starts{'; ' * bool(active)}{', '.join(active)}"
    )


def _distance(solution: Solution) -> str:
    return f"{solution.position_error:.6g} m and {solution.orientation_error:.6g} rad are"


def _active(task: Task, solution: Solution) -> Sequence[tuple[str, int]]:
    return [
        (joint, int(side)) for joint, side in zip(task.arm.joints, solution.at_limit, strict=True) if side
    ]


def _beyond(task: Task, solution: Solution) -> list[str]:
    return [joint for joint, is_so in zip(task.arm.joints, solution.beyond, strict=True) if is_so]


def _side(side: int) -> str:
    return "upper" if side > 0 else "lower"


def _at(solution: Solution, joint: int) -> str:
    if solution.beyond[joint]:
        return "beyond"
    return f"at {_side(int(solution.at_limit[joint]))}" if solution.at_limit[joint] else ""
