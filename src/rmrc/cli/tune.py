"""The verb `tune`: find an inverse and a damping for a scenario."""

from pathlib import Path
from typing import Annotated

from typer import Option

from rmrc.cli import options
from rmrc.cli.console import InterruptedVerb, progress, show
from rmrc.cli.options import Number, Text, Texts
from rmrc.support.errors import ScenarioError


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
    from rmrc.results.leaving import refuse_unwritable
    from rmrc.scenario import angle
    from rmrc.show.asked import sized
    from rmrc.show.report import Report, plain
    from rmrc.show.sheets import Sheet
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
