"""`rmrc.run`, `rmrc.compare` and `rmrc.sweep`: the verbs for Python, which write nothing unless asked to."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeAlias

from rmrc.results.run import Run
from rmrc.scenario import Source, draft_of, grid
from rmrc.study.compare import Comparison
from rmrc.study.dataset import Table
from rmrc.study.run import Job, beside
from rmrc.study.study import Ran, Study
from rmrc.study.sweep import Sweep
from rmrc.support.errors import ScenarioError

Values: TypeAlias = Mapping[str, Iterable[object]]
"""Values of keys, such as `{"control.feedback": [5, 10]}`, each as a file would have it."""


def run(scenario: Source, *, out: str | os.PathLike[str] | None = None, record: bool = True) -> Run:
    """Run a scenario; the function behind `rmrc run`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        out: Folder for NAME.rrd, NAME.npz and NAME.json; made if it is missing. None: nothing is written.
        record: Whether the recording NAME.rrd is among them.

    Returns:
        The run as far as it came: `run.divergence` says whether it diverged, and `run.baseline` is that of
        its baseline, if the scenario has one.

    Raises:
        ScenarioError: All that is wrong, before anything moves.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C; the files hold what was run until then.

    Example:
        >>> found = run("line_tracking")
        >>> found["qdot_cmd"].shape == (len(found), 2)
        True
        >>> found.scorecard["position_error.max"].unit
        'm'
    """
    if out is None:
        study = Study(scenario)
        return beside(study.step(study.prepare_beside()))[0].run
    left = Job(scenario, Path(out), record).run()
    left.raise_any()
    return left.results[0].run


def compare(
    scenario: Source, vary: Values, *, out: str | os.PathLike[str] | None = None, record: bool = True
) -> dict[str, Run]:
    """Run variants of a scenario side by side, as one batch; the function behind `rmrc compare`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        vary: Values of keys; their combinations are the variants, 2 to 50.
        out: Folder for NAME.compare.rrd, .npz, .json, .png and .svg; made if it is missing. None: nothing
            is written.
        record: Whether the recording is among them.

    Returns:
        The runs, by the labels of the variants, in order: the last key changes fastest.

    Raises:
        ScenarioError: All that is wrong with all variants, before anything moves.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C; the files hold what was run until then.

    Example:
        >>> runs = compare("line_tracking", {"control.inverse.method": ["inverse", "damped"]})
        >>> list(runs)
        ['inverse', 'damped']
    """
    variants = grid(vary)
    results: Sequence[Ran]
    if out is None:
        study = Study(scenario)
        results = study.step(study.prepare_all(variants))
    else:
        left = Comparison(scenario, variants, folder=Path(out), record=record).run()
        left.raise_any()
        results = left.results
    return {variant.label: one.run for variant, one in zip(variants, results, strict=True)}


def sweep(
    scenario: Source,
    vary: Values | None = None,
    *,
    random: Mapping[str, tuple[float, float]] | None = None,
    sobol: Mapping[str, tuple[float, float]] | None = None,
    samples: int | None = None,
    repeat: int | None = None,
    seed: int | None = None,
    out: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    cluster: str | None = None,
    on_runs: Callable[[int], None] | None = None,
) -> Table:
    """Run thousands of variants of a scenario, on all cores or a cluster; the function behind `rmrc sweep`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one; perhaps with a `sweep` section.
        vary: Values of keys; their combinations are a grid.
        random: Keys that are drawn by chance for each point of the grid, each from a range.
        sobol: Keys that are drawn evenly, instead.
        samples: How many are drawn for each point of the grid.
        repeat: How often each is run, with other encoder offsets.
        seed: What is drawn.
        out: Folder for NAME.sweep.parquet, where a sweep that was interrupted goes on; made if it is missing.
            None: nothing is kept.
        threads: How many batches are run at a time; None: one a core.
        cluster: Who runs the batches instead: `local:N` worker processes, or the `tcp://HOST:PORT` of a Dask
            scheduler.
        on_runs: Called with the number of runs of each batch that is done.

    Returns:
        A row a run, as a table of pyarrow: what was varied, how it ended, every figure of its scorecard. Its
        schema has the unit and the meaning of each column.

    Raises:
        ScenarioError: All that is wrong with any run, before anything moves.
        ClusterError: The cluster cannot be used, or is lost; rows that are there are kept.
        OSError: The folder cannot be written.
        KeyboardInterrupt: Ctrl-C; the rows in the folder stay.

    Example:
        >>> rows = sweep("line_tracking", {"control.feedback": [5, 10, 20]})
        >>> rows["control.feedback"].to_pylist(), set(rows["status"].to_pylist())
        ([5.0, 10.0, 20.0], {'complete'})
    """
    if random and sobol:
        raise ScenarioError.about("sobol", "must not be given with random: all keys are drawn alike")
    drawn = random or sobol
    section = {
        **{
            f"vary.{key}": values if isinstance(values, str) else list(values)
            for key, values in (vary or {}).items()
        },
        **{f"draw.{key}": list(bounds) for key, bounds in (drawn or {}).items()},
        "sampler": ("random" if random else "sobol") if drawn else None,
        "samples": samples,
        "repeat": repeat,
        "seed": seed,
    }
    one = draft_of(scenario).scenario()
    one = one.set({f"sweep.{key}": value for key, value in section.items() if value is not None})
    with TemporaryDirectory(prefix="rmrc-") as kept:
        with Sweep(one, (), Path(kept if out is None else out), threads, cluster) as work:
            if work.run(on_runs).interrupted:
                raise KeyboardInterrupt
        return work.dataset.table()
