"""Judge the stability of a loop: run a world and its kicked twin, and test whether their difference decays.

Common effects of both worlds (path, noise, friction, a stuck arm) cancel in the difference. Slow parts of it
(damped directions, null-space motion, another way out of a singularity) are not oscillations, and are
subtracted.
"""

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.law.task import Array
from rmrc.results.run import Run
from rmrc.scenario import Scenario
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import Prepared
from rmrc.study.margins.kicks import KICK, resting, twin_of
from rmrc.study.study import Result, Study
from rmrc.textbook.stability import edge_frequency

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
# World-ticks that are run at once: 300 MB for an arm with seven joints.
_TICKS = 2_000_000
_LIMITED = int(
    Status.RATE_LIMITED | Status.ACCELERATION_LIMITED | Status.POSITION_LIMITED | Status.TORQUE_LIMITED
)

# The judged columns of a run.
_COLUMNS = ("q", "qdot_cmd", "path_time", "status")

Reason = Literal["", "diverged", "rings", "reverses"]


@dataclass(frozen=True)
class Judged:
    """Judgment of a world and its twin.

    Attributes:
        reason: Why the loop is unstable: it diverged, keeps ringing after a kick, or oscillates from limit to
            limit; "": it is stable.
        time: Time of the divergence, or start of the stretch [s]; NaN if stable.
        left: Remaining fraction of the response to a kick at the end of the worst stretch [1].
    """

    reason: Reason
    time: float
    left: float

    @property
    def is_unstable(self) -> bool:
        """Whether the loop is unstable."""
        return self.reason != ""


class _Track:
    """The judged columns of a run."""

    def __init__(self) -> None:
        self._parts: list[tuple[Array, ...]] = []

    def add(self, part: Run) -> None:
        self._parts.append(tuple(part[name] for name in _COLUMNS))

    def columns(self) -> tuple[Array, ...]:
        return tuple(np.concatenate(parts) for parts in zip(*self._parts, strict=True))


def judged(
    study: Study, worlds: Sequence[Prepared], stop: threading.Event, threads: int = 1
) -> list[Judged | None]:
    """Return the judgment of each world's loop, from two runs each; None if interrupted.

    Args:
        study: Study that prepared them.
        worlds: Worlds with a positive control.feedback.
        stop: Event that ends the runs.
        threads: Number of threads.

    Raises:
        ScenarioError: They do not fit into memory.
    """
    found: list[Judged | None] = []
    while len(found) < len(worlds):
        some, ticks = list[Prepared](), 0
        for world in worlds[len(found) :]:
            longer = resting(world, (_FEWEST + 1) * window(world.scenario))
            ticks += 2 * longer.most_ticks
            if some and ticks > _TICKS:
                break
            some.append(longer)
        found += _judged(study, some, stop, threads)
    return found


def _judged(
    study: Study, worlds: Sequence[Prepared], stop: threading.Event, threads: int
) -> Sequence[Judged | None]:
    """Judge worlds that are stepped together."""
    if stop.is_set():
        return [None] * len(worlds)
    pairs = [one for world in worlds for one in (world, twin_of(world, _starts(world), kick_of(world)))]
    tracks = [_Track() for _ in pairs]
    results = study.watch(pairs, lambda index, part: tracks[index].add(part), stop, threads)
    if stop.is_set():
        return [None] * len(worlds)
    return [_judge(results[i : i + 2], tracks[i : i + 2]) for i in range(0, len(pairs), 2)]


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


def kick_of(world: Prepared) -> float:
    """Return the size of a kick of a world's twin [rad]; for lengths, times `task.length`."""
    return max(KICK, _STEPS * _step(world))


def _step(world: Prepared) -> float:
    """Return the largest step of its encoders, scaled as the joints of its task [1]."""
    return float(np.max(world.scenario.arm.encoder.resolution / world.task.joint_scale))


