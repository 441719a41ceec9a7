"""A sweep: validated as a whole, run in batches here or on a cluster, with each finished batch stored."""

import hashlib
import json
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self, cast

from rmrc.results import facts
from rmrc.results.leaving import refuse_unwritable
from rmrc.scenario import Change, Problems, Source, draft_of
from rmrc.simulation.footprint import Array, excess
from rmrc.simulation.prepare import Prepared
from rmrc.study import dask as clusters
from rmrc.study.dataset import Contents, Dataset
from rmrc.study.executors import Crew
from rmrc.study.executors import threads as in_threads
from rmrc.study.parcel import Parcel, pack
from rmrc.study.picks import Choice, chosen, figures_of
from rmrc.study.plan import plan_of
from rmrc.study.rows import AsRows, digest, figure_columns, fingerprint, last_columns, own_columns
from rmrc.study.run import Job
from rmrc.study.study import OnRuns, Study
from rmrc.study.summary import Summary, summarize
from rmrc.support.errors import ScenarioError
from rmrc.support.interruption import interruptible

# Keys that change the model, or the files from which it is made.
_MODELS = ("arm.model.", "arm.tool.", "arm.packages.")

# A batch takes about two seconds of one core (some 5 us per tick of a small arm, and a run takes as long as
# some 500 ticks before its first one): the most that a killed process loses, and a hundred times the cost of
# starting a batch and writing its part. In large sweeps it is up to five times longer, so that a cluster has
# at most about this many batches to schedule.
_TICKS, _TICKS_BEFORE = 400_000, 500
_MANY, _LONGER = 10_000, 5.0
# Samples of targets that a batch may hold at once, on each thread: 64 MB.
_MOST_SAMPLES = 2**26 // 104
# The number of parts is a multiple of this, so that 2, 4, 8 or 16 threads are busy until the end.
_PARTS = 16

# Months of one core, at some milliseconds each.
_MOST_RUNS = 10**9

# Other keys beside those of the encoders that may make runs random.
_CHANCE = ("arm", "plant", "plant.jitter", "plant.loss")

# The largest number in a 64-bit column.
_MOST_SEED = 2**63 - 1


@dataclass(frozen=True)
class Swept:
    """The output of a sweep.

    Attributes:
        done: Number of finished runs, including earlier ones.
        interrupted: Whether Ctrl-C ended it.
    """

    done: int
    interrupted: bool


