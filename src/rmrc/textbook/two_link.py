"""The planar arm with two links: Jacobians, rates, small displacements, both postures, and its workspace.

Frame {0} does not move, frame {1} has its x axis along the first link, frame {2} along the second.
`lengths` is l₁, l₂ in m, `q` is θ₁, θ₂ in radians; q = 0 is stretched out along x.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError
from rmrc.support.spatial import each_of, matrix_of

# Squares of lengths are rounded: a point computed at full reach may lie beyond it by this share of the
# largest of them.
BEYOND = 1e-14


def two_link_position(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the tip of the two-link arm.

    x = l₁ c₁ + l₂ c₁₂, y = l₁ s₁ + l₂ s₁₂ [Khatib08].

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        q: θ₁, θ₂, (..., 2) [rad].

    Returns:
        [x, y], (..., 2) [m].

    Example:
        >>> two_link_position([1, 1], np.radians([60, -120])).round(3) + 0.0
        array([1., 0.])
    """
    (l1, l2), (q1, q2) = each_of(lengths), each_of(q)
    x = l1 * np.cos(q1) + l2 * np.cos(q1 + q2)
    y = l1 * np.sin(q1) + l2 * np.sin(q1 + q2)
    return np.stack([x, y], axis=-1)


def two_link_jacobian(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the two rows that can move of the two-link arm's Jacobian, in frame {0}.

    J = [[−l₁ s₁ − l₂ s₁₂, −l₂ s₁₂], [l₁ c₁ + l₂ c₁₂, l₂ c₁₂]] [Craig05, §5.7].

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        q: θ₁, θ₂, (..., 2) [rad].

    Returns:
        Rows x, y, (..., 2, 2) [m].

    Example:
        >>> two_link_jacobian([1, 1], np.radians([0, 90])).round(3) + 0.0
        array([[-1., -1.],
               [ 1.,  0.]])
    """
    (l1, l2), (q1, q2) = each_of(lengths), each_of(q)
    x2, y2 = l2 * np.cos(q1 + q2), l2 * np.sin(q1 + q2)
    x, y = l1 * np.cos(q1) + x2, l1 * np.sin(q1) + y2
    return np.stack([np.stack([-y, -y2], axis=-1), np.stack([x, x2], axis=-1)], axis=-2)


def two_link_determinant(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return det J = l₁ l₂ s₂: singular stretched out or folded, θ₂ = kπ [Craig05, example 5.4].

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        q: θ₁, θ₂, (..., 2) [rad].

    Returns:
        det J, (...) [m²].

    Example:
        >>> two_link_determinant([6, 3], np.radians([10, 30])).round(3)
        np.float64(9.0)
    """
    (l1, l2), (_, q2) = each_of(lengths), each_of(q)
    return np.asarray(l1 * l2 * np.sin(q2))[()]


def two_link_jacobian_inverse(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the inverse of the two-link arm's Jacobian, in frame {0}.

    J⁻¹ = [[l₂ c₁₂, l₂ s₁₂], [−l₁ c₁ − l₂ c₁₂, −l₁ s₁ − l₂ s₁₂]] / (l₁ l₂ s₂)
    [Craig05, example 5.5].

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        q: θ₁, θ₂, (..., 2) [rad].

    Returns:
        J⁻¹, columns x, y, (..., 2, 2) [1/m].

    Raises:
        numpy.linalg.LinAlgError: If a determinant is exactly zero. In floating point sin π is 1e-16
            and not 0, so an arm folded by θ₂ = π gives huge numbers instead.

    Example:
        >>> two_link_jacobian_inverse([1, 1], np.radians([0, 90])).round(3) + 0.0
        array([[ 0.,  1.],
               [-1., -1.]])
    """
    determinant = np.asarray(two_link_determinant(lengths, q))
    if np.any(determinant == 0.0):
        raise np.linalg.LinAlgError("two-link arm: det J = l1 l2 sin(theta2) = 0, J has no inverse")
    J = two_link_jacobian(lengths, q)
    adjugate = matrix_of([J[..., 1, 1], -J[..., 0, 1]], [-J[..., 1, 0], J[..., 0, 0]])
    return adjugate / determinant[..., None, None]


def two_link_rates(lengths: ArrayLike, q: ArrayLike, speed: float = 1.0) -> NDArray[np.float64]:
    """Return the joint rates that move the tip along x: they grow without bound as θ₂ → 0.

    θ̇₁ = v c₁₂ / (l₁ s₂), θ̇₂ = −v c₁ / (l₂ s₂) − v c₁₂ / (l₁ s₂) [Craig05, example 5.5].

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        q: θ₁, θ₂, (..., 2) [rad].
        speed: v along x of frame {0} [m/s].

    Returns:
        [θ̇₁, θ̇₂], (..., 2) [rad/s].

    Raises:
        numpy.linalg.LinAlgError: If a determinant is exactly zero.

    Example:
        Each row is ten times nearer to full reach than the previous one, and ten times faster:

        >>> two_link_rates([1, 1], [[0, 0.1], [0, 0.01], [0, 0.001]]).round(1)
        array([[   10.,   -20.],
               [  100.,  -200.],
               [ 1000., -2000.]])
    """
    if np.any(two_link_determinant(lengths, q) == 0.0):
        raise np.linalg.LinAlgError("two-link arm: det J = l1 l2 sin(theta2) = 0, rates are unbounded")
    (l1, l2), (q1, q2) = each_of(lengths), each_of(q)
    rate1 = speed * np.cos(q1 + q2) / (l1 * np.sin(q2))
    return np.stack([rate1, -speed * np.cos(q1) / (l2 * np.sin(q2)) - rate1], axis=-1)


def two_link_velocity_in_frame_0(lengths: ArrayLike, q: ArrayLike, qdot: ArrayLike) -> NDArray[np.float64]:
    """Return the velocity of the tip along the axes of frame {0}.

    ⁰v = (−l₁ θ̇₁ s₁ − l₂ (θ̇₁ + θ̇₂) s₁₂, l₁ θ̇₁ c₁ + l₂ (θ̇₁ + θ̇₂) c₁₂) [Craig05, example 5.3].

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        q: θ₁, θ₂, (..., 2) [rad].
        qdot: θ̇₁, θ̇₂, (..., 2) [rad/s].

    Returns:
        (..., 2) [m/s].

    Example:
        >>> two_link_velocity_in_frame_0([1, 1], np.radians([90, 0]), [1, 1]).round(3) + 0.0
        array([-3.,  0.])
    """
    (l1, l2), (q1, q2), (first, second) = each_of(lengths), each_of(q), each_of(qdot)
    q12, both = q1 + q2, first + second
    x = -l1 * first * np.sin(q1) - l2 * both * np.sin(q12)
    y = l1 * first * np.cos(q1) + l2 * both * np.cos(q12)
    return np.stack([x, y], axis=-1)


def two_link_velocity_in_frame_2(lengths: ArrayLike, q: ArrayLike, qdot: ArrayLike) -> NDArray[np.float64]:
    """Return the same velocity of the tip, relative to the ground, along the axes of frame {2}.

    ²v = (l₁ θ̇₁ s₂, l₁ θ̇₁ c₂ + l₂ (θ̇₁ + θ̇₂)): the frame only writes it [Craig05, example 5.3].

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        q: θ₁, θ₂, (..., 2) [rad]; θ₁ plays no part.
        qdot: θ̇₁, θ̇₂, (..., 2) [rad/s].

    Returns:
        (..., 2) [m/s].

    Example:
        >>> two_link_velocity_in_frame_2([1, 1], np.radians([90, 0]), [1, 1])
        array([0., 3.])
    """
    (l1, l2), (_, q2), (first, second) = each_of(lengths), each_of(q), each_of(qdot)
    x = l1 * first * np.sin(q2)
    y = l1 * first * np.cos(q2) + l2 * (first + second)
    return np.stack(np.broadcast_arrays(x, y), axis=-1)


def two_link_jacobian_in_frame_1(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of the tip along the axes of the first link.

    ¹J = [[−l₂ s₂, −l₂ s₂], [l₁ + l₂ c₂, l₂ c₂]]: its first row is zero at θ₂ = kπ, so that x of
    frame {1} is the direction that is lost [Khatib08].

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        q: θ₁, θ₂, (..., 2) [rad]; θ₁ plays no part.

    Returns:
        Rows x, y, (..., 2, 2) [m].

    Example:
        >>> two_link_jacobian_in_frame_1([2, 1], [0.7, 0.0]) + 0.0
        array([[0., 0.],
               [3., 1.]])
    """
    (l1, l2), (_, q2) = each_of(lengths), each_of(q)
    x, y = l2 * np.cos(q2), l2 * np.sin(q2)
    return matrix_of([-y, -y], [l1 + x, x])


def two_link_jacobian_in_frame_2(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of the tip along the axes of the second link.

    ²J = [[l₁ s₂, 0], [l₁ c₂ + l₂, l₂]] [Craig05, §5.7].

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        q: θ₁, θ₂, (..., 2) [rad]; θ₁ plays no part.

    Returns:
        Rows x, y, (..., 2, 2) [m].

    Example:
        >>> two_link_jacobian_in_frame_2([2, 1], np.radians([40, 90])).round(3)
        array([[2., 0.],
               [1., 1.]])
    """
    (l1, l2), (_, q2) = each_of(lengths), each_of(q)
    x, y = l1 * np.cos(q2), l1 * np.sin(q2)
    return matrix_of([y, np.zeros_like(y * l2)], [x + l2, l2 + np.zeros_like(x)])


def two_link_small_displacements(
    lengths: ArrayLike, elbow: ArrayLike, displacement: ArrayLike
) -> NDArray[np.float64]:
    """Return the joint displacements that move the tip a little, near full reach.

    To first order in the small θ₂, with Δx, Δy along the axes of frame {1} [Khatib08]:
    Δq₁ = Δx/(l₁ θ₂) + Δy/l₁, Δq₂ = −(l₁ + l₂) Δx/(l₁ l₂ θ₂) − Δy/l₁. Motion across the arm (Δy) is regular.
    Along the arm (Δx) both joints must move without bound as θ₂ → 0.

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        elbow: θ₂, small but not 0, (...) [rad].
        displacement: [Δx, Δy] in frame {1}, (..., 2) [m].

    Returns:
        [Δq₁, Δq₂], (..., 2) [rad]; the relative error is of order θ₂.

    Raises:
        numpy.linalg.LinAlgError: If some θ₂ is 0.

    Example:
        A millimeter along an arm that is bent by 0.01 rad, and a millimeter across it:

        >>> two_link_small_displacements([1, 1], 0.01, [[0.001, 0], [0, 0.001]]).round(6)
        array([[ 0.1  , -0.2  ],
               [ 0.001, -0.001]])
    """
    elbow = np.asarray(elbow, dtype=np.float64)
    if np.any(elbow == 0.0):
        raise np.linalg.LinAlgError("two-link arm: theta2 = 0, the tip cannot move along the arm")
    (l1, l2), (dx, dy) = each_of(lengths), each_of(displacement)
    along, across = dx / elbow, dy / l1
    return np.stack([along / l1 + across, -(l1 + l2) * along / (l1 * l2) - across], axis=-1)


def two_link_postures(lengths: ArrayLike, position: ArrayLike) -> NDArray[np.float64]:
    """Return both postures that bring the tip to a position: the inverse kinematics.

    tan²(θ₂/2) = ((l₁ + l₂)² − r²)/(r² − (l₁ − l₂)²), the law of cosines for r² = x² + y², and
    θ₁ = atan2(y, x) − atan2(l₂ s₂, l₁ + l₂ c₂) [Craig05, §4.4]. The half angle loses no digits at
    full reach, where the arc cosine loses half of them.

    Args:
        lengths: l₁, l₂, (..., 2) [m].
        position: [x, y], (..., 2) [m].

    Returns:
        [θ₁, θ₂], first the posture with θ₂ ≥ 0, then the one with θ₂ ≤ 0; they agree at full reach.
        Angles are in [−π, π]; NaN where the position is out of reach, (..., 2, 2) [rad]. With l₁ = l₂
        the arm can fold onto its base at any θ₁; one of them is returned.

    Example:
        >>> np.degrees(two_link_postures([1, 1], [1, 1])).round(6) + 0.0
        array([[  0.,  90.],
               [ 90., -90.]])
        >>> two_link_postures([1, 1], [2, 1])
        array([[nan, nan],
               [nan, nan]])
    """
    (l1, l2), (x, y) = each_of(lengths), each_of(position)
    square = x * x + y * y
    left_out, left_in = (l1 + l2) ** 2 - square, square - (l1 - l2) ** 2
    slack = BEYOND * ((l1 + l2) ** 2 + square)
    reached = (left_out >= -slack) & (left_in >= -slack)
    bend = 2 * np.arctan2(np.sqrt(np.maximum(left_out, 0.0)), np.sqrt(np.maximum(left_in, 0.0)))
    second = np.stack([bend, -bend], axis=-1)
    l1, l2, x, y = (value[..., None] for value in (l1, l2, x, y))
    first = np.arctan2(y, x) - np.arctan2(l2 * np.sin(second), l1 + l2 * np.cos(second))
    turns = np.round(first / (2 * np.pi))
    postures = np.stack([first - 2 * np.pi * turns, second], axis=-1)
    return np.where(reached[..., None, None], postures, np.nan)


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
