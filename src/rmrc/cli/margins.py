"""The verb `margins`: find how much more delay, lag and gain a loop tolerates."""

from typing import Annotated

from typer import Option

from rmrc import scenario as scenarios
from rmrc.cli import options
from rmrc.cli.console import InterruptedVerb, progress, show

# Usual number of runs of a search, for the progress bar.
_RUNS = 40


def margins(
    scenario: options.Scenario,
    accuracy: Annotated[float, Option(help="Relative precision of the limits, 0.005 to 0.5.")] = 0.02,
    set_: options.Overrides = None,
    threads: options.Threads = None,
    junit: options.Junit = None,
    summary: options.Summary = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Find by simulation how much more gain, dead time and lag the loop tolerates before it becomes unstable.

    Runs each setting twice; the second run briefly displaces the reference. The loop is unstable if the
    response keeps ringing. For comparison, prints the rule K <= 1/(delay + T/2 + lag) and the exact limit of
    the ideal plant. Exit code 1: the loop is unstable as written.
    """
    from rmrc.results import ci
    from rmrc.show.sheets import as_markdown
    from rmrc.study.margins.margins import margins as search
    from rmrc.study.margins.report import report

    with ci.files(scenario.stem, junit, summary) as results:
        loaded = scenarios.load(scenario, set_ or ())
        with progress(f"{loaded.name}: margins", _RUNS, quiet or as_json) as on_runs:
            result = search(loaded, accuracy=accuracy, threads=threads, on_runs=on_runs)
        answer = report(result)
        cut = f"interrupted after {result.runs} runs" if result.interrupted else ""
        results.name = loaded.name
        results.suites = [ci.Suite(loaded.name, answer.cases, cut, answer.problem)]
        results.figures = "\n\n".join(map(as_markdown, answer.sheets))
    show(answer, as_json, quiet, options.written(junit, summary))
    if cut:
        raise InterruptedVerb(cut)
