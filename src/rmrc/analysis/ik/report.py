"""The result of inverse kinematics, as tables of at most 100 columns and as JSON."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from rmrc.analysis.ik.ik import IkResult, Postures
from rmrc.analysis.ik.solve import Solution, linearized
from rmrc.law.task import Task
from rmrc.show.report import Report, plain
from rmrc.show.sheets import Sheet, number

# Columns of numbers that fit beside the names of joints.
BESIDE = 8


def report(answer: IkResult, iterates: bool = False) -> Report:
    """Return the report of a goal and the joint positions for it; its condition is met if they reach it.

    Args:
        answer: The result of `ik`.
        iterates: Whether to show every step; those of Newton's method are shown anyway.

    Example:
        >>> from rmrc.analysis.ik.ik import ik
        >>> shown = report(ik("models/planar_2link.xml", [3.0, 0.0]))
        >>> shown.met, shown.problem
        (False, 'not reached: 1 m and 0 rad are left at the nearest of 201 starts')
    """
    task, solution, postures = answer.task, answer.solution, answer.postures
    iterates = postures is None and (iterates or solution.method == "newton")
    values = {
        "model": str(task.arm.path), "site": task.arm.site, "axes": task.axes, "length": task.length,
        "limits": answer.limits, "tolerance": answer.tolerance, "goal": answer.goal, "start": answer.start,
        **_solution_values(task, solution, iterates),
    }  # fmt: skip
    if postures is not None:
        values |= {
            "postures": [
                {"q": dict(zip(task.arm.joints, q, strict=True)), "starts": hits, "freedom": freedom}
                for q, hits, freedom in zip(postures.q, postures.hits, postures.freedom, strict=True)
            ],
            "continuum": postures.is_continuum,
            "starts": postures.starts,
        }
    if postures is not None and answer.found:
        sheets = _posture_sheets(task, postures)
    else:
        sheets = _iterates(task, solution) if iterates else []
        sheets += _solution_sheets(task, solution, answer.limits)
    problem = "" if answer.found else _failure(task, solution)
    return Report(sheets, plain(values), met=answer.found, problem=problem)


def _solution_values(task: Task, solution: Solution, iterates: bool) -> dict[str, Any]:
    joints, path = task.arm.joints, solution.iterates
    values: dict[str, Any] = {
        "found": solution.found, "method": solution.method, "q": dict(zip(joints, solution.q, strict=True)),
        "pose": solution.pose, "error": solution.error, "position_error": solution.position_error,
        "orientation_error": solution.orientation_error, "at_limit": _limits_met(task, solution),
        "beyond_limit": _beyond(task, solution), "steps": solution.steps, "tries": solution.tries,
    }  # fmt: skip
    if iterates:
        values["iterates"] = {"q": path.q, "h": path.step, "error": path.error, "damping": path.damping}
        if solution.method == "newton":
            values["iterates"] |= dict(zip(("f", "J"), linearized(task, solution), strict=True))
    return values


def _solution_sheets(task: Task, solution: Solution, limits: bool) -> list[Sheet]:
    """Return the joints, with the limits that were kept, the site, and the errors."""
    arm, rows, beyond = task.arm, [], _beyond(task, solution)
    states = {joint: f"at {side}" for joint, side in _limits_met(task, solution).items()}
    states |= dict.fromkeys(beyond, "beyond")
    for joint, q, unit, ends in zip(arm.joints, solution.q, arm.units, arm.position_limit, strict=True):
        degrees = _decimals([np.degrees(q)], 3) if unit == "rad" else ("",)
        shown = (number(end) if limits and np.isfinite(end) else "none" for end in ends)
        rows.append((joint, *_decimals([q]), unit, *degrees, *shown, states.get(joint, "")))
    nearest = "the nearest" if solution.method == "damped" else "the end of the steps"
    title = "Reached" if solution.found else f"Not reached; {nearest}"
    headings = ("joint", "q", "", "deg", "lower", "upper", "")
    poses = [(name, *_decimals(pose)) for name, pose in (("goal", solution.goal), ("reached", solution.pose))]
    errors = (
        ("position error", number(solution.position_error), "m"),
        ("orientation error", number(solution.orientation_error), "rad"),
        ("steps", str(solution.steps), ""),
        ("starts tried", str(solution.tries), ""),
    )
    axes = ("", "x", "y", "z", "qw", "qx", "qy", "qz")
    return [
        Sheet(f"{title}: {arm.path.stem}, {arm.site}", headings, rows, frozenset({0, 2, 6})),
        Sheet(f"Site; task rows: {', '.join(task.axes)}", axes, poses),
        Sheet("", ("", "value", "unit"), errors, frozenset({0, 2})),
    ]


def _posture_sheets(task: Task, postures: Postures) -> list[Sheet]:
    """Return the postures side by side."""
    isolated = int(np.count_nonzero(postures.freedom == 0))
    counts = [f"{isolated} posture{'s' * (isolated != 1)}"] if isolated else []
    if postures.is_continuum:
        counts.append("a continuum; the table shows its posture nearest to the start")
    title = f"{task.arm.path.stem}, {task.arm.site}: {' and '.join(counts)}; {postures.starts} starts"
    sheets = []
    for first in range(0, len(postures.q), BESIDE):
        part = slice(first, first + BESIDE)
        rows = [
            (joint, unit, *_decimals(values, 4))
            for joint, unit, values in zip(task.arm.joints, task.arm.units, postures.q[part].T, strict=True)
        ]
        rows.append(("starts that led there", "", *map(str, postures.hits[part])))
        if postures.is_continuum:
            rows.append(("directions of self-motion", "", *map(str, postures.freedom[part])))
        numbered = (str(first + i + 1) for i in range(len(postures.q[part])))
        sheets.append(Sheet("" if first else title, ("joint", "", *numbered), rows, frozenset({0, 1})))
    return sheets


def _iterates(task: Task, solution: Solution) -> list[Sheet]:
    """Return q, h of q⁺ = q − h, and Newton's f and J of J h = f, for every step, in blocks of joints."""
    path, n = solution.iterates, task.arm.n
    is_damped = solution.method == "damped"
    sheets = list[Sheet]()
    for first in range(0, n, BESIDE):
        part = slice(first, first + BESIDE)
        joints = range(1, n + 1)[part]
        rows = [
            (str(i), number(error), *_decimals(q[part]))
            for i, (error, q) in enumerate(zip(path.error, path.q, strict=True))
        ]
        sheets.append(Sheet("Iterates", ("", "|e|", *(f"q{j}" for j in joints)), rows))
        steps = [
            (str(i), *([number(damping)] * is_damped), *_decimals(h[part]))
            for i, (damping, h) in enumerate(zip(path.damping, path.step, strict=True))
        ]
        headings = ("", *["λ"] * is_damped, *(f"h{j}" for j in joints))
        sheets.append(Sheet("Steps, next q = q − h", headings, steps))
    for first in range(0, 0 if is_damped else n, BESIDE - 1):
        part = slice(first, first + BESIDE - 1)
        rows = [
            (str(i) if row == 0 else "", axis, *_decimals([error], 4), *_decimals(line[part], 4))
            for i, (f, J) in enumerate(zip(*linearized(task, solution), strict=True))
            for row, (axis, error, line) in enumerate(zip(task.axes, f, J, strict=True))
        ]
        headings = ("", "", "f", *(f"J{j}" for j in range(1, n + 1)[part]))
        sheets.append(Sheet("Equations J h = f", headings, rows, frozenset({0, 1})))
    return sheets


