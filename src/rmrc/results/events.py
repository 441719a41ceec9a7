"""The commands of a run that a profile refuses, and the acceleration from which they chatter."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario.profile import Profile, Taper

Array = NDArray[np.float64]

# The conditions of a profile.
CONDITIONS = ("position", "rate", "acceleration", "jerk")

# An acceleration up to this does not count where a joint has no limits [rad/s² or m/s²]. With limits the
# bound is the smaller of the acceleration to its largest rate in a second and a tenth of its largest
# acceleration. Encoder noise of 1e-5 rad stays below it: at K = 20 /s and 1 ms it is 20 · 1e-5 · √2/0.001 =
# 0.3 rad/s² rms.
CHATTER_FLOOR = 1.0


class Refused(NamedTuple):
    """The commands that a profile refuses.

    Attributes:
        number: How many; NaN: there is no profile.
        condition: The first violated condition of the first of them; "": there is none.
        joint: The first joint that violates it; -1: there is none.
        time: When the command was sent [s].
        value: Value that violates the condition.
        bound: Bound that it reaches.
    """

    number: float = math.nan
    condition: str = ""
    joint: int = -1
    time: float = math.nan
    value: float = math.nan
    bound: float = math.nan


def refused(
    profile: Profile, time: Array, q: Array, rate: Array, acceleration: Array, jerk: Array
) -> Refused:
    """Return the commands that a profile refuses. A bound that is reached is violated.

    Args:
        profile: The profile.
        time: Time of each tick [s], (T,).
        q: Joint positions, (n, T).
        rate: Commanded rates, and so on, (n, T) each.
        acceleration: Their difference quotients.
        jerk: Those of the accelerations.
    """

    def column(part: object, name: str, default: float) -> Array:
        return np.array(getattr(part, name) if part else [default] * len(q))[:, None]

    most = [column(part, "value", math.inf) for part in (profile.rate, profile.acceleration, profile.jerk)]
    bounds = [(-bound, bound) for bound in most]
    if profile.rate_near_ends:
        bounds[0] = _tapered(profile.rate_near_ends, q, most[0])
    ends = profile.position
    bounds.insert(0, (column(ends, "lower", -math.inf), column(ends, "upper", math.inf)))
    values = (q, rate, acceleration, jerk)
    violates = np.array([~((x > low) & (x < high)) for x, (low, high) in zip(values, bounds, strict=True)])
    ticks = np.flatnonzero(violates.any(axis=(0, 1)))  # of NaN as well
    if not len(ticks):
        return Refused(0.0)
    tick = ticks[0]
    i, j = np.argwhere(violates[:, :, tick])[0].tolist()
    value = float(values[i][j, tick])
    low, high = (float(np.broadcast_to(bound, q.shape)[j, tick]) for bound in bounds[i])
    bound = low if value <= low else high
    return Refused(float(len(ticks)), CONDITIONS[i], j, float(time[tick]), value, bound)


def _tapered(taper: Taper, q: Array, rate: Array) -> tuple[Array, Array]:
    """Return the bounds of rates at some positions, with the taper toward the ends, (n, T) each."""

    def most(distance: Array) -> Array:
        slowing = np.sqrt(np.maximum(0.0, 2.0 * np.array(taper.deceleration)[:, None] * distance))
        return np.asarray(np.minimum(rate, np.maximum(0.0, slowing - np.array(taper.offset)[:, None])))

    lower, upper = (np.array(end)[:, None] for end in (taper.lower, taper.upper))
    return -most(q - lower), most(upper - q)
