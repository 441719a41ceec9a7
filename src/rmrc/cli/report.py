"""The verb `report`: write a run, a comparison, a sweep or a search as one HTML page."""

from pathlib import Path
from typing import Annotated

import typer

from rmrc.cli.console import interruption, output, print_line
from rmrc.cli.kinds import REPORTED, expect
from rmrc.cli.options import Quiet
from rmrc.support.errors import QuestionError
from rmrc.support.invocation import command
from rmrc.support.legible import visible

# A page opens under these names.
PAGES = (".html", ".htm")


def _left(path: Path) -> Path:
    """Return the file with the columns or rows of a result.

    Raises:
        QuestionError: It is not there, or the file given is something else.
    """
    expect(path, REPORTED)
    if path.suffix not in REPORTED.suffixes:
        raise QuestionError(f"{visible(str(path))}: must be {REPORTED.name}: {' '.join(REPORTED.suffixes)}")
    beside = path if path.suffix == ".parquet" else path.with_suffix(".npz")
    if path.exists() and not beside.exists():
        raise QuestionError(
            f"{visible(str(path))}: {visible(beside.name)}, which has its columns, is missing next to it; "
            f"`{command('run', 'SCENARIO')}` writes both"
        )
    return beside


def report(
    result: Annotated[
        Path,
        typer.Argument(
            help="Output of a verb: NAME.npz, .rrd or .json of `run` or `compare`, NAME.sweep.parquet, "
            "NAME.tune.parquet.",
            show_default=False,
            callback=_left,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE", help="File of the page: .html.", show_default="NAME.html"
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Write one HTML page to share: verdict, metrics, plots with readout, and blocks to copy.

    The page is self-contained and loads nothing over the network.
    """
    wanted = out or result.with_suffix(".html")
    if wanted.suffix not in PAGES:
        raise QuestionError(f"--out {visible(str(wanted))}: must end in .html")
    with interruption("interrupted; nothing was written"):
        from rmrc.results.leaving import refuse_unwritable
        from rmrc.tuning.page import page

        refuse_unwritable([wanted])
        page(result).write(wanted)
    print_line(output(quiet), f"wrote {wanted}")
