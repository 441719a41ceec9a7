"""The verb `inspect`: analyze an arm at one or more configurations."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from rmrc.cli.console import notice, warn
from rmrc.cli.options import (
    AsJson,
    Body,
    Length,
    Model,
    Packages,
    Site,
    TaskAxes,
    TaskFrame,
    drawable,
    pictured,
    read_arm,
)
from rmrc.cli.reports import show
from rmrc.cli.texts import configuration, numbers, task_axes
from rmrc.support.errors import QuestionError
from rmrc.support.notices import READING

if TYPE_CHECKING:
    from rmrc.arm import Arm

AllPositions = Annotated[
    list[str] | None,
    typer.Option(
        "--q", metavar="Q1,Q2,...", help='Joint positions: rad, m, or angles such as "60 deg"; repeatable.'
    ),
]
Keyframes = Annotated[
    list[str] | None, typer.Option(help="Joint positions by name; repeatable; default: home.")
]
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
    q: AllPositions = None,
    keyframe: Keyframes = None,
    axes: TaskAxes = None,
    task_frame: TaskFrame = None,
    length: Length = None,
    frame: Frame = None,
    joint_error: JointError = None,
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Analyze an arm at a configuration: pose, Jacobian, singularities, ellipsoids."""
    if q and keyframe:
        raise QuestionError("give --q or --keyframe, not both")
    rows = task_axes(axes)
    with notice(READING):
        from rmrc.analysis.inspect.inspection import inspect as ask
        from rmrc.analysis.inspect.report import report

    arm = read_arm(model, site, body, package)
    positions = [configuration(arm, text, None) for text in q or ()]
    positions += [configuration(arm, None, name) for name in keyframe or ()]
    errors = None if joint_error is None else _joint_errors(arm, joint_error)
    found = [
        ask(placed, at, axes=rows, task_frame=task_frame, length=length, frame=frame, joint_error=errors)
        for placed, at in positions or [configuration(arm, None, None)]
    ]
    warn(warning for one in found for warning in one.warnings)
    answer = report(*found)
    if picture is not None and answer.draw is not None:
        answer.draw(picture)
    show(answer, as_json)


def _joint_errors(arm: "Arm", text: str) -> NDArray[np.float64]:
    """Return the standard deviation of each joint, (n,): one for all that are of one kind, or one each."""
    if "," in text or arm.n == 1:
        return numbers("--joint-error", text, arm.joints)
    if arm.is_slide.any() and not arm.is_slide.all():
        raise QuestionError(
            f"--joint-error {text}: the arm has both hinge and slide joints; give one value for each of "
            f"{', '.join(arm.joints)}"
        )
    return np.repeat(numbers("--joint-error", text, ("joint",)), arm.n)
