"""The function behind `rmrc tune`."""

import os
from pathlib import Path

from rmrc.results.leaving import refuse_unwritable
from rmrc.scenario import Source
from rmrc.study.study import OnRuns
from rmrc.tuning.copies import Spread
from rmrc.tuning.only import Only
from rmrc.tuning.report import told
from rmrc.tuning.robot import Given
from rmrc.tuning.tune import Tuned, Tuning


def tune(
    scenario: Source,
    only: Only | None = None,
    *,
    copies: int = 4,
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
        only: What keys are restricted to, such as `{"control.inverse.method": ["damped", "filtered"]}`.
        copies: How many perturbed scenarios there are; the worst of all counts.
        start: How far the joints of a copy start off, to either side [rad]; slides: times `task.length` [m].
        offset: How far the target of a copy is off along each axis, to either side [m].
        payload: Most that a copy carries beside [kg].
        delay: Dead time of the robot's commands [s]: a number, the least and the largest, or a text such as
            `6ms..12ms`. Where neither this nor `lag` or `noise` is given, nor the scenario tells any of it, a
            modest robot is assumed.
        lag: Time constant with which its actuators follow [s].
        noise: Standard deviation of its encoders' noise [rad]; of slides, times `task.length` [m].
        calibration: How far lengths of its links and zeros of its joints are off, to either side [1, rad].
        ideal: Whether the loop is as the scenario has it, and nothing is assumed.
        gain_margin: Times its feedback that what is recommended bears on the slowest of the robots; 1: no
            margin is asked for; None: 2, or 1 with `ideal`.
        slower: Times the duration with the scenario's own setting that another may take.
        runs: How many runs are made at most, last looks beside; first looks count by their ticks.
        seed: Seed of the copies and of the search.
        out: Folder for NAME.tune.yaml, .png and .parquet; created if missing. None: writes nothing.
        threads: Number of threads, one batch each; None: one per core.
        on_runs: Called with the number of runs of each batch that was done.

    Returns:
        What was found, with `tuned.block`, the control section to paste; Ctrl-C ends the search and keeps the
        results so far.

    Raises:
        ScenarioError: Lists all problems, before the first run.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C, before anything was found.
    """
    spread = Spread(start, offset, payload)
    work = Tuning(
        scenario, only=only or (), copies=copies, seed=seed, spread=spread,
        robot={"delay": delay, "lag": lag, "noise": noise, "calibration": calibration}, ideal=ideal,
        gain_margin=gain_margin, slower=slower, runs=runs, threads=threads,
    )  # fmt: skip
    if out is not None:
        refuse_unwritable(work.files(Path(out)))
    found = work.run(on_runs)
    if out is not None:
        work.write(found, Path(out), told=told(work, found))
    return found
