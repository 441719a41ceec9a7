"""The verb `ik`: find joint positions that bring a site to a pose, or as near as possible."""

from typing import Annotated, Literal

from typer import Option

from rmrc.cli import options
from rmrc.cli.console import show, working
from rmrc.cli.options import Text
from rmrc.support.errors import QuestionError


def ik(
    model: options.Model,
    to: Annotated[Text, Option(metavar="X,Y,...", help="The goal: one value per task row.")] = None,
    quat: Annotated[Text, Option(metavar="W,X,Y,Z", help="Its orientation; --to then takes x,y,z.")] = None,
    to_q: Annotated[Text, Option(metavar="Q1,Q2,...", help="The goal: the pose at these positions.")] = None,
    q: options.Positions = None,
    keyframe: options.Keyframe = None,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    axes: options.TaskAxes = None,
    task_frame: options.TaskFrame = None,
    length: options.Length = None,
    method: Annotated[Literal["damped", "newton"], Option(help="Newton's has one start.")] = "damped",
    limits: Annotated[bool, Option(help="Respect the model's position limits.")] = True,
    every: Annotated[bool, Option("--all", help="Search for all solutions, from many starts.")] = False,
    iterates: Annotated[bool, Option("--iterates", help="Print every step.")] = False,
    tolerance: Annotated[
        float, Option(callback=options.within(1e-12, 1.0), help="Largest error of a reached goal.")
    ] = 1e-9,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Find joint positions that bring a site to a pose, starting at --q or --keyframe.

    The goal is in m, rad, or angles such as "120 deg"; rx,ry,rz form a rotation vector. In a task with only
    some of them, it rotates the site from its orientation with all joints at 0. Errors are those of the
    orientation in rad, and of the position divided by --length. Solutions of --all within 1e-4 rad (slides: m
    divided by --length) count as one. Exit code 1: the goal was not reached.
    """
    if every and iterates:
        raise QuestionError("give --all or --iterates, not both: --all searches from many starts")
    with working("searching"):
        from rmrc.analysis.ik.ik import ik as ask
        from rmrc.analysis.ik.report import report

        found = ask(
            options.read_arm(model, site, body, package),
            options.values("--to", to), options.values("--q", q), quat=options.values("--quat", quat),
            to_q=options.values("--to-q", to_q), keyframe=keyframe, axes=options.rows(axes),
            task_frame=task_frame, length=length, method=method, limits=limits, every=every,
            tolerance=tolerance,
        )  # fmt: skip
    show(report(found, iterates), as_json, quiet)
