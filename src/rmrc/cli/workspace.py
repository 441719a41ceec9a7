"""The verb `workspace`: map an arm's reach, its singularities and its dexterity."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
from rmrc.cli.texts import configuration, numbers, task_axes
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted
from rmrc.support.notices import READING

if TYPE_CHECKING:
    from rmrc.analysis.workspace.joint_map import JointMap
    from rmrc.analysis.workspace.reach import Workspace
    from rmrc.analysis.workspace.slices import Slice

MAPS = ("sigma_min", "manipulability", "condition", "postures")


def _known(measure: str | None) -> str | None:
    if measure is not None and measure not in MAPS:
        raise QuestionError(f"--map must be one of {', '.join(MAPS)}, got {quoted(measure)}")
    return measure


Plane = Annotated[
    str | None,
    typer.Option(
        metavar="xy|xz|yz|rz",
        help="Plane of the slice; rz: distance from the first axis and height. Default: a planar arm's "
        "plane, rz or xz.",
    ),
]
Through = Annotated[
    str | None, typer.Option(metavar="X,Y,Z", help="A point of the plane [m]; default: the site.")
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
        help="Number of random configurations, used if the arm is redundant for a point of the slice.",
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
    through: Through = None,
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
        from rmrc.analysis.workspace import joint_map, slices
        from rmrc.analysis.workspace import workspace as slicing
        from rmrc.analysis.workspace.files import save
        from rmrc.analysis.workspace.report import report
        from rmrc.results.leaving import refuse_unwritable

        arm = read_arm(model, site, body, package)
        slicing.compile_for(arm)
    name = f"{arm.path.stem}.{'workspace' if over is None else 'joints'}"
    files = [picture or out / f"{name}.png", out / f"{name}.npz"]
    arm, at = configuration(arm, q, keyframe)
    refuse_unwritable(files)
    ask: Callable[..., Workspace | JointMap]
    try:
        if over is None:
            point = None if through is None else numbers("--through", through, ("x", "y", "z"))
            part = slices.choose_slice(arm, plane, at, point)
            _refuse_to_count(part, map_)
            what, total = "workspace", slicing.expected(part, cells, samples)
            ask = partial(slicing.workspace, plane=plane, through=point, samples=samples, worst=worst)
        else:
            _refuse_slice(plane is not None or through is not None or worst or map_ == "postures")
            what, total = over, (cells + 1) ** 2
            ask = partial(joint_map.joint_map, over=over.split(","))
        with progress(f"{arm.path.stem}: {what}", total, quiet or as_json) as on_samples:
            found = ask(
                arm, q=at, axes=rows, task_frame=task_frame, length=length, cells=cells, on_samples=on_samples
            )
        answer = report(found, map_)
        if answer.draw is not None:
            answer.draw(files[0])
        save(found, files[1])
    except KeyboardInterrupt:
        complain("interrupted; nothing was written")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    show(answer, as_json, quiet, files)


def _refuse_slice(is_asked: bool) -> None:
    """Refuse options of a slice together with --over."""
    if is_asked:
        raise QuestionError("--over has no slice: leave out --plane, --through, --worst and --map postures")


def _refuse_to_count(part: "Slice", measure: str | None) -> None:
    """Refuse to count postures where they are infinitely many."""
    if measure == "postures" and not part.is_surface:
        raise QuestionError(
            f"--map postures: {len(part.joints)} joints move the site in the slice {part.name}; postures "
            "can be counted for two"
        )
