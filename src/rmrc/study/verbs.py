"""`rmrc.run`, `rmrc.compare` and `rmrc.sweep`: the verbs in Python, which write files only on request."""

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeAlias

from rmrc.results.run import Run, Runs
from rmrc.scenario import Source, draft_of, grid
from rmrc.scenario.keywords import hinted
from rmrc.study.dataset import Table, read_table
from rmrc.study.run import Job
from rmrc.study.sweep import Sweep
from rmrc.support.errors import ScenarioError

Values: TypeAlias = Mapping[str, Iterable[object]]
"""Values of keys, such as `{"control.feedback": [5, 10]}`, each as in a file."""


@hinted
def run(scenario: Source, *, out: str | os.PathLike[str] | None = None, record: bool = True) -> Run:
    """Run a scenario; the function behind `rmrc run`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        out: Folder for NAME.rrd, NAME.npz and NAME.json; created if missing. None: writes nothing.
        record: Whether to write the recording NAME.rrd.

    Returns:
        The run, up to a possible divergence in `run.divergence`; `run.baseline` is the run of its baseline,
        if there is one.

    Raises:
        ScenarioError: Lists all problems, before the run starts.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C; the files hold the ticks until then.

    Example:
        >>> result = run("line_tracking")
        >>> result["qdot_cmd"].shape == (len(result), 2)
        True
        >>> result.scorecard["position_error.max"].unit
        'm'
    """
    return next(iter(_runs(Job(scenario, out, record)).values()))


@hinted
def compare(
    scenario: Source, vary: Values, *, out: str | os.PathLike[str] | None = None, record: bool = True
) -> Runs:
    """Run variants of a scenario side by side; the function behind `rmrc compare`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        vary: Values of keys; their combinations are the variants, 2 to 50.
        out: Folder for NAME.compare.rrd, .npz and .json; created if missing. None: writes nothing.
        record: Whether to write the recording.

    Returns:
        The runs by the labels of the variants; the last key changes fastest.

    Raises:
        ScenarioError: Lists the problems of all variants, before the run starts.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C; the files hold the ticks until then.

    Example:
        >>> runs = compare("line_tracking", {"control.inverse.method": ["inverse", "damped"]})
        >>> list(runs)
        ['inverse', 'damped']
    """
    return _runs(Job(scenario, out, record, grid(vary)))


def _runs(job: Job) -> Runs:
    """Run a job, and raise what a verb prints on stderr."""
    job.run()
    if job.interrupted:
        raise KeyboardInterrupt
    if job.failures:
        raise OSError("; ".join(job.failures))
    return job.runs


@hinted
def sweep(
    scenario: Source, vary: Values | None = None, *,
    random: Mapping[str, tuple[float, float]] | None = None,
    sobol: Mapping[str, tuple[float, float]] | None = None,
    samples: int | None = None, repeat: int | None = None, seed: int | None = None,
    out: str | os.PathLike[str] | None = None, threads: int | None = None, cluster: str | None = None,
    on_runs: Callable[[int], None] = lambda _: None,
) -> Table:  # fmt: skip
    """Run thousands of variants of a scenario, on all cores or a cluster; the function behind `rmrc sweep`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one; with or without a `sweep` section.
        vary: Values of keys; their combinations are a grid.
        random: Keys to draw at random for each grid point, each from a range.
        sobol: Keys to draw from the Sobol sequence instead.
        samples: Samples per grid point.
        repeat: Runs per sample, each with different encoder offsets and noise.
        seed: Seed of the samples.
        out: Folder for NAME.sweep.parquet, where an interrupted sweep resumes; created if missing. None:
            stores nothing.
        threads: Number of threads; None: one per core.
        cluster: Cluster that runs them instead: `local:N` worker processes, or the `tcp://HOST:PORT`
            of a Dask scheduler.
        on_runs: Called with the number of newly finished runs.

    Returns:
        One row per run, as a table of pyarrow: varied keys, end of the run, every metric of its scorecard.
        Its schema has the unit and the meaning of each column.

    Raises:
        ScenarioError: Lists the problems of any run, before the run starts.
        ClusterError: The cluster is unusable or lost; existing rows are kept.
        OSError: The folder cannot be written.
        KeyboardInterrupt: Ctrl-C; the rows in the folder stay.

    Example:
        >>> rows = sweep("line_tracking", {"control.feedback": [5, 10, 20]})
        >>> rows["control.feedback"].to_pylist(), set(rows["status"].to_pylist())
        ([5.0, 10.0, 20.0], {'complete'})
    """
    if random and sobol:
        raise ScenarioError.about("sobol", "must not be combined with random: one method draws all keys")
    drawn = random or sobol
    section = {
        **{f"vary.{key}": v if isinstance(v, str) else list(v) for key, v in (vary or {}).items()},
        **{f"draw.{key}": list(bounds) for key, bounds in (drawn or {}).items()},
        "sampler": ("random" if random else "sobol") if drawn else None,
        "samples": samples, "repeat": repeat, "seed": seed,
    }  # fmt: skip
    swept = draft_of(scenario).scenario()
    swept = swept.set({f"sweep.{key}": value for key, value in section.items() if value is not None})
    with TemporaryDirectory(prefix="rmrc-") as temporary:
        work = Sweep(swept, (), Path(out or temporary), threads, cluster)
        work.run(on_runs)
        return read_table(work.dataset.file)
