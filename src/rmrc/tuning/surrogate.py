"""Prediction of the results of a structure's settings from its runs: Gaussian processes over its cube."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

# Lengths along an edge of the cube over which metrics change, and the share of noise in their variance, for
# example where another scenario becomes the worst.
_LENGTHS, _NOISE = (0.1, 0.2, 0.4, 0.8, 1.6), 1e-3
# Largest number of settings to learn from, the last ones: the time grows with the cube of their number.
_MOST = 80


class Surrogate:
    """Metrics over a unit cube, with a Matérn kernel that has a length for each edge [Rasmussen06]."""

    def __init__(self, points: _Array, values: _Array) -> None:
        """Learn.

        Args:
            points: In the cube, (m, d), two at least.
            values: Metrics there, (m, 2).
        """
        self._points, values = points[-_MOST:], values[-_MOST:]
        self._mean, self._scale = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-9)
        self._values = (values - self._mean) / self._scale
        self._lengths = np.full(points.shape[1], 0.4)
        likely = self._learn()
        for edge in (*range(points.shape[1]), *range(points.shape[1])):
            for length in _LENGTHS:
                before = self._lengths[edge]
                self._lengths[edge] = length
                found = self._learn()
                if found > likely:
                    likely = found
                else:
                    self._lengths[edge] = before
        self._learn()

    def _learn(self) -> float:
        """Solve for these lengths; return their log likelihood, up to a constant."""
        kernel = self._kernel(self._points) + _NOISE * np.eye(len(self._points))
        self._root = np.linalg.cholesky(kernel)
        self._white = np.linalg.solve(self._root, self._values)
        return float(-0.5 * np.sum(self._white**2) - 2.0 * np.log(np.diag(self._root)).sum())

    def _kernel(self, points: _Array) -> _Array:
        """Return the kernel between points and those that are known, (k, m)."""
        apart = (points[:, None] - self._points) / self._lengths
        distance = math.sqrt(5.0) * np.sqrt(np.einsum("kmd,kmd->km", apart, apart))
        return np.asarray((1.0 + distance + distance**2 / 3.0) * np.exp(-distance))

    def at(self, points: _Array, less: float) -> _Array:
        """Return optimistic metrics at points, (k, 2): this many standard deviations less than expected."""
        white = np.linalg.solve(self._root, self._kernel(points).T)
        spread = np.sqrt(np.maximum(1.0 - np.sum(white**2, axis=0), 0.0))
        return np.asarray(self._mean + self._scale * (white.T @ self._white - less * spread[:, None]))


def gains(front: _Array, points: _Array, reference: Sequence[float]) -> _Array:
    """Return by how much more than a front each point dominates of a plane below a reference, (k,).

    Args:
        front: Its points, (m, 2).
        points: To be added to it, one at a time, (k, 2).
        reference: Beyond which nothing counts.

    >>> gains(np.array([[1.0, 1.0]]), np.array([[0.0, 2.0], [2.0, 0.0], [2.0, 2.0]]), (3.0, 3.0))
    array([1., 1., 0.])
    """
    kept = front[np.argsort(front[:, 0])]
    edges = np.minimum(np.concatenate([[-math.inf], kept[:, 0], [math.inf]]), reference[0])
    lowest = np.minimum(np.minimum.accumulate(np.concatenate([[math.inf], kept[:, 1]])), reference[1])
    widths = np.clip(edges[1:] - np.maximum(edges[:-1], points[:, :1]), 0.0, None)
    return np.asarray((widths * np.clip(lowest - points[:, 1:], 0.0, None)).sum(axis=1))
