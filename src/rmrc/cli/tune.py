"""The verb `tune`: find an inverse and a damping for a scenario."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rmrc.cli.console import (
    EXIT_INTERRUPTED,
    EXIT_MISSED,
    complain,
    interruption,
    output,
    print_line,
    progress,
)
from rmrc.cli.options import Out, Quiet, Threads, drawable, pictured
from rmrc.cli.scenarios import Overrides, ScenarioFile
from rmrc.support.errors import ScenarioError

if TYPE_CHECKING:
    from rmrc.tuning.tune import Tuned, Tuning

Only = Annotated[
    list[str] | None,
    typer.Option(metavar="KEY=V1,V2,...", help="Restrict a tunable key to these values; repeatable."),
]
Perturbed = Annotated[int, typer.Option(help="Number of perturbed scenarios; 0: none.")]
Start = Annotated[
    str,
    typer.Option(help="Largest start offset of a joint in a perturbed scenario; slides: times task.length."),
]
Offset = Annotated[
    float, typer.Option(help="Largest target offset in a perturbed scenario along each axis [m].")
]
Payload = Annotated[
    float | None,
    typer.Option(
        help="Largest additional payload of a perturbed scenario [kg]; 0: none.",
        show_default="5 % of the mass that the joints move",
    ),
]
Friction = Annotated[
    float | None,
    typer.Option(
        help="Largest additional dry friction of each joint in a perturbed scenario [N·m or N]; 0: none.",
        show_default="what accelerates the joint by 1 rad/s²",
    ),
]
Delay = Annotated[
    str | None,
    typer.Option(metavar="RANGE", help="Dead time of the robot [s], such as 8ms or 6ms..12ms."),
]
Lag = Annotated[
    str | None, typer.Option(metavar="RANGE", help="Time constant of its actuators [s], such as 0..10ms.")
]
Noise = Annotated[
    str | None,
    typer.Option(
        metavar="RANGE", help="Noise of its encoders [rad], such as 1e-5; slides: times task.length."
    ),
]
Calibration = Annotated[
    float | None, typer.Option(help="Calibration error of its link lengths [relative] and joint zeros [rad].")
]
Ideal = Annotated[bool, typer.Option("--ideal", help="Use the loop of the scenario, and assume no robot.")]
GainMargin = Annotated[
    float | None,
    typer.Option(
        metavar="FACTOR",
        help="Gain margin that a recommended loop must have on the slowest robot; 1: any.",
        show_default="2; with --ideal: 1",
    ),
]
Slower = Annotated[float, typer.Option(help="Largest allowed duration, relative to the scenario as written.")]
Runs = Annotated[int, typer.Option(help="Largest number of runs, without the final checks.")]
Seed = Annotated[int, typer.Option(help="Seed of the perturbed scenarios and of the search.")]
Picture = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="File of the picture: .png, .svg or .pdf.",
        show_default="NAME.tune.png in --out",
    ),
]


@pictured
def tune(
    scenario: ScenarioFile,
    only: Only = None,
    perturbed: Perturbed = 4,
    start: Start = "1 deg",
    offset: Offset = 0.002,
    payload: Payload = None,
    friction: Friction = None,
    delay: Delay = None,
    lag: Lag = None,
    noise: Noise = None,
    calibration: Calibration = None,
    ideal: Ideal = False,
    gain_margin: GainMargin = None,
    slower: Slower = 1.1,
    runs: Runs = 340,
    seed: Seed = 0,
    set_: Overrides = None,
    out: Out = Path("recordings"),
    picture: Picture = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Search inverse, damping, feedback and at_singularity for the least tracking error within the limits.

    Rates each setting by its worst result on the scenario and its perturbed scenarios, over all robots that
    --delay, --lag, --noise and --calibration or the scenario describe; without them, on an assumed modest
    robot. Prints the Pareto front of peak rate and error, the recommendation, and a control section to
    paste. Writes NAME.tune.yaml, .png and .parquet. Exit code 1: no setting keeps the limits.
    """
    from rmrc.results.leaving import refuse_unwritable
    from rmrc.scenario import angle
    from rmrc.tuning.tune import Tuning
    from rmrc.tuning.verb import files

    drawable(picture)
    try:
        off = angle(start)
    except ValueError as error:
        raise ScenarioError.about("--start", str(error)) from None
    with interruption("interrupted before the first result"):
        work = Tuning(
            scenario, set_ or (), only=only or (), perturbed=perturbed, start=off, offset=offset,
            payload=payload, friction=friction, delay=delay, lag=lag, noise=noise, calibration=calibration,
            ideal=ideal, gain_margin=gain_margin, slower=slower, runs=runs, seed=seed, threads=threads,
        )  # fmt: skip
        work.compile()
        refuse_unwritable(files(work, out, picture))
        with progress(f"{work.scenario.name}: {runs} runs", runs, quiet, unit="runs") as on_runs:
            tuned = work.run(on_runs)
    if tuned.interrupted:  # printed first: the picture takes longer than a user waits after Ctrl-C
        complain(f"interrupted after {tuned.runs} of {runs} runs")
    _show(work, tuned, (out, picture), quiet)
    if tuned.interrupted:
        raise typer.Exit(EXIT_INTERRUPTED)
    raise typer.Exit(0 if tuned.feasible else EXIT_MISSED)


def _show(work: "Tuning", tuned: "Tuned", places: tuple[Path, Path | None], quiet: bool) -> None:
    from rmrc.show.terminal import render
    from rmrc.tuning.answer import about, rows_of, sheets
    from rmrc.tuning.verb import write

    console, facts = output(quiet), about(work, tuned)
    first = int(tuned.is_worse)  # a bad recommendation says so before anything else
    for line in facts["lines"][:first]:
        console.print(line, highlight=False)
    console.print(render(sheets(facts, rows_of(tuned))))
    if tuned.feasible:
        for line in facts["lines"][first:]:
            console.print(line, highlight=False)
        console.print(f"\n{facts['block']}", highlight=False, soft_wrap=True)
    for path in write(work, tuned, *places):
        print_line(console, f"wrote {path}")
    if not tuned.feasible:
        complain(facts["lines"][0])
