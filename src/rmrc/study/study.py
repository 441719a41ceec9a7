"""A study: variants of one scenario, checked and run in pieces; each is to the bit what it is alone.

    variants --prepare_all--> worlds --compile--> --step, watched--> Result, one each       a few, here
    variants --check--> Checked, and in pieces --step--> Result, one each --reduce, where they ran-->
        payload --Sink, here                                                              many, by a crew

`run` and `statics --hold` are a study of one, `compare` of a few, `sweep` of thousands, and `tune` asks one
for what it tries next. Watchers see the ticks of a few: progress, a recording, a rule that ends them. Who
works on the pieces of many is a crew of `rmrc.study.executors`, of threads or of other machines.
"""

import math
import sys
import threading
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from rmrc.plants.batches import Batches
from rmrc.results.columns import Divergence
from rmrc.results.run import Run
from rmrc.results.scorecard import Outcome, Scorecard, check, refuse_unknown
from rmrc.scenario import Change, Draft, Scenario, Source, Variant, draft_of
from rmrc.simulation.footprint import Footprint, footprint
from rmrc.simulation.prepare import Cache, Prepared, prepare
from rmrc.simulation.simulation import Rule, Simulation, Watcher
from rmrc.study.executors import Crew, done
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Problem

P = TypeVar("P")
P_co = TypeVar("P_co", covariant=True)

# Variants that are kept from their check until they are run: 30 MB. Small studies are then prepared once.
_KEPT = 1000

# Who is named of those that have a problem in common.
_NAMED = 50

# Variants that are checked as one piece, at first and at most: a tenth of a second, or some. Many pieces are
# for a cluster to schedule, a few for every thread to have something to do until the end.
_CHECKED, _MOST_CHECKED, _MANY, _PARTS = 100, 5000, 10_000, 16

OnRuns = Callable[[int], None]


class Variants(Protocol):
    """Which variants there are, each known by its index and by nothing else."""

    @property
    def most_told(self) -> int:
        """How many problems are told."""

    def __len__(self) -> int:
        """Return how many there are."""

    def changes(self, index: int) -> tuple[Change, ...]:
        """Return what makes one of them."""

    def named(self, indices: Sequence[int], count: int) -> list[str]:
        """Return how messages call those that have a problem in common.

        Args:
            indices: The first of them.
            count: How many they are.
        """


@dataclass(frozen=True)
class Listed:
    """A few variants, each of them named in messages.

    Attributes:
        variants: All of them.
        kind: What stands before the label, such as `variant`.
    """

    variants: Sequence[Variant]
    kind: str = ""

    @property
    def most_told(self) -> int:
        """As many as there are."""
        return sys.maxsize

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.variants)

    def changes(self, index: int) -> tuple[Change, ...]:
        """Return what makes one of them."""
        return self.variants[index].changes

    def named(self, indices: Sequence[int], count: int) -> list[str]:  # noqa: ARG002 - all are named
        """Return the label of each that has a problem."""
        labels = (self.variants[index].label for index in indices)
        return [f'{self.kind} "{label}"' if self.kind else label for label in labels]


@dataclass(frozen=True, eq=False)
class Result:
    """What came of one variant.

    Attributes:
        index: Of the variant.
        prepared: What was run.
        scorecard: Its figures.
        outcomes: Of the expectations that count: all that its scenario has.
        divergence: Where it diverged.
        interrupted: Whether the runs were ended from outside.
        ended: Whether a rule ended it before its time.
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
        """How it ended: `complete`, `diverged`, `interrupted`, or `unfinished` where its time was up."""
        if self.divergence:
            return "diverged"
        if self.scorecard["completed"].value == 1.0:
            return "complete"
        return "interrupted" if self.interrupted else "unfinished"

    def facts(self) -> dict[str, Any]:
        """Return what is known about it, ready for strict JSON."""
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
        run: They, as far as it came.
    """

    run: Run

    def facts(self) -> dict[str, Any]:
        """Return what is known about it, and who touches from the start, ready for strict JSON."""
        return super().facts() | {"resting": [list(pair) for pair in self.run.resting]}


class Reduce(Protocol[P_co]):
    """Makes what is kept of the results of a piece, where they were run: it is pickled, and what it makes."""

    def __call__(self, results: Sequence[Result]) -> P_co:
        """Return what is kept."""


class Sink(Protocol[P]):
    """What is kept of a study, here."""

    @property
    def reduce(self) -> Reduce[P]:
        """What makes it of the results of a piece."""

    def missing(self) -> Iterable[range]:
        """Return the pieces that are not there yet."""

    def keep(self, piece: range, payload: P) -> None:
        """Keep what came of a piece."""


