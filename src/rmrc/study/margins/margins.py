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

from rmrc.scenario import Change, Scenario, Source, changes_of
from rmrc.simulation.prepare import Prepared
from rmrc.study.margins.ringing import Judged, judged, lateness
from rmrc.study.study import Study
from rmrc.support.errors import ScenarioError
from rmrc.support.interruption import interruptible
from rmrc.support.text import brief
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


class Margin(NamedTuple):
    """One stability margin of a loop.

    Attributes:
        name: `gain`, a factor on control.feedback; `delay` or `lag`, an additional time [s].
        low: Highest value up to which the loop is stable; 0: none.
        high: Lowest unstable value; infinite: none was found.
        bound: Largest value of the search.
        ideal: Limit of the ideal plant, by equation; infinite if any value is stable.
        rule: Value by the rule of thumb; below 1, or negative, if it allows less than the scenario has.
        tried: Each tried value with its judgment, by rising value.
    """

    name: str
    low: float
    high: float
    bound: float
    ideal: float
    rule: float
    tried: tuple[tuple[float, Judged], ...]

    @property
    def is_found(self) -> bool:
        """Whether the limit lies between two values that were tried."""
        return self.low > 0.0 and self.high < math.inf

    @property
    def value(self) -> float:
        """The margin: the geometric mean of both bounds, or the only bound."""
        return math.sqrt(self.low * self.high) if self.is_found else self.low or self.high


@brief
@dataclass(frozen=True)
class Margins:
    """The margins of a scenario.

    Attributes:
        scenario: The scenario.
        written: Judgment of the loop as written; None: interrupted before.
        interrupted: Whether Ctrl-C ended the search.
        gain: Factor on control.feedback at the limit; below 1 if the loop is unstable as written.
        delay: Dead time that can be added [s]; None if the loop is unstable as written.
        lag: Lag that can be added at every joint [s]; None if the loop is unstable as written.
    """

    scenario: Scenario
    written: Judged | None
    interrupted: bool
    gain: Margin
    delay: Margin | None = None
    lag: Margin | None = None

    @property
    def all(self) -> list[Margin]:
        """The margins that were searched."""
        return [margin for margin in (self.gain, self.delay, self.lag) if margin]

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
    study = Study(scenario)
    loop = study.prepare()
    if loop.scenario.control.feedback == 0.0:
        wrong = "must be > 0, got 0: a loop without feedback cannot be unstable"
        raise ScenarioError([loop.scenario.problem("control.feedback", wrong)])
    study.compile([loop])
    with interruptible() as stop, ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        judge = _judge(study, stop, on_runs)
        written = judge(())
        limits = _limits(loop) if written and not written.is_unstable else _limits(loop)[:1]
        searches = [pool.submit(_close_in, judge, limit, written, accuracy) for limit in limits]
        results = [search.result() for search in searches]
    return Margins(loop.scenario, written, stop.is_set(), *results)


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
        wanted = factor * loop.control.feedback
        quick = _QUICK * edge_gain(loop.control.period, *lateness(loop))
        for feedback in sorted({wanted, max(wanted, quick)}, reverse=True):
            judgment = judge((*base, *changes_of({"control.feedback": feedback})))
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
        setting: Function from a margin to its setting.
        late: The total lateness [s], of which a margin is the part that is added; 0: it is the factor.
    """

    name: str
    ideal: float
    rule: float
    least: float
    most: float
    setting: Callable[[float], dict[str, object]]
    late: float = 0.0

    def margin(self, factor: float) -> float:
        """Return the reported value of a factor."""
        return (factor - 1.0) * self.late if self.late else factor


def _limits(prepared: Prepared) -> list[_Limit]:
    """Return the limits to search for."""
    scenario, plant = prepared.scenario, prepared.scenario.plant
    feedback, period, (delay, lag) = scenario.control.feedback, scenario.control.period, lateness(scenario)
    late = delay + lag + 0.5 * period
    rule = 1.0 / (feedback * late)

    def lagging(more: float) -> dict[str, object]:
        lags = plant.lag
        return {"plant.lag": [each + more for each in lags] if isinstance(lags, tuple) else lags + more}

    ideal = edge_gain(period, delay, lag) / feedback
    ideal_delay = 1.0 + max(0.0, edge_delay(feedback, period, lag) - delay) / late
    ideal_lag = 1.0 + max(0.0, edge_lag(feedback, period, delay) - lag) / late
    longest = 1.0 + (_SHARE * prepared.reference.duration - plant.delay) / late
    least, most = min(_LOWEST, 0.1 * ideal), _BEYOND * max(1.0, ideal)
    latest = max(1.0, min(_BEYOND * ideal_delay, longest))
    slowest = _BEYOND * (ideal_lag if ideal_lag < math.inf else 1.0 + rule)
    return [
        _Limit("gain", ideal, rule, least, most, lambda factor: {"control.feedback": factor * feedback}),
        _Limit("delay", ideal_delay, rule, 1.0, latest, lambda s: {"plant.delay": plant.delay + s}, late),
        _Limit("lag", ideal_lag, rule, 1.0, slowest, lagging, late),
    ]


def _close_in(judge: _Judge, limit: _Limit, written: Judged | None, accuracy: float) -> Margin:
    """Search a limit by ever longer steps from below that of the ideal plant, then by bisection."""
    tried, low, high = dict[float, Judged](), 0.0, math.inf
    if written:
        tried[1.0] = written
        low, high = (0.0, 1.0) if written.is_unstable else (1.0, math.inf)
    factor = min(max(_FIRST * limit.ideal, limit.least, low), limit.most, high)
    step = max(_STEP, 1.0 + accuracy)
    while high > low * (1.0 + accuracy):
        judgment = tried.get(factor) or judge(changes_of(limit.setting(limit.margin(factor))))
        if judgment is None:
            break
        tried[factor] = judgment
        if judgment.is_unstable:
            high = factor
            factor = max(high / step, math.sqrt(low * high) or limit.least)
        else:
            low = factor
            factor = min(low * step, math.sqrt(low * high), limit.most)
        if factor in tried:
            break
        step *= step
    each = tuple((limit.margin(factor), judgment) for factor, judgment in sorted(tried.items()))
    high, bound, ideal, rule = map(limit.margin, (high, limit.most, limit.ideal, limit.rule))
    return Margin(limit.name, limit.margin(low) if low else 0.0, high, bound, ideal, rule, each)
