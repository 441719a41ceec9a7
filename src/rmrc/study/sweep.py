"""`rmrc.sweep`: all runs are checked first, then run by threads here or by a cluster; rows are stored."""

import hashlib
import json
import os
import threading
import time
from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario import Source, draft_of
from rmrc.scenario.changes import hinted
from rmrc.scenario.sections import PROFILE
from rmrc.show.sheets import Sheet, number
from rmrc.simulation.footprint import refuse_excess
from rmrc.simulation.prepare import Prepared
from rmrc.study import dask
from rmrc.study.dataset import Dataset, Table, about_of, read_table, schema_of
from rmrc.study.runs import Parcel, Rows, Runs, columns_of, pack, plan_of
from rmrc.study.study import OnRuns, Values, validated
from rmrc.support.errors import QuestionError, ScenarioError
from rmrc.support.files import reading, refuse_unwritable
from rmrc.support.process import interruptible, side_by_side

# The metrics of most interest.
METRICS = (
    "joint_rate.peak", "joint_acceleration.peak", "position_error.max", "position_error.end",
    "orientation_error.max", "orientation_error.end", "sigma.min",
)  # fmt: skip

# Runs that a worker gets at once, at most, and pieces of all runs at least.
_AT_ONCE, _PIECES = 16, 16
# A part is written after a second [s], or this fraction of the time so far: what a killed process loses.
_SECOND, _FRACTION = 1.0, 0.02


