"""The function behind `rmrc tune`, and the files that a search leaves."""

import os
from functools import partial
from pathlib import Path
from typing import Any

from rmrc.scenario import Source, block
from rmrc.scenario.changes import hinted
from rmrc.study.dataset import Column, schema_of, write_table
from rmrc.support.files import refuse_unwritable, written_whole
from rmrc.tuning.answer import about, rows_of
from rmrc.tuning.robot import Only, Options
from rmrc.tuning.space import NUMBERS, WORDS
from rmrc.tuning.trials import OnRuns
from rmrc.tuning.tune import Tuned, Tuning

_COLUMNS = (
    Column("index", "count", "1", "number of the setting, in the order of trial"),
    *(Column(key, "text", "", "null if the setting has none") for key in WORDS),
    *(Column(key, "number", "as the key", "NaN if the setting does not use it") for key in NUMBERS),
    Column("role", "text", "", "as written, recommended, second best, or why it is shown beside them; null"),
    Column("scenarios", "count", "1", "number of scenarios run: the scenario itself and perturbed ones"),
    Column("error", "number", "m", "largest error of all its runs; angles times task.length"),
    Column("nominal", "number", "m", "largest error on the scenario itself; 0: not run there"),
    Column("end", "number", "m", "largest error at the end of its runs; angles times task.length"),
    Column("peak_rate", "number", "rad/s", "largest joint rate of its runs; slides over task.length"),
    Column("time", "number", "s", "longest duration of its runs"),
    Column("completed", "number", "1", "smallest completed fraction of the path"),
    Column("excess", "number", "1", "largest relative excess over a limit; <= 0: all limits are kept"),
    Column("missed", "text", "", "the limit with the largest excess"),
    Column("feasible", "switch", "", "whether it was run on all scenarios, and keeps all limits on them"),
    Column("on_front", "switch", "", "whether it is on the Pareto front: feasible, and not dominated"),
)


@partial(hinted, more=Options)
def tune(
    scenario: Source,
    only: Only = (),
    *,
    out: str | os.PathLike[str] | None = None,
    on_runs: OnRuns = lambda _: None,
    **options: Any,
) -> Tuned:
    """Search for the inverse, damping and feedback with the smallest tracking error within the limits.

    The function behind `rmrc tune`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        only: Values to which keys are restricted, such as `{"control.inverse.method": ["damped",
            "filtered"]}`.
        out: Folder for NAME.tune.yaml, .png and .parquet; created if missing. None: writes nothing.
        on_runs: Called with the number of finished runs.
        options: The other options of the verb by name, as `rmrc.tuning.robot.Options` has them:
            `perturbed`, `start`, `offset`, `payload`, `friction`, `delay`, `lag`, `noise`, `calibration`,
            `ideal`, `gain_margin`, `slower`, `runs`, `seed` and `threads`.

    Returns:
        The result, with `tuned.block`, the control section to paste; Ctrl-C ends the search and keeps the
        results so far.

    Raises:
        ScenarioError: Lists all problems, before the first run.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C, before anything was found.
    """
    work = Tuning(scenario, only=only, **options)
    if out is not None:
        refuse_unwritable(files(work, Path(out)))
    tuned = work.run(on_runs)
    if out is not None:
        write(work, tuned, Path(out))
    return tuned


def files(work: Tuning, folder: Path, picture: Path | None = None) -> list[Path]:
    """Return the files that `write` may leave: the best setting, the picture, all settings."""
    best, drawn, rows = (folder / f"{work.scenario.name}.tune.{kind}" for kind in ("yaml", "png", "parquet"))
    return [best, picture or drawn, rows]


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
    paths, rows = files(work, folder, picture), rows_of(tuned)
    write_table(paths[2], schema_of(_COLUMNS, about(work, tuned)), rows)
    best = tuned.verdict.recommended
    if best is None:
        return paths[2:]
    data = work.written(best.setting)
    data.pop("sweep", None)
    # beside the scenario's own files; the model stays where it is
    data["name"] = f"{work.scenario.name[:94]}-tuned"
    model = (work.draft.folder / data["arm"]["model"]).resolve()
    data["arm"]["model"] = os.path.relpath(model, folder.resolve())
    name = Path(work.draft.source).name or work.scenario.name
    with written_whole(paths[0]) as temporary:
        head = f"# {name} with the control section that `rmrc tune` recommends."
        head += (
            "\n# It has a larger error than the setting as written, which breaks a limit." * tuned.is_worse
        )
        temporary.write_text(f"{head}\n{block(data)}", "utf-8")
    from rmrc.show.figures import save
    from rmrc.tuning.page import front_figure

    save(front_figure(work.scenario.name, rows), [paths[1]])
    return paths
