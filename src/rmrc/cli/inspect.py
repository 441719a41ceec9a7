"""The verb `inspect`: an arm at one configuration, or at several."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from rmrc.cli.console import notice, output, print_json, warn
from rmrc.cli.questions import (
    AsJson,
    Length,
    Model,
    Site,
    TaskAxes,
    check_picture,
    configuration,
    numbers,
    task_axes,
    wrench_of,
)
from rmrc.support.errors import QuestionError

if TYPE_CHECKING:
    from rmrc.arm import Arm


def inspect(
    model: Model,
    site: Site = None,
    q: Annotated[
        list[str] | None,
        typer.Option(
            "--q",
            metavar="Q1,Q2,...",
            help='Joint positions: rad, m, or angles such as "60 deg"; repeatable.',
        ),
    ] = None,
    keyframe: Annotated[
        list[str] | None, typer.Option(help="Joint positions by name; repeatable; default: home.")
    ] = None,
    axes: TaskAxes = None,
    length: Length = 1.0,
    frame: Annotated[
        str, typer.Option(metavar="world|site|base", help="Along whose axes J and the words are.")
    ] = "world",
    joint_error: Annotated[
        str | None,
        typer.Option(
            metavar="S | S1,S2,...",
            help='Standard deviation of the joints, such as "0.1 deg": tell the site\'s.',
        ),
    ] = None,
    wrench: Annotated[
        str | None,
        typer.Option(
            metavar="FX,...,NZ",
            help="Force in N, or force and moment in N m, on the arm at the site, in the world: tell what "
            "holds it.",
        ),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the arm with its ellipses: .png, .svg or .pdf.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Tell what an arm can and cannot do at a configuration: pose, J, singularity, ellipsoids, statics."""
    check_picture(picture)
    if q and keyframe:
        raise QuestionError("give --q or --keyframe, not both")
    rows = task_axes(axes)
    with notice("reading the model ..."):
        from rmrc.analysis.inspect import json as inspection_json
        from rmrc.analysis.inspect import tables as inspection_tables
        from rmrc.analysis.inspect.inspection import inspect as ask
        from rmrc.arm import load
        from rmrc.show.sheets import render

    arm = load(model, site)
    positions = [configuration(arm, text, None) for text in q or ()]
    positions += [configuration(arm, None, name) for name in keyframe or ()]
    errors = None if joint_error is None else _joint_errors(arm, joint_error)
    load_on_site = None if wrench is None else wrench_of(wrench)
    found = [
        ask(
            arm, one, axes=rows, length=length, frame=frame, joint_error=errors, wrench=load_on_site
        )
        for one in positions or [configuration(arm, None, None)]
    ]  # fmt: skip
    warn(warning for one in found for warning in one.warnings)
    if picture is not None:
        from rmrc.analysis.inspect.figure import draw_arm

        draw_arm(found, picture)
    if as_json:
        facts = [inspection_json.facts(one) for one in found]
        print_json(facts[0] if len(facts) == 1 else facts, allow_nan=False)
        return
    console = output()
    for one in found:
        console.print(render(inspection_tables.sheets(one)))


def _joint_errors(arm: "Arm", text: str) -> NDArray[np.float64]:
    """Return the standard deviation of each joint, (n,): one for all that are of one kind, or one each."""
    if "," in text or arm.n == 1:
        return numbers("--joint-error", text, arm.joints)
    if arm.is_slide.any() and not arm.is_slide.all():
        raise QuestionError(
            f"--joint-error {text}: one value will not do for joints that turn and joints that slide; "
            f"give one for each of {', '.join(arm.joints)}"
        )
    return np.repeat(numbers("--joint-error", text, ("joint",)), arm.n)
