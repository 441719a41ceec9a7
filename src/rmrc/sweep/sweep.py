"""A sweep from file to file: checked whole, run in batches on all cores, each batch kept once it is done."""

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rmrc import facts, scenario
from rmrc.control.records import tick_type
from rmrc.errors import ScenarioError
from rmrc.interruption import interruptible
from rmrc.job import Job
from rmrc.preparation import Prepared
from rmrc.simulation import Simulation
from rmrc.sweep.columns import figure_columns, last_columns, own_columns, typed
from rmrc.sweep.dataset import Contents, Dataset
from rmrc.sweep.plan import Plan, plan_of
from rmrc.sweep.records import Choice, chosen
from rmrc.sweep.shards import Shards, digest
from rmrc.sweep.summary import Summary, summarize

# A batch is about a second of one core (some 5 us a tick of a small arm, and a run takes as long as some 500
# ticks before its first one): the most that a killed process loses, and a hundred times what starting a batch
# and writing its part take.
_TICKS, _TICKS_BEFORE = 200_000, 500
# Of ticks that a batch may hold at once, on each thread.
_MOST_BYTES = 2**26
# However small a sweep is, so many threads have something to do until the end.
_FEWEST_PARTS = 16

# Problems that are told, of all that a sweep may have.
_TOLD = 20

OnRuns = Callable[[int], None]


@dataclass(frozen=True)
class Swept:
    """What a sweep left.

    Attributes:
        contents: What the dataset holds when it is whole.
        done: Runs that have their rows, from before as well.
        interrupted: Whether Ctrl-C ended it.
    """

    contents: Contents
    done: int
    interrupted: bool


