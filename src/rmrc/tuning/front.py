"""The Pareto front of peak rate and error, and the area that it dominates."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

# Smaller rates and errors count as this one.
_NOTHING = 1e-12


class Point(NamedTuple):
    """Objectives of a setting: less is better.

    Attributes:
        peak_rate: [rad/s].
        error: [m].
        time: [s]; counts only between settings that are equal in both.
    """

    peak_rate: float
    error: float
    time: float

    @property
    def logs(self) -> tuple[float, float]:
        """The logarithms of peak rate and error."""
        return math.log(max(self.peak_rate, _NOTHING)), math.log(max(self.error, _NOTHING))


def dominates(a: Point, b: Point) -> bool:
    """Return whether a is better than b in one and worse in none; of equals, the shorter is better.

    Example:
        >>> dominates(Point(1.0, 2.0, 9.0), Point(1.0, 3.0, 5.0)), dominates(Point(1, 2, 9), Point(2, 1, 9))
        (True, False)
    """
    if a[:2] == b[:2]:
        return a.time < b.time
    return a.peak_rate <= b.peak_rate and a.error <= b.error


def front(points: Sequence[Point]) -> list[int]:
    """Return the indices of the nondominated points, by rising peak rate; equal points are all included.

    Example:
        >>> front([Point(1, 5, 0), Point(2, 2, 0), Point(3, 3, 0), Point(4, 1, 0)])
        [0, 1, 3]
    """
    chosen = list[int]()
    for i in sorted(range(len(points)), key=lambda i: (points[i], i)):
        # of those before it, the last has the smallest error
        if not chosen or not dominates(points[chosen[-1]], points[i]):
            chosen.append(i)
    return chosen


def area(points: Sequence[Point], reference: tuple[float, float]) -> float:
    """Return the area that points dominate below a reference, in the plane of ln(peak rate) and ln(error).

    Args:
        points: In any order.
        reference: Largest peak rate and error that count, as logarithms.

    Example:
        >>> round(area([Point(1.0, 1.0, 0.0), Point(math.e, 9.0, 0.0)], (2.0, 3.0)), 9)
        6.0
    """
    total, (most, lowest) = 0.0, reference
    for rate, error in sorted(point.logs for point in points):
        if rate < most and error < lowest:
            total += (lowest - error) * (most - rate)
            lowest = error
    return total


def gains(front: _Array, points: _Array, reference: Sequence[float]) -> _Array:
    """Return by how much more than a front each point dominates of a plane below a reference, (k,).

    Args:
        front: Its points, (m, 2).
        points: To be added to it, one at a time, (k, 2).
        reference: Beyond which nothing counts.

    Example:
        >>> gains(np.array([[1.0, 1.0]]), np.array([[0.0, 2.0], [2.0, 0.0], [2.0, 2.0]]), (3.0, 3.0))
        array([1., 1., 0.])
    """
    known = front[np.argsort(front[:, 0])]
    edges = np.minimum(np.concatenate([[-math.inf], known[:, 0], [math.inf]]), reference[0])
    lowest = np.minimum(np.minimum.accumulate(np.concatenate([[math.inf], known[:, 1]])), reference[1])
    widths = np.clip(edges[1:] - np.maximum(edges[:-1], points[:, :1]), 0.0, None)
    return np.asarray((widths * np.clip(lowest - points[:, 1:], 0.0, None)).sum(axis=1))
