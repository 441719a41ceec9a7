"""Verbs about scenarios: run, compare, replay, schema."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.text import Text

from rmrc import scenario as scenarios
from rmrc.cli.console import (
    EXIT_DIVERGED,
    EXIT_INPUT,
    EXIT_INTERRUPTED,
    EXIT_MISSED,
    complain,
    interruption,
    output,
    print_json,
    print_line,
    progress,
)
from rmrc.cli.kinds import RECORDING, SCENARIO, expect
from rmrc.cli.options import Junit, Out, Quiet, Summary, within
from rmrc.support.invocation import command

if TYPE_CHECKING:
    from rmrc.study.run import Job

ScenarioFile = Annotated[
    Path,
    typer.Argument(
        help="The scenario: a YAML file, or the name of a shipped one.",
        callback=lambda path: expect(path, SCENARIO),
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override any key of the scenario; repeatable."),
]
Record = Annotated[bool, typer.Option(help="Write the .rrd recording.")]


def run(
    scenario: ScenarioFile,
    set_: Overrides = None,
    out: Out = Path("recordings"),
    record: Record = True,
    junit: Junit = None,
    summary: Summary = None,
    quiet: Quiet = False,
) -> None:
    """Run a scenario; write NAME.rrd, NAME.npz (all columns) and NAME.json (scorecard)."""
    from rmrc.results import ci
    from rmrc.results.verdict import warnings
    from rmrc.show import tables
    from rmrc.study.run import Job  # imports numba and mujoco, which `schema` and `replay` do not need

    console = output(quiet, pipe=80)
    with ci.files(scenario.stem, junit, summary) as results:
        job = Job(scenario, out, record, overrides=set_ or ())
        _run(job, job.name, quiet)
        one = job.results[0]
        beside = one.run.baseline.scorecard if one.run.baseline else None
        results.name = job.name
        results.figures = tables.markdown(one.scorecard, (), beside).partition("\n\n")[2]  # below its heading
        results.suites = [ci.suite(job.name, one.run, one.outcomes, job.interrupted, job.failures)]
    console.print(tables.render(one.scorecard, one.outcomes, beside))
    for assumed in one.prepared.assumed:
        if assumed.is_otherwise:
            print_line(console, f"assumed: {assumed.text}")
    for pair in one.run.resting:
        print_line(console, f"touching from the start, not counted as CONTACT: {' – '.join(pair)}")
    _list(console, job, [*filter(None, (junit, summary))])
    console.print(Text(one.run.verdict), soft_wrap=False)
    for line in warnings(one.scorecard, one.prepared.scenario.expect):
        complain(line)
    raise typer.Exit(_exit_code(job))


def _exit_code(job: "Job") -> int:
    """Report problems of a scenario on stderr, and return the exit code of the worst."""
    one = job.results[0]
    missed, run = [outcome for outcome in one.outcomes if not outcome.ok], one.run
    for outcome in missed:
        complain(f"missed: {outcome}")
    code = _cut_short(job, f"interrupted at tick {len(run)} of {run.planned}")
    if job.interrupted:
        return code
    if run.divergence:
        complain(f"error: {run.name} {run.divergence}")
        return code or EXIT_DIVERGED
    if not (code or run.is_complete):
        complain(
            f"{run.name} completed {run.completed:.0%} of its path in {len(run)} ticks; "
            "control.slow.longest ended it"
        )
    return code or (EXIT_MISSED if missed else 0)


def compare(
    scenario: ScenarioFile,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=V1,V2,...",
            help="Values of a key to compare; repeat the option for a grid.",
        ),
    ] = None,
    set_: Overrides = None,
    out: Out = Path("recordings"),
    record: Record = True,
    junit: Junit = None,
    summary: Summary = None,
    quiet: Quiet = False,
) -> None:
    """Run variants of a scenario side by side; write NAME.compare.rrd, .npz and .json.

    Expectations do not change the exit code; the table lists those that were missed.
    """
    from rmrc.results import ci
    from rmrc.results.verdict import warnings
    from rmrc.show.sheets import as_markdown
    from rmrc.show.terminal import render
    from rmrc.study.run import Job

    console = output(quiet)
    with ci.files(scenario.stem, junit, summary) as results:
        job = Job(scenario, out, record, scenarios.variants(vary or ()), set_ or ())
        _run(job, f"{job.name}: {len(job.variants)} variants", quiet)
        table = job.table()
        results.name, results.figures = job.name, as_markdown(replace(table, title=""))
        results.suites = [
            ci.suite(f"{job.name} {label}", one.run, one.outcomes, job.interrupted, job.failures)
            for label, one in zip(job.labels, job.results, strict=True)
        ]
    console.print(render([table]))
    _list(console, job, [*filter(None, (junit, summary))])
    for label, one in zip(job.labels, job.results, strict=True):
        for line in warnings(one.scorecard, one.prepared.scenario.expect):
            complain(f'variant "{label}": {line}')
        if one.run.divergence:
            complain(f'error: variant "{label}" {one.run.divergence}')
    runs = job.runs.values()
    ticks, planned = sum(map(len, runs)), sum(run.planned for run in runs)
    code = _cut_short(job, f"interrupted at tick {ticks} of {planned}, counting all variants")
    raise typer.Exit(code or (EXIT_DIVERGED if any(run.divergence for run in runs) else 0))


def replay(
    recording: Annotated[
        Path,
        typer.Argument(
            help="A recording of `run`, its NAME.npz, or a folder: then its newest recording.",
            callback=lambda path: path if _stands_for_one(path) else expect(path, RECORDING),
        ),
    ],
    web: Annotated[bool, typer.Option("--web", help="Serve the viewer to a web browser instead.")] = False,
    at: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Time at which to pause the cursor; default: play from the start.",
            show_default=False,
            callback=lambda one: None if one is None else within("--at", 0.0, 1e9)(one),
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=1, max=65535, help="Port of 127.0.0.1 to listen on; default: a free one.", show_default=False
        ),
    ] = None,
) -> None:
    """Open a recording in the rerun viewer, on this machine only and without telemetry."""
    from rmrc.recording import viewer

    viewer.replay(recording, web, at, port)


def _stands_for_one(path: Path) -> bool:
    """Return whether a path is a folder or columns, for which a recording is found."""
    return path.is_dir() or path.suffix == ".npz"


def schema(
    as_json: Annotated[bool, typer.Option("--json", help="JSON Schema, for editors.")] = False,
) -> None:
    """Print the keys of a scenario with type, unit, default and meaning."""
    from rmrc.show import tables

    if as_json:
        print_json(scenarios.json_schema())
    elif sys.stdout.isatty():
        output().print(tables.schema(scenarios.schema_rows()))
    else:
        print(tables.schema_text(scenarios.schema_rows()))


def _run(job: "Job", what: str, quiet: bool) -> None:
    """Compile and run."""
    with interruption("interrupted before the first tick"):
        job.compile()
    with progress(what, sum(one.reference.ticks for one in job.worlds), quiet) as on_ticks:
        job.run(on_ticks)


def _cut_short(job: "Job", where: str) -> int:
    """Report files not written and the tick of an interruption; return an exit code, or 0."""
    for failure in job.failures:
        complain(f"error: {failure}")
    if job.interrupted:
        complain(where)
    return EXIT_INPUT if job.failures else EXIT_INTERRUPTED if job.interrupted else 0


def _list(console: Console, job: "Job", more: Sequence[Path]) -> None:
    for path in (*job.files, *more):
        print_line(console, f"wrote {path}")
    if job.files and job.files[0].suffix == ".rrd":
        print_line(console, f"look at it: {command('replay', job.files[0])}")
