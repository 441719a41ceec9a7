"""Countable events of a run, piece by piece: statuses, standstill, chatter, and what a profile refuses.

Each class takes the next ticks of a run in pieces of any length, and knows the same whatever the pieces are.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.scenario.profile import Profile

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

_STATUSES = (Status.OK, *IN_RUNS)
_BITS = np.array(IN_RUNS, np.int64)[:, None]


class Statuses:
    """How often each status occurred, and when first; OK stands for ticks without a status."""

    def __init__(self) -> None:
        """Begin before the first tick."""
        self._count = np.zeros(len(_STATUSES), np.int64)
        self._time = np.full(len(_STATUSES), math.nan)

    def add(self, time: Array, status: NDArray[np.int64]) -> None:
        """Add ticks, (T,), T > 0."""
        occurs = np.vstack([status == 0, (status & _BITS) != 0])
        count = np.count_nonzero(occurs, axis=1)
        is_first = (count > 0) & (self._count == 0)
        self._time[is_first] = time[occurs[is_first].argmax(axis=1)]
        self._count += count

    def count(self, status: Status) -> int:
        """Return the number of ticks with a status."""
        return int(self._count[_STATUSES.index(status)])

    def first_time(self, status: Status) -> float:
        """Return the time of the first tick with a status [s]; NaN: there is none."""
        return float(self._time[_STATUSES.index(status)])


class Standstill:
    """The longest stretch of ticks in which an arm is stuck; the first of equals.

    Attributes:
        longest: Its number of ticks.
        time: Time of its first tick [s]; NaN: there is none.
    """

    def __init__(self) -> None:
        """Begin before the first tick."""
        self.longest, self.time = 0, math.nan
        self._length, self._began = 0, math.nan  # of the stretch that reaches the last tick

    def add(self, time: Array, is_stuck: NDArray[np.bool_]) -> None:
        """Add ticks, (T,), T > 0."""
        edges = np.flatnonzero(np.diff(is_stuck, prepend=False, append=False))
        lengths, times = edges[1::2] - edges[::2], time[edges[::2]]
        if is_stuck[0] and self._length:  # the stretch goes on
            lengths[0] += self._length
            times[0] = self._began
        if len(lengths) and lengths.max() > self.longest:
            longest = lengths.argmax()
            self.longest, self.time = int(lengths[longest]), float(times[longest])
        self._length, self._began = (lengths[-1], times[-1]) if is_stuck[-1] else (0, math.nan)


class Chatter:
    """Changes of the commanded accelerations' signs.

    Attributes:
        count: Number of changes that come within CHATTER_TIME of the one before, (n,).
    """

    def __init__(self, floor: Array, period: float) -> None:
        """Begin before the first tick.

        Args:
            floor: Acceleration of each joint up to which a sign does not count, (n,).
            period: Control period [s].
        """
        self._floor, self._soon = floor[:, None], round(CHATTER_TIME / period)
        self._sign = np.zeros(len(floor))  # of the last acceleration that counts
        self._changed = np.full(len(floor), -math.inf)  # tick of the last change
        self.count = np.zeros(len(floor), np.int64)

    def add(self, acceleration: Array, ticks: int) -> None:
        """Add commanded accelerations, (n, T), that follow a number of ticks."""
        counts = np.abs(acceleration) > self._floor
        if not counts.any():
            return
        signs = np.column_stack([self._sign, np.where(counts, np.sign(acceleration), 0.0)])
        joint, column = np.nonzero(signs)  # joint by joint, each in the order of time
        sign = signs[joint, column]
        self._sign[joint] = sign  # the last of each joint remains
        is_change = (joint[1:] == joint[:-1]) & (sign[1:] != sign[:-1])
        joint, tick = joint[1:][is_change], column[1:][is_change] - 1 + ticks
        is_first = np.diff(joint, prepend=-1) != 0
        before = np.where(is_first, self._changed[joint], np.roll(tick, 1))
        self.count += np.bincount(joint[tick - before <= self._soon], minlength=len(self.count))
        self._changed[joint] = tick


@dataclass(frozen=True)
class Violation:
    """A command that a profile refuses.

    Attributes:
        condition: Its first violated condition; "": there is no such command.
        joint: The first joint that violates it; -1: there is none.
        time: When the command was sent [s].
        value: Value that violates the condition.
        bound: Bound that it reaches.
    """

    condition: str = ""
    joint: int = -1
    time: float = math.nan
    value: float = math.nan
    bound: float = math.nan


class Conditions:
    """The commands that a profile refuses. A bound is violated where it is reached, and by NaN.

    Attributes:
        refused: Number of refused commands; NaN without a profile.
        first: The first of them.
    """

    def __init__(self, profile: Profile | None, n: int) -> None:
        """Begin before the first tick, with a profile or none, of an arm with n joints."""
        self.refused, self.first = 0.0 if profile else math.nan, Violation()
        if profile is None:
            return
        infinite = np.full((n, 1), math.inf)
        self._ends = -infinite, infinite
        if profile.position:
            self._ends = _column(profile.position.lower), _column(profile.position.upper)
        self._rate, self._acceleration, self._jerk = (
            _column(bound.value) if bound else infinite
            for bound in (profile.rate, profile.acceleration, profile.jerk)
        )
        self._taper = profile.rate_near_ends

    def add(self, time: Array, q: Array, rate: Array, acceleration: Array, jerk: Array) -> None:
        """Add ticks: positions and what was commanded, (n, T) each."""
        if math.isnan(self.refused):
            return
        conditions = (
            (q, *self._ends),
            (rate, *self._rates(q)),
            (acceleration, -self._acceleration, self._acceleration),
            (jerk, -self._jerk, self._jerk),
        )
        violates = np.array([~((value > lower) & (value < upper)) for value, lower, upper in conditions])
        ticks = np.flatnonzero(violates.any(axis=(0, 1)))
        if len(ticks) and not self.refused:
            tick = int(ticks[0])
            condition, joint = map(int, np.argwhere(violates[:, :, tick])[0])
            value, lower, upper = (
                float(np.broadcast_to(part, q.shape)[joint, tick]) for part in conditions[condition]
            )
            bound = lower if value <= lower else upper
            self.first = Violation(CONDITIONS[condition], joint, float(time[tick]), value, bound)
        self.refused += len(ticks)

    def _rates(self, q: Array) -> tuple[Array, Array]:
        """Return the bounds of rates at some positions, with the taper toward the ends: see `Taper`."""
        lower, upper = -self._rate, self._rate
        if self._taper:
            offset, deceleration = _column(self._taper.offset), _column(self._taper.deceleration)
            for_lower, for_upper = (
                np.maximum(0.0, np.sqrt(np.maximum(0.0, 2.0 * deceleration * distance)) - offset)
                for distance in (q - _column(self._taper.lower), _column(self._taper.upper) - q)
            )
            lower, upper = np.maximum(lower, -for_lower), np.minimum(upper, for_upper)
        return lower, upper


def _column(values: tuple[float, ...]) -> Array:
    """Return numbers of joints as a column, (n, 1)."""
    return np.array(values, float)[:, None]
