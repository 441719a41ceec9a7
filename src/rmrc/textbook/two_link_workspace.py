"""The workspace of the two-link arm's tip: its area and its boundary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError
from rmrc.textbook.two_link import two_link_position, two_link_postures

Array = NDArray[np.float64]
ArcKind = Literal["outer", "inner", "q1 lower", "q1 upper", "q2 lower", "q2 upper"]

# A posture is away from its limits if it is this far inside [rad]: more than the rounding of the inverse
# kinematics near full reach, √1e-16, less than can be seen.
INSIDE = 1e-6

# Number of tests per point of an arc: if arcs nearly touch, the remaining arcs can be short.
FINER = 16


@dataclass(frozen=True, eq=False)
class Arc:
    """A piece of the boundary of the workspace.

    Attributes:
        kind: "outer": stretched out (θ₂ = 0); "inner": folded (θ₂ = π); else the limit that is reached.
        q: Postures along it, (k, 2) [rad].
        points: Positions of the tip there, (k, 2) [m].
    """

    kind: ArcKind
    q: Array
    points: Array


def two_link_free_area(lengths: ArrayLike) -> NDArray[np.float64]:
    """Return the area that the tip reaches without joint limits: π((l₁ + l₂)² − (l₁ − l₂)²).

    It is the annulus between the circles of det J = 0; the same as 4π l₁ l₂ [Craig05, §4.2].

    Args:
        lengths: l₁, l₂, (..., 2) [m].

    Returns:
        (...) [m²].

    Example:
        The notes' arm, between the circles of radius 9 and 3:

        >>> float(two_link_free_area([6, 3]) / np.pi)
        72.0
    """
    l1, l2 = np.moveaxis(np.asarray(lengths, dtype=np.float64), -1, 0)
    return np.asarray(np.pi * ((l1 + l2) ** 2 - (l1 - l2) ** 2))[()]


def two_link_boundary(
    lengths: ArrayLike, limits: ArrayLike | None = None, spacing: float = np.radians(1.0)
) -> tuple[Arc, ...]:
    """Return the arcs that bound the workspace, with or without joint limits.

    The tip lacks a direction of motion only where det J = 0 or a joint is at its limit, so the boundary is
    among these arcs: circles of radius l₁ + l₂ and |l₁ − l₂| about the base (θ₂ = 0, π), with limits also the
    arcs about the base where θ₂ is at a limit, and of radius l₂ about the elbow where θ₁ is [Craig05, §4.2].
    The function omits the parts that the other posture, or the same one a full turn further, reaches away
    from limits and singularities, because they are inside.

    Args:
        lengths: l₁, l₂, both > 0, (2,) [m].
        limits: Lower and upper limit of θ₁ and of θ₂, (2, 2) [rad]; infinite or a full turn apart: free.
            None: both are free.
        spacing: Between the points of an arc, at most, in the joint that moves [rad].

    Returns:
        The arcs; together they are closed, except pieces shorter than spacing/16. With l₁ = l₂ there is no
        inner circle, only a point.

    Raises:
        ModelError: If a length is not positive, or a lower limit is not below the upper one.

    Example:
        The notes' arm of 6 and 3, first free, then with 0 < θ₁ < 135° and 0 < θ₂ < 120°:

        >>> for arc in two_link_boundary([6, 3]):
        ...     print(arc.kind, np.linalg.norm(arc.points, axis=1).round(3)[[0, -1]])
        outer [9. 9.]
        inner [3. 3.]
        >>> for arc in two_link_boundary([6, 3], np.radians([[0, 135], [0, 120]])):
        ...     print(arc.kind, *(arc.points[[0, -1]].round(3) + 0.0).tolist())
        q1 lower [9.0, 0.0] [4.5, 2.598]
        q1 upper [-6.364, 6.364] [-5.019, 1.345]
        outer [9.0, 0.0] [-6.364, 6.364]
        q2 upper [4.5, 2.598] [-5.019, 1.345]
    """
    l1, l2 = lengths = np.asarray(lengths, dtype=np.float64)
    if not np.all(lengths > 0.0):
        raise ModelError(f"two-link arm: lengths must be > 0, got {l1:g} and {l2:g}")
    ranges = np.full((2, 2), [-np.inf, np.inf]) if limits is None else np.array(limits, dtype=np.float64)
    for joint, (lower, upper) in enumerate(ranges, start=1):
        if not lower < upper:
            raise ModelError(f"two-link arm: limits of q{joint} must be rising, got {lower:g} to {upper:g}")
    is_free = ranges[:, 1] - ranges[:, 0] >= 2 * np.pi
    # A half-infinite range is a full turn too; all angles are then once in one turn.
    ranges[is_free] = [-np.pi, np.pi]
    return tuple(
        Arc(kind, piece, two_link_position(lengths, piece))
        for kind, ends in _candidates(ranges, is_free, skip_inner=bool(l1 == l2))
        for piece in _outside(lengths, ends, ranges, is_free, spacing)
    )


def _candidates(
    ranges: Array, is_free: NDArray[np.bool_], skip_inner: bool
) -> Iterator[tuple[ArcKind, tuple[Array, Array]]]:
    """Yield all possible boundary arcs, as lines in joint space."""
    (a, b), (c, d) = ranges
    if not is_free[0]:
        yield "q1 lower", (np.array([a, c]), np.array([a, d]))
        yield "q1 upper", (np.array([b, c]), np.array([b, d]))
    singular: tuple[tuple[ArcKind, float], ...] = (("outer", 0.0), ("inner", np.pi))
    for kind, angle in singular:
        elbow = angle + 2 * np.pi * np.ceil((c - angle - INSIDE) / (2 * np.pi))
        if elbow <= d + INSIDE and not (kind == "inner" and skip_inner):
            yield kind, (np.array([a, elbow]), np.array([b, elbow]))
    limits: tuple[tuple[ArcKind, float], ...] = (("q2 lower", c), ("q2 upper", d))
    for kind, elbow in limits:
        # At θ₂ = kπ it is one of those above.
        if not is_free[1] and abs(np.sin(elbow)) > INSIDE:
            yield kind, (np.array([a, elbow]), np.array([b, elbow]))


def _outside(
    lengths: Array, ends: tuple[Array, Array], ranges: Array, is_free: NDArray[np.bool_], spacing: float
) -> Iterator[Array]:
    """Yield the pieces of a line in joint space that no other posture reaches away from its limits."""
    first, last = ends
    width = float(np.abs(last - first).sum())

    def visible(t: Array) -> NDArray[np.bool_]:
        tip = two_link_position(lengths, first + t[:, None] * (last - first))
        postures = two_link_postures(lengths, tip)
        beyond = (postures - ranges[:, 0]) % (2 * np.pi)
        within = is_free | ((beyond > INSIDE) & (beyond < ranges[:, 1] - ranges[:, 0] - INSIDE))
        # If both limits of θ₂ give the same circle, the lower one includes it.
        mirrored = np.abs(beyond[..., 1] - np.pi) > np.pi - INSIDE
        within[..., 1] |= mirrored & ~is_free[1] & (first[1] == last[1] == ranges[1, 1])
        inside = within.all(axis=-1) & (np.abs(np.sin(postures[..., 1])) > INSIDE)
        return np.logical_not(inside.any(axis=-1))

    count = int(np.ceil(width / spacing))
    t, tests = np.linspace(0.0, 1.0, count + 1), np.linspace(0.0, 1.0, FINER * count + 1)
    seen = visible(tests)
    changes = np.flatnonzero(seen[1:] != seen[:-1])
    # Where a piece begins or ends, between two samples: by bisection, to the last bit.
    low, high = tests[changes], tests[changes + 1]
    for _ in range(50):
        middle = 0.5 * (low + high)
        as_before = visible(middle) == seen[changes]
        low, high = np.where(as_before, middle, low), np.where(as_before, high, middle)
    knots = np.concatenate([[0.0], 0.5 * (low + high), [1.0]])
    for i, (start, stop) in enumerate(pairwise(knots)):
        is_seen = bool(seen[0]) != bool(i % 2)  # it changes at every knot
        # A piece shorter than the margin around a limit is that margin.
        if is_seen and (stop - start) * width > 10 * INSIDE:
            piece = np.concatenate([[start], t[(t > start) & (t < stop)], [stop]])
            yield first + piece[:, None] * (last - first)
