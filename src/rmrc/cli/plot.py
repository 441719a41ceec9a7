"""The verb `plot`: draw a run, a comparison or a sweep for a paper or a lecture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rmrc.cli.console import interruption, output, print_line
from rmrc.cli.kinds import REPORTED, expect
from rmrc.cli.options import PICTURES, Quiet, inches, within
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.invocation import command
from rmrc.support.legible import quoted, visible


def _columns_of(path: Path) -> Path:
    """Return the rows of a sweep, or the columns of a run, beside its recording and its scorecard.

    Raises:
        QuestionError: It is not there, or the file given is something else.
    """
    expect(path, REPORTED)
    if path.suffix == ".parquet":
        return path
    columns = path.with_suffix(".npz")
    if path.suffix != ".npz" and path.exists() and not columns.exists():
        raise QuestionError(
            f"{visible(str(path))}: {visible(columns.name)}, which has the columns, is missing next to it; "
            f"`{command('run', 'SCENARIO')}` writes both"
        )
    return columns


def plot(
    run: Annotated[
        Path,
        typer.Argument(
            help="Output of `run` or `compare`: NAME.npz, or its NAME.rrd or NAME.json; or "
            "NAME.sweep.parquet.",
            show_default=False,
            callback=_columns_of,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="File of the picture: .pdf, .svg or .png.",
            show_default="NAME.pdf",
        ),
    ] = None,
    panels: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,...",
            help="Any of arm, path, rates, sigma, error, turn_error, torque, pace, belief, joints, status "
            "and g, in this order from the top; for a sweep: distributions, keys; default: all that have "
            "data, but arm and joints.",
        ),
    ] = None,
    width: Annotated[
        str, typer.Option(help="Width of the picture in in, cm, mm or pt; a journal column is 3.5in wide.")
    ] = "7.16in",
    font: Annotated[float, typer.Option(help="Font size [pt].", callback=within("--font", 4.0, 40.0))] = 8.0,
    quiet: Quiet = False,
) -> None:
    """Plot a run, or variants side by side, for a paper: path, rates, singular values, errors, status.

    For a sweep, plots the distributions of its metrics, and the first one over each varied key.
    """
    wanted = out or run.with_suffix(".pdf")
    if wanted.suffix not in PICTURES:
        raise QuestionError(f"--out {visible(str(wanted))}: must end in .png, .svg or .pdf")
    size = inches(width)
    with interruption("interrupted; nothing was written"):
        from rmrc.results.leaving import refuse_unwritable
        from rmrc.show.figure import NAMES
        from rmrc.study import pictures

        names = _chosen(panels, pictures.PANELS if run.suffix == ".parquet" else NAMES)
        refuse_unwritable([wanted])
        pictures.plot(run, wanted, names, size, font)
    print_line(output(quiet), f"wrote {wanted}")


def _chosen(text: str | None, known: Sequence[str]) -> list[str]:
    """Return the names of `--panels`."""
    names = [] if text is None else [name.strip() for name in text.split(",")]
    for name in names:
        if name not in known:
            raise QuestionError(
                f"--panels: {quoted(name)} is not a panel; choose from "
                f"{', '.join(known)}{did_you_mean(name, known)}"
            )
        if names.count(name) > 1:
            raise QuestionError(f"--panels: {quoted(name)} is given twice")
    return names
