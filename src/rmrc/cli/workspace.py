"""The verb `workspace`: map an arm's reach, its singularities and its dexterity."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from rmrc.cli.console import interruption, notice, progress
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
from rmrc.support.notices import READING

PLANE = (
    "rz: distance from the first axis and height; others: the view along the third axis. Default: a planar "
    "arm's plane, or rz or xz, and the planes that some joint leaves alone, such as xy of a SCARA."
)
Plane = Annotated[Literal["xy", "xz", "yz", "rz"] | None, typer.Option(help=PLANE)]
MAP = "Quantity to color, of the best posture in each cell; default: none."
Map = Annotated[Literal["sigma_min", "manipulability"] | None, typer.Option("--map", help=MAP)]
Cells = Annotated[int, typer.Option(help="Cells along the longer side.", min=10, max=2000)]
SAMPLES = "Number of random configurations of each slice, with and without limits."
Samples = Annotated[int, typer.Option(help=SAMPLES, min=1000)]
PICTURE = "Write the picture to this file instead: .png, .svg or .pdf."
Picture = Annotated[Path | None, typer.Option(metavar="FILE", help=PICTURE, callback=drawable)]


@pictured
def workspace(
    model: Model,
    site: Site = None,
    body: Body = None,
    package: Packages = None,
    plane: Plane = None,
    map_: Map = None,
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
    """Map the reach and the singularities of an arm; write NAME.workspace.png."""
    with notice(READING):
        from rmrc.analysis.workspace import workspace as mapping
        from rmrc.analysis.workspace.report import draw, report
        from rmrc.results.leaving import refuse_unwritable

        arm, start = configuration(read_arm(model, site, body, package), q, keyframe)
    file = picture or out / f"{arm.path.stem}.workspace.png"
    refuse_unwritable([file])
    with (
        interruption("interrupted; nothing was written"),
        progress(f"{arm.path.stem}: workspace", 2 * samples, quiet or as_json) as on_samples,
    ):
        space = mapping.workspace(
            arm, plane, start, axes=task_axes(axes), task_frame=task_frame, length=length, cells=cells,
            samples=samples, on_samples=on_samples,
        )  # fmt: skip
        draw(space, file, map_)
    show(report(space), as_json, quiet, [file])
