"""The verb `sweep`: run thousands of variants of a scenario."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rmrc import scenario as scenarios
from rmrc.cli.console import (
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
from rmrc.support.invocation import command
from rmrc.support.legible import shortened
from rmrc.support.problems import Origin, Problem

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
    quiet: Quiet = False,
) -> None:
    """Run thousands of variants of a scenario; write NAME.sweep.parquet with one row per run.

    Rerunning the command resumes an interrupted sweep. A run that diverges gets a row like any other.
    """
    from rmrc.show.terminal import render
    from rmrc.study.sweep import Sweep
    from rmrc.study.swept import Swept

    options = _options(vary or (), random or (), sobol or (), (samples, repeat, seed))
    if cluster is not None and threads:
        raise ClusterError(
            "--threads: must not be given with --cluster, whose workers have their own threads"
        )
    base = scenarios.draft_of(scenario, set_ or ())
    for option, (key, value) in options.items():
        base = base.given(key, value, option)
    with interruption("interrupted before the first run"):
        work = Sweep(base, (), out, threads, cluster)
        with progress("checking", len(work), quiet, unit="runs") as on_runs:
            work.check(on_runs)
    name = work.scenario.name
    with progress(f"{name}: {len(work)} runs", len(work), quiet, len(work.dataset.done), "runs") as on_runs:
        try:
            work.run(on_runs)
        except KeyboardInterrupt:
            done = f"{len(work.dataset.done)} of {len(work)} runs"
            complain(f"interrupted after {done}; rerun the command to resume")
            raise typer.Exit(EXIT_INTERRUPTED) from None
    console, swept = output(quiet), Swept.of(work.dataset.file)
    console.print(render(swept.sheets()))
    for index in sorted({i for ends in swept.extremes().values() for i in ends}):
        words = [f"--set={text}" for text in (*(set_ or ()), *map(str, work.plan.changes(index)))]
        print_line(console, f"run {index}: {command('run', scenario, *words)}")
    print_line(console, f"wrote {work.dataset.file}")


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
