"""The response of a joint to commanded rates with a delay and a first-order lag: exact, at any times.

A rate holds until the next is sent. With dead time d, lag L and an acceleration of at most a, the rate w of
the joint and its travel x are

    ẇ(t) = min(max((u(t − d) − w(t))/L, −a), a),   x(t) = ∫ w

so that between two commands w first approaches u by a ramp of ± a, if it is farther away than a L, and from
there by exp(−s/L).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A lag below this share of the median period has no effect, and would overflow.
LEAST_SHARE = 1e-9
# A share of a rate that is lost in rounding.
VANISHED = 1e-18


@dataclass(frozen=True, eq=False)
class Commands:
    """Commanded rates of a joint.

    Attributes:
        time: Time of each command, increasing, (K,) [s].
        rate: (K,) [rad/s or m/s].
        until: Until when each is known to hold: the next one, or less where rows are missing, (K,) [s].
    """

    time: Array
    rate: Array
    until: Array

    @property
    def period(self) -> float:
        """The median step [s]."""
        return float(np.median(np.diff(self.time)))

    def answer(self, time: Array, lag: float = 0.0, limit: float = np.inf) -> tuple[Array, Array]:
        """Return travel and rate of the joint at some times less the delay, (T,) each; it starts steady.

        Args:
            time: (T,) [s].
            lag: L [s].
            limit: a [rad/s² or m/s²].
        """
        step, lag = np.diff(self.time), max(lag, LEAST_SHARE * self.period)
        if np.isinf(limit):
            decay = np.exp(-step / lag)
            start = _recursion(decay, (1.0 - decay) * self.rate[:-1], float(self.rate[0]))
        else:
            start = self._saturated(step, lag, limit)
        steps, _ = _advance(start[:-1], self.rate[:-1], step, lag, limit)
        row = np.maximum(np.searchsorted(self.time, time, "right") - 1, 0)
        since = np.maximum(time - self.time[row], 0.0)
        further, rate = _advance(start[row], self.rate[row], since, lag, limit)
        return np.concatenate([[0.0], np.cumsum(steps)])[row] + further, rate

    def _saturated(self, step: Array, lag: float, limit: float) -> Array:
        """Return the rate of the joint at each command."""
        rate, start = float(self.rate[0]), [float(self.rate[0])]
        for sent, time, whole in zip(
            self.rate.tolist(), step.tolist(), np.exp(-step / lag).tolist(), strict=False
        ):
            gap = sent - rate
            ramp = min(max(abs(gap) / limit - lag, 0.0), time)
            decay = math.exp(-(time - ramp) / lag) if ramp else whole
            rate = sent - (gap - math.copysign(limit * ramp, gap)) * decay
            start.append(rate)
        return np.array(start)


class Samples(NamedTuple):
    """Positions of a joint, and the commands to which they respond.

    Attributes:
        commands: Commands of the joint.
        time: Time of the positions, increasing, (N,) [s].
        position: (N,) [rad or m].
    """

    commands: Commands
    time: Array
    position: Array


def _advance(start: Array, sent: Array, since: Array, lag: float, limit: float) -> tuple[Array, Array]:
    """Return travel and rate some time after a command."""
    gap, travel = sent - start, np.zeros(len(start))
    if not np.isinf(limit):
        ramp = np.clip(np.abs(gap) / limit - lag, 0.0, since)
        bend = np.copysign(limit, gap) * ramp
        travel, since, gap = (start + 0.5 * bend) * ramp, since - ramp, gap - bend
    ahead = gap * np.exp(-since / lag)
    return travel + sent * since - lag * (gap - ahead), sent - ahead


def _recursion(a: Array, b: Array, first: float) -> Array:
    """Return w with w[0] = first and w[k + 1] = a[k] w[k] + b[k], by doubling, (K,).

    The factors a are in [0, 1]; where their products have vanished no further doubling is needed.
    """
    w, product = np.concatenate([[first], b]), np.concatenate([[0.0], a])
    reach = 1
    while reach < len(w) and product.max() > VANISHED:
        w[reach:] += product[reach:] * w[:-reach]
        product[reach:] = product[reach:] * product[:-reach]
        reach *= 2
    return w
