"""The verb `sweep`: run thousands of variants of a scenario."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from rmrc import scenario as scenarios
from rmrc.cli.console import (
    EXIT_INPUT,
    EXIT_INTERRUPTED,
    complain,
    interruption,
    output,
    print_line,
    progress,
)
from rmrc.cli.kinds import SCENARIO, expect
from rmrc.cli.options import Out, Quiet, Threads
from rmrc.cli.scenarios import Overrides
from rmrc.support.errors import ClusterError, ScenarioError
from rmrc.support.legible import shortened
from rmrc.support.problems import Origin, Problem

if TYPE_CHECKING:
    from rmrc.scenario import Draft
    from rmrc.study.dataset import Contents
    from rmrc.study.picks import Choice
    from rmrc.study.sweep import Sweep

Drawn = Annotated[
    list[str] | None,
    typer.Option(metavar="KEY=LOW..HIGH", help="Draw a key at random between two bounds; repeatable."),
]
Swept = Annotated[
    Path,
    typer.Argument(
        help="The scenario, with or without a sweep section: a YAML file, or the name of a shipped one.",
        callback=lambda path: expect(path, SCENARIO),
    ),
]


def sweep(
    scenario: Swept,
    vary: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=V1,V2,...", help="Values of a key; repeat the option for a grid."),
    ] = None,
    random: Drawn = None,
    sobol: Drawn = None,
    samples: Annotated[int | None, typer.Option(help="Samples drawn per grid point.")] = None,
    repeat: Annotated[
        int | None, typer.Option(help="Runs per sample, each with different encoder offsets and noise.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the samples and of the noise.")] = None,
    set_: Overrides = None,
    out: Out = Path("recordings"),
    threads: Threads = None,
    cluster: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Run on Dask: local:N worker processes, or the tcp://HOST:PORT of a scheduler.",
        ),
    ] = None,
    record: Annotated[
        str | None,
        typer.Option(metavar="worst:N[:METRIC]", help="Record the N worst (or best) runs in full."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Run thousands of variants of a scenario; write NAME.sweep.parquet with one row per run.

    Rerunning the command resumes an interrupted sweep. A run that diverges gets a row like any other.
    """
    from rmrc.show.terminal import render
    from rmrc.study.picks import Choice
    from rmrc.study.sweep import Sweep
    from rmrc.study.sweep_table import sheets

    options = _options(vary or (), random or (), sobol or (), (samples, repeat, seed))
    choice = Choice.read(record) if record else None
    if cluster is not None and threads:
        raise ClusterError(
            "--threads: must not be given with --cluster, whose workers have their own threads"
        )
    base = _given(scenarios.draft_of(scenario, set_ or ()), options)
    with Sweep(base, (), out, threads, cluster) as work:
        contents = _check(work, quiet)
        choice = choice and choice.settled(work.scenario, contents.columns)
        name, before = work.scenario.name, work.done
        with progress(f"{name}: {len(work)} runs", len(work), quiet, before, "runs") as on_runs:
            try:
                interrupted = work.run(on_runs).interrupted
            except KeyboardInterrupt:
                interrupted = True
    if interrupted:
        complain(f"interrupted after {work.done} of {len(work)} runs; rerun the command to resume")
        raise typer.Exit(EXIT_INTERRUPTED)
    console = output(quiet)
    console.print(render(sheets(name, work.summary(), work.plan.label)))
    print_line(console, f"wrote {work.dataset.file}")
    if choice:
        _record(console, work, choice, quiet)


def _check(work: "Sweep", quiet: bool) -> "Contents":
    with (
        interruption("interrupted before the first run"),
        progress("checking", len(work), quiet, unit="runs") as on_runs,
    ):
        work.compile()
        return work.check(on_runs)


def _given(base: "Draft", options: Mapping[str, tuple[str, str]]) -> "Draft":
    """Return a draft with the options applied."""
    for option, (key, value) in options.items():
        base = base.given(key, value, option)
    return base


def _options(
    vary: Sequence[str], random: Sequence[str], sobol: Sequence[str], numbers: Sequence[int | None]
) -> dict[str, tuple[str, str]]:
    """Return the keys and values that the options set in the section `sweep`, by the option's name."""
    problems = list[Problem]()

    def refuse(option: str, text: str) -> None:
        problems.append(Problem((), text, Origin(option)))

    if random and sobol:
        refuse("--sobol", "must not be combined with --random: one method draws all keys")
    options: dict[str, tuple[str, str]] = {}
    for text in vary:
        key, values = (part.strip() for part in text.split("=", 1)) if "=" in text else ("", "")
        if not key:
            refuse(f"--vary {shortened(text)}", "must be KEY=V1,V2,..., for example control.feedback=5,10,20")
        options[f"--vary {key}"] = f"sweep.vary.{key}", f"[{values}]"
    for option, text in (*(("--random", text) for text in random), *(("--sobol", text) for text in sobol)):
        match = re.fullmatch(r"\s*([^=\s]+)\s*=(.+?)\.\.(.+)", text)
        if match is None:
            refuse(f"{option} {shortened(text)}", "must be KEY=LOW..HIGH, for example control.feedback=5..20")
            continue
        key, low, high = match.groups()
        options[f"{option} {key}"] = f"sweep.draw.{key}", f"[{low}, {high}]"
        options[option] = "sweep.sampler", option.removeprefix("--")
    for name, number in zip(("samples", "repeat", "seed"), numbers, strict=True):
        options |= {} if number is None else {f"--{name}": (f"sweep.{name}", str(number))}
    if problems:
        raise ScenarioError(problems)
    return options


def _record(console: Console, work: "Sweep", choice: "Choice", quiet: bool) -> None:
    for index in work.chosen(choice):
        job = work.job(index)
        with progress(job.name, job.worlds[0].reference.ticks, quiet) as on_ticks:
            job.run(on_ticks)
        if job.interrupted:
            complain(f"interrupted while {job.name} was recorded; all rows are written")
            raise typer.Exit(EXIT_INTERRUPTED)
        for failure in job.failures:
            complain(f"error: {failure}")
        if job.failures:
            raise typer.Exit(EXIT_INPUT)
        print_line(console, f"wrote {job.files[0]}")
