"""The verb `render`: a picture or a film of a run, or of several side by side."""

import re
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rmrc import scenario as scenarios
from rmrc.cli.console import interruption, output, print_line, progress
from rmrc.cli.kinds import RUN, SCENARIO, Kind, expect
from rmrc.cli.options import Quiet, within
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted, visible

if TYPE_CHECKING:
    from collections.abc import Callable

FILMED = Kind(
    "what a run leaves, or a scenario", (*RUN.suffixes, *SCENARIO.suffixes), shipped=SCENARIO.shipped
)
SUFFIXES = (".gif", ".png", ".mp4")


Run = Annotated[
    Path,
    typer.Argument(
        help="What `run` or `compare` left: NAME.npz, or NAME.rrd or NAME.json beside it; or a scenario, "
        "which is run first.",
        show_default=False,
        callback=lambda path: expect(path, FILMED),
    ),
]
OutFile = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="FILE", show_default="NAME.gif",
        help="The picture .png, or the film .gif or .mp4, which needs the extra `film`.",
    ),
]  # fmt: skip
Vary = Annotated[
    list[str] | None,
    typer.Option(
        "--vary", metavar="KEY=V1,V2,...", help="Of a scenario: variants, side by side; repeatable."
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Of a scenario: override any key; repeatable."),
]
At = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", help="Time of a picture.", show_default="nearest to a singularity"),
]
Begin = Annotated[float, typer.Option("--from", metavar="SECONDS", help="Where a film begins.")]
End = Annotated[
    float | None,
    typer.Option("--to", metavar="SECONDS", help="Where a film ends.", show_default="with the longest run"),
]
Speed = Annotated[
    float, typer.Option(help="Simulated seconds in one of the film.", callback=within("--speed", 1e-4, 1e4))
]
Fps = Annotated[float, typer.Option(help="Frames a second.", callback=within("--fps", 0.1, 120.0))]
Size = Annotated[
    str | None,
    typer.Option(metavar="WIDTHxHEIGHT", help="Of the whole [pixels].", show_default="480x480 for each run"),
]


def render(
    run: Run,
    out: OutFile = None,
    vary: Vary = None,
    set_: Overrides = None,
    at: At = None,
    begin: Begin = 0.0,
    end: End = None,
    speed: Speed = 1.0,
    fps: Fps = 20.0,
    size: Size = None,
    quiet: Quiet = False,
) -> None:
    """Draw a run as a picture or a film, or variants side by side: the arm, and its rates below it.

    MuJoCo's renderer draws off screen, by EGL or OSMesa; without either the exit code is 2.
    """
    is_left = run.suffix in RUN.suffixes
    wanted = out or (run if is_left else Path("recordings") / run.name).with_suffix(".gif")
    if wanted.suffix not in SUFFIXES:
        raise QuestionError(f"--out {visible(str(wanted))}: must end in .gif, .png or .mp4")
    if at is not None and wanted.suffix != ".png":
        raise QuestionError("--at is of a picture; of a film give --from and --to, or end --out in .png")
    if is_left and (vary or set_):
        raise QuestionError(
            f"{visible(str(run))}: has been run, so that nothing can be changed; give the scenario"
        )
    pixels = _pixels(size)
    with interruption("interrupted; nothing was written"):
        from rmrc.film.opengl import refuse_missing

        refuse_missing()  # before MuJoCo is imported
        from rmrc.film.film import Cut
        from rmrc.results.leaving import refuse_unwritable
        from rmrc.study import filming

        refuse_unwritable([wanted])
        worlds = (
            filming.left(run)
            if is_left
            else filming.ran(run, scenarios.variants(vary) if vary else (), set_ or ())
        )

        def watch(frames: int) -> "AbstractContextManager[Callable[[int], None]]":
            return progress("drawing", frames, quiet)

        filming.draw(worlds, wanted, Cut(at, begin, end, speed, fps), pixels, watch)
    print_line(output(quiet), f"wrote {wanted}")


def _pixels(text: str | None) -> tuple[int, int] | None:
    """Return the numbers of `--size`."""
    if text is None:
        return None
    found = re.fullmatch(r"\s*([0-9]{1,6})\s*[x×]\s*([0-9]{1,6})\s*", text)
    if not found:
        raise QuestionError(f"--size must be WIDTHxHEIGHT in pixels, such as 960x540, got {quoted(text)}")
    return int(found[1]), int(found[2])