@dataclass(frozen=True)
class _Parts:
    """The rows of a study, on disk."""

    dataset: Dataset
    contents: Contents
    reduce: AsRows
    on_runs: OnRuns | None

    def missing(self) -> Iterator[range]:
        return map(self.contents.indices, self.dataset.missing(self.contents))

    def keep(self, piece: range, payload: bytes) -> None:
        self.dataset.keep(piece.start // self.contents.batch, payload, self.contents)
        if self.on_runs is not None:
            self.on_runs(len(piece))


class Sweep:
    """Variants of a scenario, identified by index and run in batches.

    Attributes:
        scenario: The scenario, with the overrides of all runs.
        plan: The runs.
        dataset: Their rows.
    """

    def __init__(
        self,
        source: Source,
        overrides: Sequence[str] = (),
        folder: Path = Path("recordings"),
        threads: int | None = None,
        cluster: str | None = None,
    ) -> None:
        """Validate the scenario and its plan, and check that existing rows belong to this sweep.

        Args:
            source: The scenario, or its file; its `sweep` section defines the runs.
            overrides: `KEY=VALUE` texts for all runs, including the section `sweep`, such as
                `sweep.vary.control.feedback=[5, 10, 20]`.
            folder: Folder for the rows; created if missing.
            threads: Number of threads in this process, one batch each; None: one per core.
            cluster: Cluster that runs the batches instead: `tcp://HOST:PORT` or `tls://HOST:PORT` of a Dask
                scheduler, or `local:N` for N worker processes here.

        Raises:
            ScenarioError: Lists the problems of the scenario itself; or the folder has another sweep's rows.
            ClusterError: The cluster's address is invalid, or Dask is not installed.
            OSError: The folder cannot be written.
        """
        self.scenario = draft_of(source, overrides).scenario()
        self.plan = plan_of(self.scenario)
        self.folder = folder
        self._threads = threads or os.cpu_count() or 1
        self._cluster = None if cluster is None else clusters.Address.read(cluster)
        self._users = 0
        self._working, self._opened = ExitStack(), cast(Crew | None, None)
        self._refuse_nothing()
        self._study = Study(self.scenario)
        self._identity = self._identify()
        self.dataset = Dataset(folder, self.scenario.name)
        self._contents = self.dataset.contents(self._identity, len(self.plan))
        refuse_unwritable([self.dataset.file])

    def _refuse_nothing(self) -> None:
        """Refuse a plan of one run, identical repeats, and seeds that fit no column."""
        problems = Problems(self.scenario)
        if self.plan.count > _MOST_RUNS:
            problems.add(
                "sweep",
                f"must give {_MOST_RUNS} runs or fewer, got {self.plan.count}; "
                "lower sweep.samples or sweep.repeat",
            )
            problems.raise_any()
        if len(self.plan) < 2:
            problems.add(
                "sweep",
                f"must give 2 runs or more, got {len(self.plan)}; "
                "for example --vary control.inverse.method=damped,pseudoinverse",
            )
        encoder, plant = self.scenario.arm.encoder, self.scenario.plant
        drawn = encoder.deviation, encoder.noise, plant.jitter, plant.loss
        has_chance = any(map(any, map(_each, drawn)))
        has_chance |= any(key in _CHANCE or key.startswith("arm.encoder") for key in self.plan.keys)
        most = _MOST_SEED - self.plan.samples * self.plan.repeat + 1
        if self.plan.seed > most:
            key = "arm.encoder.seed" if self.scenario.sweep.seed is None else "sweep.seed"
            problems.add(key, f"must be <= {most}, got {self.plan.seed}")
        if self.plan.repeat > 1 and not has_chance:
            problems.add(
                "sweep.repeat",
                f"must be 1 without random effects, got {self.plan.repeat}; "
                "give arm.encoder.deviation, arm.encoder.noise, plant.jitter or plant.loss",
            )
        problems.raise_any()

    def _identify(self) -> dict[str, Any]:
        """Return all inputs of the rows; a message names those that differ."""
        try:
            model_arm = self._prepare(0).arm
        except ScenarioError:  # report the problems of the others as well
            self._contents = None
            self.check()
            raise
        swept = self.scenario.sweep.model_dump(mode="json")
        # recorded motions, profiles and varied models are compared by the contents of their files and of
        # those that these depend on
        models_vary = any(key == "arm" or f"{key}.".startswith(_MODELS) for key in self.plan.keys)
        arm = self.scenario.arm
        own = () if models_vary else (arm.model, arm.tool and arm.tool.model)
        if any(path.is_file() and path not in own for path in self.scenario.draft.files()):
            files = self._parcel.models
            swept |= {f"model {path.name}": digest for path, digest in files.items() if path not in own}
        # the order of the keys, which sorting hides, determines the run of an index
        text = json.dumps([swept, self.plan.keys, self.plan.seed], sort_keys=True)
        model = "" if models_vary else fingerprint(model_arm)
        expect = self.scenario.model_dump(mode="json", include={"expect"})["expect"]
        return {
            "scenario": digest(self.scenario, model),
            "expect": expect,
            "sweep": hashlib.sha256(text.encode()).hexdigest()[:16],
            "versions": facts.versions(),
        }

    @cached_property
    def _parcel(self) -> Parcel:
        return pack(self.scenario.draft)

    def __enter__(self) -> Self:
        """Keep the threads or the cluster between calls of `check` and `run`."""
        self._users += 1
        return self

    def __exit__(self, *_: object) -> None:
        """Release them."""
        self._users -= 1
        if not self._users:
            self._opened = None
            self._working.close()

    def _crew(self) -> Crew:
        """Return the workers, started on first use."""
        if self._opened is None:
            if self._cluster:
                with suppress(ScenarioError):  # the check reports it
                    self.compile()  # worker processes on this machine can then load the code that they need
                who = clusters.opened(self._cluster, self._parcel)
            else:
                who = in_threads(self._threads, self._study)
            self._opened = self._working.enter_context(who)
        return self._opened

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(self.plan)

    @property
    def is_checked(self) -> bool:
        """Whether all runs were validated, now or at the first start of the sweep."""
        return self._contents is not None

    @property
    def done(self) -> int:
        """Number of finished runs."""
        if self._contents is None:
            return 0
        lost = sum(len(self._contents.indices(part)) for part in self.dataset.missing(self._contents))
        return len(self) - lost

    def _prepare(self, index: int) -> Prepared:
        return self._study.prepare(self.plan.changes(index))

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        self._study.compile([self._prepare(0)])

    def check(self, on_runs: OnRuns | None = None) -> Contents:
        """Validate every run before the first one starts, unless already done.

        Args:
            on_runs: Called with the number of newly validated runs.

        Returns:
            The contents of the dataset.

        Raises:
            ScenarioError: Lists all problems, one line each, with the affected runs.
            ClusterError: The cluster does not respond, has no workers, or they differ from this machine.
        """
        if self._contents is not None:
            return self._contents
        with self:
            found = self._study.check(self.plan, self._crew(), on_runs)
        size = batch_size(found.runs, found.ticks, found.longest)
        self._refuse_excess(found.world, found.longest, math.ceil(found.runs / size))
        figures = figure_columns(map(self._prepare, sorted(found.kinds.values())))
        columns = [*own_columns(self.plan), *figures, *last_columns()]
        self._contents = Contents(self._identity, found.runs, size, columns)
        self.dataset.begin(self._contents)
        return self._contents

    def _refuse_excess(self, world: Array, longest: int, batches: int) -> None:
        """Refuse runs of which those at a time do not fit into this machine's memory."""
        here = self._cluster.here or 1 if self._cluster else self._threads
        at_once = min(here, batches)
        if too_much := excess(at_once * world):
            fewer = " or lower --threads" if at_once > 1 else ""
            wrong = (
                f"has up to {longest} ticks, and its {at_once} simultaneous runs need {too_much}; "
                f"shorten it, raise control.period{fewer}"
            )
            raise ScenarioError([self.scenario.problem("target.path", wrong)])

    def run(self, on_runs: OnRuns | None = None) -> Swept:
        """Run the missing batches, and make one file of all; Ctrl-C keeps finished batches.

        Args:
            on_runs: Called after each written batch with its number of runs.

        Raises:
            ScenarioError: As in `check`; or existing rows were altered.
            ClusterError: As in `check`, or the cluster is lost; existing rows are kept.
            KeyboardInterrupt: Ctrl-C arrived before the workers started.
        """
        contents = self.check()
        self.dataset.verify(contents)
        rows = AsRows(self.plan, self.scenario, contents.columns)
        with self, ExitStack() as stack:
            # Ctrl-C ends the wait for workers by itself
            crew = self._crew() if self.dataset.missing(contents) else None
            stop = stack.enter_context(interruptible())
            if crew is not None:
                self._study.run(self.plan, crew, _Parts(self.dataset, contents, rows, on_runs), stop)
            if not (stop.is_set() or self.dataset.is_whole):
                self.dataset.merge(contents)
        self.dataset.clear()
        return Swept(self.done, stop.is_set())

    def summary(self) -> Summary:
        """Return a summary of the existing rows."""
        return summarize(self.dataset, self.check().columns, figures_of(self.scenario.expect))

    def chosen(self, choice: Choice) -> list[int]:
        """Return the indices of the worst or best rows, most extreme first; the first of equal ones.

        Raises:
            ScenarioError: No row has this metric.
        """
        settled = choice.settled(self.scenario, self.check().columns)
        return chosen(self.dataset, settled, self.scenario.expect)

    def job(self, index: int) -> Job:
        """Return one run, ready to write `NAME-INDEX.rrd`, `.npz` and `.json`, with the bits of its row.

        Args:
            index: Index of the run.
        """
        alone = Change(("name",), f"{self.scenario.name}-{index}"), Change(("baseline",), {})
        return Job(self._study.prepare((*self.plan.changes(index), *alone)).scenario, self.folder)


def batch_size(runs: int, ticks: int, longest: int) -> int:
    """Return the number of runs per batch.

    Args:
        runs: Runs of the sweep.
        ticks: Ticks of all targets.
        longest: Ticks of the longest target.

    Example: 4 s at 1 kHz, few, a thousand and a billion times.
        >>> [batch_size(runs, 4001 * runs, 4001) for runs in (32, 10**3, 10**9)]
        [2, 63, 161]
    """
    batches = (ticks + _TICKS_BEFORE * runs) / _TICKS
    in_time = int(runs / batches * min(max(1.0, batches / _MANY), _LONGER))
    parts = math.ceil(runs / max(1, min(in_time, _MOST_SAMPLES // longest)))
    return math.ceil(runs / (math.ceil(parts / _PARTS) * _PARTS))


def _each(values: float | tuple[float, ...]) -> tuple[float, ...]:
    return values if isinstance(values, tuple) else (values,)
