"""A study: variants of one scenario, checked and run in pieces; each has the bits of a separate run.

    variants --prepare_all--> worlds --compile--> --step, watched--> Result, one each       a few, here
    variants --check--> Checked, and in pieces --step--> Result, one each --reduce, where they ran-->
        payload --Sink, here                                                              many, by a crew

`run` and `statics --hold` are a study of one variant, `compare` of a few, `sweep` of thousands, and `tune`
uses one for its trials. Watchers receive the ticks of a few variants: progress, a recording, a stopping rule.
A crew of `rmrc.study.executors` works on the pieces of many, in threads or on other machines.
"""

import math
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, field
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from rmrc.results.columns import Divergence
from rmrc.results.expectations import Outcome, check, refuse_unknown
from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard
from rmrc.scenario import Change, Draft, Scenario, Source, Variant, draft_of
from rmrc.simulation.footprint import Array, footprint
from rmrc.simulation.prepare import Cache, Prepared, prepare
from rmrc.simulation.simulation import Rule, Simulation, Watcher
from rmrc.study.executors import Crew, done
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Problem

P = TypeVar("P")
P_co = TypeVar("P_co", covariant=True)

# Variants that are kept from their check until their run: 30 MB. Small studies are then prepared once.
_KEPT = 1000

# Number of variants to name for a common problem.
_NAMED = 50

# Variants that are checked as one piece, at first and at most: a tenth of a second, or some. A cluster must
# schedule many pieces; a few suffice to keep every thread busy until the end.
_CHECKED, _MOST_CHECKED, _MANY, _PARTS = 100, 5000, 10_000, 16

OnRuns = Callable[[int], None]


class Variants(Protocol):
    """The variants, each identified by its index alone."""

    @property
    def most_told(self) -> int:
        """Number of problems to report."""

    def __len__(self) -> int:
        """Return the number of variants."""

    def changes(self, index: int) -> tuple[Change, ...]:
        """Return the changes that make one of them."""

    def named(self, indices: Sequence[int], count: int) -> list[str]:
        """Return the words for variants with a common problem.

        Args:
            indices: Indices of the first of them.
            count: Their number.
        """


@dataclass(frozen=True)
class Listed:
    """A few variants, each with a label for messages.

    Attributes:
        variants: All of them.
        kind: Word before the label, such as `variant`.
    """

    variants: Sequence[Variant]
    kind: str = ""

    @property
    def most_told(self) -> int:
        """The number of variants."""
        return sys.maxsize

    def __len__(self) -> int:
        """Return the number of variants."""
        return len(self.variants)

    def changes(self, index: int) -> tuple[Change, ...]:
        """Return the changes that make one of them."""
        return self.variants[index].changes

    def named(self, indices: Sequence[int], count: int) -> list[str]:  # noqa: ARG002 - all are named
        """Return the label of each variant with a problem."""
        labels = (self.variants[index].label for index in indices)
        return [f'{self.kind} "{label}"' if self.kind else label for label in labels]


@dataclass(frozen=True, eq=False)
class Result:
    """The result of one variant.

    Attributes:
        index: Index of the variant.
        prepared: The world of the run.
        scorecard: Its metrics.
        outcomes: Outcomes of the expectations that count: all that its scenario has.
        divergence: Time and cause of its divergence.
        interrupted: Whether the runs were interrupted.
        ended: Whether a rule ended it early.
    """

    index: int
    prepared: Prepared
    scorecard: Scorecard
    outcomes: tuple[Outcome, ...]
    divergence: Divergence | None
    interrupted: bool
    ended: bool

    @property
    def status(self) -> str:
        """Its end: `complete`, `diverged`, `interrupted`, or `unfinished` at the time limit."""
        if self.divergence:
            return "diverged"
        if self.scorecard["completed"].value == 1.0:
            return "complete"
        return "interrupted" if self.interrupted else "unfinished"

    def facts(self) -> dict[str, Any]:
        """Return the facts about it, ready for strict JSON."""
        return {
            "status": self.status,
            "divergence": self.divergence and asdict(self.divergence),
            "scorecard": self.scorecard.nested(),
            "expect": [outcome.facts() for outcome in self.outcomes],
            "assumed": [*self.prepared.arm.notes, *(one.text for one in self.prepared.assumed)],
            "scenario": self.prepared.scenario.model_dump(mode="json"),
        }


