"""The verbs about an arm: `inspect`, `ik`, `statics` and `workspace`."""

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from typer import Option

from rmrc.cli import options
from rmrc.cli.console import EXIT_DIVERGED, EXIT_MISSED, complain, progress, show, working
from rmrc.cli.options import Number, Text

Plane: TypeAlias = Literal["xy", "xz", "yz", "rz"]
Quantity: TypeAlias = Literal["sigma_min", "manipulability"]


def inspect(
    model: options.Model,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    q: options.Positions = None,
    keyframe: options.Keyframe = None,
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
    with working("reading the model"):
        from rmrc.analysis.inspection import inspect as ask
        from rmrc.analysis.inspection_report import report

        arm = options.read_arm(model, site, body, package)
    errors = options.values("--joint-error", joint_error)
    if errors is not None and len(errors) == 1 == len(set(arm.units)):
        errors *= arm.n  # all joints turn, or all slide
    found = ask(
        arm, options.values("--q", q), keyframe=keyframe, axes=options.rows(axes), task_frame=task_frame,
        length=length, frame=frame, joint_error=errors,
    )  # fmt: skip
    for warning in found.warnings:
        complain(f"warning: {warning}")
    answer = report(found)
    files = options.draw(answer, output, width, font)
    show(answer, as_json, quiet, files)


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
    with working("searching"):
        from rmrc.analysis.ik import ik as ask
        from rmrc.analysis.ik_report import report

        found = ask(
            options.read_arm(model, site, body, package),
            options.values("--to", to), options.values("--q", q), quat=options.values("--quat", quat),
            to_q=options.values("--to-q", to_q), keyframe=keyframe, axes=options.rows(axes),
            task_frame=task_frame, length=length, method=method, limits=limits, every=every,
            tolerance=tolerance,
        )  # fmt: skip
    show(report(found), as_json, quiet)


def statics(
    model: options.Model,
    wrench: Annotated[
        str,
        Option(metavar="fx,fy,fz,nx,ny,nz", help="Wrench on the arm at the site [N, N·m], or a force alone."),
    ],
    q: options.Positions = None,
    keyframe: options.Keyframe = None,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    frame: Annotated[Literal["world", "base", "site"], Option(help="Frame of the wrench.")] = "world",
    at: Annotated[Text, Option(metavar="SITE", help="Print the wrench also at this site.")] = None,
    gravity: Annotated[bool, Option(help="Whether the actuators also support the arm's weight.")] = False,
    hold: Annotated[
        Number, Option(callback=options.within(0.2, 1000.0), help="Simulate until it is still [s].")
    ] = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Compute actuator torques and link loads under a wrench, and wrenches that need no torque.

    With --hold, simulates the arm until it is still, for at most this time, and reads its actuators. Another
    site of --at must be of the same body. Exit code 1: the wrench was not held; 3: the simulation diverged.
    """
    with working("holding" if hold else "reading the model"):
        from rmrc.analysis.statics import statics as ask
        from rmrc.analysis.statics_report import report

        acts = options.values("--wrench", wrench, float, 1e100)
        arm = options.read_arm(model, site, body, package)
        found = ask(
            arm, acts or (), options.values("--q", q), keyframe=keyframe, frame=frame, at=at, gravity=gravity,
            hold=hold,
        )  # fmt: skip
    diverged = found.held is not None and found.held["run"].divergence
    show(report(found), as_json, quiet, missed=EXIT_DIVERGED if diverged else EXIT_MISSED)


def workspace(
    model: options.Model,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    plane: Annotated[Plane | None, Option(help="Slice; default: it fits the arm.")] = None,
    map_: Annotated[Quantity | None, Option("--map", help="Quantity to color.")] = None,
    q: options.Positions = None,
    keyframe: options.Keyframe = None,
    axes: options.TaskAxes = None,
    task_frame: options.TaskFrame = None,
    length: options.Length = None,
    cells: Annotated[
        int, Option(callback=options.within(10, 2000), help="Cells along the longer side.")
    ] = 200,
    samples: Annotated[
        int, Option(callback=options.within(1e3, 1e9), help="Number of random configurations.")
    ] = 1_000_000,
    out: options.Out = Path("recordings"),
    output: options.Picture = None,
    width: options.Width = None,
    font: options.Font = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Map the reach and the singularities of an arm; write NAME.workspace.png.

    The plane rz has the distance from the first axis and the height; the others are seen along their third
    axis. The default is a planar arm's plane, or rz or xz, and the planes that some joint leaves alone, such
    as xy of a SCARA. Of the postures that reach a cell, --map colors it by the best. Samples are taken of
    each slice, with and without limits.
    """
    with working("reading the model"):
        from rmrc.analysis.workspace import workspace as map_workspace
        from rmrc.analysis.workspace_report import report
        from rmrc.support.files import refuse_unwritable

        arm = options.read_arm(model, site, body, package)
    file = output or out / f"{arm.path.stem}.workspace.png"
    refuse_unwritable([file])
    with progress(f"{arm.path.stem}: workspace", 2 * samples, quiet or as_json) as on_samples:
        space = map_workspace(
            arm, plane, options.values("--q", q), keyframe=keyframe, axes=options.rows(axes),
            task_frame=task_frame, length=length, cells=cells, samples=samples, on_samples=on_samples,
        )  # fmt: skip
    answer = report(space, map_)
    show(answer, as_json, quiet, options.draw(answer, file, width, font))
