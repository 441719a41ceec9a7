"""Margins of a scenario: how much more delay, lag and gain its loop tolerates before it is unstable.

Each limit is found by bisection of one factor: that of the feedback, or that of the total lateness of
commands, τ + T/2 + T₁. Threads search several limits at a time.
"""

import math
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

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


OnRuns = Callable[[int], None]
_Judge = Callable[[Sequence[Change]], Judged | None]


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
        written: Judgment of the loop as written; None: interrupted before.
        all: The margins: of gain, and of delay and lag if the loop is stable as written.
        interrupted: Whether Ctrl-C ended the search.
    """

    scenario: Scenario
    written: Judged | None
    all: tuple[Margin, ...]
    interrupted: bool

    @property
    def gain(self) -> Margin:
        """Factor on control.feedback at the limit; below 1 if the loop is unstable as written."""
        return self.all[0]

    @property
    def delay(self) -> Margin | None:
        """Dead time that can be added [s]; None if the loop is unstable as written."""
        return self.all[1] if self.is_stable else None

    @property
    def lag(self) -> Margin | None:
        """Lag that can be added at every joint [s]; None if the loop is unstable as written."""
        return self.all[2] if self.is_stable else None

    @property
    def late(self) -> tuple[float, float]:
        """Dead time of its commands, and the longest lag [s]."""
        return lateness(self.scenario)

    @property
    def runs(self) -> int:
        """Number of runs; as written, all limits share them."""
        return 2 * (1 + sum(len(margin.tried) - 1 for margin in self.all))

    @property
    def is_stable(self) -> bool:
        """Whether the loop is stable as written."""
        return self.written is not None and not self.written.is_unstable


def margins(
    scenario: Source, *, accuracy: float = ACCURACY, threads: int | None = None, on_runs: OnRuns | None = None
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
    study: Study, settings: Sequence[Sequence[Change]], stop: threading.Event, *,
    accuracy: float = ACCURACY, threads: int = 1, on_runs: OnRuns | None = None,
) -> list[Margins]:  # fmt: skip
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
    judge = _judge(study, stop, on_runs)
    loops = [study.prepare(base) for base in settings]
    with ThreadPoolExecutor(threads) as pool:
        judgments = list(pool.map(judge, settings))
        searches = [
            [
                pool.submit(_close_in, judge, base, limit, written, accuracy)
                for limit in _limits(loop, written)
            ]
            for base, loop, written in zip(settings, loops, judgments, strict=True)
        ]
        results = [tuple(search.result() for search in each) for each in searches]
    return [
        Margins(loop.scenario, written, each, stop.is_set())
        for loop, written, each in zip(loops, judgments, results, strict=True)
    ]


def bears(
    study: Study, settings: Sequence[Sequence[Change]], factor: float = 2.0, *,
    threads: int = 1, stop: threading.Event | None = None,
) -> list[bool | None]:  # fmt: skip
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
    judge = _judge(study, stop or threading.Event())
    loops = [study.prepare(base).scenario for base in settings]

    def is_borne(base: Sequence[Change], loop: Scenario) -> bool | None:
        feedback = loop.control.feedback
        quick = _QUICK * edge_gain(loop.control.period, *lateness(loop))
        for tried in sorted({factor * feedback, max(factor * feedback, quick)}, reverse=True):
            judgment = judge((*base, *changes_of({"control.feedback": tried})))
            if judgment is None or not judgment.is_unstable:
                return None if judgment is None else True
        return False

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(is_borne, settings, loops))


def _judge(study: Study, stop: threading.Event, on_runs: OnRuns | None = None) -> _Judge:
    """Return the function that judges a setting, in any thread; one prepares at a time."""
    lock = threading.Lock()

    def judge(changes: Sequence[Change]) -> Judged | None:
        with lock:
            prepared = study.prepare(changes)
        judgment = None if stop.is_set() else judged(prepared, stop)
        if judgment and on_runs:
            with lock:
                on_runs(2)
        return judgment

    return judge


class _Limit(NamedTuple):
    """What is searched: a factor of the feedback, or of the total lateness of commands, τ + T/2 + T₁.

    Attributes:
        name: Name of the margin.
        ideal: Factor at the limit of the ideal plant.
        rule: Factor by the rule of thumb.
        least: Smallest factor of the search.
        most: Largest factor.
        setting: Function from a reported value to its setting.
        late: The total lateness, if the reported value is the additional time [s]; None: it is the factor.
    """

    name: str
    ideal: float
    rule: float
    least: float
    most: float
    setting: Callable[[float], dict[str, object]]
    late: float | None = None

    def value(self, factor: float) -> float:
        """Return the reported value."""
        return factor if self.late is None else (factor - 1.0) * self.late


def _limits(prepared: Prepared, written: Judged | None) -> Iterator[_Limit]:
    """Yield the limits to search for: the gain's, and the others of a loop that is stable as written."""
    scenario, plant = prepared.scenario, prepared.scenario.plant
    feedback, period, (delay, lag) = scenario.control.feedback, scenario.control.period, lateness(scenario)
    late = delay + lag + 0.5 * period
    rule = 1.0 / (feedback * late)

    def lags(more: float) -> object:
        return [lag + more for lag in plant.lag] if isinstance(plant.lag, tuple) else plant.lag + more

    ideal = edge_gain(period, delay, lag) / feedback
    least, most = min(_LOWEST, 0.1 * ideal), _BEYOND * max(1.0, ideal)
    yield _Limit("gain", ideal, rule, least, most, lambda factor: {"control.feedback": factor * feedback})
    if written is None or written.is_unstable:
        return
    ideal = 1.0 + max(0.0, edge_delay(feedback, period, lag) - delay) / late
    most = max(1.0, min(_BEYOND * ideal, 1.0 + (_SHARE * prepared.reference.duration - plant.delay) / late))
    yield _Limit("delay", ideal, rule, 1.0, most, lambda more: {"plant.delay": plant.delay + more}, late)
    ideal = 1.0 + max(0.0, edge_lag(feedback, period, delay) - lag) / late
    most = _BEYOND * (ideal if ideal < math.inf else 1.0 + rule)
    yield _Limit("lag", ideal, rule, 1.0, most, lambda more: {"plant.lag": lags(more)}, late)


