"""Margins of a scenario: how much more delay, lag and gain its loop tolerates before it is unstable.

Each limit is found by bisection of one factor: that of the feedback, or that of the total lateness of
commands, τ + T/2 + T₁. Threads search several limits at a time.
"""

import math
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.law.task import Array
from rmrc.scenario import Change, Scenario, Source, changes_of
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.study import Study
from rmrc.support.errors import ScenarioError
from rmrc.support.process import interruptible
from rmrc.support.text import brief
from rmrc.textbook.stability import edge_delay, edge_frequency, edge_gain, edge_lag

# Ringing of a loop --------------------------------------------------------------------------------
#
# Judge the stability of a loop: run a world and its kicked twin, and test whether their difference decays.
#
# Common effects of both worlds (path, noise, friction, a stuck arm) cancel in the difference. Slow parts of
# it (damped directions, null-space motion, another way out of a singularity) are not oscillations, and are
# subtracted.

# Displacement of a twin's reference along each axis [rad], for lengths times task.length. It is so small that
# the response of the loop is linear, and ten thousand times the effect of rounding.
KICK = 1e-6
# An oscillation at the limit keeps its amplitude. Below this share remains from the middle third to the last
# of the shortest run, for a loop of dead times with a feedback half a percent below its limit.
STILL_RINGS = 0.9
# The response to a kick is of its order, or larger by the 1/σ of joints. Below this share of the kick, it
# cannot be told from other effects. Above the next, at the end, it is no response to a kick: the two worlds
# separated at a singularity or a stop, which fades, or oscillate independently as far as limits allow. Above
# the last, it is the arm's whole motion.
_LEAST, _MOST, _ALL = 0.03, 10.0, 1e5
# Encoders round the two differently, by a step now and then: a kick is this many steps, and differences below
# the second number of steps mean nothing.
_STEPS, _TELLING_STEPS = 30.0, 10.0
# A joint that oscillates at a limit gets commands of at least this share of its largest rate to both sides.
_TO_AND_FRO = 0.1
# A path is divided into at most this many stretches, each with a kick and this many windows, if it is long
# enough; otherwise it is one stretch, with this many windows including the rest after it.
_STRETCHES, _WINDOWS, _FEWEST = 8, 40, 20
# The last third of a stretch is examined in this many parts, each of at least two windows.
_PARTS = 3
_LIMITED = int(
    Status.RATE_LIMITED | Status.ACCELERATION_LIMITED | Status.POSITION_LIMITED | Status.TORQUE_LIMITED
)


class Judged(NamedTuple):
    """Judgment of a world and its twin.

    Attributes:
        reason: Why the loop is unstable: `diverged`, `rings` after a kick, or `reverses` from limit to limit;
            "": it is stable.
        time: Time of the divergence, or start of the stretch [s]; NaN if stable.
        remainder: Remaining fraction of the response to a kick at the end of the worst stretch [1].
    """

    reason: str
    time: float
    remainder: float

    @property
    def is_unstable(self) -> bool:
        """Whether the loop is unstable."""
        return self.reason != ""


