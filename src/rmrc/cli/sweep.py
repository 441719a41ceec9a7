"""The verb `sweep`: run thousands of variants of a scenario."""

from pathlib import Path
from typing import Annotated

from typer import Option

from rmrc import scenario as scenarios
from rmrc.cli import options
from rmrc.cli.console import InterruptedVerb, progress, show
from rmrc.cli.options import Count, Text, Texts
from rmrc.support.errors import ClusterError, ScenarioError
from rmrc.support.invocation import command
from rmrc.support.legible import shortened

Drawn = Annotated[Texts, Option(metavar="KEY=LOW..HIGH", help="Draw a key between bounds; repeatable.")]


def sweep(
    scenario: options.Scenario,
    vary: options.Vary = None,
    random: Drawn = None,
    sobol: Drawn = None,
    samples: Annotated[Count, Option(help="Samples drawn per grid point.")] = None,
    repeat: Annotated[Count, Option(help="Runs per sample, each with other encoder errors.")] = None,
    seed: Annotated[Count, Option(help="Seed of the samples and of the noise.")] = None,
    set_: options.Overrides = None,
    out: options.Out = Path("recordings"),
    threads: options.Threads = None,
    cluster: Annotated[
        Text,
        Option(metavar="ADDRESS", help="Run on Dask: local:N processes, or a scheduler at tcp://HOST:PORT."),
    ] = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Run thousands of variants of a scenario; write NAME.sweep.parquet with one row per run.

    Rerunning the command resumes an interrupted sweep. A run that diverges gets a row like any other.
    """
    from rmrc.show.report import Report, plain
    from rmrc.study.sweep import Sweep
    from rmrc.study.swept import Swept

    if cluster is not None and threads:
        raise ClusterError(
            "--threads: must not be given with --cluster, whose workers have their own threads"
        )
    base = scenarios.draft_of(scenario, set_ or ())
    if random and sobol:
        raise ScenarioError.about("--sobol", "must not be combined with --random: one method draws all keys")
    for option, texts in (("--vary", vary), ("--random", random), ("--sobol", sobol)):
        for text in texts or ():
            key, _, value = (part.strip() for part in text.partition("="))
            low, dots, high = value.partition("..")
            is_grid = option == "--vary"
            if not (key and (value if is_grid else dots)):
                form = "KEY=V1,V2,..., such as" if is_grid else "KEY=LOW..HIGH, such as"
                example = f"control.feedback={'5,10,20' if is_grid else '5..20'}"
                raise ScenarioError.about(f"{option} {shortened(text)}", f"must be {form} {example}")
            setting = f"vary.{key}", f"[{value}]"
            if not is_grid:
                base = base.given("sweep.sampler", option.removeprefix("--"), option)
                setting = f"draw.{key}", f"[{low}, {high}]"
            base = base.given(f"sweep.{setting[0]}", setting[1], f"{option} {key}")
    for name, number in (("samples", samples), ("repeat", repeat), ("seed", seed)):
        base = base if number is None else base.given(f"sweep.{name}", str(number), f"--{name}")
    work = Sweep(base, (), out, threads, cluster)
    with progress("checking", len(work), quiet or as_json) as on_runs:
        work.check(on_runs)
    what, done = f"{work.scenario.name}: {len(work)} runs", len(work.dataset.done)
    with progress(what, len(work), quiet or as_json, done) as on_runs:
        try:
            work.run(on_runs)
        except KeyboardInterrupt:
            done = len(work.dataset.done)
            where = f"interrupted after {done} of {len(work)} runs; rerun the command to resume"
            raise InterruptedVerb(where) from None
    swept, commands = Swept.of(work.dataset.file), []
    for index in sorted({i for ends in swept.extremes().values() for i in ends}):
        words = [f"--set={text}" for text in (*(set_ or ()), *map(str, work.plan.changes(index)))]
        commands.append(f"run {index}: {command('run', scenario, *words)}")
    rows = [dict(zip(swept.rows, row, strict=True)) for row in zip(*swept.rows.values(), strict=True)]
    facts = plain({"name": swept.name, "rows": rows})
    answer = Report(swept.sheets(), facts, block="\n".join(commands))
    show(answer, as_json, quiet, [work.dataset.file])
