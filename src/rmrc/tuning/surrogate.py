"""Predict the results of settings from the runs of their structure: a Gaussian process over its cube."""

import math

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

# Lengths along an edge of the cube over which metrics change, and the share of noise in their variance, for
# example where another world becomes the worst.
_LENGTHS, _NOISE = (0.1, 0.2, 0.4, 0.8, 1.6), 1e-3
# Largest number of settings to learn from, the last ones: the time grows with the cube of their number.
_MOST = 80


def predict(points: _Array, values: _Array, at: _Array, less: float) -> _Array:
    """Return optimistic values at other points, (k, 2): some standard deviations less than expected.

    The kernel is Matérn's, with the likeliest length along each edge [Rasmussen06].

    Args:
        points: In the cube, (m, d), two at least.
        values: There, (m, 2).
        at: Other points, (k, d).
        less: Number of standard deviations.
    """
    points, values = points[-_MOST:], values[-_MOST:]
    mean, scale = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-9)
    values, lengths = (values - mean) / scale, np.full(points.shape[1], 0.4)

    def learn(lengths: _Array) -> tuple[float, _Array, _Array]:
        root = np.linalg.cholesky(_kernel(points, points, lengths) + _NOISE * np.eye(len(points)))
        white = np.linalg.solve(root, values)
        return float(-0.5 * np.sum(white**2) - 2.0 * np.log(np.diag(root)).sum()), root, white

    for edge in (*range(len(lengths)), *range(len(lengths))):
        options = [np.where(np.arange(len(lengths)) == edge, length, lengths) for length in _LENGTHS]
        lengths = max(options, key=lambda option: learn(option)[0])
    _, root, white = learn(lengths)
    shares = np.linalg.solve(root, _kernel(points, at, lengths))
    spread = np.sqrt(np.maximum(1.0 - np.sum(shares**2, axis=0), 0.0))
    return np.asarray(mean + scale * (shares.T @ white - less * spread[:, None]))


def _kernel(points: _Array, others: _Array, lengths: _Array) -> _Array:
    apart = (points[:, None] - others) / lengths
    distance = math.sqrt(5.0) * np.linalg.norm(apart, axis=2)
    return np.asarray((1.0 + distance + distance**2 / 3.0) * np.exp(-distance))
