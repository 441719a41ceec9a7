"""The verb `inspect`: analyze an arm at one or more configurations."""

from functools import partial
from typing import Annotated

from typer import Option

from rmrc.cli import options
from rmrc.cli.console import complain, show, working
from rmrc.cli.options import Text, Texts
from rmrc.support.errors import QuestionError


def inspect(
    model: options.Model,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    q: Annotated[Texts, Option(metavar="Q1,Q2,...", help='Joint positions: "60 deg,0"; repeatable.')] = None,
    keyframe: Annotated[Texts, Option(help="Joint positions by name; repeatable; default: home.")] = None,
    axes: options.TaskAxes = None,
    task_frame: options.TaskFrame = None,
    length: options.Length = None,
    frame: Annotated[Text, Option(metavar="world|site|base", help="Frame of J.")] = None,
    joint_error: Annotated[Text, Option(metavar="S | S1,S2,...", help="Errors of the joints.")] = None,
    output: options.Picture = None,
    width: options.Width = None,
    font: options.Font = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Analyze an arm at a configuration: pose, Jacobian, singularities, ellipsoids.

    With --joint-error, such as "0.1 deg", prints the resulting errors of the site. With -o FILE, draws the
    arm with its velocity and force ellipses.
    """
    if q and keyframe:
        raise QuestionError("give --q or --keyframe, not both")
    with working("reading the model"):
        from rmrc.analysis.inspect.inspection import inspect as ask
        from rmrc.analysis.inspect.report import report

        arm = options.read_arm(model, site, body, package)
    errors = options.values("--joint-error", joint_error)
    if errors is not None and len(errors) == 1 and arm.is_slide.all() == arm.is_slide.any():
        errors *= arm.n  # all joints turn, or all slide
    at = partial(
        ask,
        arm,
        axes=options.rows(axes),
        task_frame=task_frame,
        length=length,
        frame=frame,
        joint_error=errors,
    )
    found = [at(options.values("--q", text)) for text in q or ()]
    found += [at(keyframe=name) for name in keyframe or ()]
    found = found or [at()]
    for warning in dict.fromkeys(warning for each in found for warning in each.warnings):
        complain(f"warning: {warning}")
    answer = report(*found)
    files = options.draw(answer, output, width, font)
    show(answer, as_json, quiet, files)
