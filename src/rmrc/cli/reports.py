"""Print a verb's answer as JSON or tables, and set the exit code."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from rmrc.cli.console import EXIT_MISSED, complain, output, print_json, print_line

if TYPE_CHECKING:  # imports numpy, which a help text does not need
    from rmrc.show.report import Report


def show(
    report: "Report",
    as_json: bool,
    quiet: bool = False,
    files: Sequence[Path] = (),
    missed: int = EXIT_MISSED,
) -> None:
    """Print an answer, and report its problem on stderr.

    Args:
        report: The answer.
        as_json: Whether to print JSON instead of tables.
        quiet: Whether to print no tables.
        files: Written files to list; none: no list.
        missed: Exit code if the answer's condition is not met.

    Raises:
        typer.Exit: The condition is not met.
    """
    from rmrc.show.terminal import render

    if as_json:
        more = {"files": list(map(str, files))} if files else {}
        print_json(report.json | more if more else report.json, allow_nan=False)
    else:
        console = output(quiet)
        console.print(render(report.sheets))
        if report.block:
            console.print(report.block, highlight=False, soft_wrap=True)
        for path in files:
            print_line(console, f"wrote {path}")
    if report.problem:
        complain(report.problem)
    if not report.met:
        raise typer.Exit(missed)