@dataclass(frozen=True, eq=False)
class Ran(Result):
    """A result with all its ticks.

    Attributes:
        run: The ticks so far.
    """

    run: Run

    def facts(self) -> dict[str, Any]:
        """Return the facts about it, including contacts at the start, ready for strict JSON."""
        return super().facts() | {"resting": [list(pair) for pair in self.run.resting]}


class Reduce(Protocol[P_co]):
    """Reduces the results of a piece on the worker; it and its result must be picklable."""

    def __call__(self, results: Sequence[Result]) -> P_co:
        """Return the reduced results."""


class Sink(Protocol[P]):
    """Destination for the results of a study, in this process."""

    @property
    def reduce(self) -> Reduce[P]:
        """The function that reduces the results of a piece."""

    def missing(self) -> Iterable[range]:
        """Return the missing pieces."""

    def keep(self, piece: range, payload: P) -> None:
        """Store the result of a piece."""


@dataclass
class Checked:
    """Facts about variants before they start.

    Attributes:
        runs: Their number.
        problems: For each problem, the first variants with it, and their number.
        kinds: The first variant of each kind with equal metrics, by the kind's key.
        ticks: Ticks of the references of all.
        longest: Ticks of the longest reference.
        world: Largest memory of a world, see `rmrc.simulation.footprint`, (2,) [B].
    """

    runs: int = 0
    problems: dict[Problem, tuple[tuple[int, ...], int]] = field(default_factory=dict)
    kinds: dict[object, int] = field(default_factory=dict)
    ticks: int = 0
    longest: int = 0
    world: Array = field(default_factory=lambda: np.zeros(2))
    untold: int = 0

    def refuse(self, problem: Problem, indices: tuple[int, ...], count: int, most: int) -> None:
        """Add a problem of some variants; beyond the reported number, only count."""
        known, before = self.problems.get(problem, ((), 0))
        if before or len(self.problems) < most:
            self.problems[problem] = (*known, *indices)[:_NAMED], before + count
        else:
            self.untold += count

    def add(self, index: int, one: Prepared) -> None:
        """Add a valid variant."""
        self.kinds.setdefault(
            (one.arm.joints, tuple(one.arm.is_slide.tolist()), one.scenario.task.axes), index
        )
        self.ticks += one.reference.ticks
        self.longest = max(self.longest, one.reference.ticks)
        self.world = np.maximum(self.world, footprint([one], keep_columns=False))

    def extend(self, other: "Checked", most: int) -> None:
        """Add the facts of the following variants."""
        self.runs += other.runs
        for problem, (indices, count) in other.problems.items():
            self.refuse(problem, indices, count, most)
        self.kinds = other.kinds | self.kinds
        self.ticks += other.ticks
        self.longest = max(self.longest, other.longest)
        self.world = np.maximum(self.world, other.world)

    def raise_any(self, variants: Variants) -> None:
        """Raise the problems; a problem of every variant appears once.

        Raises:
            ScenarioError: There is a problem.
        """
        told = list[Problem]()
        for problem, (indices, count) in self.problems.items():
            who = [""] if count == len(variants) else variants.named(indices, count)
            told += [problem._replace(who=one) for one in who]
        if self.untold:
            told.append(Problem((), f"and {self.untold} more problems of other runs"))
        if told:
            raise ScenarioError(told)


