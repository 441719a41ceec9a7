"""The verb `workspace`: where an arm reaches, where it is singular there, and how well it moves."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rmrc.cli.console import (
    EXIT_INTERRUPTED,
    complain,
    notice,
    output,
    print_json,
    print_line,
    progress,
)
from rmrc.cli.questions import (
    AsJson,
    Keyframe,
    Length,
    Model,
    Positions,
    Site,
    TaskAxes,
    check_picture,
    configuration,
    numbers,
    task_axes,
)
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted

if TYPE_CHECKING:
    from rmrc.arm import Arm
    from rmrc.law.task import Array
    from rmrc.show.sheets import Sheet

MAPS = ("sigma_min", "manipulability", "condition", "postures")


def workspace(
    model: Model,
    site: Site = None,
    plane: Annotated[
        str | None,
        typer.Option(
            metavar="xy|xz|yz|rz",
            help="Slice; rz: distance from the first axis, height. Default: a planar arm's plane, rz or xz.",
        ),
    ] = None,
    through: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="A point of the plane [m]; default: the site.")
    ] = None,
    map_: Annotated[
        str | None,
        typer.Option(
            "--map", metavar="|".join(MAPS), help="What to color; default: nothing, with --over sigma_min."
        ),
    ] = None,
    worst: Annotated[
        bool,
        typer.Option(
            help="Of the postures that reach a cell keep the worst; default: the best.", show_default=False
        ),
    ] = False,
    over: Annotated[
        str | None,
        typer.Option(metavar="JOINT,JOINT", help="Map these two joints, the others at --q or --keyframe."),
    ] = None,
    q: Positions = None,
    keyframe: Keyframe = None,
    axes: TaskAxes = None,
    length: Length = 1.0,
    cells: Annotated[int, typer.Option(help="Cells along the longer side.", min=10, max=2000)] = 200,
    samples: Annotated[
        int, typer.Option(help="Random configurations, where more joints move than fix a point.", min=1000)
    ] = 1_000_000,
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path("recordings"),
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The picture instead: .png, .svg or .pdf.")
    ] = None,
    as_json: AsJson = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only what went wrong.")] = False,
) -> None:
    """Map where an arm reaches and where it is singular; leave NAME.workspace.png and .npz."""
    check_picture(picture)
    if map_ is not None and map_ not in MAPS:
        raise QuestionError(f"--map must be one of {', '.join(MAPS)}, got {quoted(map_)}")
    rows = task_axes(axes)
    with notice("reading the model ..."):
        from rmrc.analysis.workspace.workspace import compile_for
        from rmrc.arm import load
        from rmrc.results.leaving import refuse_unwritable
        from rmrc.show.sheets import render

        arm = load(model, site)
        compile_for(arm)
    name = f"{arm.path.stem}.{'workspace' if over is None else 'joints'}"
    files = [picture or out / f"{name}.png", out / f"{name}.npz"]
    at = configuration(arm, q, keyframe)
    refuse_unwritable(files)
    try:
        if over is None:
            point = None if through is None else numbers("--through", through, ("x", "y", "z"))
            asked = _Asked(arm, at, rows, length, cells, quiet or as_json)
            facts, sheet = _slice(asked, plane, point, map_, worst, samples, files)
        else:
            if plane is not None or through is not None or worst or map_ == "postures":
                raise QuestionError(
                    "--over has no slice: leave out --plane, --through, --worst and --map postures"
                )
            facts, sheet = _over(_Asked(arm, at, rows, length, cells, quiet or as_json), over, map_, files)
    except KeyboardInterrupt:
        complain("interrupted; nothing was written")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    if as_json:
        print_json(facts | {"files": list(map(str, files))}, allow_nan=False)
        return
    console = output(quiet)
    console.print(render([sheet]))
    for path in files:
        print_line(console, f"wrote {path}")


# Measured [B]: of each node of a sheet's grid, of each cell where it is sampled, and of a map over joints.
_NODE, _CELL, _MAPPED = 150, 500, 300


def _refuse_excess(cells: int, size: int) -> None:
    """Refuse a grid that does not fit into memory.

    Args:
        cells: That were asked for along the longer side.
        size: What is held [B].
    """
    from rmrc.simulation.footprint import LIBRARIES
    from rmrc.support.memory import excess

    too_much = excess(LIBRARIES + size)
    if too_much:
        raise QuestionError(f"--cells: {cells} need {too_much}; ask for fewer")


@dataclass(frozen=True)
class _Asked:
    """What both kinds of map need."""

    arm: "Arm"
    q: "Array"
    axes: tuple[str, ...] | None
    length: float
    cells: int
    quiet: bool


def _slice(
    asked: _Asked,
    plane: str | None,
    through: "Array | None",
    measure: str | None,
    worst: bool,
    samples: int,
    files: list[Path],
) -> tuple[dict[str, Any], "Sheet"]:
    from rmrc.analysis.workspace import figure as workspace_figure
    from rmrc.analysis.workspace import tables as workspace_table
    from rmrc.analysis.workspace.files import save, summary
    from rmrc.analysis.workspace.search import steps_of_grid
    from rmrc.analysis.workspace.slices import choose_slice
    from rmrc.analysis.workspace.workspace import expected, workspace

    part = choose_slice(asked.arm, plane, asked.q, through)
    if measure == "postures" and not part.is_surface:
        raise QuestionError(
            f"--map postures: {len(part.joints)} joints move the site in the slice {part.name}; "
            "postures are counted where two do"
        )
    nodes = steps_of_grid(asked.cells) ** 2
    _refuse_excess(asked.cells, _NODE * nodes if part.is_surface else _CELL * asked.cells**2)
    with progress(
        f"{asked.arm.path.stem}: workspace", expected(part, asked.cells, samples), asked.quiet
    ) as on_samples:
        found = workspace(
            asked.arm, plane, asked.q, through=through, axes=asked.axes, length=asked.length,
            cells=asked.cells, samples=samples, worst=worst, on_samples=on_samples,
        )  # fmt: skip
    workspace_figure.draw_workspace(found, files[0], measure)
    save(found, files[1])
    facts = summary(found)
    return facts, workspace_table.sheet(facts)


def _over(asked: _Asked, over: str, measure: str | None, files: list[Path]) -> tuple[dict[str, Any], "Sheet"]:
    from rmrc.analysis.workspace import figure as workspace_figure
    from rmrc.analysis.workspace import tables as workspace_table
    from rmrc.analysis.workspace.files import joint_summary, save_joint_map
    from rmrc.analysis.workspace.joint_map import joint_map

    _refuse_excess(asked.cells, _MAPPED * (asked.cells + 1) ** 2)
    with progress(f"{asked.arm.path.stem}: {over}", (asked.cells + 1) ** 2, asked.quiet) as on_samples:
        found = joint_map(
            asked.arm, over.split(","), asked.q, axes=asked.axes, length=asked.length, cells=asked.cells,
            on_samples=on_samples,
        )  # fmt: skip
    workspace_figure.draw_joint_map(found, files[0], measure or "sigma_min")
    save_joint_map(found, files[1])
    facts = joint_summary(found)
    return facts, workspace_table.joint_sheet(facts)