@dataclass
class Checked:
    """What is known of some variants before they start.

    Attributes:
        runs: How many they are.
        problems: Who has it, the first of them, and how many have it, by what is wrong.
        kinds: The first of those that have the same figures, by what decides these.
        ticks: Of the references of all.
        longest: Of the longest of them.
        world: What a world takes of memory, at most.
    """

    runs: int = 0
    problems: dict[Problem, tuple[tuple[int, ...], int]] = field(default_factory=dict)
    kinds: dict[object, int] = field(default_factory=dict)
    ticks: int = 0
    longest: int = 0
    world: Footprint = field(default_factory=lambda: Footprint(0, 0))
    untold: int = 0

    def refuse(self, problem: Problem, indices: tuple[int, ...], count: int, most: int) -> None:
        """Keep what is wrong with some variants; beyond so many problems, only that there are more."""
        known, before = self.problems.get(problem, ((), 0))
        if before or len(self.problems) < most:
            self.problems[problem] = (*known, *indices)[:_NAMED], before + count
        else:
            self.untold += count

    def add(self, index: int, one: Prepared) -> None:
        """Take a variant into account that can be run."""
        self.kinds.setdefault(
            (one.arm.joints, tuple(one.arm.is_slide.tolist()), one.scenario.task.axes), index
        )
        self.ticks += one.reference.ticks
        self.longest = max(self.longest, one.reference.ticks)
        self.world = self.world.or_more(footprint([one], keep_columns=False))

    def extend(self, other: "Checked", most: int) -> None:
        """Take the variants into account that follow."""
        self.runs += other.runs
        for problem, (indices, count) in other.problems.items():
            self.refuse(problem, indices, count, most)
        self.kinds = other.kinds | self.kinds
        self.ticks += other.ticks
        self.longest = max(self.longest, other.longest)
        self.world = self.world.or_more(other.world)

    def raise_any(self, variants: Variants) -> None:
        """Raise what is wrong; what is wrong with every variant is told once.

        Raises:
            ScenarioError: If anything is.
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
    """A scenario of which variants are prepared and run; threads may share it.

    The law runs without the interpreter's lock. Preparation does not, and asks arms that are shared, so that
    one thread prepares at a time.
    """

    def __init__(self, base: Source, cache: Cache | None = None) -> None:
        """Keep what all variants share.

        Args:
            base: The scenario, its file, or a draft, which may be wrong as long as the variants are not.
            cache: What was found out before, such as the arm.
        """
        self._base = base if isinstance(base, Scenario) else draft_of(base)
        self._cache, self._batches = cache or Cache(), Batches()
        self._lock = threading.Lock()
        self._kept: dict[int, Prepared] = {}
        if isinstance(self._base, Draft):
            with suppress(ScenarioError):  # told of each variant
                self._base = self._base.scenario()

    def prepare(self, changes: Sequence[Change] = ()) -> Prepared:
        """Return a variant, with everything checked; for one thread at a time.

        Args:
            changes: That make it.

        Raises:
            ScenarioError: All that is wrong with it.
        """
        base = self._base.changed(*changes) if changes else self._base
        prepared = prepare(base.scenario() if isinstance(base, Draft) else base, self._cache)
        refuse_unknown(prepared.scenario, prepared.arm.joints)
        return prepared

    def prepare_beside(self) -> list[Prepared]:
        """Return the scenario, and its baseline if it has one, with everything checked.

        Raises:
            ScenarioError: All that is wrong with either.
        """
        one = self.prepare()
        if not one.scenario.baseline:
            return [one]
        try:
            return [one, self.prepare(one.scenario.baseline_changes)]
        except ScenarioError as error:
            told = [p if "baseline" in str(p) else p._replace(who="baseline") for p in error.problems]
            raise ScenarioError(told) from None

    def _sound(self, index: int, changes: Sequence[Change], found: "Checked") -> Prepared | None:
        """Return a variant, or None: what is wrong with it is among what was found then."""
        try:
            return self.prepare(changes)
        except ScenarioError as error:
            for problem in error.problems:
                found.refuse(problem, (index,), 1, sys.maxsize)
            return None

    # A few variants, here --------------------------------------------------------------------

    def prepare_all(self, variants: Sequence[Variant], kind: str = "variant") -> list[Prepared]:
        """Return a few variants, checked and ready to run.

        Args:
            variants: All of them.
            kind: What messages say before a label.

        Raises:
            ScenarioError: All that is wrong with all of them; what is wrong with each is told once.
        """
        found = Checked()
        worlds = [self._sound(index, variant.changes, found) for index, variant in enumerate(variants)]
        found.raise_any(Listed(variants, kind))
        return [one for one in worlds if one is not None]

    def compile(self, worlds: Sequence[Prepared]) -> None:
        """Load the compiled law, or compile it the first time, which takes seconds.

        Args:
            worlds: That will be run, or one for each kind of them.
        """
        Simulation(worlds, keep_columns=False, batches=self._batches).release()

    def step(
        self,
        worlds: Sequence[Prepared],
        stop: threading.Event | None = None,
        watchers: Sequence[Watcher] = (),
    ) -> list[Ran]:
        """Return what comes of a few variants, stepped as one batch on this thread, with all their ticks.

        Args:
            worlds: The variants.
            stop: Once it is set, the runs end.
            watchers: Called with each block of ticks, one after another.

        Raises:
            ScenarioError: They do not fit into memory.
        """

        def watch(index: int, part: Run) -> None:
            for watcher in watchers:
                watcher(index, part)

        stop, simulation = stop or threading.Event(), Simulation(worlds, batches=self._batches)
        runs = simulation.run(watch if watchers else None, stop)
        results = _results(simulation, range(len(worlds)), worlds, stop)
        return [Ran(**vars(one), run=run) for one, run in zip(results, runs, strict=True)]

    def watch(
        self,
        worlds: Sequence[Prepared],
        watcher: Watcher,
        stop: threading.Event,
        threads: int = 1,
        columns: Collection[str] | None = None,
    ) -> list[Result]:
        """Return what comes of a few variants, stepped together; their ticks are for a watcher alone.

        Args:
            worlds: The variants.
            watcher: Called with each block of ticks, from any thread, one call at a time.
            stop: Once it is set, the runs end.
            threads: How many step their share of the variants.
            columns: That the watcher sees beside `time`; None: all, which takes longer.

        Raises:
            ScenarioError: They do not fit into memory.
        """
        with self._lock:
            simulation = Simulation(worlds, threads, keep_columns=False, batches=self._batches)
        simulation.step(watcher, stop, columns=columns)
        return _results(simulation, range(len(worlds)), worlds, stop)

    # Many variants, by a crew ----------------------------------------------------------------

    def check(self, variants: Variants, crew: Crew, on_runs: OnRuns | None = None) -> Checked:
        """Check every variant before the first one starts.

        Args:
            variants: All of them. Each study has one such plan; `results` finds what is prepared of it.
            crew: Who does it.
            on_runs: Called with the number of variants that were checked.

        Raises:
            ScenarioError: All that is wrong, with the variants that it is wrong with.
        """
        size = check_size(len(variants))
        pieces = (range(first, min(first + size, len(variants))) for first in range(0, len(variants), size))
        early, whole = dict[int, Checked](), Checked()
        with closing(done(crew, Check(variants), pieces, threading.Event())) as found:
            for piece, some in found:
                early[piece.start] = some
                while whole.runs in early:  # in order, so that the first to have a problem is named
                    whole.extend(early.pop(whole.runs), variants.most_told)
                if on_runs is not None:
                    on_runs(len(piece))
        whole.raise_any(variants)
        return whole

    def checked(self, variants: Variants, piece: range, stop: threading.Event) -> Checked | None:
        """Return what is known of some variants before they start, or None if that was interrupted.

        Args:
            variants: All of them.
            piece: Which.
            stop: Once it is set, this ends.
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
        """Return what comes of some variants, stepped as one batch on this thread; nothing if interrupted.

        Args:
            variants: All of them.
            piece: Which.
            stop: Once it is set, the runs end.
            rule: Ends runs before their time, by the indices of their variants.
        """
        with self._lock:
            prepared = [
                self._kept.pop(index) if index in self._kept else self.prepare(variants.changes(index))
                for index in piece
                if not stop.is_set()
            ]
            if stop.is_set():
                return []
            simulation = Simulation(prepared, keep_columns=False, batches=self._batches)
        of_variants: Rule | None = rule and (lambda some, seen: rule([piece[i] for i in some], seen))
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
        """Run what is missing in a sink; when it is stopped, what has ended is kept.

        Args:
            variants: All of them.
            crew: Who does it.
            into: What is kept.
            stop: Once it is set, the runs end.
            rule: Ends runs before their time, by the indices of their variants.
        """
        work = Runs(variants, into.reduce, rule)
        with closing(done(crew, work, iter(into.missing()), stop)) as found:
            for piece, payload in found:
                into.keep(piece, payload)


