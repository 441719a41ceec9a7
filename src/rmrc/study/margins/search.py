"""Find the stability limit of a loop: run settings in parallel, on a grid that closes in on the limit."""

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

from rmrc.scenario import Change, Scenario, changes_of
from rmrc.study.margins.ringing import Judged, judged, lateness
from rmrc.study.study import OnRuns, Study
from rmrc.textbook.stability import edge_delay, edge_gain, edge_lag

# The first round lies around the limit of the ideal plant. Then points between the two nearest to the limit
# follow, as many as the accuracy needs and at most this many, until these two differ by less than the
# accuracy. A sparing search has fewer at a time, and begins a little lower, where the limit of lagging
# actuators is.
_GRID, _FEW = (0.6, 0.77, 0.9, 1.0, 1.15, 1.4, 2.0), (0.91, 0.954, 1.0)
_POINTS = 6
ACCURACY = 0.02
# Steps are finer than the accuracy by this share, so that rounding needs no further round.
_ROUNDING = 1e-9
# A dead time is at most this share of the path's duration.
_SHARE = 0.9
# Where the limit is not near, each round continues by these factors, up to this multiple of the limit of the
# ideal plant, and down to this share of the feedback as written.
_STEPS, _FEW_STEPS = (1.5, 2.25, 3.4, 5.0), (1.15, 1.5)
_BEYOND, _LOWEST = 10.0, 0.01
# With this share of the ideal plant's limit, a loop shows its stability quickly.
_QUICK = 0.25


class Edge(NamedTuple):
    """Interval that contains the limit.

    Attributes:
        low: Highest value up to which the loop is stable; 0: none.
        high: Lowest unstable value; infinite: none was found.
    """

    low: float
    high: float

    @property
    def value(self) -> float:
        """The limit: the geometric mean of both bounds, or the only bound."""
        return math.sqrt(self.low * self.high) if self.is_found else max(self.low, 0.0) or self.high

    @property
    def is_found(self) -> bool:
        """Whether both bounds exist."""
        return self.low > 0.0 and self.high < math.inf


@dataclass
class Search:
    """The search for one limit, along one direction.

    Attributes:
        changes: Function from a factor to the changes of its setting.
        guess: Guess of the limit.
        most: Largest factor of the search.
        least: Smallest factor.
        value: Function from a factor to the reported value: the factor itself, or a time [s].
        accuracy: Relative, of the factor.
        is_sparing: Whether to take more rounds of fewer runs.
        first: First factors of a sparing search, relative to the guess.
        stable: A factor with which the loop was found stable before; 0: none.
        known: Judgments, by factor.
    """

    changes: Callable[[float], tuple[Change, ...]]
    guess: float
    most: float
    least: float
    value: Callable[[float], float] = float
    accuracy: float = ACCURACY
    is_sparing: bool = False
    first: tuple[float, ...] = _FEW
    stable: float = 0.0
    known: dict[float, Judged] = field(default_factory=dict)

    @property
    def edge(self) -> Edge:
        """The present interval."""
        high = min((one for one, found in self.known.items() if found.is_unstable), default=math.inf)
        return Edge(max((one for one in (*self.known, self.stable) if one < high), default=0.0), high)

    @property
    def tried(self) -> list[tuple[float, Judged]]:
        """Each tried value with its judgment, by rising value."""
        return [(self.value(factor), self.known[factor]) for factor in sorted(self.known)]

    def next(self) -> list[float]:
        """Return the factors to try next; none: the limit is known, or is out of bounds."""
        low, high = self.edge
        steps = _FEW_STEPS if self.is_sparing else _STEPS
        if self.known.keys() <= {1.0} and not high <= 1.0 <= self.guess:
            wanted = [self.guess * share for share in (self.first if self.is_sparing else _GRID)]
        elif low == 0.0:
            wanted = [high / step for step in steps] if high > self.least else []
        elif high == math.inf:
            wanted = [low * step for step in steps] if low < self.most else []
        elif high > low * (1.0 + self.accuracy):
            parts = math.ceil(math.log(high / low) / math.log1p(self.accuracy) + _ROUNDING)
            parts = min(parts, 2 if self.is_sparing else _POINTS + 1)
            wanted = list(np.geomspace(low, high, parts + 1)[1:-1])
        else:
            return []
        within = (float(min(max(one, self.least), self.most)) for one in wanted)
        return [one for one in dict.fromkeys(within) if one not in self.known]


def gain(scenario: Scenario, base: Sequence[Change] = ()) -> Search:
    """Return the search for the factor on control.feedback."""
    period, feedback = scenario.control.period, scenario.control.feedback
    guess = edge_gain(period, *lateness(scenario)) / feedback

    def changes(factor: float) -> tuple[Change, ...]:
        return (*base, *changes_of({"control.feedback": feedback * factor}))

    return Search(changes, guess, _BEYOND * max(1.0, guess), min(_LOWEST, 0.1 * guess))


