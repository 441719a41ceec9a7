"""Judge the stability of a loop: run a world and its kicked twin, and test whether their difference decays.

Common effects of both worlds (path, noise, friction, a stuck arm) cancel in the difference. Slow parts of it
(damped directions, null-space motion, another way out of a singularity) are not oscillations, and are
subtracted.
"""

import math
import threading
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.law.task import Array
from rmrc.scenario import Scenario
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.textbook.stability import edge_frequency

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


@dataclass(frozen=True)
class Judged:
    """Judgment of a world and its twin.

    Attributes:
        reason: Why the loop is unstable: it diverged, keeps ringing after a kick, or oscillates from limit to
            limit; "": it is stable.
        time: Time of the divergence, or start of the stretch [s]; NaN if stable.
        left: Remaining fraction of the response to a kick at the end of the worst stretch [1].
    """

    reason: Literal["", "diverged", "rings", "reverses"]
    time: float
    left: float

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
    world = resting(prepared, (_FEWEST + 1) * width)
    count = min(_STRETCHES, max(1, world.reference.ticks // (_WINDOWS * width)))
    starts = tuple(i * world.reference.ticks // count for i in range(count))
    runs = []
    for one in (world, twin_of(world, starts, kick)):
        (run,) = Simulation([one]).run(stop=stop)
        if stop.is_set():
            return None
        if run.divergence:
            return Judged("diverged", run.divergence.time, math.inf)
        runs.append({name: run[name].copy() for name in ("q", "qdot_cmd", "path_time", "status")})
    ticks = min(len(run["q"]) for run in runs)
    apart = (runs[1]["q"][:ticks] - runs[0]["q"][:ticks]) / (world.task.joint_scale * kick)
    swings, sent = without_trend(apart, width), runs[0]["qdot_cmd"]
    is_limited = runs[0]["status"].astype(np.int64) & _LIMITED != 0
    # a slowed path reaches the start of a stretch late
    firsts = np.searchsorted(runs[0]["path_time"], (np.array(starts) - 0.5) * period)
    stretches = list[Judged]()
    for first, last in zip(firsts, [*(firsts[1:] - width // 2), len(swings)], strict=True):
        if last - first < _FEWEST * width:
            continue
        remainder = still_ringing(swings[first:last], max(_LEAST, _TELLING_STEPS * step / kick))
        reason: Literal["", "rings", "reverses"] = ""
        if remainder >= STILL_RINGS:
            reason = "rings"
        elif reverses(sent[first:last], is_limited[first:last], _TO_AND_FRO * np.abs(sent).max(axis=0)):
            reason = "reverses"
        stretches.append(Judged(reason, float(first * period) if reason else math.nan, remainder))
    # the first unstable one, with the worst remaining fraction; the first stretch is never too short
    judgment = next((one for one in stretches if one.is_unstable), stretches[0])
    return replace(judgment, left=max(one.left for one in stretches))


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


def resting(prepared: Prepared, least: int) -> Prepared:
    """Return a world of at least this many ticks, with the target at rest after the end of its path."""
    path = prepared.reference
    return replace(prepared, reference=replace(path, ticks=max(path.ticks, least)))


def twin_of(prepared: Prepared, starts: tuple[int, ...], size: float) -> Prepared:
    """Return the twin of a world, which differs only by small, brief displacements of the reference.

    A kick lasts 1/K, in which a loop follows most of it, and goes to a corner of a box: to either side along
    each axis, including axes outside the task. Each of 64 kicks goes to a different corner.

    Args:
        prepared: The world returned by `resting`.
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
