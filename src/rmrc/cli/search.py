"""The verbs of many runs: `sweep`, `tune` and `margins`."""

from pathlib import Path
from typing import Annotated

from typer import Option

from rmrc import scenario as scenarios
from rmrc.cli import options
from rmrc.cli.console import InterruptedVerb, progress, show
from rmrc.cli.options import Count, Number, Text, Texts
from rmrc.support.errors import ClusterError, ScenarioError
from rmrc.support.text import command, shortened

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
    from rmrc.show.sheets import Report, plain
    from rmrc.study.sweep import Sweep, Swept

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


def tune(
    scenario: options.Scenario,
    only: Annotated[Texts, Option(metavar="KEY=V1,V2,...", help="Restrict a key; repeatable.")] = None,
    perturbed: Annotated[int, Option(help="Number of perturbed scenarios; 0: none.")] = 4,
    start: Annotated[
        str, Option(help="Largest offset of joints in them; slides: times task.length.")
    ] = "1 deg",
    offset: Annotated[
        float, Option(help="Largest offset of the target in them along each axis [m].")
    ] = 0.002,
    payload: Annotated[Number, Option(help="Largest payload in them [kg]; default: 5 % of the arm.")] = None,
    friction: Annotated[
        Number, Option(help="Largest dry friction in them [N·m or N]; default: for 1 rad/s² of the joint.")
    ] = None,
    delay: Annotated[Text, Option(metavar="RANGE", help="Delay of the robot: 8ms or 6ms..12ms.")] = None,
    lag: Annotated[Text, Option(metavar="RANGE", help="Lag of its actuators: 0..10ms.")] = None,
    noise: Annotated[Text, Option(metavar="RANGE", help="Noise of its encoders [rad]: 1e-5.")] = None,
    calibration: Annotated[Number, Option(help="Errors of its link lengths and joint zeros [rad].")] = None,
    ideal: Annotated[bool, Option("--ideal", help="Assume no robot: use the scenario's loop.")] = False,
    gain_margin: Annotated[Number, Option(help="Required gain margin; default: 2, or 1 if ideal.")] = None,
    slower: Annotated[float, Option(help="Largest duration, relative to the scenario's own.")] = 1.1,
    runs: Annotated[int, Option(help="Largest number of runs, without the final checks.")] = 340,
    seed: Annotated[int, Option(help="Seed of the perturbed scenarios and of the search.")] = 0,
    set_: options.Overrides = None,
    out: options.Out = Path("recordings"),
    output: options.Picture = None,
    width: options.Width = None,
    font: options.Font = None,
    threads: options.Threads = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Search the inverse and damping of least error within limits.

    Rates each setting by its worst result on the scenario and its perturbed scenarios, over all robots that
    --delay, --lag, --noise and --calibration or the scenario describe; without them, on an assumed modest
    robot. Prints the Pareto front of peak rate and error, the recommendation, and a control section to
    paste. Writes NAME.tune.yaml, .png and .parquet. Exit code 1: no setting keeps the limits.
    """
    from rmrc.scenario import angle
    from rmrc.show.palette import sized
    from rmrc.show.sheets import Report, Sheet, plain
    from rmrc.support.files import refuse_unwritable
    from rmrc.tuning.answer import about, rows_of, sheets
    from rmrc.tuning.tune import Tuning
    from rmrc.tuning.verb import files, write

    try:
        off = angle(start)
    except ValueError as error:
        raise ScenarioError.about("--start", str(error)) from None
    work = Tuning(
        scenario, set_ or (), only=only or (), perturbed=perturbed, start=off, offset=offset,
        payload=payload, friction=friction, delay=delay, lag=lag, noise=noise, calibration=calibration,
        ideal=ideal, gain_margin=gain_margin, slower=slower, runs=runs, seed=seed, threads=threads,
    )  # fmt: skip
    work.compile()
    refuse_unwritable(files(work, out, output))
    with progress(f"{work.scenario.name}: {runs} runs", runs, quiet or as_json) as on_runs:
        tuned = work.run(on_runs)
    with sized(width, font):
        left = write(work, tuned, out, output)
    facts, rows = about(work, tuned), rows_of(tuned)
    lines = facts["lines"] if tuned.feasible else []
    answer = Report(
        [*sheets(facts, rows), Sheet("", notes=tuple(lines))],
        plain({**facts, "rows": rows}),
        met=bool(tuned.feasible) or tuned.interrupted,
        problem="" if tuned.feasible else facts["lines"][0],
        block=facts["block"] if tuned.feasible else "",
    )
    show(answer, as_json, quiet, left)
    if tuned.interrupted:
        raise InterruptedVerb(f"interrupted after {tuned.runs} of {runs} runs")


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
    from rmrc.results import expectations
    from rmrc.show.sheets import as_markdown
    from rmrc.study.margins import margins as search
    from rmrc.study.margins_report import report

    with expectations.files(scenario.stem, junit, summary) as results:
        loaded = scenarios.load(scenario, set_ or ())
        with progress(f"{loaded.name}: margins", _RUNS, quiet or as_json) as on_runs:
            result = search(loaded, accuracy=accuracy, threads=threads, on_runs=on_runs)
        answer = report(result)
        cut = f"interrupted after {result.runs} runs" if result.interrupted else ""
        results.name = loaded.name
        results.suites = [expectations.Suite(loaded.name, answer.cases, cut, answer.problem)]
        results.figures = "\n\n".join(map(as_markdown, answer.sheets))
    show(answer, as_json, quiet, [junit, summary])
    if cut:
        raise InterruptedVerb(cut)