def _starts(world: Prepared) -> tuple[int, ...]:
    """Return the start of each stretch of the path, in ticks."""
    ticks = world.reference.ticks
    count = min(_STRETCHES, max(1, ticks // (_WINDOWS * window(world.scenario))))
    return tuple(i * ticks // count for i in range(count))


def _judge(results: Sequence[Result], tracks: Sequence[_Track]) -> Judged:
    """Judge a world and its twin."""
    world, period = results[0].prepared, results[0].prepared.scenario.control.period
    for one in results:
        if one.divergence:
            return Judged("diverged", one.divergence.time, math.inf)
    (q, sent, path_time, status), (moved, *_) = (track.columns() for track in tracks)
    ticks, width = min(len(q), len(moved)), window(world.scenario)
    kick = kick_of(world)
    least = max(_LEAST, _TELLING_STEPS * _step(world) / kick)
    apart = (moved[:ticks] - q[:ticks]) / (world.task.joint_scale * kick)
    swings = without_trend(apart, width)
    starts = np.searchsorted(path_time, (np.array(_starts(world)) - 0.5) * period)
    found = []
    for first, last in zip(starts, [*(starts[1:] - width // 2), len(swings)], strict=True):
        if last - first >= _FEWEST * width:  # a slowed path reaches a shorter one late
            left = still_ringing(swings, first, last, least)
            turns = reverses(sent, status.astype(np.int64) & _LIMITED != 0, first, last)
            reason: Reason = "rings" if left >= STILL_RINGS else "reverses" if turns else ""
            found.append(Judged(reason, float(first * period) if reason else math.nan, left))
    # the first unstable one, with the worst remaining fraction; the first stretch is never too short
    judgment = next((one for one in found if one.is_unstable), found[0])
    return replace(judgment, left=max(one.left for one in found))


def without_trend(values: Array, width: int) -> Array:
    """Return values (T, n) minus their moving mean over `width` ticks.

    Values before the first count as 0; the last half width has no mean and is omitted.
    """
    half = width // 2
    total = np.concatenate([np.zeros((half + 1, values.shape[1])), values]).cumsum(axis=0)
    mean = (total[width:] - total[:-width]) / width
    return np.asarray(values[: len(mean)] - mean)


def still_ringing(swings: Array, first: int, last: int, least: float = _LEAST) -> float:
    """Return the fraction of a kick's response at the end of a stretch [1]; 1: it neither decays nor grows.

    It is the smallest amplitude of the parts of the last third over the largest of the middle third. Where it
    grows throughout the last third, it is the amplitude of its last part over that of its first, if that is
    larger: at a stop, or past a singularity, the two worlds separate by more than the kick, and that may fade
        or
    grow as well. It is 1 where they oscillate independently, as far as limits allow, and with nearly the same
    amplitude at the end.

    Only joints count that oscillate to both sides in each part, by a detectable amplitude.

    Args:
        swings: In units of the kick, (T, n).
        first: First tick of the stretch, that of the kick.
        last: One past its last.
        least: Detectable amplitude.
    """
    third = (last - first) // 3
    middle, end = swings[last - 2 * third : last - third], swings[last - third : last]
    parts = np.array_split(end, _PARTS)
    peaks = np.array([np.abs(part).max(axis=0) for part in parts])
    swings_on = np.all([_both_ways(part, 0.0) for part in parts], axis=0) & (peaks.min(axis=0) >= least)
    if not swings_on.any():
        return 0.0
    peaks = peaks[:, swings_on]
    weakest, largest = peaks.min(axis=0), peaks.max(axis=0)
    left = weakest / max(np.abs(middle).max(), least)
    grown = np.where(peaks[-1] >= largest, peaks[-1] / peaks[0], 0.0)
    alone = (weakest >= _ALL) | ((weakest >= _MOST) & (peaks[-1] >= 0.5 * largest))
    return float(np.maximum(left, np.where(grown >= 1.0, grown, alone)).max())


def reverses(sent: Array, is_limited: NDArray[np.bool_], first: int, last: int) -> bool:
    """Return whether a joint oscillates between limits in each part of the last third of a stretch.

    Such an oscillation may hide a kick: where limits act, the rates do not depend on the arm's position.

    Args:
        sent: Commanded rates, (T, n).
        is_limited: Whether a limit acts, (T,).
        first: First tick of the stretch.
        last: One past its last.
    """
    third = slice(last - (last - first) // 3, last)
    if not all(part.any() for part in np.array_split(is_limited[third], _PARTS)):
        return False
    least = _TO_AND_FRO * np.abs(sent).max(axis=0)
    return bool(
        np.all([_both_ways(part, least) for part in np.array_split(sent[third], _PARTS)], axis=0).any()
    )


def _both_ways(values: Array, least: ArrayLike) -> NDArray[np.bool_]:
    """Return the columns of values (t, n) that exceed ±least on both sides."""
    return np.asarray((values.max(axis=0) > least) & (values.min(axis=0) < -np.asarray(least)))
