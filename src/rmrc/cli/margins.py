"""The verb `margins`: find how much more delay, lag and gain a loop tolerates."""

from pathlib import Path
from typing import Annotated

import typer

from rmrc import scenario as scenarios
from rmrc.cli.console import EXIT_INTERRUPTED, complain, interruption, progress
from rmrc.cli.options import AsJson, Junit, Quiet, Summary, Threads, drawable
from rmrc.cli.reports import show
from rmrc.cli.scenarios import Overrides, ScenarioFile

# Usual number of runs of a search, for the progress bar.
_RUNS = 40


def margins(
    scenario: ScenarioFile,
    accuracy: Annotated[
        float, typer.Option(help="Relative precision of the stability limits, 0.005 to 0.5.")
    ] = 0.02,
    set_: Overrides = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Plot all tried settings to this file: .png, .svg or .pdf."),
    ] = None,
    as_json: AsJson = False,
    threads: Threads = None,
    junit: Junit = None,
    summary: Summary = None,
    quiet: Quiet = False,
) -> None:
    """Find by simulation how much more gain, dead time and lag the loop tolerates before it becomes unstable.

    Runs each setting twice; the second run briefly displaces the reference. The loop is unstable if the
    response keeps ringing. For comparison, prints the rule K <= 1/(delay + T/2 + lag) and the exact limit of
    the ideal plant. Exit code 1: the loop is unstable as written.
    """
    from rmrc.results.leaving import refuse_unwritable
    from rmrc.study import ci
    from rmrc.study.margins.margins import margins as search
    from rmrc.study.margins.report import report

    files = [path for path in (drawable(picture),) if path is not None]
    with ci.Files(scenario.stem, junit, summary) as kept:
        refuse_unwritable(files)
        loaded = scenarios.load(scenario, set_ or ())
        with (
            interruption("interrupted before the first run"),
            progress(f"{loaded.name}: margins", _RUNS, quiet or as_json, unit="runs") as on_runs,
        ):
            result = search(loaded, accuracy=accuracy, threads=threads, on_runs=on_runs)
        answer = report(result)
        cut = f"interrupted after {result.runs} runs" if result.interrupted else ""
        kept.write_answer(loaded.name, answer, cut)
    if cut:
        complain(cut)
    for path in files:
        if answer.draw is not None:
            answer.draw(path)
    show(answer, as_json, quiet, [*files, *kept.paths])
    if cut:
        raise typer.Exit(EXIT_INTERRUPTED)
