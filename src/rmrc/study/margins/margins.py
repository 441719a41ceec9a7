"""Margins of a scenario: how much more delay, lag and gain its loop tolerates before it is unstable.

Each limit is found by bisection of one factor: that of the feedback, or that of the total lateness of
commands, τ + T/2 + T₁. Threads search several limits at a time.
"""

import math
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rmrc.scenario import Change, Scenario, Source, changes_of
from rmrc.simulation.prepare import Prepared
from rmrc.study.margins.ringing import Judged, judged, lateness
from rmrc.study.study import Study
from rmrc.support.brief import brief
from rmrc.support.errors import ScenarioError
from rmrc.support.interruption import interruptible
from rmrc.textbook.stability import edge_delay, edge_gain, edge_lag

# The relative accuracy of a limit, and its bounds: at its limit a loop takes forever to show on which side of
# it it is.
ACCURACY, _FINEST, _COARSEST = 0.02, 0.005, 0.5
# A search begins at this share of the ideal plant's limit: lags, limits and singularities leave less. Its
# first step from there is at least this long, and each is twice as long as the last, up to this multiple of
# the ideal plant's limit, and down to this share of the feedback.
_FIRST, _STEP, _BEYOND, _LOWEST = 0.9, 1.1, 10.0, 0.01
# A dead time is at most this share of the path's duration: with a longer one, no command arrives in time.
_SHARE = 0.9
# With this share of the ideal plant's limit, a loop shows its stability quickly.
_QUICK = 0.25

_NAMES = "gain", "delay", "lag"

OnRuns = Callable[[int], None]


class Edge(NamedTuple):
    """Interval that contains a limit.

    Attributes:
        low: Highest value up to which the loop is stable; 0: none.
        high: Lowest unstable value; infinite: none was found.
    """

    low: float
    high: float

    @property
    def value(self) -> float:
        """The limit: the geometric mean of both bounds, or the only bound."""
        return math.sqrt(self.low * self.high) if self.is_found else self.low or self.high

    @property
    def is_found(self) -> bool:
        """Whether both bounds exist."""
        return self.low > 0.0 and self.high < math.inf


@dataclass(frozen=True)
class Margin:
    """One stability margin of a loop.

    Attributes:
        name: `gain`, a factor on control.feedback; `delay` or `lag`, an additional time [s].
        edge: Interval in which the loop becomes unstable; infinite above: no limit was found.
        bound: Largest value of the search.
        ideal: Limit of the ideal plant, by equation; infinite if any value is stable.
        rule: Value by the rule of thumb; below 1, or negative, if it allows less than the scenario has.
        tried: Each tried value with its judgment, by rising value.
    """

    name: str
    edge: Edge
    bound: float
    ideal: float
    rule: float
    tried: tuple[tuple[float, Judged], ...]

    @property
    def value(self) -> float:
        """The margin: the limit, or the largest stable value if none was found."""
        return self.edge.value


@brief
@dataclass(frozen=True)
class Margins:
    """The margins of a scenario.

    Attributes:
        scenario: The scenario.
        late: Dead time of its commands, and the longest lag [s].
        written: Judgment of the loop as written; None: interrupted before.
        gain: Factor on control.feedback at the limit; below 1 if the loop is unstable as written.
        delay: Dead time that can be added [s]; None if the loop is unstable as written.
        lag: Lag that can be added at every joint [s]; None as for `delay`.
        runs: Number of runs.
        interrupted: Whether Ctrl-C ended the search.
    """

    scenario: Scenario
    late: tuple[float, float]
    written: Judged | None
    gain: Margin
    delay: Margin | None
    lag: Margin | None
    runs: int
    interrupted: bool

    @property
    def is_stable(self) -> bool:
        """Whether the loop is stable as written."""
        return self.written is not None and not self.written.is_unstable

    @property
    def all(self) -> tuple[Margin, ...]:
        """All margins of the loop."""
        return tuple(one for one in (self.gain, self.delay, self.lag) if one is not None)


