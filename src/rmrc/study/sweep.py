"""A sweep from file to file: checked whole, run in batches here or on a cluster, each kept once done."""

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
from rmrc.simulation.footprint import Footprint
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

# Keys with which the model varies, or the files that it is made of.
_MODELS = ("arm.model.", "arm.tool.", "arm.packages.")

# A batch is about two seconds of one core (some 5 us a tick of a small arm, and a run takes as long as some
# 500 ticks before its first one): the most that a killed process loses, and a hundred times what starting a
# batch and writing its part take. Of large sweeps it is up to five times longer, so that a cluster has not
# many more than so many batches to schedule.
_TICKS, _TICKS_BEFORE = 400_000, 500
_MANY, _LONGER = 10_000, 5.0
# Samples of targets that a batch may hold at once, on each thread: 64 MB.
_MOST_SAMPLES = 2**26 // 104
# Parts come in multiples of it, so that 2, 4, 8 or 16 threads have something to do until the end.
_PARTS = 16

# Months of one core, at some milliseconds each.
_MOST_RUNS = 10**9

# Keys that may bring chance in, beside those of the encoders.
_CHANCE = ("arm", "plant", "plant.jitter", "plant.loss")

# Of a column of 64 bits.
_MOST_SEED = 2**63 - 1


@dataclass(frozen=True)
class Swept:
    """What a sweep left.

    Attributes:
        done: Runs that have their rows, from before as well.
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
    """Variants of a scenario, known by index, that are run in batches.

    Attributes:
        scenario: With the overrides that hold for all runs.
        plan: Which runs there are.
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
        """Check the scenario and its plan, and whether the folder has rows of just this sweep.

        Args:
            source: The scenario, or its file; its `sweep` section says what is run.
            overrides: `KEY=VALUE` texts that hold for all runs, of the section `sweep` as well, such as
                `sweep.vary.control.feedback=[5, 10, 20]`.
            folder: Where the rows go; made if it is missing.
            threads: How many batches are run at a time in this process; None: one a core.
            cluster: Who runs the batches instead: `tcp://HOST:PORT` or `tls://HOST:PORT` of a Dask scheduler,
                or `local:N` for N worker processes here.

        Raises:
            ScenarioError: All that is wrong with the scenario itself, or the folder has another sweep's rows.
            ClusterError: The text of the cluster is none, or Dask is not installed.
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
        """Refuse a plan of one run, repeats that all give the same, and seeds that no column holds."""
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
                f"must be 1 where nothing is left to chance, got {self.plan.repeat}; "
                "give arm.encoder.deviation, arm.encoder.noise, plant.jitter or plant.loss",
            )
        problems.raise_any()

    def _identify(self) -> dict[str, Any]:
        """Return what decides the rows. What differs names itself in a message."""
        try:
            arm = self._prepare(0).arm
        except ScenarioError:  # tell what is wrong with the others as well
            self._contents = None
            self.check()
            raise
        swept = self.scenario.sweep.model_dump(mode="json")
        # recorded motions, profiles, and models that are varied, count with what is in their files, and in
        # those that these depend on
        models_vary = any(key == "arm" or f"{key}.".startswith(_MODELS) for key in self.plan.keys)
        draft = self.scenario.draft
        named = (*(draft.models if models_vary else ()), *draft.motions, *draft.profiles)
        if named:
            files = self._parcel.models
            swept |= {f"model {name}": files[name].digest for name in named if name in files}
        # the order of the keys, which sorting hides, decides which run an index is
        text = json.dumps([swept, self.plan.keys, self.plan.seed], sort_keys=True)
        model = "" if models_vary else fingerprint(arm)
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
        """Keep the threads or the cluster from one call of `check` or `run` to the next."""
        self._users += 1
        return self

    def __exit__(self, *_: object) -> None:
        """Let them go."""
        self._users -= 1
        if not self._users:
            self._opened = None
            self._working.close()

    def _crew(self) -> Crew:
        """Return who works, who is asked for when there is work for the first time."""
        if self._opened is None:
            if self._cluster:
                with suppress(ScenarioError):  # which the check tells
                    self.compile()  # what workers on this machine load, they need not compile
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
        """Whether all runs were checked, now or when the sweep was first started."""
        return self._contents is not None

    @property
    def done(self) -> int:
        """How many runs have their rows."""
        if self._contents is None:
            return 0
        lost = sum(len(self._contents.indices(part)) for part in self.dataset.missing(self._contents))
        return len(self) - lost

    def _prepare(self, index: int) -> Prepared:
        return self._study.prepare(self.plan.changes(index))

    def compile(self) -> None:
        """Load the compiled law, or compile it the first time, which takes seconds."""
        self._study.compile([self._prepare(0)])

    def check(self, on_runs: OnRuns | None = None) -> Contents:
        """Check every run before the first one starts, unless that was done before.

        Args:
            on_runs: Called with the number of runs that were checked.

        Returns:
            What the dataset will hold.

        Raises:
            ScenarioError: All that is wrong, a line each, with the runs that it is wrong with.
            ClusterError: The cluster does not answer, has no workers, or they are not as this machine is.
        """
        if self._contents is not None:
            return self._contents
        with self:
            found = self._study.check(self.plan, self._crew(), on_runs)
        size = batch_size(found.runs, found.ticks, found.longest)
        self._refuse_excess(found.world.times(size), found.longest, math.ceil(found.runs / size))
        figures = figure_columns(map(self._prepare, sorted(found.kinds.values())))
        columns = [*own_columns(self.plan), *figures, *last_columns()]
        self._contents = Contents(self._identity, found.runs, size, columns)
        self.dataset.begin(self._contents)
        return self._contents

    def _refuse_excess(self, batch: Footprint, longest: int, batches: int) -> None:
        """Refuse batches that do not fit into memory, as many as are run at a time on this machine."""
        here = self._cluster.here or 1 if self._cluster else self._threads
        at_once = min(here, batches)
        excess = batch.times(at_once).excess
        if excess:
            fewer = " or lower --threads" if at_once > 1 else ""
            wrong = (
                f"has up to {longest} ticks, and the batches that are run at a time, {at_once}, need "
                f"{excess}; shorten it, raise control.period{fewer}"
            )
            raise ScenarioError([self.scenario.problem("target.path", wrong)])

    def run(self, on_runs: OnRuns | None = None) -> Swept:
        """Run what is missing, and make one file when nothing is; Ctrl-C leaves what is done.

        Args:
            on_runs: Called with the number of runs of each batch that was written.

        Raises:
            ScenarioError: As in `check`, or rows that are there are not those that were written.
            ClusterError: As in `check`, or the cluster is lost; rows that are there are kept.
            KeyboardInterrupt: Ctrl-C came before there was anyone who works.
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
        """Return what the rows say that are there."""
        return summarize(self.dataset, self.check().columns, figures_of(self.scenario.expect))

    def chosen(self, choice: Choice) -> list[int]:
        """Return the indices of the worst or the best rows, those first; of equal ones, the first.

        Raises:
            ScenarioError: No row has such a figure.
        """
        settled = choice.settled(self.scenario, self.check().columns)
        return chosen(self.dataset, settled, self.scenario.expect)

    def job(self, index: int) -> Job:
        """Return one run, ready to leave `NAME-INDEX.rrd`, `.npz` and `.json`; with the bits of its row.

        Args:
            index: Of the run.
        """
        alone = Change(("name",), f"{self.scenario.name}-{index}"), Change(("baseline",), {})
        return Job(self._study.prepare((*self.plan.changes(index), *alone)).scenario, self.folder)


def batch_size(runs: int, ticks: int, longest: int) -> int:
    """Return how many runs a batch has.

    Args:
        runs: Of the sweep.
        ticks: Of all targets.
        longest: Of the longest target.

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
