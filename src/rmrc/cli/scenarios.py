"""Verbs about scenarios: run, compare, replay, schema."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from rmrc import scenario as scenarios
from rmrc.cli.console import (
    EXIT_DIVERGED,
    EXIT_INPUT,
    EXIT_INTERRUPTED,
    EXIT_MISSED,
    complain,
    output,
    print_json,
    print_line,
    progress,
)
from rmrc.cli.kinds import RECORDING, SCENARIO, expect
from rmrc.cli.options import Out, Quiet
from rmrc.support.invocation import command

if TYPE_CHECKING:
    from rmrc.study.compare import Comparison, Results
    from rmrc.study.run import Ended, Job

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
    quiet: Quiet = False,
) -> None:
    """Run a scenario; leave NAME.rrd, NAME.npz (all columns) and NAME.json (scorecard)."""
    from rmrc.results import stuck
    from rmrc.show import tables
    from rmrc.study.run import Job  # with numba and mujoco, which `schema` and `replay` do without

    console = output(quiet, pipe=80)
    job = Job(scenarios.load(scenario, set_ or ()), out, record)
    _compile(job)
    with progress(job.scenario.name, job.ticks, quiet) as on_ticks:
        ended = job.run(on_ticks)
    console.print(tables.render(ended.scorecard, ended.outcomes))
    _list(console, ended.files, record)
    still = stuck.told(ended.run, job.prepared.arm)
    if still:
        complain(still)
    raise typer.Exit(_exit_code(ended))


def _exit_code(ended: "Ended") -> int:
    """Say on stderr what did not go well, and return the worst of it."""
    missed = [outcome for outcome in ended.outcomes if not outcome.ok]
    for outcome in missed:
        complain(f"missed: {outcome}")
    for failure in ended.failures:
        complain(f"error: {failure}")
    if ended.interrupted:
        complain(f"interrupted at tick {len(ended.run)} of {ended.run.planned}")
        return EXIT_INPUT if ended.failures else EXIT_INTERRUPTED
    if ended.run.divergence:
        complain(f"error: {ended.run.name} {ended.run.divergence}")
        return EXIT_INPUT if ended.failures else EXIT_DIVERGED
    if ended.failures:
        return EXIT_INPUT
    if not ended.run.is_complete:
        complain(
            f"{ended.run.name} came {ended.run.completed:.0%} of its path in {len(ended.run)} ticks, "
            "where control.slow.longest ends it"
        )
    return EXIT_MISSED if missed else 0


def compare(
    scenario: ScenarioFile,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary", metavar="KEY=V1,V2,...", help="Values of a key to compare; repeatable: a grid."
        ),
    ] = None,
    set_: Overrides = None,
    out: Out = Path("recordings"),
    record: Record = True,
    quiet: Quiet = False,
) -> None:
    """Run variants of a scenario side by side; leave NAME.compare.rrd, .json, .png and .svg.

    The exit code is that of the runs, whatever the scenario expects: what was missed is in the table.
    """
    from rmrc.show.terminal import render
    from rmrc.study.compare import Comparison
    from rmrc.study.compare_table import sheets

    console = output(quiet)
    comparison = Comparison(scenario, scenarios.variants(vary or ()), set_ or (), out, record)
    _compile(comparison)
    with progress(
        f"{comparison.name}: {len(comparison.variants)} variants", comparison.ticks, quiet
    ) as on_ticks:
        results = comparison.run(on_ticks)
    console.print(render(sheets(results.name, [one.row for one in results.variants])))
    _list(console, results.files, record)
    raise typer.Exit(_exit_code_of_all(results))


def _exit_code_of_all(results: "Results") -> int:
    """Say on stderr which variants did not reach their end, and return the worst of it."""
    diverged = [one for one in results.variants if one.run.divergence]
    for one in diverged:
        complain(f'error: variant "{one.variant.label}" {one.run.divergence}')
    for failure in results.failures:
        complain(f"error: {failure}")
    if results.interrupted:
        ticks, planned = (
            sum(of(one.run) for one in results.variants) for of in (len, lambda run: run.planned)
        )
        complain(f"interrupted at tick {ticks} of {planned}, of all variants together")
        return EXIT_INPUT if results.failures else EXIT_INTERRUPTED
    if results.failures:
        return EXIT_INPUT
    return EXIT_DIVERGED if diverged else 0


def replay(
    recording: Annotated[
        Path,
        typer.Argument(help="A recording that `run` left.", callback=lambda path: expect(path, RECORDING)),
    ],
    web: Annotated[bool, typer.Option("--web", help="Serve it to a browser instead.")] = False,
) -> None:
    """Open a recording in the rerun viewer, on this machine only and without telemetry."""
    from rmrc.recording import viewer

    raise typer.Exit(viewer.replay(recording, web))


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


def _compile(work: "Job | Comparison") -> None:
    try:
        work.compile()
    except KeyboardInterrupt:
        complain("interrupted before the first tick")
        raise typer.Exit(EXIT_INTERRUPTED) from None


def _list(console: Console, files: Sequence[Path], record: bool) -> None:
    for path in files:
        print_line(console, f"wrote {path}")
    if record and files and files[0].suffix == ".rrd":
        print_line(console, f"look at it: {command('replay', files[0])}")
