"""The verb `workspace`: map an arm's reach, its singularities and its dexterity."""

from pathlib import Path
from typing import Annotated

import typer

from rmrc.cli.console import EXIT_INTERRUPTED, complain, notice, progress
from rmrc.cli.options import (
    AsJson,
    Body,
    Keyframe,
    Length,
    Model,
    Out,
    Packages,
    Positions,
    Quiet,
    Site,
    TaskAxes,
    TaskFrame,
    drawable,
    pictured,
    read_arm,
)
from rmrc.cli.reports import show
from rmrc.cli.texts import configuration, task_axes
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted
from rmrc.support.notices import READING

MAPS = ("sigma_min", "manipulability", "condition")


def _known(measure: str | None) -> str | None:
    if measure is not None and measure not in MAPS:
        raise QuestionError(f"--map must be one of {', '.join(MAPS)}, got {quoted(measure)}")
    return measure


Plane = Annotated[
    str | None,
    typer.Option(
        metavar="xy|xz|yz|rz",
        help="rz: distance from the first axis and height; others: the view along the third axis. Default: a "
        "planar arm's plane, rz or xz.",
    ),
]
Map = Annotated[
    str | None,
    typer.Option(
        "--map",
        metavar="|".join(MAPS),
        help="Quantity to color; default: none, with --over sigma_min.",
        callback=_known,
    ),
]
Worst = Annotated[
    bool,
    typer.Option(
        help="Keep the worst of the postures that reach a cell; default: the best.", show_default=False
    ),
]
Over = Annotated[
    str | None,
    typer.Option(
        metavar="JOINT,JOINT", help="Map over these two joints, with the others at --q or --keyframe."
    ),
]
Cells = Annotated[int, typer.Option(help="Cells along the longer side.", min=10, max=2000)]
Samples = Annotated[
    int,
    typer.Option(
        help="Number of random configurations, with and without limits.",
        min=1000,
    ),
]
Picture = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Write the picture to this file instead: .png, .svg or .pdf.", callback=drawable
    ),
]


@pictured
def workspace(
    model: Model,
    site: Site = None,
    body: Body = None,
    package: Packages = None,
    plane: Plane = None,
    map_: Map = None,
    worst: Worst = False,
    over: Over = None,
    q: Positions = None,
    keyframe: Keyframe = None,
    axes: TaskAxes = None,
    task_frame: TaskFrame = None,
    length: Length = None,
    cells: Cells = 200,
    samples: Samples = 1_000_000,
    out: Out = Path("recordings"),
    picture: Picture = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Map the reach and the singularities of an arm; write NAME.workspace.png and .npz."""
    rows = task_axes(axes)
    with notice(READING):
        from rmrc.analysis.workspace import workspace as mapping
        from rmrc.analysis.workspace.report import report, save
        from rmrc.results.leaving import refuse_unwritable

        arm = read_arm(model, site, body, package)
    name = f"{arm.path.stem}.{'workspace' if over is None else 'joints'}"
    files = [picture or out / f"{name}.png", out / f"{name}.npz"]
    arm, at = configuration(arm, q, keyframe)
    refuse_unwritable(files)
    names, total = None if over is None else over.split(","), cells**2 if over else 2 * samples
    if over is not None and (plane is not None or worst):
        raise QuestionError("--over has no slice: leave out --plane and --worst")
    try:
        with progress(f"{arm.path.stem}: {over or 'workspace'}", total, quiet or as_json) as on_samples:
            space = mapping.workspace(
                arm, plane, at, over=names, axes=rows, task_frame=task_frame, length=length, cells=cells,
                samples=samples, worst=worst, on_samples=on_samples,
            )  # fmt: skip
        answer = report(space, map_)
        if answer.draw is not None:
            answer.draw(files[0])
        save(space, files[1])
    except KeyboardInterrupt:
        complain("interrupted; nothing was written")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    show(answer, as_json, quiet, files)
