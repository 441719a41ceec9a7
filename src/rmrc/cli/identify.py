"""The verb `identify`: estimate an arm's delay, lag and noise from a log of commands and positions."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from rmrc.cli.console import interruption, notice
from rmrc.cli.kinds import LOG, expect
from rmrc.cli.options import AsJson, Out, Quiet, drawable
from rmrc.cli.reports import show
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted

LogFile = Annotated[
    Path,
    typer.Argument(
        help="The log: CSV, Parquet, or the .npz of a run, with the columns t, q and qdot_cmd of each joint.",
        show_default=False,
        callback=lambda path: expect(path, LOG),
    ),
]
Columns = Annotated[
    list[str] | None,
    typer.Option(
        "--columns",
        metavar="KIND=NAME",
        help="Column of t, or columns of q or qdot_cmd: A,B,C, or a pattern with * for the joint; a unit may "
        'follow: "t=stamp ms". Repeatable.',
    ),
]
Degrees = Annotated[
    bool, typer.Option("--degrees", help="Angles are in degrees; default: rad.", show_default=False)
]
Picture = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Write the picture to this file instead: .png, .svg or .pdf.",
        show_default=False,
        callback=drawable,
    ),
]


def identify(
    log: LogFile,
    columns: Columns = None,
    degrees: Degrees = False,
    out: Out = Path("recordings"),
    picture: Picture = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Estimate delay, lag and noise of each joint from a log of commands and positions.

    Prints a plant and arm.encoder block to paste into a scenario. Writes the block to NAME.identify.yaml and
    a plot of the fit and the data to .png. Exit code 1: the log identifies no joint's delay; a message says
    what to log instead.
    """
    given = dict(_mapped(text) for text in columns or ())
    with (
        interruption("interrupted; nothing was written"),
        nullcontext() if quiet else notice("identifying ..."),
    ):
        from rmrc.analysis.identify.identify import identify as ask
        from rmrc.analysis.identify.report import report
        from rmrc.results.leaving import refuse_unwritable
        from rmrc.support.files import written_whole

        wanted = picture or out / f"{log.stem}.identify.png", out / f"{log.stem}.identify.yaml"
        refuse_unwritable(wanted)
        found = ask(log, columns=given, degrees=degrees)
        answer = report(found)
        files = []
        if answer.draw is not None:
            answer.draw(wanted[0])
            files.append(wanted[0])
        if answer.block:
            with written_whole(wanted[1]) as temporary:
                temporary.write_text(answer.block, "utf-8")
            files.append(wanted[1])
    show(answer, as_json, quiet, files)


def _mapped(text: str) -> tuple[str, str]:
    kind, mark, name = text.partition("=")
    if not (mark and kind.strip() and name.strip()):
        raise QuestionError(f"--columns must be KIND=NAME, such as t=stamp, got {quoted(text)}")
    return kind.strip(), name.strip()
