"""Countable events of a run: stretches of ticks, chatter, and commands that a profile refuses."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario.profile import Profile, Taper

Array = NDArray[np.float64]

# The conditions of a profile.
CONDITIONS = ("position", "rate", "acceleration", "jerk")

# A command whose acceleration changes its sign twice within this time shakes the arm [s]: 5 Hz. On a smooth
# path, changes are farther apart; a loop that oscillates, or a law that switches, takes some ticks.
CHATTER_TIME = 0.1
# An acceleration up to this does not count where a joint has no limits [rad/s² or m/s²]. With limits the
# bound is the smaller of the acceleration to its largest rate in a second and a tenth of its largest
# acceleration. Encoder noise of 1e-5 rad stays below it: at K = 20 /s and 1 ms it is 20 · 1e-5 · √2/0.001 =
# 0.3 rad/s² rms.
CHATTER_FLOOR = 1.0


def stretches(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the first tick, and one past the last, of each stretch in which something holds, (k, 2).

    Args:
        holds: Whether it does at each tick, (T,).
    """
    return np.flatnonzero(np.diff(holds, prepend=False, append=False)).reshape(-1, 2)


def chatter(acceleration: Array, floor: Array, period: float) -> NDArray[np.int64]:
    """Return how many changes of sign come within CHATTER_TIME of the one before, (n,).

    Args:
        acceleration: Commanded accelerations, (n, T).
        floor: Acceleration of each joint up to which a sign does not count, (n,).
        period: Control period [s].
    """
    counts = np.zeros(len(floor), np.int64)
    is_large = np.abs(acceleration) > floor[:, None]
    for j in np.flatnonzero(is_large.any(axis=1)):
        ticks = np.flatnonzero(is_large[j])
        changes = ticks[1:][np.diff(acceleration[j, ticks] > 0.0)]
        counts[j] = np.count_nonzero(np.diff(changes) <= round(CHATTER_TIME / period))
    return counts


@dataclass(frozen=True)
class Violation:
    """A command that a profile refuses.

    Attributes:
        condition: Its first violated condition; "": there is no such command.
        joint: The first joint that violates it; -1: there is none.
        tick: When the command was sent.
        value: Value that violates the condition.
        bound: Bound that it reaches.
    """

    condition: str = ""
    joint: int = -1
    tick: int = -1
    value: float = math.nan
    bound: float = math.nan


def refused(
    profile: Profile, q: Array, rate: Array, acceleration: Array, jerk: Array
) -> tuple[int, Violation]:
    """Return how many commands a profile refuses, and the first. A bound that is reached is violated.

    Args:
        profile: The profile.
        q: Joint positions, (n, T).
        rate: Commanded rates, and so on, (n, T) each.
        acceleration: Their difference quotients.
        jerk: Those of the accelerations.
    """
    most = [
        np.array(part.value if part else [math.inf] * len(q))[:, None]
        for part in (profile.rate, profile.acceleration, profile.jerk)
    ]
    bounds = [(-bound, bound) for bound in most]
    if profile.rate_near_ends:
        bounds[0] = _tapered(profile.rate_near_ends, q, most[0])
    ends = profile.position
    position = (ends.lower, ends.upper) if ends else ([-math.inf] * len(q), [math.inf] * len(q))
    bounds.insert(0, (np.array(position[0])[:, None], np.array(position[1])[:, None]))
    values = (q, rate, acceleration, jerk)
    violates = np.array(
        [~((value > low) & (value < high)) for value, (low, high) in zip(values, bounds, strict=True)]
    )  # of NaN as well
    ticks = np.flatnonzero(violates.any(axis=(0, 1)))
    if not len(ticks):
        return 0, Violation()
    tick = int(ticks[0])
    i, j = map(int, np.argwhere(violates[:, :, tick])[0])
    value = float(values[i][j, tick])
    low, high = (float(np.broadcast_to(bound, q.shape)[j, tick]) for bound in bounds[i])
    return len(ticks), Violation(CONDITIONS[i], j, tick, value, low if value <= low else high)


def _tapered(taper: Taper, q: Array, rate: Array) -> tuple[Array, Array]:
    """Return the bounds of rates at some positions, with the taper toward the ends, (n, T) each."""
    lower, upper, offset, deceleration = (
        np.array(part)[:, None] for part in (taper.lower, taper.upper, taper.offset, taper.deceleration)
    )
    for_lower, for_upper = (
        np.maximum(0.0, np.sqrt(np.maximum(0.0, 2.0 * deceleration * distance)) - offset)
        for distance in (q - lower, upper - q)
    )
    return np.maximum(-rate, -for_lower), np.minimum(rate, for_upper)
