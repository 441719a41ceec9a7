"""The Pareto front of peak rate and error, and nondominated sorting."""

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


def ranks(points: Sequence[Point]) -> list[int]:
    """Return how many fronts are before each point: 0 on the front, 1 on that of the rest, and so on [Deb02].

    With two objectives one pass over the points in order is enough: of each front, only the last point so far
    can dominate the next one, because none before it has a smaller error.

    Example:
        >>> ranks([Point(1, 5, 0), Point(2, 2, 0), Point(3, 3, 0), Point(4, 1, 0)])
        [0, 0, 1, 0]
    """
    result, last = [0] * len(points), list[Point]()
    for i in sorted(range(len(points)), key=points.__getitem__):
        rank = next((r for r, end in enumerate(last) if not dominates(end, points[i])), len(last))
        last[rank : rank + 1] = [points[i]]
        result[i] = rank
    return result


def front(points: Sequence[Point]) -> list[int]:
    """Return the indices of the nondominated points, by rising peak rate; equal points are all included."""
    found = [i for i, rank in enumerate(ranks(points)) if rank == 0]
    return sorted(found, key=lambda i: (points[i], i))
