"""A study: variants of one scenario, prepared with shared parts, and the results of their runs.

    variants --prepare_all--> worlds --compile--> --step or watch--> Result, one each

`run` and `statics --hold` are a study of one variant, `compare` of a few, `sweep` of thousands, and `tune`
uses one for its trials. Watchers receive the ticks: for progress, a recording, or a rule that stops.
"""

import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any

from rmrc.results.columns import Divergence
from rmrc.results.expectations import Outcome, check, refuse_unknown
from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard
from rmrc.scenario import Change, Draft, Scenario, Source, Variant, draft_of
from rmrc.simulation.prepare import Cache, Prepared, prepare
from rmrc.simulation.simulation import Simulation, Watcher
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Problem

# Called with the number of newly finished runs.
OnRuns = Callable[[int], None]


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
    """

    index: int
    prepared: Prepared
    scorecard: Scorecard
    outcomes: tuple[Outcome, ...]
    divergence: Divergence | None
    interrupted: bool

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


class Study:
    """A scenario whose variants are prepared, by one thread at a time, and run."""

    def __init__(self, base: Source, cache: Cache | None = None) -> None:
        """Store the data common to all variants.

        Args:
            base: The scenario, its file, or a draft, which may be invalid as long as the variants are valid.
            cache: Earlier results, such as the arm.
        """
        self._base = base if isinstance(base, Scenario) else draft_of(base)
        self._cache = cache or Cache()
        if isinstance(self._base, Draft):
            with suppress(ScenarioError):  # each variant reports it
                self._base = self._base.scenario()

    def prepare(self, changes: Sequence[Change] = ()) -> Prepared:
        """Return a validated variant.

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
        world = self.prepare()
        if not world.scenario.baseline:
            return [world]
        try:
            return [world, self.prepare(world.scenario.baseline_changes)]
        except ScenarioError as error:
            problems = [p if "baseline" in str(p) else p._replace(who="baseline") for p in error.problems]
            raise ScenarioError(problems) from None

    def prepare_all(self, variants: Sequence[Variant], word: str = "variant") -> list[Prepared]:
        """Return a few variants, validated and ready to run.

        Args:
            variants: All of them.
            word: Word before a label in messages.

        Raises:
            ScenarioError: Lists the problems of all variants; a problem of every variant appears once.
        """
        worlds, problems = list[Prepared](), dict[Problem, list[str]]()
        for label, changes in variants:
            try:
                worlds.append(self.prepare(changes))
            except ScenarioError as error:
                for problem in error.problems:
                    problems.setdefault(problem, []).append(f'{word} "{label}"' if word else label)
        if problems:
            raise ScenarioError(
                problem._replace(who=name)
                for problem, names in problems.items()
                for name in ([""] if len(names) == len(variants) else names)
            )
        return worlds

    def of(self, changes: Sequence[Change]) -> "Study":
        """Return the study of a variant, which shares earlier results.

        Args:
            changes: Changes that make it.

        Raises:
            ScenarioError: Lists its problems.
        """
        return Study(self.prepare(changes).scenario, self._cache)

    def compile(self, worlds: Sequence[Prepared]) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds.

        Args:
            worlds: Worlds to run.
        """
        Simulation(worlds, keep_columns=False)

    def step(
        self,
        worlds: Sequence[Prepared],
        stop: threading.Event | None = None,
        watchers: Iterable[Watcher] = (),
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
        results = _results(simulation, worlds, stop)
        return [Ran(**vars(result), run=run) for result, run in zip(results, runs, strict=True)]

    def watch(
        self,
        worlds: Sequence[Prepared],
        watcher: Watcher | None,
        stop: threading.Event,
        threads: int = 1,
    ) -> list[Result]:
        """Return the results of a few variants; only a watcher sees their ticks.

        Args:
            worlds: The variants.
            watcher: Called with each block of ticks, from any thread, one call at a time; None: nobody.
            stop: Event that ends the runs.
            threads: Number of threads.

        Raises:
            ScenarioError: They do not fit into memory.
        """
        simulation = Simulation(worlds, threads, keep_columns=False)
        simulation.step(watcher, stop)
        return _results(simulation, worlds, stop)


def _results(simulation: Simulation, worlds: Sequence[Prepared], stop: threading.Event) -> list[Result]:
    """Return the results of a simulation."""
    ends = zip(worlds, simulation.scorecards(), simulation.divergences(), strict=True)
    return [
        Result(index, world, card, tuple(check(card, world.scenario.expect)), divergence, stop.is_set())
        for index, (world, card, divergence) in enumerate(ends)
    ]
