"""The verb `ik`: find joint positions that bring a site to a pose, or as near as possible."""

from typing import Annotated, Literal

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
from rmrc.support.notices import READING

TO = (
    'The goal: one value per task row, in m, rad, or angles such as "120 deg"; rx,ry,rz form a rotation '
    "vector; in a task with only some of them, it rotates the site from its orientation with all joints at 0."
)
To = Annotated[str | None, typer.Option("--to", metavar="X,Y,...", help=TO)]
QUAT = "The goal's orientation; --to then takes x,y,z only."
Quat = Annotated[str | None, typer.Option("--quat", metavar="W,X,Y,Z", help=QUAT)]
TO_Q = "The goal: the pose of the site at these joint positions."
ToPositions = Annotated[str | None, typer.Option("--to-q", metavar="Q1,Q2,...", help=TO_Q)]
TOLERANCE = (
    "Largest error at which a goal counts as reached: orientation in rad, position divided by --length."
)
Tolerance = Annotated[float, typer.Option(help=TOLERANCE, callback=within("--tolerance", 1e-12, 1.0))]
METHOD = "Damped least squares (DLS) from several starts; or Newton's from one start, every step printed."
Method = Annotated[Literal["damped", "newton"], typer.Option(help=METHOD)]
Limits = Annotated[bool, typer.Option("--limits/--no-limits", help="Respect the model's position limits.")]
ALL = "Search for all solutions, from many starts; those within 1e-4 rad (slides: m over --length) are one."
Every = Annotated[bool, typer.Option("--all", help=ALL)]


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
    method: Method = "damped",
    limits: Limits = True,
    every: Every = False,
    tolerance: Tolerance = 1e-9,
    as_json: AsJson = False,
) -> None:
    """Find joint positions that bring a site to a pose, starting at --q or --keyframe."""
    rows = task_axes(axes)
    with notice(READING):
        from rmrc.analysis.ik.ik import ik as ask
        from rmrc.analysis.ik.report import report
        from rmrc.analysis.subject import subject

    arm, start = configuration(read_arm(model, site, body, package), q, keyframe)
    names = subject(arm, axes=rows, length=length, task_frame=task_frame).task.axes
    if quat is not None:
        names = tuple(axis for axis in names if not axis.startswith("r"))
    answer = ask(
        arm,
        to if to is None else numbers("--to", to, names),
        start,
        quat=quat if quat is None else numbers("--quat", quat, ("w", "x", "y", "z")),
        to_q=to_q if to_q is None else numbers("--to-q", to_q, arm.joints),
        axes=rows, task_frame=task_frame, length=length,
        method=method, limits=limits, every=every, tolerance=tolerance,
    )  # fmt: skip
    show(report(answer), as_json)
