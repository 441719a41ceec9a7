"""The verb `ik`: find joint positions that bring a site to a pose, or as near as possible."""

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from rmrc.cli.console import notice
from rmrc.cli.options import (
    AsJson,
    Body,
    Keyframe,
    Length,
    Model,
    Packages,
    Positions,
    Site,
    TaskAxes,
    TaskFrame,
    read_arm,
    within,
)
from rmrc.cli.reports import show
from rmrc.cli.texts import configuration, numbers, task_axes
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted
from rmrc.support.notices import READING

if TYPE_CHECKING:
    from rmrc.law.task import Array, Task


class Method(StrEnum):
    """How to search."""

    DAMPED = "damped"
    NEWTON = "newton"


To = Annotated[
    str | None,
    typer.Option(
        "--to",
        metavar="X,Y,...",
        help="The goal: one value per task row, in m, rad, or angles such as "
        '"120 deg"; rx,ry,rz form a rotation vector; in a task with only some of them, it rotates the site '
        "from its orientation with all joints at 0.",
    ),
]
Quat = Annotated[
    str | None,
    typer.Option("--quat", metavar="W,X,Y,Z", help="The goal's orientation; --to then takes x,y,z only."),
]
ToPositions = Annotated[
    str | None,
    typer.Option(
        "--to-q", metavar="Q1,Q2,...", help="The goal: the pose of the site at these joint positions."
    ),
]
Tolerance = Annotated[
    float,
    typer.Option(
        help="Largest error at which a goal counts as reached: orientation in rad, position divided by "
        "--length.",
        callback=within("--tolerance", 1e-12, 1.0),
    ),
]
WhichMethod = Annotated[
    Method,
    typer.Option(
        help="Damped least squares (DLS) from several starts, or Newton's method from "
        "one start with every step printed."
    ),
]
Limits = Annotated[bool, typer.Option("--limits/--no-limits", help="Respect the model's position limits.")]
Every = Annotated[
    bool,
    typer.Option(
        "--all",
        help="Search for all solutions, from many starts; solutions within 1e-4 rad (slides: m divided by "
        "--length) count as one.",
    ),
]
Iterates = Annotated[bool, typer.Option("--iterates", help="Print every step.")]


def ik(
    model: Model,
    to: To = None,
    quat: Quat = None,
    to_q: ToPositions = None,
    q: Positions = None,
    keyframe: Keyframe = None,
    site: Site = None,
    body: Body = None,
    package: Packages = None,
    axes: TaskAxes = None,
    task_frame: TaskFrame = None,
    length: Length = None,
    method: WhichMethod = Method.DAMPED,
    limits: Limits = True,
    every: Every = False,
    iterates: Iterates = False,
    tolerance: Tolerance = 1e-9,
    as_json: AsJson = False,
) -> None:
    """Find joint positions that bring a site to a pose, starting at --q or --keyframe."""
    if every and (iterates or method is Method.NEWTON):
        option = "--iterates" if iterates else "--method newton"
        raise QuestionError(f"give --all or {option}, not both: --all searches from many starts")
    rows = task_axes(axes)
    with notice(READING):
        from rmrc.analysis.ik.ik import ik as ask
        from rmrc.analysis.ik.ik import searchable
        from rmrc.analysis.ik.report import report
        from rmrc.analysis.subject import subject

    arm, start = configuration(read_arm(model, site, body, package), q, keyframe)
    task = searchable(subject(arm, axes=rows, length=length, task_frame=task_frame).task)
    goal = _goal(task, to, quat, to_q)
    found = ask(
        arm, q=start, pose=goal, axes=task.axes, length=length, method=method.value, limits=limits,
        every=every, tolerance=tolerance,
    )  # fmt: skip
    show(report(found, iterates), as_json)


def _goal(task: "Task", to: str | None, quat: str | None, to_q: str | None) -> "Array":
    """Return the pose (7,) of --to and --quat, or of --to-q."""
    from rmrc.analysis.ik.solve import goal_pose

    if to_q is not None:
        if to is not None or quat is not None:
            raise QuestionError("give --to-q or --to and --quat, not both")
        return task.arm.pose(numbers("--to-q", to_q, task.arm.joints))
    positions = tuple(axis for axis in task.axes if not axis.startswith("r"))
    if quat is None:
        if to is None:
            raise QuestionError(
                f"give a goal: --to with one value for each of {', '.join(task.axes)}, or --to-q"
            )
        return goal_pose(task, numbers("--to", to, task.axes))
    if to is None and positions:
        raise QuestionError(f"--quat needs --to with one value for each of {', '.join(positions)}")
    values = numbers("--to", to, positions) if to is not None else ()
    orientation = numbers("--quat", quat, ("w", "x", "y", "z"))
    if not orientation.any():
        raise QuestionError(f"--quat must not be zero, got {quoted(quat)}")
    return goal_pose(task, values, orientation)
