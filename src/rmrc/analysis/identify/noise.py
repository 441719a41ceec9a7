"""Noise and resolution of encoders, from the positions of a log and the residual of a fit."""

import numpy as np

from rmrc.analysis.identify.fit import Interval, Z
from rmrc.analysis.identify.response import Array

# Steps of this many units can still be recognized as multiples; fewer steps than the second are not enough.
_UNITS, _LEAST = 50.0, 4
# Required agreement of steps with multiples: 1 is perfect; random ones give 1/sqrt of their number.
_AGREEMENT = 0.95


def resolution(position: Array) -> float:
    """Return the step that divides all differences of positions; 0 if none is visible.

    Args:
        position: (N,) [rad or m].

    Example:
        >>> round(resolution(0.25 * np.arange(20) ** 2 % 7), 9)
        0.25
    """
    values = np.unique(position)
    steps = np.diff(values)
    steps = steps[steps > 1e-12 * max(float(np.abs(values).max()), 1e-6)]  # smaller ones are rounding
    if len(steps) < _LEAST:
        return 0.0
    unit = float(steps.min())
    for units in (1.5, 5.0, 15.0, _UNITS):  # a file with few digits rounds each step
        near = steps[steps < units * unit]
        whole = np.maximum(np.round(near / unit), 1.0)
        unit = float(near @ whole / (whole @ whole))
    agreement = abs(complex(np.exp(2j * np.pi * near / unit).mean()))
    return unit if len(near) >= _LEAST and agreement > _AGREEMENT else 0.0


def white_noise(residual: Array, step: float) -> Interval:
    """Return the standard deviation of the white part of a residual, less that of a resolution.

    It uses second differences, which cancel smooth parts: var(e₋ − 2 e + e₊) = 6 σ². The variance of their
    mean square, 140 σ⁴/N, gives the interval.

    Args:
        residual: (N,) [rad or m].
        step: Resolution r; its rounding has the variance r²/12.
    """
    second = np.diff(residual, 2)
    square = float(second @ second) / (6.0 * max(len(second), 1))
    spread = Z * np.sqrt(140.0 / max(len(second), 1)) / 6.0
    ends = (square * (1.0 + far) - step**2 / 12.0 for far in (0.0, -spread, spread))
    value, low, high = (float(np.sqrt(max(one, 0.0))) for one in ends)
    # where the joint is slow, rounding hides a smaller noise
    return Interval(value, low, max(high, step / np.sqrt(12.0)) if low == 0.0 else high)
