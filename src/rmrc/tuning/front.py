"""The Pareto front of peak rate and error."""

from collections.abc import Sequence
from typing import NamedTuple


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