class Sweep:
    """Variants of a scenario, known by index, that are run in batches.

    Attributes:
        scenario: With the overrides that hold for all runs.
        plan: Which runs there are.
        dataset: Their rows.
    """

    def __init__(
        self,
        path: Path,
        overrides: Sequence[str] = (),
        folder: Path = Path("recordings"),
        threads: int | None = None,
    ) -> None:
        """Check the scenario and its plan, and whether the folder has rows of just this sweep.

        Args:
            path: Of the scenario; its `sweep` section says what is run.
            overrides: `KEY=VALUE` texts that hold for all runs, of the section `sweep` as well, such as
                `sweep.vary.control.feedback=[5, 10, 20]`.
            folder: Where the rows go; made if it is missing.
            threads: How many batches are run at a time; None: one a core.

        Raises:
            ScenarioError: All that is wrong with the scenario itself, or the folder has another sweep's rows.
            OSError: The folder cannot be written.
        """
        self.scenario = scenario.load(path, overrides)
        self.plan = plan_of(self.scenario)
        self.folder, self._path = folder, path
        self._threads = threads or os.cpu_count() or 1
        self._refuse_nothing()
        self._shards = Shards(path, overrides, self.scenario, self.plan)
        self._identity = self._identify()
        self.dataset = Dataset(folder, self.scenario.name)
        self._contents = self.dataset.contents(self._identity)
        folder.mkdir(parents=True, exist_ok=True)

    def _refuse_nothing(self) -> None:
        """Refuse a plan of one run, and repeats that all give the same."""
        problems = []
        if len(self.plan) < 2:
            problems.append(
                f"{self.scenario.locate('sweep')}: must give 2 runs or more, got {len(self.plan)}; "
                "for example --vary control.inverse.method=damped,pseudoinverse"
            )
        encoder = self.scenario.arm.encoder
        has_chance = any(key.startswith("arm.encoder") for key in self.plan.keys)
        if self.plan.repeat > 1 and not (has_chance or any(_each(encoder.deviation))):
            problems.append(
                f"{self.scenario.locate('sweep.repeat')}: must be 1 where nothing is left to chance, "
                f"got {self.plan.repeat}; give arm.encoder.deviation"
            )
        if problems:
            raise ScenarioError(problems)

    def _identify(self) -> dict[str, Any]:
        """Return what decides the rows. What differs names itself in a message."""
        try:
            arm = self._shards.prepare(0).arm
        except ScenarioError:  # tell what is wrong with the others as well
            self._contents = None
            self.check()
            raise
        swept = self.scenario.sweep.model_dump(mode="json")
        # models that are varied count with what is in their files
        for name in self.scenario.sweep.vary.get("arm.model", ()):
            file = self._path.parent / str(name)
            if file.is_file():  # else the check tells
                swept[f"model {name}"] = hashlib.sha256(file.read_bytes()).hexdigest()
        text = json.dumps([swept, self.plan.seed], sort_keys=True)
        model = "" if "arm.model" in self.plan.keys else self._shards.fingerprint(arm)
        expect = {name: one.model_dump(mode="json") for name, one in self.scenario.expect.items()}
        return {
            "scenario": digest(self.scenario, model),
            "expect": expect,
            "sweep": hashlib.sha256(text.encode()).hexdigest()[:16],
            "versions": facts.versions(),
        }

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

    def compile(self) -> None:
        """Load the compiled law, or compile it the first time, which takes seconds."""
        Simulation([self._shards.prepare(0)])

    def check(self, on_runs: OnRuns | None = None) -> Contents:
        """Check every run before the first one starts, unless that was done before.

        Args:
            on_runs: Called with the number of runs that were checked.

        Returns:
            What the dataset will hold.

        Raises:
            ScenarioError: All that is wrong, a line each, with the runs that it is wrong with.
        """
        if self._contents is not None:
            return self._contents
        problems = _Problems(self.plan)
        kinds: dict[object, Prepared] = {}  # one run of each that has figures of its own
        ticks = largest = 0
        for index in range(len(self)):
            try:
                one = self._shards.prepare(index)
                kinds.setdefault((one.arm.joints, tuple(one.arm.is_slide), one.scenario.task.axes), one)
                ticks += _TICKS_BEFORE + one.reference.ticks
                largest = max(largest, _most_bytes(one))
            except ScenarioError as error:
                problems.add(index, error)
            if on_runs is not None:
                on_runs(1)
        problems.raise_any()
        of_a_second, that_fit = _TICKS * len(self) // ticks, _MOST_BYTES // largest
        size = max(1, min(of_a_second, that_fit, -(-len(self) // _FEWEST_PARTS)))
        columns = [*own_columns(self.plan), *figure_columns(kinds.values()), *last_columns()]
        self._contents = Contents(self._identity, len(self), size, columns)
        self.dataset.begin(self._contents)
        return self._contents

    def run(self, on_runs: OnRuns | None = None) -> Swept:
        """Run what is missing, and make one file when nothing is; Ctrl-C leaves what is done.

        Args:
            on_runs: Called with the number of runs of each batch that was written.

        Raises:
            ScenarioError: As in `check`.
        """
        contents = self.check()
        with interruptible() as stop, ThreadPoolExecutor(self._threads) as pool:
            missing = iter(self.dataset.missing(contents))
            running: dict[Future[list[dict[str, Any]] | None], int] = {}
            try:
                while True:
                    # one more than there are threads, so that none waits while rows are written
                    while len(running) <= self._threads and not stop.is_set():
                        part = next(missing, None)
                        if part is None:
                            break
                        running[pool.submit(self._shards.run, contents.indices(part), stop)] = part
                    if not running:
                        break
                    self._collect(contents, running, on_runs)
            except BaseException:  # a bug or a full disk: the other threads must not go on for nothing
                stop.set()
                raise
            if not (stop.is_set() or self.dataset.is_whole):
                self.dataset.merge(contents)
        self.dataset.clear()
        return Swept(contents, self.done, stop.is_set())

    def summary(self) -> Summary:
        """Return what the rows say that are there."""
        return summarize(self.dataset, self.check().columns, tuple(self.scenario.expect))

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
        prepared = self._shards.prepare(index, f"name={self.scenario.name}-{index}")
        return Job(prepared.scenario, self.folder)

    def _collect(
        self,
        contents: Contents,
        running: dict[Future[list[dict[str, Any]] | None], int],
        on_runs: OnRuns | None,
    ) -> None:
        """Write the rows of the batches that are done."""
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            part, rows = running.pop(future), future.result()
            if rows is None:
                continue
            self.dataset.write(contents, part, [typed(row, contents.columns) for row in rows])
            if on_runs is not None:
                on_runs(len(rows))


class _Problems:
    """What is wrong with which runs; what many have in common is told once."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.found, self.untold = plan, dict[str, list[int]](), 0

    def add(self, index: int, error: ScenarioError) -> None:
        for problem in error.problems:
            if problem in self.found:
                self.found[problem][1] += 1
            elif len(self.found) < _TOLD:
                self.found[problem] = [index, 1]
            else:
                self.untold += 1

    def raise_any(self) -> None:
        lines = []
        for problem, (first, count) in self.found.items():
            who = f"{count} runs, the first " * (count > 1) + self.plan.label(first)
            lines.append(problem if count == len(self.plan) else f"{who}: {problem}")
        if self.untold:
            lines.append(f"and {self.untold} more problems of other runs")
        if lines:
            raise ScenarioError(lines)


def _most_bytes(one: Prepared) -> int:
    """Return how much a run may record."""
    slow = one.scenario.control.slow.longest if one.scenario.control.at_singularity == "slow" else 1.0
    return int(slow * one.reference.ticks) * tick_type(one.arm.n).itemsize


def _each(values: float | tuple[float, ...]) -> tuple[float, ...]:
    return values if isinstance(values, tuple) else (values,)
