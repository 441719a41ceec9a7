"""The sampled loop around joints with a delay, and its largest stable feedback.

The law sends K times the error every T seconds. The command arrives after a dead time τ. Rates follow it with
the time constant T₁, and the joint integrates the rates. Without a lag and with τ = d T this is the
difference equation e(t + 1) = e(t) − K T e(t − d) [Astrom97, chapter 4].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

# The phase falls smoothly: between neighbors of this many frequencies it crosses −π at most once. The lowest
# is below the ringing frequency of any loop with the same sum of times.
_FREQUENCIES, _LOWEST = 400, 1e-3
# Halvings of an interval of logarithms until it is at rounding.
_HALVINGS = 60
# 0.3/0.1 is off by some 1e-16: a whole number of ticks is one.
_ROUNDING = 1e-9
# A lag this many times as long as all other times has the effect of an infinite one.
_ENDLESS = 1e6


def rule_gain(period: float, delay: float = 0.0, lag: float = 0.0) -> float:
    """Return the feedback that the rule of thumb allows.

    K = 1/(τ + T/2 + T₁): a sampled command is late by half a period on average. It leaves a gain margin of
    about π/2 without a lag, and more with one.

    Args:
        period: Period of the law, T [s].
        delay: Dead time τ of a command [s].
        lag: Time constant T₁ of the rates [s].

    Returns:
        K [1/s].

    Example:
        >>> round(rule_gain(0.001, delay=0.008), 3)
        117.647
    """
    return 1.0 / (delay + 0.5 * period + lag)


def edge_gain(period: float, delay: float = 0.0, lag: float = 0.0) -> float:
    """Return the feedback at the stability limit of the loop around an ideal joint.

    It is the smallest K for which 1 + K P(z) = 0 has a root on the unit circle, with P of `edge_frequency`.
    For d ticks of dead time and no lag, K T = 2 sin(π/(2 (2 d + 1))): 2, 1, 0.618, 0.445, ...

    Args:
        period: Period of the law, T [s].
        delay: Dead time τ of a command [s]; any part of a period.
        lag: Time constant T₁ of the rates [s].

    Returns:
        K [1/s].

    Example:
        >>> [round(edge_gain(1.0, delay), 3) for delay in (0, 1, 2, 3)]
        [2.0, 1.0, 0.618, 0.445]
    """
    z = np.asarray(np.exp(1j * edge_frequency(period, delay, lag) * period))
    _, late, follow = _factors(z, period, delay, lag)
    return float(abs((z - 1.0) / (late * follow)) / period)


@lru_cache(maxsize=4096)
def edge_frequency(period: float, delay: float = 0.0, lag: float = 0.0) -> float:
    """Return the ringing frequency at the stability limit: the first at which the phase of P is −π.

    P(z) = T/(z − 1) · z^(−d) ((1 − f) + f/z) · ((1 − m) + m s/(z − 1 + s)), with τ = (d + f) T, d whole and
    0 <= f < 1, s = 1 − exp(−T/T₁) and m = s T₁/T: a command that arrives within a tick counts by its share
    of it, and the joint moves by the mean of the lagging rate.

    Args:
        period: Period of the law, T [s].
        delay: Dead time τ of a command [s].
        lag: Time constant T₁ of the rates [s].

    Returns:
        ω [rad/s]; π/T at most.

    Example:
        >>> round(edge_frequency(0.002) * 0.002 / np.pi, 9)
        1.0
    """
    slowest = _LOWEST / (1.0 + (delay + lag) / period)
    angles = np.pi * np.geomspace(slowest, 1.0, _FREQUENCIES)
    above = _phase(angles, period, delay, lag) > -np.pi
    if above.all():
        return math.pi / period
    last = int(np.argmin(above))  # the first that is not above
    low, high = math.log(angles[last - 1]), math.log(angles[last])
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _phase(np.exp(middle), period, delay, lag) > -np.pi:
            low = middle
        else:
            high = middle
    return math.exp(high) / period


@lru_cache(maxsize=256)
def edge_delay(feedback: float, period: float, lag: float = 0.0) -> float:
    """Return the dead time at the stability limit of the loop around an ideal joint.

    Args:
        feedback: K [1/s], positive.
        period: Period of the law, T [s].
        lag: Time constant T₁ of the rates [s].

    Returns:
        τ [s]; 0 where the loop tolerates none.

    Example:
        >>> edge_delay(1000.0, 0.001)  # doctest: +ELLIPSIS
        0.001...
    """
    # the limit with any lag is below π/2/τ
    return _edge(lambda delay: edge_gain(period, delay, lag) >= feedback, 0.5 * math.pi / feedback)


def edge_lag(feedback: float, period: float, delay: float = 0.0) -> float:
    """Return the shortest time constant at the stability limit of the loop around an ideal joint.

    For an infinite lag the limit is K = 1/(τ + T/2): with a smaller K, the loop tolerates any lag.

    Args:
        feedback: K [1/s], positive.
        period: Period of the law, T [s].
        delay: Dead time τ of a command [s].

    Returns:
        T₁ [s]; 0 where the loop tolerates none, infinite where it tolerates any.

    Example:
        >>> edge_lag(20.0, 0.001, delay=0.008)
        inf
    """
    longest = _ENDLESS * (delay + period)
    if edge_gain(period, delay, longest) >= feedback:
        return math.inf
    return _edge(lambda lag: edge_gain(period, delay, lag) >= feedback, longest)


def _edge(is_stable: Callable[[float], bool], most: float) -> float:
    """Return the stability limit between 0 and an unstable value."""
    if not is_stable(0.0):
        return 0.0
    low, high = 0.0, most
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_stable(middle) else (low, middle)
    return low


def _phase(angle: ArrayLike, period: float, delay: float, lag: float) -> NDArray[np.float64]:
    """Return the phase of P(e^(iα)) for 0 < α <= π, as it falls from −π/2 on, unwrapped."""
    z = np.asarray(np.exp(1j * np.asarray(angle)))
    whole, late, follow = _factors(z, period, delay, lag)
    # of the integrator −π/2 − α/2; the other factors turn by less than π each
    return np.asarray(
        -0.5 * np.pi - (0.5 + whole) * np.asarray(angle) - abs(np.angle(late)) - abs(np.angle(follow))
    )


def _factors(
    z: NDArray[np.complex128], period: float, delay: float, lag: float
) -> tuple[int, NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the whole ticks of a dead time, and the factors of its remainder and of the lag."""
    whole = math.floor(delay / period + _ROUNDING)
    part = max(0.0, delay / period - whole)
    late = np.asarray((1.0 - part) + part / z)
    if lag == 0.0:
        return whole, late, np.ones_like(z)
    step = -math.expm1(-period / lag)
    behind = step * lag / period
    return whole, late, np.asarray((1.0 - behind) + behind * step / (z - 1.0 + step))