def margins(
    scenario: Source,
    *,
    accuracy: float = ACCURACY,
    threads: int | None = None,
    on_runs: OnRuns | None = None,
) -> Margins:
    """Find by simulation how much more gain, delay and lag a loop tolerates before it is unstable.

    The function behind `rmrc margins`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        accuracy: Relative accuracy of the limits: of the gain, and of the total lateness of commands.
        threads: Number of threads; None: one per core.
        on_runs: Called after each tried setting with its number of runs.

    Returns:
        The margins; Ctrl-C ends the search and keeps the results so far.

    Raises:
        ScenarioError: Lists all problems, before the first run; or a run does not fit into memory.
        KeyboardInterrupt: Ctrl-C before the first run.
    """
    if not _FINEST <= accuracy <= _COARSEST:
        wrong = f"must be between {_FINEST:g} and {_COARSEST:g}, got {accuracy:g}"
        raise ScenarioError.about("--accuracy", wrong)
    study, threads = Study(scenario), threads or os.cpu_count() or 1
    prepared = study.prepare()
    if prepared.scenario.control.feedback == 0.0:
        wrong = "must be > 0, got 0: a loop without feedback cannot be unstable"
        raise ScenarioError([prepared.scenario.problem("control.feedback", wrong)])
    study.compile([prepared])
    with interruptible() as stop:
        return margins_of(study, [()], stop, accuracy=accuracy, threads=threads, on_runs=on_runs)[0]


def margins_of(
    study: Study,
    settings: Sequence[Sequence[Change]],
    stop: threading.Event,
    *,
    accuracy: float = ACCURACY,
    threads: int = 1,
    on_runs: OnRuns | None = None,
) -> list[Margins]:
    """Return the margins of several settings of a scenario.

    Args:
        study: Study of the scenario.
        settings: Changes that make each setting, with a positive feedback.
        stop: Event that ends the runs.
        accuracy: Relative accuracy of the limits.
        threads: Number of threads.
        on_runs: Called after each tried setting with its number of runs.

    Raises:
        ScenarioError: A setting is wrong, or a run does not fit into memory.
    """
    judge = _Judge(study, stop, on_runs)
    loops = [_Loop(judge.prepare(base), base) for base in settings]
    with ThreadPoolExecutor(threads) as pool:
        written = pool.map(lambda loop: judge(loop.changes("gain", 1.0)), loops)
        for loop, judgment in zip(loops, written, strict=True):
            if judgment is not None:
                loop.begin(judgment)
        searches = [(loop, name) for loop in loops for name in loop.tried if loop.written]
        list(pool.map(lambda search: _close_in(judge, accuracy, *search), searches))
    return [loop.margins(is_interrupted=stop.is_set()) for loop in loops]


def bears(
    study: Study,
    settings: Sequence[Sequence[Change]],
    factor: float = 2.0,
    *,
    threads: int = 1,
    stop: threading.Event | None = None,
) -> list[bool | None]:
    """Return whether loops stay stable with their feedback times a factor; None if interrupted.

    Slow ringing takes long to detect, so a loop with little feedback is judged with more feedback first,
    which implies stability with less; only if that fails is it judged as given.

    Args:
        study: Study of the scenario.
        settings: Changes that make each setting; with a positive feedback.
        factor: On `control.feedback`.
        threads: Number of threads.
        stop: Event that ends the runs.

    Raises:
        ScenarioError: A setting is wrong, or a run does not fit into memory.
    """
    judge = _Judge(study, stop or threading.Event())

    def is_borne(base: Sequence[Change]) -> bool | None:
        loop, judgment = _Loop(judge.prepare(base), base), None
        for by in dict.fromkeys((max(factor, _QUICK * loop.ideal("gain")), factor)):
            judgment = judge(loop.changes("gain", by))
            if judgment is None or not judgment.is_unstable:
                break
        return None if judgment is None else not judgment.is_unstable

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(is_borne, settings))


class _Judge:
    """Judges settings of a scenario, from any thread; one prepares at a time."""

    def __init__(self, study: Study, stop: threading.Event, on_runs: OnRuns | None = None) -> None:
        self._study, self._stop, self._on_runs, self._lock = study, stop, on_runs, threading.Lock()

    def prepare(self, changes: Sequence[Change]) -> Prepared:
        with self._lock:
            return self._study.prepare(changes)

    def __call__(self, changes: Sequence[Change]) -> Judged | None:
        judgment = None if self._stop.is_set() else judged(self.prepare(changes), self._stop)
        with self._lock:
            if judgment and self._on_runs:
                self._on_runs(2)
        return judgment


