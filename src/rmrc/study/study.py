"""A study: variants of one scenario, prepared with shared parts, and the results of their runs.

    variants --prepare_all--> worlds --compile--> --step--> Result, one each

`run` and `statics --hold` are a study of one variant, `compare` of a few. `sweep` and `tune` prepare theirs
with it.
"""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, TypeAlias

from rmrc.results.columns import Divergence
from rmrc.results.expectations import Outcome, check, refuse_unknown
from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard
from rmrc.scenario import Change, Source, Variant, draft_of
from rmrc.simulation.prepare import Cache, Prepared, prepare
from rmrc.simulation.simulation import Simulation, Watcher
from rmrc.support.errors import Problem, ScenarioError

Values: TypeAlias = Mapping[str, Iterable[object]]
"""Values of keys, such as `{"control.feedback": [5, 10]}`, each as in a file."""

# Called with the number of newly finished runs.
OnRuns: TypeAlias = Callable[[int], None]

# Problems that are reported at once.
_MOST_PROBLEMS = 20


@dataclass(frozen=True, eq=False)
class Result:
    """The result of one variant.

    Attributes:
        prepared: The world of the run.
        run: The ticks so far.
        scorecard: Its metrics.
        outcomes: Outcomes of all expectations of its scenario.
        status: Its end: as in `ending`, or `interrupted`.
    """

    prepared: Prepared
    run: Run
    scorecard: Scorecard
    outcomes: tuple[Outcome, ...]
    status: str

    def facts(self) -> dict[str, Any]:
        """Return the facts about it, ready for strict JSON."""
        return {
            "status": self.status,
            "divergence": self.run.divergence and asdict(self.run.divergence),
            "scorecard": self.scorecard.nested(),
            "expect": [outcome.facts() for outcome in self.outcomes],
            "assumed": [*self.prepared.arm.notes, *(fact.text for fact in self.prepared.assumed)],
            "scenario": self.prepared.scenario.model_dump(mode="json"),
            "resting": [list(pair) for pair in self.run.resting],
        }


def ending(scorecard: Scorecard, divergence: Divergence | None) -> str:
    """Return the end of a run: `complete`, `diverged`, or `unfinished` at the time limit."""
    if divergence:
        return "diverged"
    return "complete" if scorecard["completed"].value == 1.0 else "unfinished"


class Study:
    """A scenario whose variants are prepared, by one thread at a time, and run."""

    def __init__(self, base: Source, cache: Cache | None = None) -> None:
        """Store the data common to all variants.

        Args:
            base: The scenario, its file, or a draft, which may be invalid as long as the variants are valid.
            cache: Earlier results, such as the arm.
        """
        self._base, self._cache = draft_of(base), cache or Cache()

    def prepare(self, changes: Sequence[Change] = ()) -> Prepared:
        """Return a validated variant.

        Args:
            changes: Changes that make it.

        Raises:
            ScenarioError: Lists its problems.
        """
        prepared = prepare(self._base.changed(*changes).scenario(), self._cache)
        refuse_unknown(prepared.scenario, prepared.arm.joints)
        return prepared

    def prepare_beside(self) -> list[Prepared]:
        """Return the validated scenario, and its baseline if it has one.

        Raises:
            ScenarioError: Lists the problems of the first that has some.
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
            ScenarioError: As in `validated`.
        """
        labels = [f'{word} "{variant.label}"' if word else variant.label for variant in variants]
        return list(validated(lambda i: self.prepare(variants[i].changes), len(labels), labels.__getitem__))

    def compile(self, worlds: Sequence[Prepared]) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds.

        Args:
            worlds: Worlds to run.
        """
        Simulation(worlds, keep_columns=False)

    def step(
        self, worlds: Sequence[Prepared], stop: threading.Event | None = None, watcher: Watcher | None = None
    ) -> list[Result]:
        """Return the results of a few variants, one after another on this thread, with all ticks.

        Args:
            worlds: The variants.
            stop: Event that ends the runs.
            watcher: Called with each block of ticks.

        Raises:
            ScenarioError: They do not fit into memory.
        """
        stop, results = stop or threading.Event(), list[Result]()
        runs = Simulation(worlds).run(watcher, stop)
        for world, run in zip(worlds, runs, strict=True):
            card = run.scorecard
            status = ending(card, run.divergence)
            status = "interrupted" if status == "unfinished" and stop.is_set() else status
            results.append(Result(world, run, card, tuple(check(card, world.scenario.expect)), status))
        return results


def validated(
    prepare: Callable[[int], Prepared], count: int, label: Callable[[int], str]
) -> Iterator[Prepared]:
    """Iterate over variants that are valid; at the end, raise the problems of the others.

    Args:
        prepare: Returns a variant by index, or raises its problems.
        count: Number of variants.
        label: Returns the name of a variant in messages.

    Raises:
        ScenarioError: Lists the problems, each once, with the first variant that has it, unless all have it.
    """
    problems = dict[Problem, list[int]]()
    for index in range(count):
        try:
            yield prepare(index)
        except ScenarioError as error:
            for problem in error.problems:
                problems.setdefault(problem, []).append(index)
    lines = list[Problem]()
    for problem, indices in list(problems.items())[:_MOST_PROBLEMS]:
        who = label(indices[0]) + (f" and {len(indices) - 1} more" if len(indices) > 1 else "")
        lines.append(problem._replace(who="" if len(indices) == count else who))
    if len(problems) > _MOST_PROBLEMS:
        lines.append(Problem((), f"and {len(problems) - _MOST_PROBLEMS} more problems of other variants"))
    if lines:
        raise ScenarioError(lines)
