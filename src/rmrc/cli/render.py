"""The verb `render`: draw a picture or a film of one run, or of several side by side."""

import re
from pathlib import Path
from typing import Annotated

import typer

from rmrc import scenario as scenarios
from rmrc.cli.console import interruption, output, print_line, progress
from rmrc.cli.kinds import RUN, SCENARIO, Kind, expect
from rmrc.cli.options import Quiet, within
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted, visible

FILMED = Kind(
    "the output of a run, or a scenario", (*RUN.suffixes, *SCENARIO.suffixes), shipped=SCENARIO.shipped
)
SUFFIXES = (".gif", ".png", ".mp4")


Run = Annotated[
    Path,
    typer.Argument(
        help="Output of `run` or `compare`: NAME.npz, or its NAME.rrd or NAME.json; or a scenario, which "
        "is run first.",
        show_default=False,
        callback=lambda path: expect(path, FILMED),
    ),
]
OutFile = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="FILE", show_default="NAME.gif",
        help="File of the picture (.png) or film (.gif, or .mp4 with the extra `film`).",
    ),
]  # fmt: skip
Vary = Annotated[
    list[str] | None,
    typer.Option(
        "--vary",
        metavar="KEY=V1,V2,...",
        help="For a scenario: values of a key, drawn side by side; repeatable.",
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="For a scenario: override any key; repeatable."),
]
At = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", help="Time of a picture.", show_default="nearest to a singularity"),
]
Begin = Annotated[float, typer.Option("--from", metavar="SECONDS", help="Start time of a film.")]
End = Annotated[
    float | None,
    typer.Option(
        "--to", metavar="SECONDS", help="End time of a film.", show_default="end of the longest run"
    ),
]
Speed = Annotated[
    float, typer.Option(help="Simulated seconds per second of film.", callback=within("--speed", 1e-4, 1e4))
]
Fps = Annotated[float, typer.Option(help="Frames per second.", callback=within("--fps", 0.1, 120.0))]
Size = Annotated[
    str | None,
    typer.Option(
        metavar="WIDTHxHEIGHT", help="Size of the whole image [pixels].", show_default="480x480 for each run"
    ),
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
    """Draw a run, or variants side by side, as a picture or a film: the arm above its joint rates.

    MuJoCo renders off screen through EGL or OSMesa; without either the exit code is 2.
    """
    wanted = out or (run if run.suffix in RUN.suffixes else Path("recordings") / run.name).with_suffix(".gif")
    if wanted.suffix not in SUFFIXES:
        raise QuestionError(f"--out {visible(str(wanted))}: must end in .gif, .png or .mp4")
    if at is not None and wanted.suffix != ".png":
        raise QuestionError(
            "--at applies to a picture; for a film give --from and --to, or end --out in .png"
        )
    pixels = _pixels(size)
    with interruption("interrupted; nothing was written"):
        from rmrc.film import film
        from rmrc.results.leaving import refuse_unwritable
        from rmrc.study.pictures import worlds_of

        refuse_unwritable([wanted])
        worlds = worlds_of(run, scenarios.variants(vary) if vary else (), set_ or ())
        cut = film.Cut(at, begin, end, speed, fps)
        film.render(worlds, wanted, cut, pixels, lambda frames: progress("drawing", frames, quiet))
    print_line(output(quiet), f"wrote {wanted}")


def _pixels(text: str | None) -> tuple[int, int] | None:
    """Return the numbers of `--size`."""
    if text is None:
        return None
    found = re.fullmatch(r"\s*([0-9]{1,6})\s*[x×]\s*([0-9]{1,6})\s*", text)
    if not found:
        raise QuestionError(f"--size must be WIDTHxHEIGHT in pixels, such as 960x540, got {quoted(text)}")
    return int(found[1]), int(found[2])
