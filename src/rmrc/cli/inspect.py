"""The verb `inspect`: analyze an arm at a configuration."""

from pathlib import Path
from typing import Annotated

import typer

from rmrc.cli.console import notice, warn
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
    drawable,
    pictured,
    read_arm,
)
from rmrc.cli.reports import show
from rmrc.cli.texts import configuration, numbers, task_axes
from rmrc.support.notices import READING

Frame = Annotated[
    str | None,
    typer.Option(
        metavar="world|site|base",
        help="Frame of the axes of J and of the directions in words.",
        show_default="the frame of the rows",
    ),
]
JointError = Annotated[
    str | None,
    typer.Option(
        metavar="S | S1,S2,...",
        help='Joint errors, such as "0.1 deg": print the resulting errors of the site.',
    ),
]
Picture = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Draw the arm with its velocity and force ellipses: .png, .svg or .pdf.",
        callback=drawable,
    ),
]


@pictured
def inspect(
    model: Model,
    site: Site = None,
    body: Body = None,
    package: Packages = None,
    q: Positions = None,
    keyframe: Keyframe = None,
    axes: TaskAxes = None,
    task_frame: TaskFrame = None,
    length: Length = None,
    frame: Frame = None,
    joint_error: JointError = None,
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Analyze an arm at a configuration: pose, Jacobian, singularities, ellipsoids."""
    rows, errors = task_axes(axes), None
    with notice(READING):
        from rmrc.analysis.inspect.inspection import inspect as ask
        from rmrc.analysis.inspect.report import report

    arm, positions = configuration(read_arm(model, site, body, package), q, keyframe)
    if joint_error is not None:  # one for all joints of one unit, or one for each
        is_each = "," in joint_error or len(set(arm.units)) > 1
        text = joint_error if is_each else ",".join([joint_error] * arm.n)
        errors = numbers("--joint-error", text, arm.joints)
    found = ask(
        arm, positions, axes=rows, task_frame=task_frame, length=length, frame=frame, joint_error=errors
    )
    warn(found.warnings)
    answer = report(found)
    if picture is not None and answer.draw is not None:
        answer.draw(picture)
    show(answer, as_json)