def _decimals(values: Iterable[float], digits: int = 6) -> tuple[str, ...]:
    """Return this many decimals, and no sign for values that round to 0."""
    return tuple(
        f"{round(value, digits) + 0.0:.{digits}f}" if abs(value) < 1e3 else number(value) for value in values
    )


def _failure(task: Task, solution: Solution) -> str:
    """Return why a goal was not reached, in one line."""
    distance = f"{solution.position_error:.6g} m and {solution.orientation_error:.6g} rad are"
    beyond = ", ".join(_beyond(task, solution))
    if solution.method == "newton" and beyond:
        return (
            f"not reached: Newton's method ends beyond the limits of {beyond}; "
            "try --method damped, or --no-limits"
        )
    if solution.method == "newton":
        steps = f"after {solution.steps} of Newton's steps"
        return f"not reached: {distance} left {steps}; try another start or --method damped"
    active = [f"{joint} at its {side} limit" for joint, side in _limits_met(task, solution).items()]
    nearest = f"not reached: {distance} left at the nearest of {solution.tries} starts"
    return "; ".join([nearest, ", ".join(active)] if active else [nearest])


def _limits_met(task: Task, solution: Solution) -> dict[str, str]:
    """Return `upper` or `lower` for each joint at a limit."""
    sides = zip(task.arm.joints, solution.at_limit, strict=True)
    return {joint: "upper" if side > 0 else "lower" for joint, side in sides if side}


def _beyond(task: Task, solution: Solution) -> list[str]:
    return [joint for joint, is_so in zip(task.arm.joints, solution.beyond, strict=True) if is_so]
