"""The verb `identify`: estimate an arm's delay, lag and noise from a log of commands and positions."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from rmrc.cli import options
from rmrc.cli.console import show, working
from rmrc.cli.options import Texts
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted


def identify(
    log: Annotated[
        Path,
        Argument(help="The log: CSV, Parquet or a run's .npz, with t, and q and qdot_cmd of each joint."),
    ],
    columns: Annotated[
        Texts, Option(metavar="KIND=NAME", help="Column of t, q or qdot_cmd; repeatable.")
    ] = None,
    degrees: Annotated[bool, Option("--degrees", help="Angles are in degrees; default: rad.")] = False,
    longest: Annotated[
        float, Option(callback=options.within(1e-3, 10.0), help="Largest delay and lag [s].")
    ] = 0.5,
    out: options.Out = Path("recordings"),
    output: options.Picture = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Estimate delay, lag and noise of each joint from a log of commands and positions.

    Prints a plant and arm.encoder block to paste into a scenario. Writes the block to NAME.identify.yaml, and
    a plot of the fit and the data to .png. `--columns` names the column of t, or those of q or qdot_cmd:
    A,B,C, or a pattern with * for the joint; a unit may follow, as in "t=stamp ms". Exit code 1: the log
    identifies no joint's delay; a message says what to log instead.
    """
    pairs = dict[str, str]()
    for text in columns or ():
        kind, mark, name = (part.strip() for part in text.partition("="))
        if not (mark and kind and name):
            raise QuestionError(f"--columns must be KIND=NAME, such as t=stamp, got {quoted(text)}")
        pairs[kind] = name
    with working("identifying"):
        from rmrc.analysis.identify.identify import identify as ask
        from rmrc.analysis.identify.report import report
        from rmrc.results.leaving import refuse_unwritable
        from rmrc.support.files import write_text

        picture, block = output or out / f"{log.stem}.identify.png", out / f"{log.stem}.identify.yaml"
        refuse_unwritable([picture, block])
        answer = report(ask(log, columns=pairs, degrees=degrees, longest=longest))
        files = options.draw(answer, picture)
        if answer.block:
            write_text(block, answer.block)
            files.append(block)
    show(answer, as_json, quiet, files)
