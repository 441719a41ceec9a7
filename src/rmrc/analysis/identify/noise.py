"""Noise and resolution of encoders, and jitter of stamps, from positions and the residual of a fit."""

from typing import NamedTuple

import numpy as np

from rmrc.analysis.identify.fit import STAMP, Fitted, Interval, Z
from rmrc.analysis.identify.response import Array


class Noise(NamedTuple):
    """Noise of the positions of a joint.

    Attributes:
        value: Standard deviation of the white noise of its encoder, with its interval [rad or m].
        resolution: Step of its positions; 0: none is visible [rad or m].
        jitter: Standard deviation of the time at which they are read [s].
        total: Standard deviation of all these together, in the mean [rad or m].
    """

    value: Interval
    resolution: float
    jitter: float
    total: float


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
    if len(steps) < 4:
        return 0.0
    unit = float(steps.min())
    for units in (1.5, 5.0, 15.0, 50.0):  # a file with few digits rounds each step
        near = steps[steps < units * unit]
        whole = np.maximum(np.round(near / unit), 1.0)
        unit = float(near @ whole / (whole @ whole))
    agreement = abs(complex(np.exp(2j * np.pi * near / unit).mean()))
    return unit if len(near) >= 4 and agreement > 0.95 else 0.0


def noise_of(fitted: Fitted, step: float) -> Noise:
    """Return the noise of positions with a resolution.

    Second differences of the residual cancel smooth parts. Their mean square is 6 σ² + τ² (w₋² + 4 w² + w₊²)
    with the rates w and a jitter τ of the times. The variance of their mean square, 140 σ⁴/N, gives the
    interval.
    """
    rows = np.flatnonzero(fitted.parts[2:] == fitted.parts[:-2])
    second, squares = np.diff(fitted.residual, 2)[rows] ** 2, fitted.rate**2
    grown = (squares[:-2] + 4.0 * squares[1:-1] + squares[2:])[rows]
    # a joint that moves by less than its resolution repeats its reading, whatever the noise
    pace = np.median(np.diff(fitted.samples.time)) * np.sqrt(grown / 6.0)
    moving = pace >= step if (pace >= step).sum() > 0.1 * len(pace) else pace >= 0.0
    columns = np.column_stack([np.full(moving.sum(), 6.0), grown[moving]])
    second, weight = second[moving], np.ones(moving.sum())
    for _ in range(8):
        scaled = columns * weight[:, None]
        square, jitter = np.linalg.lstsq(scaled.T @ columns, scaled.T @ second, rcond=None)[0]
        square, jitter = max(square, 0.0), max(jitter, 0.0)
        weight = 1.0 / np.maximum(columns @ (square, jitter), 1e-3 * second.mean() + 1e-300) ** 2
    if jitter * grown.mean() < 3.0 * square or jitter < (0.5 * STAMP) ** 2:
        square, jitter = float(second.mean()) / 6.0, 0.0
    spread = Z * np.sqrt(140.0 / max(len(second), 1)) / 6.0
    ends = (square * (1.0 + far) - step**2 / 12.0 for far in (0.0, -spread, spread))
    value, low, high = (float(np.sqrt(max(end, 0.0))) for end in ends)
    # where the joint is slow, rounding hides a smaller noise
    high = max(high, step / np.sqrt(12.0)) if low == 0.0 else high
    total = float(np.sqrt(max(square, step**2 / 12.0) + jitter * squares.mean()))
    return Noise(Interval(value, low, high), step, float(np.sqrt(jitter)), total)