def _results(
    simulation: Simulation, indices: Iterable[int], worlds: Sequence[Prepared], stop: threading.Event
) -> list[Result]:
    """Return what a simulation came to, which lets go of what it was lent."""
    simulation.release()
    cards, ends, ended = simulation.scorecards(), simulation.divergences(), simulation.ended()
    return [
        Result(index, one, card, tuple(check(card, one.scenario.expect)), end, stop.is_set(), early)
        for index, one, card, end, early in zip(indices, worlds, cards, ends, ended, strict=True)
    ]


# What a crew does with the pieces of a study: pickled, for crews of other machines ------------------


@dataclass(frozen=True)
class Check:
    """Checks a piece."""

    variants: Variants

    def __call__(self, study: Study, piece: range, stop: threading.Event) -> Checked | None:
        """Return what is known of it."""
        return study.checked(self.variants, piece, stop)


@dataclass(frozen=True)
class Runs(Generic[P]):
    """Runs a piece."""

    variants: Variants
    reduce: Reduce[P]
    rule: Rule | None = None

    def __call__(self, study: Study, piece: range, stop: threading.Event) -> P | None:
        """Return what is kept of it, or None if it was interrupted."""
        results = study.results(self.variants, piece, stop, self.rule)
        return self.reduce(results) if results else None


def check_size(runs: int) -> int:
    """Return how many variants are checked as one piece.

    Args:
        runs: How many there are.
    """
    return min(max(_CHECKED, runs // _MANY), _MOST_CHECKED, math.ceil(runs / _PARTS))
