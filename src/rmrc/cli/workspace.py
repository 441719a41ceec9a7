"""The verb `workspace`: where an arm reaches, where it is singular there, and how well it moves."""

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
        help="Slice; rz: distance from the first axis, height. Default: a planar arm's plane, rz or xz.",
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
        help="What to color; default: nothing, with --over sigma_min.",
        callback=_known,
    ),
]
Worst = Annotated[
    bool,
    typer.Option(
        help="Of the postures that reach a cell keep the worst; default: the best.", show_default=False
    ),
]
Over = Annotated[
    str | None,
    typer.Option(metavar="JOINT,JOINT", help="Map these two joints, the others at --q or --keyframe."),
]
Cells = Annotated[int, typer.Option(help="Cells along the longer side.", min=10, max=2000)]
Samples = Annotated[
    int, typer.Option(help="Random configurations, where more joints move than fix a point.", min=1000)
]
Picture = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="The picture instead: .png, .svg or .pdf.", callback=drawable),
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
    length: Length = 1.0,
    cells: Cells = 200,
    samples: Samples = 1_000_000,
    out: Out = Path("recordings"),
    picture: Picture = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Map where an arm reaches and where it is singular; leave NAME.workspace.png and .npz."""
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
    """Refuse what asks for a slice beside two joints."""
    if is_asked:
        raise QuestionError("--over has no slice: leave out --plane, --through, --worst and --map postures")


def _refuse_to_count(part: "Slice", measure: str | None) -> None:
    """Refuse to count postures where there are infinitely many."""
    if measure == "postures" and not part.is_surface:
        raise QuestionError(
            f"--map postures: {len(part.joints)} joints move the site in the slice {part.name}; "
            "postures are counted where two do"
        )
