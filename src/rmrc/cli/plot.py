"""The verb `plot`: the figure of a run or of a comparison, for a paper or a lecture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rmrc.cli.console import interruption, output, print_line
from rmrc.cli.kinds import RUN, expect
from rmrc.cli.options import PICTURES, Quiet, inches, within
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.invocation import command
from rmrc.support.legible import quoted, visible


def _columns_of(path: Path) -> Path:
    """Return the file with the columns of a run, which lies beside its recording and its scorecard.

    Raises:
        QuestionError: It is not there, or the file given is something else.
    """
    expect(path, RUN)
    columns = path.with_suffix(".npz")
    if path.suffix != ".npz" and path.exists() and not columns.exists():
        raise QuestionError(
            f"{visible(str(path))}: {visible(columns.name)}, which has the columns, is not beside it; "
            f"`{command('run', 'SCENARIO')}` leaves both"
        )
    return columns


def plot(
    run: Annotated[
        Path,
        typer.Argument(
            help="What `run` or `compare` left: NAME.npz, or NAME.rrd or NAME.json beside it.",
            show_default=False,
            callback=_columns_of,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE", help="The picture: .pdf, .svg or .png.", show_default="NAME.pdf"
        ),
    ] = None,
    panels: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,...",
            help="Of path, rates, sigma, error, torque, pace, status and g, in this order from the top; "
            "default: all that the run has something for.",
        ),
    ] = None,
    width: Annotated[
        str, typer.Option(help="Of the picture: in, cm, mm or pt; a journal's column is 3.5in.")
    ] = "7.16in",
    font: Annotated[
        float, typer.Option(help="Size of the letters [pt].", callback=within("--font", 4.0, 40.0))
    ] = 8.0,
    quiet: Quiet = False,
) -> None:
    """Draw a run, or variants side by side, for a paper: path, rates, singular values, errors, status."""
    wanted = out or run.with_suffix(".pdf")
    if wanted.suffix not in PICTURES:
        raise QuestionError(f"--out {visible(str(wanted))}: must end in .png, .svg or .pdf")
    size = inches(width)
    with interruption("interrupted; nothing was written"):
        from rmrc.results.leaving import refuse_unwritable
        from rmrc.results.run import read_runs
        from rmrc.show.panels import NAMES
        from rmrc.show.plot import plot as draw

        names = _chosen(panels, NAMES)
        refuse_unwritable([wanted])
        found = read_runs(run)
        for label, one in found.items():
            if not len(one):
                raise QuestionError(
                    f"{visible(str(run))}: {quoted(label)} has no tick, so there is nothing to draw"
                )
        draw(found, wanted, names, size, font)
    print_line(output(quiet), f"wrote {wanted}")


def _chosen(text: str | None, known: Sequence[str]) -> list[str]:
    """Return the names of `--panels`."""
    names = [] if text is None else [name.strip() for name in text.split(",")]
    for name in names:
        if name not in known:
            raise QuestionError(
                f"--panels: {quoted(name)} is none of {', '.join(known)}{did_you_mean(name, known)}"
            )
        if names.count(name) > 1:
            raise QuestionError(f"--panels: {quoted(name)} is given twice")
    return names
