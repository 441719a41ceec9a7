"""The verbs `run` and `compare`: run a scenario, or variants of it side by side, and record them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from rmrc import scenario as scenarios
from rmrc.cli import options
from rmrc.cli.console import EXIT_DIVERGED, EXIT_INPUT, EXIT_MISSED, InterruptedVerb, complain, progress, show
from rmrc.support.text import command

if TYPE_CHECKING:
    from rmrc.study.run import Job

Record = Annotated[bool, Option(help="Write the .rrd recording.")]


def run(
    scenario: options.Scenario,
    set_: options.Overrides = None,
    out: options.Out = Path("recordings"),
    record: Record = True,
    every: Annotated[bool, Option("--all", help="Print all metrics.")] = False,
    junit: options.Junit = None,
    summary: options.Summary = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Run a scenario beside its baseline; print how it went.

    Writes NAME.rrd (recording), NAME.npz (all columns) and NAME.json (scorecard). Exit code 1: an expectation
    was missed; 3: it diverged.
    """
    from rmrc.results import expectations
    from rmrc.results.scorecard import warnings
    from rmrc.show import tables
    from rmrc.show.sheets import Report, Sheet
    from rmrc.study.run import Job  # imports numba and mujoco, which other verbs do not need

    with expectations.files(scenario.stem, junit, summary) as results:
        job = Job(scenario, out, record, overrides=set_ or ())
        _run(job, job.name, quiet or as_json)
        first = job.results[0]
        ran, beside = first.run, first.run.baseline.scorecard if first.run.baseline else None
        results.name = job.name
        results.figures = tables.markdown(first.scorecard, (), beside).partition("\n\n")[2]  # below its title
        results.suites = [expectations.suite(job.name, ran, first.outcomes, job.interrupted, job.failures)]
    notes = [ran.verdict]
    notes += [f"assumed: {assumed.text}" for assumed in first.prepared.assumed if assumed.is_otherwise]
    notes += [f"touching from the start, not counted as CONTACT: {' – '.join(pair)}" for pair in ran.resting]
    sheets = [Sheet("", notes=tuple(notes))]
    if every:
        sheets += tables.sheets(first.scorecard, first.outcomes, beside)
    else:
        sheets.append(tables.few(first.scorecard, first.outcomes, beside))
    show(
        Report(sheets, job.facts()),
        as_json,
        quiet,
        [*job.files, junit, summary],
        _hint(job),
    )
    for line in warnings(first.scorecard, first.prepared.scenario.expect):
        complain(line)
    missed = [outcome for outcome in first.outcomes if not outcome.ok]
    for outcome in missed:
        complain(f"missed: {outcome}")
    _raise_if_cut_short(job, f"interrupted at tick {len(ran)} of {ran.planned}")
    if ran.divergence:
        complain(f"error: {ran.name} {ran.divergence}")
        raise typer.Exit(EXIT_DIVERGED)
    if not ran.is_complete:
        share = f"completed {ran.completed:.0%} of its path in {len(ran)} ticks"
        complain(f"{ran.name} {share}; control.slow.longest ended it")
    raise typer.Exit(EXIT_MISSED if missed else 0)


def compare(
    scenario: options.Scenario,
    vary: options.Vary = None,
    set_: options.Overrides = None,
    out: options.Out = Path("recordings"),
    record: Record = True,
    junit: options.Junit = None,
    summary: options.Summary = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Run variants of a scenario side by side.

    Writes NAME.compare.rrd, .npz and .json. Expectations do not change the exit code; the table counts those
    that were missed. Exit code 3: a variant diverged.
    """
    from rmrc.results import expectations
    from rmrc.results.scorecard import warnings
    from rmrc.show.sheets import Report, as_markdown
    from rmrc.study.run import Job

    with expectations.files(scenario.stem, junit, summary) as results:
        job = Job(scenario, out, record, scenarios.variants(vary or ()), set_ or ())
        _run(job, f"{job.name}: {len(job.variants)} variants", quiet or as_json)
        results.name, results.figures = job.name, "\n\n".join(map(as_markdown, job.tables()))
        results.suites = [
            expectations.suite(f"{job.name} {label}", each.run, each.outcomes, job.interrupted, job.failures)
            for label, each in zip(job.labels, job.results, strict=True)
        ]
    files = [*job.files, junit, summary]
    show(Report(job.tables(), job.facts()), as_json, quiet, files, _hint(job))
    for label, each in zip(job.labels, job.results, strict=True):
        for line in warnings(each.scorecard, each.prepared.scenario.expect):
            complain(f'variant "{label}": {line}')
        if each.run.divergence:
            complain(f'error: variant "{label}" {each.run.divergence}')
    runs = job.runs.values()
    ticks, planned = sum(map(len, runs)), sum(run.planned for run in runs)
    _raise_if_cut_short(job, f"interrupted at tick {ticks} of {planned}, counting all variants")
    raise typer.Exit(EXIT_DIVERGED if any(run.divergence for run in runs) else 0)


def _run(job: "Job", what: str, quiet: bool) -> None:
    """Compile and run."""
    job.compile()
    with progress(what, sum(world.reference.ticks for world in job.worlds), quiet) as on_ticks:
        job.run(on_ticks)


def _hint(job: "Job") -> str:
    """Return the command that opens the recording."""
    recordings = [file for file in job.files if file.suffix == ".rrd"]
    return f"look at it: {command('replay', recordings[0])}" if recordings else ""


def _raise_if_cut_short(job: "Job", where: str) -> None:
    """Report files that were not written and the tick of an interruption."""
    for failure in job.failures:
        complain(f"error: {failure}")
    if job.failures:
        raise typer.Exit(EXIT_INPUT)
    if job.interrupted:
        raise InterruptedVerb(where)
