"""The planar arm with two links: Jacobians, rates, small displacements, both postures.

Frame {0} does not move, frame {1} has its x axis along the first link, frame {2} along the second.
`lengths` is l₁, l₂ in m, `q` is θ₁, θ₂ in radians; q = 0 is stretched out along x.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    (l1, l2), (q1, q2) = _each(lengths), _each(q)
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
    (l1, l2), (q1, q2) = _each(lengths), _each(q)
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
    (l1, l2), (_, q2) = _each(lengths), _each(q)
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
    adjugate = np.stack(
        [
            np.stack([J[..., 1, 1], -J[..., 0, 1]], axis=-1),
            np.stack([-J[..., 1, 0], J[..., 0, 0]], axis=-1),
        ],
        axis=-2,
    )
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
    (l1, l2), (q1, q2) = _each(lengths), _each(q)
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
    (l1, l2), (q1, q2), (first, second) = _each(lengths), _each(q), _each(qdot)
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
    (l1, l2), (_, q2), (first, second) = _each(lengths), _each(q), _each(qdot)
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
    (l1, l2), (_, q2) = _each(lengths), _each(q)
    x, y = l2 * np.cos(q2), l2 * np.sin(q2)
    return _matrix([-y, -y], [l1 + x, x])


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
    (l1, l2), (_, q2) = _each(lengths), _each(q)
    x, y = l1 * np.cos(q2), l1 * np.sin(q2)
    return _matrix([y, np.zeros_like(y * l2)], [x + l2, l2 + np.zeros_like(x)])


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
    (l1, l2), (dx, dy) = _each(lengths), _each(displacement)
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
    (l1, l2), (x, y) = _each(lengths), _each(position)
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


def _each(values: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    return tuple(np.moveaxis(np.asarray(values, dtype=np.float64), -1, 0))


def _matrix(*rows: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
