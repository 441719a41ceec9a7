"""The function behind `rmrc tune`."""

import os
from pathlib import Path

from rmrc.results.leaving import refuse_unwritable
from rmrc.scenario import Source
from rmrc.study.study import OnRuns
from rmrc.tuning.only import Only
from rmrc.tuning.perturbed import Spread
from rmrc.tuning.report import told
from rmrc.tuning.robot import Given
from rmrc.tuning.tune import Tuned, Tuning


def tune(
    scenario: Source,
    only: Only | None = None,
    *,
    perturbed: int = 4,
    start: float = Spread.start,
    offset: float = Spread.offset,
    payload: float = Spread.payload,
    delay: Given = None,
    lag: Given = None,
    noise: Given = None,
    calibration: Given = None,
    ideal: bool = False,
    gain_margin: float | None = None,
    slower: float = 1.1,
    runs: int = 2000,
    seed: int = 0,
    out: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    on_runs: OnRuns | None = None,
) -> Tuned:
    """Search for the inverse, damping and feedback with the smallest tracking error within the limits.

    The function behind `rmrc tune`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        only: Values to which keys are restricted, such as `{"control.inverse.method": ["damped",
            "filtered"]}`.
        perturbed: Number of perturbed scenarios; the worst of all counts.
        start: Perturbation of the joints' start, to either side [rad]; slides: times `task.length` [m].
        offset: Offset of the target along each axis, to either side [m].
        payload: Largest additional payload of a perturbed scenario [kg].
        delay: Dead time of the robot's commands [s]: a number, the smallest and the largest, or a text such
            as `6ms..12ms`. If neither this nor `lag` or `noise` is given, nor in the scenario, a modest robot
            is assumed.
        lag: Time constant with which its actuators follow [s].
        noise: Standard deviation of its encoders' noise [rad]; of slides, times `task.length` [m].
        calibration: Errors of its link lengths and joint zeros, to either side [1, rad].
        ideal: Whether to keep the loop of the scenario, and assume nothing.
        gain_margin: Factor on its feedback that a recommendation tolerates on the slowest of the robots; 1:
            no margin is required; None: 2, or 1 with `ideal`.
        slower: Factor on the duration with the scenario's own setting that another may take.
        runs: Largest number of runs, without the final checks; runs on the model count by their ticks.
        seed: Seed of the perturbed scenarios and of the search.
        out: Folder for NAME.tune.yaml, .png and .parquet; created if missing. None: writes nothing.
        threads: Number of threads, one batch each; None: one per core.
        on_runs: Called with the number of finished runs of each batch.

    Returns:
        The result, with `tuned.block`, the control section to paste; Ctrl-C ends the search and keeps the
        results so far.

    Raises:
        ScenarioError: Lists all problems, before the first run.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C, before anything was found.
    """
    spread = Spread(start, offset, payload)
    work = Tuning(
        scenario, only=only or (), perturbed=perturbed, seed=seed, spread=spread,
        robot={"delay": delay, "lag": lag, "noise": noise, "calibration": calibration}, ideal=ideal,
        gain_margin=gain_margin, slower=slower, runs=runs, threads=threads,
    )  # fmt: skip
    if out is not None:
        refuse_unwritable(work.files(Path(out)))
    found = work.run(on_runs)
    if out is not None:
        work.write(found, Path(out), told=told(work, found))
    return found