class _Loop:
    """A loop, and the judgments of its search for each limit, by factor."""

    def __init__(self, prepared: Prepared, base: Sequence[Change]) -> None:
        self.scenario, self._base, self._duration = prepared.scenario, base, prepared.reference.duration
        self._feedback, self._period = self.scenario.control.feedback, self.scenario.control.period
        self._delay, self._lag = lateness(self.scenario)
        self._late = self._delay + self._lag + 0.5 * self._period
        self.written: Judged | None = None
        self.tried: dict[str, dict[float, Judged]] = {"gain": {}}

    def begin(self, written: Judged) -> None:
        """Begin the searches that follow the judgment of the loop as written."""
        self.written = written
        names = _NAMES[:1] if written.is_unstable else _NAMES
        self.tried = {name: {1.0: written} for name in names}

    def changes(self, name: str, factor: float) -> tuple[Change, ...]:
        """Return the changes that make a setting."""
        plant, more = self.scenario.plant, (factor - 1.0) * self._late
        lags = (np.atleast_1d(plant.lag) + more).tolist()
        setting = {
            "gain": {"control.feedback": self._feedback * factor},
            "delay": {"plant.delay": plant.delay + more},
            "lag": {"plant.lag": lags if len(lags) > 1 else lags[0]},
        }[name]
        return (*self._base, *changes_of(setting))

    def ideal(self, name: str) -> float:
        """Return the factor at the limit of the ideal plant."""
        feedback, period, delay, lag = self._feedback, self._period, self._delay, self._lag
        if name == "gain":
            return edge_gain(period, delay, lag) / feedback
        longer = edge_delay(feedback, period, lag) if name == "delay" else edge_lag(feedback, period, delay)
        return 1.0 + max(0.0, longer - (delay if name == "delay" else lag)) / self._late

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the smallest and the largest factor of a search."""
        ideal = self.ideal(name)
        if name == "gain":
            return min(_LOWEST, 0.1 * ideal), _BEYOND * max(1.0, ideal)
        most = _BEYOND * (ideal if ideal < math.inf else 1.0 + 1.0 / (self._feedback * self._late))
        if name == "delay":
            most = min(most, 1.0 + (_SHARE * self._duration - self.scenario.plant.delay) / self._late)
        return 1.0, max(1.0, most)

    def edge(self, name: str) -> Edge:
        """Return the present interval of factors."""
        tried = self.tried[name]
        high = min((factor for factor, judgment in tried.items() if judgment.is_unstable), default=math.inf)
        return Edge(max((factor for factor in tried if factor < high), default=0.0), high)

    def margin(self, name: str) -> Margin:
        """Return the result of a search, in factors of the feedback or in times."""

        def value(factor: float) -> float:
            return factor if name == "gain" else (factor - 1.0) * self._late

        low, high = self.edge(name)
        rule = 1.0 / (self._feedback * self._late)
        tried = tuple((value(factor), judgment) for factor, judgment in sorted(self.tried[name].items()))
        edge = Edge(value(low) if low else 0.0, value(high))
        return Margin(name, edge, value(self.bounds(name)[1]), value(self.ideal(name)), value(rule), tried)

    def margins(self, *, is_interrupted: bool) -> Margins:
        """Return all results."""
        runs = 2 * (1 + sum(len(tried) - 1 for tried in self.tried.values()))  # as written: once
        gain, delay, lag = (self.margin(name) if name in self.tried else None for name in _NAMES)
        assert gain is not None
        late = self._delay, self._lag
        return Margins(self.scenario, late, self.written, gain, delay, lag, runs, is_interrupted)


def _close_in(judge: _Judge, accuracy: float, loop: _Loop, name: str) -> None:
    """Search a limit by ever longer steps from below that of the ideal plant, then by bisection."""
    (low, high), (least, most), tried = loop.edge(name), loop.bounds(name), loop.tried[name]
    factor = min(max(_FIRST * loop.ideal(name), least, low), most, high)
    step = max(_STEP, 1.0 + accuracy)
    while True:
        if factor not in tried:
            judgment = judge(loop.changes(name, factor))
            if judgment is None:
                return
            tried[factor] = judgment
        low, high = loop.edge(name)
        if factor == high:
            factor = max(high / step, math.sqrt(low * high) if low else least)
        else:
            factor = min(low * step, math.sqrt(low * high) if high < math.inf else most)
        if factor in tried or high <= low * (1.0 + accuracy):
            return
        step *= step