class Study:
    """A scenario whose variants are prepared and run; threads may share it.

    The law releases the interpreter's lock. Preparation holds it and uses shared arms, so one thread prepares
    at a time.
    """

    def __init__(self, base: Source, cache: Cache | None = None) -> None:
        """Store the data common to all variants.

        Args:
            base: The scenario, its file, or a draft, which may be invalid as long as the variants are valid.
            cache: Earlier results, such as the arm.
        """
        self._base = base if isinstance(base, Scenario) else draft_of(base)
        self._cache = cache or Cache()
        self._lock = threading.Lock()
        self._kept: dict[int, Prepared] = {}
        if isinstance(self._base, Draft):
            with suppress(ScenarioError):  # each variant reports it
                self._base = self._base.scenario()

    def prepare(self, changes: Sequence[Change] = ()) -> Prepared:
        """Return a validated variant; for one thread at a time.

        Args:
            changes: Changes that make it.

        Raises:
            ScenarioError: Lists its problems.
        """
        base = self._base.changed(*changes) if changes else self._base
        prepared = prepare(base.scenario() if isinstance(base, Draft) else base, self._cache)
        refuse_unknown(prepared.scenario, prepared.arm.joints)
        return prepared

    def prepare_beside(self) -> list[Prepared]:
        """Return the validated scenario, and its baseline if it has one.

        Raises:
            ScenarioError: Lists the problems of both.
        """
        one = self.prepare()
        if not one.scenario.baseline:
            return [one]
        try:
            return [one, self.prepare(one.scenario.baseline_changes)]
        except ScenarioError as error:
            told = [p if "baseline" in str(p) else p._replace(who="baseline") for p in error.problems]
            raise ScenarioError(told) from None

    def of(self, changes: Sequence[Change]) -> "Study":
        """Return the study of a variant, which shares earlier results.

        Args:
            changes: Changes that make it.

        Raises:
            ScenarioError: Lists its problems.
        """
        return Study(self.prepare(changes).scenario, self._cache)

    def _sound(self, index: int, changes: Sequence[Change], found: "Checked") -> Prepared | None:
        """Return a variant, or None if it has a problem, which `check` has already reported."""
        try:
            return self.prepare(changes)
        except ScenarioError as error:
            for problem in error.problems:
                found.refuse(problem, (index,), 1, sys.maxsize)
            return None

    # A few variants, here --------------------------------------------------------------------

    def prepare_all(self, variants: Sequence[Variant], kind: str = "variant") -> list[Prepared]:
        """Return a few variants, validated and ready to run.

        Args:
            variants: All of them.
            kind: Word before a label in messages.

        Raises:
            ScenarioError: Lists the problems of all variants; a problem of every variant appears once.
        """
        found = Checked()
        worlds = [self._sound(index, variant.changes, found) for index, variant in enumerate(variants)]
        found.raise_any(Listed(variants, kind))
        return [one for one in worlds if one is not None]

    def compile(self, worlds: Sequence[Prepared]) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds.

        Args:
            worlds: Worlds to run, or one of each kind.
        """
        Simulation(worlds, keep_columns=False)

    def step(
        self,
        worlds: Sequence[Prepared],
        stop: threading.Event | None = None,
        watchers: Sequence[Watcher] = (),
    ) -> list[Ran]:
        """Return the results of a few variants, one after another on this thread, with all ticks.

        Args:
            worlds: The variants.
            stop: Event that ends the runs.
            watchers: Called with each block of ticks, one after another.

        Raises:
            ScenarioError: They do not fit into memory.
        """

        def watch(index: int, part: Run) -> None:
            for watcher in watchers:
                watcher(index, part)

        stop, simulation = stop or threading.Event(), Simulation(worlds)
        runs = simulation.run(watch if watchers else None, stop)
        results = _results(simulation, range(len(worlds)), worlds, stop)
        return [Ran(**vars(one), run=run) for one, run in zip(results, runs, strict=True)]

    def watch(
        self,
        worlds: Sequence[Prepared],
        watcher: Watcher,
        stop: threading.Event,
        threads: int = 1,
    ) -> list[Result]:
        """Return the results of a few variants; only a watcher sees their ticks.

        Args:
            worlds: The variants.
            watcher: Called with each block of ticks, from any thread, one call at a time.
            stop: Event that ends the runs.
            threads: Number of threads.

        Raises:
            ScenarioError: They do not fit into memory.
        """
        with self._lock:
            simulation = Simulation(worlds, threads, keep_columns=False)
        simulation.step(watcher, stop)
        return _results(simulation, range(len(worlds)), worlds, stop)

    # Many variants, by a crew ----------------------------------------------------------------

    def check(self, variants: Variants, crew: Crew, on_runs: OnRuns | None = None) -> Checked:
        """Validate every variant before the first one starts.

        Args:
            variants: All of them. Each study has one plan; `results` uses its prepared parts.
            crew: The workers.
            on_runs: Called with the number of newly validated variants.

        Raises:
            ScenarioError: Lists all problems, with the affected variants.
        """
        size = check_size(len(variants))
        pieces = (range(first, min(first + size, len(variants))) for first in range(0, len(variants), size))
        early, whole = dict[int, Checked](), Checked()
        with closing(done(crew, Check(variants), pieces, threading.Event())) as found:
            for piece, some in found:
                early[piece.start] = some
                while whole.runs in early:  # in order, so that the first variant with a problem is named
                    whole.extend(early.pop(whole.runs), variants.most_told)
                if on_runs is not None:
                    on_runs(len(piece))
        whole.raise_any(variants)
        return whole

    def checked(self, variants: Variants, piece: range, stop: threading.Event) -> Checked | None:
        """Return the facts about some variants before they start, or None if interrupted.

        Args:
            variants: All of them.
            piece: Indices of the variants.
            stop: Event that ends this.
        """
        found = Checked(len(piece))
        with self._lock:
            for index in piece:
                if stop.is_set():
                    return None
                one = self._sound(index, variants.changes(index), found)
                if one is None:
                    continue
                found.add(index, one)
                if len(self._kept) < _KEPT and not one.scenario.arm.stretch:  # stretched arms are large
                    self._kept[index] = one
        return found

    def results(
        self, variants: Variants, piece: range, stop: threading.Event, rule: Rule | None = None
    ) -> list[Result]:
        """Return the results of some variants, one after another on this thread; none if interrupted.

        Args:
            variants: All of them.
            piece: Indices of the variants.
            stop: Event that ends the runs.
            rule: Rule that ends runs early, by the indices of their variants.
        """
        with self._lock:
            prepared = [
                self._kept.pop(index) if index in self._kept else self.prepare(variants.changes(index))
                for index in piece
                if not stop.is_set()
            ]
            if stop.is_set():
                return []
            simulation = Simulation(prepared, keep_columns=False)
        of_variants: Rule | None = rule and (lambda index, run: rule(piece[index], run))
        simulation.step(stop=stop, rule=of_variants)
        return [] if stop.is_set() else _results(simulation, piece, prepared, stop)

    def run(
        self,
        variants: Variants,
        crew: Crew,
        into: Sink[P],
        stop: threading.Event,
        rule: Rule | None = None,
    ) -> None:
        """Run the missing pieces of a sink; after a stop, finished pieces are kept.

        Args:
            variants: All of them.
            crew: The workers.
            into: Destination of the results.
            stop: Event that ends the runs.
            rule: Rule that ends runs early, by the indices of their variants.
        """
        work = Runs(variants, into.reduce, rule)
        with closing(done(crew, work, iter(into.missing()), stop)) as found:
            for piece, payload in found:
                into.keep(piece, payload)


def _results(
    simulation: Simulation, indices: Iterable[int], worlds: Sequence[Prepared], stop: threading.Event
) -> list[Result]:
    """Return the results of a simulation."""
    cards, ends, ended = simulation.scorecards(), simulation.divergences(), simulation.ended()
    return [
        Result(index, one, card, tuple(check(card, one.scenario.expect)), end, stop.is_set(), early)
        for index, one, card, end, early in zip(indices, worlds, cards, ends, ended, strict=True)
    ]


# Work of a crew on the pieces of a study: pickled, for crews of other machines --------------------


@dataclass(frozen=True)
class Check:
    """Checks a piece."""

    variants: Variants

    def __call__(self, study: Study, piece: range, stop: threading.Event) -> Checked | None:
        """Return the facts about it."""
        return study.checked(self.variants, piece, stop)


@dataclass(frozen=True)
class Runs(Generic[P]):
    """Runs a piece."""

    variants: Variants
    reduce: Reduce[P]
    rule: Rule | None = None

    def __call__(self, study: Study, piece: range, stop: threading.Event) -> P | None:
        """Return its reduced results, or None if it was interrupted."""
        results = study.results(self.variants, piece, stop, self.rule)
        return self.reduce(results) if results else None


def check_size(runs: int) -> int:
    """Return the number of variants to validate per piece.

    Args:
        runs: Number of variants.
    """
    return min(max(_CHECKED, runs // _MANY), _MOST_CHECKED, math.ceil(runs / _PARTS))
