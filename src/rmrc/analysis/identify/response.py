"""The response of a joint to commanded rates with a delay and a first-order lag: exact, at any times.

A rate holds until the next is sent. With dead time d and lag L, the rate w of the joint and its travel x are

    L ẇ(t) = u(t − d) − w(t),   x(t) = ∫ w = c(t − d) − L w(t),   c(t) = ∫ u

so that between two commands, for L > 0, w(s) = u + (w₀ − u) exp(−(s − s₀)/L), at s = t − d.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A lag below this share of the median period has no effect, and would overflow.
_LEAST_SHARE = 1e-3
# A share of a rate that is lost in rounding.
_VANISHED = 1e-18


@dataclass(frozen=True, eq=False)
class Commands:
    """Commanded rates of a joint.

    Attributes:
        time: Time of each command, increasing, (K,) [s].
        rate: (K,) [rad/s or m/s].
        travel: Their integral since the first one, (K,) [rad or m].
    """

    time: Array
    rate: Array
    travel: Array

    @classmethod
    def of(cls, time: Array, rate: Array) -> "Commands":
        """Return commands with their travel."""
        return cls(time, rate, np.concatenate([[0.0], np.cumsum(np.diff(time) * rate[:-1])]))

    def lagged(self, lag: float) -> "Lagged":
        """Return the commands after a lag [s], at rest or steady where they begin."""
        step = np.diff(self.time)
        if lag <= _LEAST_SHARE * float(np.median(step)):
            return Lagged(self, 0.0, self.rate)
        decay = np.exp(-step / lag)
        return Lagged(self, lag, _recursion(decay, (1.0 - decay) * self.rate[:-1], self.rate[0]))


@dataclass(frozen=True, eq=False)
class Lagged:
    """Commands after a lag.

    Attributes:
        commands: The commands before it.
        lag: L; 0: none [s].
        start: w at the time of each command, (K,) [rad/s or m/s].
    """

    commands: Commands
    lag: float
    start: Array

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return travel and rate at some times less the delay, (T,) each; both are 0 before the commands."""
        sent = self.commands
        row = np.searchsorted(sent.time, time, "right") - 1
        before = row < 0
        row[before] = 0
        since = np.where(before, 0.0, time - sent.time[row])
        rate = sent.rate[row]
        travel = sent.travel[row] + rate * since
        if self.lag:
            rate = rate + (self.start[row] - rate) * np.exp(-since / self.lag)
            travel -= self.lag * (rate - sent.rate[0])
        return travel, np.where(before, 0.0, rate)


def _recursion(a: Array, b: Array, first: float) -> Array:
    """Return w with w[0] = first and w[k + 1] = a[k] w[k] + b[k], by doubling, (K,).

    The factors a are in [0, 1]; where their products have vanished no further doubling is needed.
    """
    w, product = np.concatenate([[first], b]), np.concatenate([[0.0], a])
    reach = 1
    while reach < len(w) and product.max() > _VANISHED:
        w[reach:] += product[reach:] * w[:-reach]
        product[reach:] = product[reach:] * product[:-reach]
        reach *= 2
    return w
