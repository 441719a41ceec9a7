"""The function behind `rmrc tune`, and the files that a search leaves."""

import os
from pathlib import Path
from typing import Any

from rmrc.results.leaving import refuse_unwritable
from rmrc.scenario import Source, block
from rmrc.study.dataset import Column, write_table
from rmrc.support.files import written_whole
from rmrc.tuning.answer import answer_of
from rmrc.tuning.robot import Given
from rmrc.tuning.space import NUMBERS, WORDS, Only
from rmrc.tuning.trials import OnRuns
from rmrc.tuning.tune import Tuned, Tuning
from rmrc.tuning.verdict import Trial
from rmrc.tuning.worlds import Spread

_RESULTS = {
    "role": ("text", "", "as written, recommended or second best; null for the others"),
    "scenarios": ("count", "1", "number of scenarios run: the scenario itself and perturbed ones"),
    "error": ("number", "m", "largest error of all its runs; angles times task.length"),
    "peak_rate": ("number", "rad/s", "largest joint rate of its runs; slides divided by task.length"),
    "time": ("number", "s", "longest duration of its runs"),
    "completed": ("number", "1", "smallest completed fraction of the path"),
    "excess": ("number", "1", "largest relative excess over a limit; <= 0: all limits are kept"),
    "missed": ("text", "", "the limit with the largest excess"),
    "feasible": ("switch", "", "whether it keeps all limits on all scenarios; null if not run on all"),
    "on_front": ("switch", "", "whether it is on the Pareto front: feasible, and not dominated"),
}
_COLUMNS = (
    Column("index", "count", "1", "number of the setting, in the order of trial"),
    *(Column(key, "text", "", "null if the setting has none") for key in WORDS),
    *(Column(key, "number", "as the key", "NaN if the setting does not use it") for key in NUMBERS),
    *(Column(name, *column) for name, column in _RESULTS.items()),
)


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
    runs: int = 560,
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
        runs: Largest number of runs, without the final checks.
        seed: Seed of the perturbed scenarios and of the search.
        out: Folder for NAME.tune.yaml, .png and .parquet; created if missing. None: writes nothing.
        threads: Number of threads, one world each; None: one per core.
        on_runs: Called with the number of finished runs.

    Returns:
        The result, with `tuned.block`, the control section to paste; Ctrl-C ends the search and keeps the
        results so far.

    Raises:
        ScenarioError: Lists all problems, before the first run.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C, before anything was found.
    """
    work = Tuning(
        scenario, only=only or (), perturbed=perturbed, seed=seed, spread=Spread(start, offset, payload),
        robot={"delay": delay, "lag": lag, "noise": noise, "calibration": calibration}, ideal=ideal,
        gain_margin=gain_margin, slower=slower, runs=runs, threads=threads,
    )  # fmt: skip
    if out is not None:
        refuse_unwritable(work.files(Path(out)))
    tuned = work.run(on_runs)
    if out is not None:
        write(work, tuned, Path(out))
    return tuned


def write(work: Tuning, tuned: Tuned, folder: Path, picture: Path | None = None) -> list[Path]:
    """Write NAME.tune.parquet with all settings, NAME.tune.yaml with the best one, and a picture.

    Args:
        work: The search.
        tuned: The result; the last two files need a feasible setting.
        folder: Created if missing.
        picture: Path of the picture; None: NAME.tune.png.

    Returns:
        The files.
    """
    from rmrc.show.figures import save
    from rmrc.tuning.figure import front_figure

    files, answer = work.files(folder, picture), answer_of(work, tuned)
    rows = [_row(index, trial, tuned) for index, trial in enumerate(tuned.tried)]
    write_table(files[2], _COLUMNS, rows, answer)
    best = tuned.verdict.recommended
    if best is None:
        return files[2:]
    data = work.written(best.setting)
    data.pop("sweep", None)
    # beside the scenario's own files; the model stays where it is
    data["name"] = f"{work.scenario.name[:94]}-tuned"
    model = (work.draft.folder / data["arm"]["model"]).resolve()
    data["arm"]["model"] = os.path.relpath(model, folder.resolve())
    name = Path(work.draft.source).name or work.scenario.name
    head = f"# {name} with the control section that `rmrc tune` recommends."
    with written_whole(files[0]) as temporary:
        temporary.write_text(f"{head}\n{block(data)}", "utf-8")
    save(front_figure(answer, rows), [files[1]])
    return files


def _row(index: int, trial: Trial, tuned: Tuned) -> dict[str, Any]:
    count = sum(world in trial.outcomes for world in range(len(tuned.scenarios)))
    is_whole = count == len(tuned.scenarios) or not trial.keeps_limits
    own = {"index": index, "role": tuned.role(trial) or None, "scenarios": count}
    feasible = {
        "feasible": trial.keeps_limits if is_whole else None,
        "on_front": trial in tuned.verdict.front,
    }
    return {**trial.setting.values, **trial.worst._asdict(), **own, **feasible}