def judged(prepared: Prepared, stop: threading.Event) -> Judged | None:
    """Return the judgment of a loop, from two runs; None if interrupted.

    Args:
        prepared: A world with a positive control.feedback.
        stop: Event that ends the runs.

    Raises:
        ScenarioError: A run does not fit into memory.
    """
    period, width = prepared.scenario.control.period, window(prepared.scenario)
    step = float(np.max(prepared.scenario.arm.encoder.resolution / prepared.task.joint_scale))
    kick = max(KICK, _STEPS * step)
    ticks = max(prepared.reference.ticks, (_FEWEST + 1) * width)  # the target rests after the end of its path
    world = replace(prepared, reference=replace(prepared.reference, ticks=ticks))
    count = min(_STRETCHES, max(1, ticks // (_WINDOWS * width)))
    starts = tuple(i * ticks // count for i in range(count))
    run, twin = (Simulation([each]).run(stop=stop)[0] for each in (world, twin_of(world, starts, kick)))
    if stop.is_set():
        return None
    if end := run.divergence or twin.divergence:
        return Judged("diverged", end.time, math.inf)
    ticks = min(len(run), len(twin))
    apart = (twin["q"][:ticks] - run["q"][:ticks]) / (world.task.joint_scale * kick)
    swings, sent = without_trend(apart, width), run["qdot_cmd"]
    least, is_limited = _TO_AND_FRO * np.abs(sent).max(axis=0), run["status"].astype(np.int64) & _LIMITED != 0
    # a slowed path reaches the start of a stretch late
    firsts = np.searchsorted(run["path_time"], (np.array(starts) - 0.5) * period)
    stretches = list[Judged]()
    for first, last in zip(firsts, [*(firsts[1:] - width // 2), len(swings)], strict=True):
        if last - first < _FEWEST * width:
            continue
        remainder = still_ringing(swings[first:last], max(_LEAST, _TELLING_STEPS * step / kick))
        reason = "rings" if remainder >= STILL_RINGS else ""
        if not reason and reverses(sent[first:last], is_limited[first:last], least):
            reason = "reverses"
        stretches.append(Judged(reason, float(first * period) if reason else math.nan, remainder))
    # the first unstable one, with the worst remaining fraction; the first stretch is never too short
    judgment = next((stretch for stretch in stretches if stretch.is_unstable), stretches[0])
    return judgment._replace(remainder=max(stretch.remainder for stretch in stretches))


def lateness(scenario: Scenario) -> tuple[float, float]:
    """Return the lateness of a loop without T/2: dead time of the round trip, and the longest lag [s]."""
    plant = scenario.plant
    # the mean of jitter, which is uniform from 0 on
    return plant.delay + 0.5 * plant.jitter + scenario.arm.encoder.delay, float(np.max(plant.lag))


def window(scenario: Scenario) -> int:
    """Return the longest period of ringing of a loop, as an odd number of ticks.

    At its limit a loop with dead time rings at K, or more slowly with lag; beyond it, faster.
    """
    period, feedback = scenario.control.period, scenario.control.feedback
    slowest = min(feedback, edge_frequency(period, *lateness(scenario)))
    return max(5, math.ceil(2.0 * math.pi / (slowest * period)) | 1)


def twin_of(prepared: Prepared, starts: tuple[int, ...], size: float) -> Prepared:
    """Return the twin of a world, which differs only by small, brief displacements of the reference.

    A kick lasts 1/K, in which a loop follows most of it, and goes to a corner of a box: to either side along
    each axis, including axes outside the task. Each of 64 kicks goes to a different corner.

    Args:
        prepared: The world.
        starts: First tick of each kick, on the path.
        size: Displacement along each axis [rad]; for lengths, times `task.length`.
    """
    path = prepared.reference
    ticks = max(1, math.floor(1.0 / (prepared.scenario.control.feedback * path.period)))
    lengths = size * np.array([prepared.task.length] * 3 + [1.0] * 3)
    for i, first in enumerate(starts):
        corner = np.array([1.0 - 2.0 * (i * 11 >> bit & 1) for bit in range(6)])
        path = path.displaced(first, min(first + ticks, path.ticks - 1), lengths * corner)
    return replace(prepared, reference=path)


def without_trend(values: Array, width: int) -> Array:
    """Return values (T, n) minus their moving mean over `width` ticks.

    Values before the first count as 0; the last half width has no mean and is omitted.
    """
    half = width // 2
    total = np.concatenate([np.zeros((half + 1, values.shape[1])), values]).cumsum(axis=0)
    mean = (total[width:] - total[:-width]) / width
    return np.asarray(values[: len(mean)] - mean)


def still_ringing(swings: Array, least: float = _LEAST) -> float:
    """Return the fraction of a kick's response at the end of a stretch [1]; 1: it neither decays nor grows.

    It is the smallest amplitude of the parts of the last third over the largest of the middle third. Where it
    grows throughout the last third, it is the amplitude of its last part over that of its first, if that is
    larger: at a stop, or past a singularity, the two worlds separate by more than the kick, and that may fade
    or grow as well. It is 1 where they oscillate independently, as far as limits allow, and with nearly the
    same amplitude at the end.

    Only joints count that oscillate to both sides in each part, by a detectable amplitude.

    Args:
        swings: From the tick of the kick to the end of the stretch, in units of the kick, (t, n).
        least: Detectable amplitude.
    """
    third, parts = len(swings) // 3, _end(swings)
    peaks = np.array([np.abs(part).max(axis=0) for part in parts])
    swings_on = np.all([_both_ways(part, 0.0) for part in parts], axis=0) & (peaks.min(axis=0) >= least)
    if not swings_on.any():
        return 0.0
    middle, peaks = swings[-2 * third : -third], peaks[:, swings_on]
    weakest, largest = peaks.min(axis=0), peaks.max(axis=0)
    remainder = weakest / max(np.abs(middle).max(), least)
    grown = np.where(peaks[-1] >= largest, peaks[-1] / peaks[0], 0.0)
    alone = (weakest >= _ALL) | ((weakest >= _MOST) & (peaks[-1] >= 0.5 * largest))
    return float(np.maximum(remainder, np.where(grown >= 1.0, grown, alone)).max())


def reverses(sent: Array, is_limited: NDArray[np.bool_], least: Array) -> bool:
    """Return whether a joint oscillates between limits in each part of the last third of a stretch.

    Such an oscillation may hide a kick: where limits act, the rates do not depend on the arm's position.

    Args:
        sent: Commanded rates of the stretch, (t, n).
        is_limited: Whether a limit acts, (t,).
        least: Rates that count as an oscillation if they are exceeded to both sides, (n,).
    """
    if not all(part.any() for part in _end(is_limited)):
        return False
    return bool(np.all([_both_ways(part, least) for part in _end(sent)], axis=0).any())


def _end(values: NDArray[Any]) -> list[NDArray[Any]]:
    """Return the last third of values (t, ...) in parts."""
    return np.array_split(values[len(values) - len(values) // 3 :], _PARTS)


def _both_ways(values: Array, least: ArrayLike) -> NDArray[np.bool_]:
    """Return the columns of values (t, n) that exceed ±least on both sides."""
    return np.asarray((values.max(axis=0) > least) & (values.min(axis=0) < -np.asarray(least)))


# The search for limits ----------------------------------------------------------------------------

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