class Sweep:
    """Variants of a scenario, identified by index.

    Attributes:
        scenario: The scenario, with the overrides of all runs.
        plan: The runs.
        dataset: Their rows.
    """

    def __init__(
        self, source: Source, overrides: Sequence[str] = (), folder: Path = Path("recordings"),
        threads: int | None = None, cluster: str | None = None,
    ) -> None:  # fmt: skip
        """Validate the scenario and its plan, and check that existing rows belong to this sweep.

        Args:
            source: The scenario, or its file; its `sweep` section defines the runs.
            overrides: `KEY=VALUE` texts for all runs, including the section `sweep`, such as
                `sweep.vary.control.feedback=[5, 10, 20]`.
            folder: Folder for the rows; created if missing.
            threads: Number of threads in this process; None: one per core.
            cluster: Cluster that runs them instead: `tcp://HOST:PORT` or `tls://HOST:PORT` of a Dask
                scheduler, or `local:N` for N worker processes here.

        Raises:
            ScenarioError: Lists the problems of the scenario itself; or the folder has another sweep's rows.
            ClusterError: The cluster's address is invalid, or Dask is not installed.
            OSError: The folder cannot be written.
        """
        self.scenario = draft_of(source, overrides).scenario()
        self.plan = plan_of(self.scenario)
        if cluster is not None:
            dask.refuse(cluster)
        self._threads, self._cluster = threads or os.cpu_count() or 1, cluster
        self._parcel = pack(self.scenario, self.plan)
        self._runs, self._identity = Runs(self._parcel), _identify(self._parcel)
        self.dataset = Dataset(folder, self.scenario.name, self._identity)
        refuse_unwritable([self.dataset.file, self.dataset.folder / "part"])

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(self.plan)

    def check(self, on_runs: OnRuns = lambda _: None) -> None:
        """Validate every run before the first one starts, unless there are rows of an earlier start.

        Args:
            on_runs: Called with the number of newly validated runs.

        Raises:
            ScenarioError: Lists all problems, one line each, with the affected runs.
        """
        if self.dataset.schema is not None:
            return
        shapes, longest = dict[object, Prepared](), None
        for world in validated(self._runs.prepare, len(self), self.plan.label):
            arm = world.arm
            shapes.setdefault((arm.joints, *arm.is_slide.tolist(), world.scenario.task.axes), world)
            longest = max(longest or world, world, key=lambda each: each.most_ticks)
            on_runs(1)
        if longest and not self._cluster:
            at_once = min(self._threads, len(self))
            refuse_excess([longest] * at_once, keep_columns=False, threads=at_once)
        columns = columns_of(self.plan, shapes.values())
        names = {column.name for column in columns}
        expected = (f"{PROFILE}.refused" if name == PROFILE else name for name in self.scenario.expect)
        metrics = [name for name in dict.fromkeys((*METRICS, *expected)) if name in names]
        self.dataset.schema = schema_of(columns, {"identity": self._identity, "metrics": metrics})

    def run(self, on_runs: OnRuns = lambda _: None) -> None:
        """Run what is missing, and make one file of all; Ctrl-C keeps finished rows.

        Args:
            on_runs: Called with the number of newly finished runs.

        Raises:
            ScenarioError: As in `check`; or existing rows are damaged.
            ClusterError: The cluster does not respond, has no workers, or is lost; existing rows are kept.
            KeyboardInterrupt: Ctrl-C.
        """
        self.check()
        missing = [index for index in range(len(self)) if index not in self.dataset.done]
        size = min(_AT_ONCE, -(-len(missing) // _PIECES) or 1)
        pieces = [missing[first : first + size] for first in range(0, len(missing), size)]
        with interruptible() as stop:
            started = written = time.monotonic()
            rows: Rows = []
            try:
                with closing(self._results(pieces, stop)) as results:
                    for some in results:
                        rows += some
                        on_runs(len(some))
                        now = time.monotonic()
                        if now - written > max(_SECOND, _FRACTION * (now - started)):
                            self.dataset.add(rows)
                            rows, written = [], now
            finally:
                self.dataset.add(rows)
            if stop.is_set():
                raise KeyboardInterrupt
            self.dataset.merge()

    def _results(self, pieces: Sequence[Sequence[int]], stop: threading.Event) -> Generator[Rows]:
        """Yield the rows of pieces as they finish; after a stop, they soon end by themselves."""
        if self._cluster and pieces:
            yield from dask.results(self._cluster, self._parcel, pieces, stop)
            return
        with side_by_side(self._threads) as pool:
            try:
                for future in as_completed([pool.submit(self._runs.rows, piece, stop) for piece in pieces]):
                    yield future.result()
            except BaseException:
                stop.set()
                raise


def _identify(parcel: Parcel) -> dict[str, str]:
    """Return all inputs of the rows; a message names those that differ."""
    values = {name: value for name, value in parcel.draft.values().items() if name not in ("name", "look")}
    # the order of the keys, which sorting hides, determines the run of an index
    values["sweep"] = [values.get("sweep"), parcel.plan.keys, parcel.plan.seed, parcel.plan.plant_seed]
    texts = {name: json.dumps(value, sort_keys=True, default=str) for name, value in values.items()}
    digest = hashlib.sha256()
    for path, data in parcel.files.items():
        digest.update(f"{path.name} {len(data)} ".encode() + data)
    return texts | {"files": digest.hexdigest()[:16]}


@hinted
def sweep(
    scenario: Source, vary: Values | None = None, *,
    random: Mapping[str, tuple[float, float]] | None = None,
    sobol: Mapping[str, tuple[float, float]] | None = None,
    samples: int | None = None, repeat: int | None = None, seed: int | None = None,
    out: str | os.PathLike[str] | None = None, threads: int | None = None, cluster: str | None = None,
    on_runs: OnRuns = lambda _: None,
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
    drawn = random or sobol or {}
    section: dict[str, object] = {
        f"vary.{key}": v if isinstance(v, str) else list(v) for key, v in (vary or {}).items()
    }
    section |= {f"draw.{key}": list(bounds) for key, bounds in drawn.items()}
    if drawn:
        section["sampler"] = "random" if random else "sobol"
    section |= {"samples": samples, "repeat": repeat, "seed": seed}
    written = {f"sweep.{key}": value for key, value in section.items() if value is not None}
    with TemporaryDirectory(prefix="rmrc-") as temporary:
        base = draft_of(scenario).scenario().set(written)
        work = Sweep(base, (), Path(out or temporary), threads, cluster)
        work.run(on_runs)
        return read_table(work.dataset.file)


# The rows, ready to show --------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Swept:
    """The rows of a sweep, at least one, by rising index from 0 on.

    Attributes:
        name: Name of the sweep.
        rows: All columns, by name.
        units: Units of each.
        varied: Keys with several values.
        figures: The main metrics of any run, (runs,) each; NaN where a run has none.
    """

    name: str
    rows: Mapping[str, list[Any]]
    units: Mapping[str, str]
    varied: Sequence[str]
    figures: Mapping[str, NDArray[np.float64]]

    @classmethod
    def of(cls, path: Path, table: Table | None = None) -> "Swept":
        """Return the contents of a file.

        Args:
            path: The `.parquet` that `sweep` left.
            table: Its contents, if already read.

        Raises:
            OSError: It cannot be opened.
            QuestionError: It is another kind of file.
        """
        table = read_table(path) if table is None else table
        rows, names = table.to_pydict(), table.column_names
        if "seed" not in names:
            raise QuestionError(f"{path}: holds no sweep; `rmrc report` shows what `tune` has left")
        with reading(path, "of a sweep"):
            units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
            varied = [key for key in names[1 : names.index("seed")] if len(set(map(str, rows[key]))) > 1]
            metrics = json.loads(about_of(table.schema))["metrics"]
            figures = {name: np.array(rows[name], float) for name in metrics}
        figures = {name: values for name, values in figures.items() if np.isfinite(values).any()}
        return cls(path.name.removesuffix(".parquet").removesuffix(".sweep"), rows, units, varied, figures)

    def extremes(self) -> dict[str, tuple[int, int]]:
        """Return the runs with the smallest and largest value of each metric, the first of equal ones."""
        return {key: (int(np.nanargmin(v)), int(np.nanargmax(v))) for key, v in self.figures.items()}

    def sheets(self) -> list[Sheet]:
        """Return the tables of the summary."""
        ends, met = self.rows["status"], [value for value in self.rows["met"] if value is not None]
        counts = [(status, str(count)) for status, count in sorted(Counter(ends).items())]
        counts += [("all expectations met", str(sum(met)))] if met else []
        extremes = []
        for name, runs in self.extremes().items():
            cells = [text for i in runs for text in (number(float(self.figures[name][i])), str(i))]
            extremes.append((f"{name} [{self.units[name]}]", *cells))
        return [
            Sheet(f"{self.name}: {len(ends)} runs", ("", ""), counts),
            Sheet("", ("metric", "least", "run", "most", "run"), extremes),
        ]
