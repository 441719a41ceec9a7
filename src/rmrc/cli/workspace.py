"""The verb `workspace`: map an arm's reach, its singularities and its dexterity."""

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from typer import Option

from rmrc.cli import options
from rmrc.cli.console import progress, show, working
from rmrc.cli.options import Text
from rmrc.support.errors import QuestionError

Quantity: TypeAlias = Literal["sigma_min", "manipulability", "condition"]


def workspace(
    model: options.Model,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    plane: Annotated[Text, Option(metavar="xy|xz|yz|rz", help="Slice; default: it fits the arm.")] = None,
    map_: Annotated[Quantity | None, Option("--map", help="Quantity to color.")] = None,
    worst: Annotated[bool, Option(help="Keep the worst of the postures that reach a cell.")] = False,
    over: Annotated[Text, Option(metavar="JOINT,JOINT", help="Map over these two joints instead.")] = None,
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
    """Map the reach and the singularities of an arm; write NAME.workspace.png and .npz.

    The plane rz has the distance from the first axis and the height; the others are seen along their third
    axis. Its default is a planar arm's plane, rz or xz. With --over, the other joints are at --q or
    --keyframe, and the default of --map is sigma_min. Of the postures that reach a cell, the best is kept,
    unless --worst is given. Samples are taken with and without limits.
    """
    with working("reading the model"):
        from rmrc.analysis.workspace import workspace as mapping
        from rmrc.analysis.workspace.report import report, save
        from rmrc.results.leaving import refuse_unwritable

        arm = options.read_arm(model, site, body, package)
    name = f"{arm.path.stem}.{'joints' if over else 'workspace'}"
    picture, arrays = output or out / f"{name}.png", out / f"{name}.npz"
    refuse_unwritable([picture, arrays])
    if over and (plane or worst):
        raise QuestionError("--over has no slice: leave out --plane and --worst")
    total = cells**2 if over else 2 * samples
    with progress(f"{arm.path.stem}: {over or 'workspace'}", total, quiet or as_json) as on_samples:
        space = mapping.workspace(
            arm, plane, options.values("--q", q), keyframe=keyframe, over=over.split(",") if over else None,
            axes=options.rows(axes), task_frame=task_frame, length=length, cells=cells, samples=samples,
            worst=worst, on_samples=on_samples,
        )  # fmt: skip
    answer = report(space, map_)
    files = options.draw(answer, picture, width, font)
    save(space, arrays)
    show(answer, as_json, quiet, [*files, arrays])