def _close_in(
    judge: _Judge, base: Sequence[Change], limit: _Limit, written: Judged | None, accuracy: float
) -> Margin:
    """Search a limit by ever longer steps from below that of the ideal plant, then by bisection."""
    tried = {1.0: written} if written else {}

    def ends() -> tuple[float, float]:
        high = min((factor for factor, judgment in tried.items() if judgment.is_unstable), default=math.inf)
        return max((factor for factor in tried if factor < high), default=0.0), high

    low, high = ends()
    factor = min(max(_FIRST * limit.ideal, limit.least, low), limit.most, high)
    step = max(_STEP, 1.0 + accuracy)
    while True:
        if factor not in tried:
            judgment = judge((*base, *changes_of(limit.setting(limit.value(factor)))))
            if judgment is None:
                break
            tried[factor] = judgment
        low, high = ends()
        if factor == high:
            factor = max(high / step, math.sqrt(low * high) if low else limit.least)
        else:
            factor = min(low * step, math.sqrt(low * high) if high < math.inf else limit.most)
        if factor in tried or high <= low * (1.0 + accuracy):
            break
        step *= step
    edge = Edge(limit.value(low) if low else 0.0, limit.value(high))
    most, ideal, rule = map(limit.value, (limit.most, limit.ideal, limit.rule))
    each = tuple((limit.value(factor), judgment) for factor, judgment in sorted(tried.items()))
    return Margin(limit.name, edge, most, ideal, rule, each)