def delay(scenario: Scenario, longest: float, base: Sequence[Change] = ()) -> Search:
    """Return the search for a longer dead time, by the factor on the total lateness of commands.

    Args:
        scenario: The scenario.
        longest: Duration of its path [s]: with this dead time, no command arrives during the run.
        base: Changes from the study's scenario.
    """
    ideal, own = edge_delay(*_loop(scenario)[:2], lateness(scenario)[1]), scenario.plant.delay

    def changes(factor: float) -> tuple[Change, ...]:
        return (*base, *changes_of({"plant.delay": own + added(scenario, factor)}))

    search = _later(scenario, ideal - own, changes)
    search.most = max(1.0, min(search.most, 1.0 + (_SHARE * longest - own) / _loop(scenario)[2]))
    return search


def lag(scenario: Scenario, base: Sequence[Change] = ()) -> Search:
    """Return the search for a longer lag of all joints, by the factor on the total lateness of commands."""
    longest = edge_lag(*_loop(scenario)[:2], lateness(scenario)[0])
    own = np.atleast_1d(scenario.plant.lag)

    def changes(factor: float) -> tuple[Change, ...]:
        lags = [float(one) for one in own + added(scenario, factor)]
        return (*base, *changes_of({"plant.lag": lags if len(lags) > 1 else lags[0]}))

    search = _later(scenario, longest - own.max(), changes)
    if longest == math.inf:  # if the equation has no limit, there may be none up to the largest value
        search.first = (search.most / search.guess,)
    return search


def close_in(
    study: Study,
    searches: Sequence[Search],
    stop: threading.Event,
    threads: int = 1,
    on_runs: OnRuns | None = None,
) -> None:
    """Continue searches in parallel until each has its limit, or until interrupted.

    Args:
        study: Study of the scenario.
        searches: Searches, updated in place.
        stop: Event that ends the runs.
        threads: Number of threads.
        on_runs: Called after each round with its number of runs.

    Raises:
        ScenarioError: A setting is wrong, or they do not fit into memory.
    """
    while not stop.is_set():
        wanted = [(search, factor) for search in searches for factor in search.next()]
        if not wanted:
            return
        worlds = [study.prepare(search.changes(factor)) for search, factor in wanted]
        for (search, factor), one in zip(wanted, judged(study, worlds, stop, threads), strict=True):
            if one is not None:
                search.known[factor] = one
        if on_runs is not None:
            on_runs(2 * len(wanted))


def bears(
    study: Study,
    settings: Sequence[Sequence[Change]],
    factor: float = 2.0,
    *,
    threads: int = 1,
    stop: threading.Event | None = None,
) -> list[bool | None]:
    """Return whether loops stay stable with their feedback times a factor; None if interrupted.

    Takes two runs each. Slow ringing takes long to detect, so a loop with little feedback is judged with more
    feedback first, which implies stability with less; only if that fails is it judged as given.

    Args:
        study: Study of the scenario.
        settings: Changes that make each setting; with a positive feedback.
        factor: On `control.feedback`.
        threads: Number of threads.
        stop: Event that ends the runs.

    Raises:
        ScenarioError: A setting is wrong, or they do not fit into memory.
    """
    searches = [gain(study.prepare(one).scenario, one) for one in settings]
    stop = stop or threading.Event()

    def judge(which: Sequence[int], factors: Sequence[float]) -> list[bool | None]:
        worlds = [study.prepare(searches[i].changes(by)) for i, by in zip(which, factors, strict=True)]
        return [None if one is None else not one.is_unstable for one in judged(study, worlds, stop, threads)]

    quick = [max(factor, _QUICK * one.guess) for one in searches]
    found = judge(range(len(searches)), quick)
    again = [i for i, one in enumerate(found) if one is False and quick[i] > factor]
    for i, one in zip(again, judge(again, [factor] * len(again)), strict=True):
        found[i] = one
    return found


def _loop(scenario: Scenario) -> tuple[float, float, float]:
    """Return feedback, period, and the total lateness of commands."""
    period = scenario.control.period
    return scenario.control.feedback, period, sum(lateness(scenario)) + 0.5 * period


def added(scenario: Scenario, factor: float) -> float:
    """Return the additional time that makes commands later by a factor [s]."""
    return (factor - 1.0) * _loop(scenario)[2]


def _later(scenario: Scenario, guess: float, changes: Callable[[float], tuple[Change, ...]]) -> Search:
    """Return a search for an additional time of commands."""
    late = _loop(scenario)[2]
    factor = 1.0 + max(guess, 0.0) / late
    if not factor < math.inf:
        factor = 1.0 + 1.0 / (scenario.control.feedback * late)
    return Search(changes, max(factor, 1.0 + ACCURACY), _BEYOND * factor, 1.0, partial(added, scenario))
