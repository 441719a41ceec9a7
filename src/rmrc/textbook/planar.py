"""Planar arms: n links, three as printed in the notes, a sliding joint, and a platform on three legs.

All links move in the x-y plane, joint axes along +z, q = 0 stretched out along x. The rows of a
planar Jacobian are x, y and the rotation about z; `lengths` is l_1..l_n in m, `q` is in radians.

The arm of exercise 6.3 has a revolute joint at the origin, then a sliding one [Selig92]. At home the rod
lies along x and its point Q is at (r₀, 0), with r₀ = 1 in the exercise. q = (θ, d): the angle, and the
displacement of the rod from home.

The 3-RPR platform is a triangle on three legs that slide, hinged at both ends. For a parallel mechanism, the
inverse kinematics is a function: the pose of the platform determines the lengths of the legs. The inverse
Jacobian therefore has a closed form.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.spatial import each_of
from rmrc.textbook.chains import DHChain


def planar_position(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the position and direction of the tip of an n-link arm.

    x = Σ l_i cos φ_i, y = Σ l_i sin φ_i, rz = φ_n, with φ_i = q_1 + ... + q_i [Khatib08].

    Args:
        lengths: l, (..., n) [m].
        q: Joint positions, (..., n) [rad].

    Returns:
        [x, y, rz], (..., 3) [m, m, rad]; rz is the sum of the angles, not wrapped.

    Example:
        >>> planar_position([1, 1, 1], np.radians([90, -90, -90])).round(3)
        array([ 1.   ,  0.   , -1.571])
    """
    phi, lengths = np.broadcast_arrays(
        np.cumsum(np.asarray(q, dtype=np.float64), axis=-1), np.asarray(lengths, dtype=np.float64)
    )
    x, y = np.sum(lengths * np.cos(phi), axis=-1), np.sum(lengths * np.sin(phi), axis=-1)
    return np.stack([x, y, phi[..., -1]], axis=-1)


def planar_jacobian(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of the tip of an n-link arm.

    Column i is (−Σ_k l_k sin φ_k, Σ_k l_k cos φ_k, 1) with k = i..n [Khatib08].
    With l_n = 0 it is the Jacobian of the wrist point, which turns with the last link: J_W of the notes.

    Args:
        lengths: l, (..., n) [m].
        q: Joint positions, (..., n) [rad].

    Returns:
        Rows x, y, rz in frame {0}, (..., 3, n).

    Example:
        >>> planar_jacobian([1, 1, 1], np.radians([90, -90, -90])).round(3) + 0.0
        array([[0., 1., 1.],
               [1., 1., 0.],
               [1., 1., 1.]])
    """
    phi, lengths = np.broadcast_arrays(
        np.cumsum(np.asarray(q, dtype=np.float64), axis=-1), np.asarray(lengths, dtype=np.float64)
    )
    x = np.cumsum((-lengths * np.sin(phi))[..., ::-1], axis=-1)[..., ::-1]
    y = np.cumsum((lengths * np.cos(phi))[..., ::-1], axis=-1)[..., ::-1]
    return np.stack([x, y, np.ones_like(phi)], axis=-2)


def planar_jacobian_from_centers(centers: ArrayLike, point: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of a point from the positions of the joints, without a derivative.

    Each joint is the center of rotation of all later links, so its column is (j_y − y, x − j_x) for the joint
    at j and the point at (x, y), and 1 for the angle [Selig92, §6.4].

    Args:
        centers: Positions j_1..j_n of the joints, (..., n, 2) [m].
        point: Position of the point, (..., 2) [m].

    Returns:
        Rows x, y, rz in the frame of centers and point, (..., 3, n).

    Example:
        Two links of 1 m, bent by 90°: joints at (0, 0) and (1, 0), the tip at (1, 1).

        >>> planar_jacobian_from_centers([[0, 0], [1, 0]], [1, 1])
        array([[-1., -1.],
               [ 1.,  0.],
               [ 1.,  1.]])
    """
    arm = np.asarray(point, dtype=np.float64)[..., None, :] - np.asarray(centers, dtype=np.float64)
    return np.stack([-arm[..., 1], arm[..., 0], np.ones_like(arm[..., 0])], axis=-2)


def embed_planar_jacobian(jacobian: ArrayLike) -> NDArray[np.float64]:
    """Return a planar Jacobian with all six rows: z, rx and ry of a planar arm are zero.

    Args:
        jacobian: Rows x, y, rz, (..., 3, n).

    Returns:
        Rows [v; ω], (..., 6, n).

    Example:
        >>> embed_planar_jacobian(planar_jacobian([1, 1], [0, 0])).T + 0.0
        array([[0., 2., 0., 0., 0., 1.],
               [0., 1., 0., 0., 0., 1.]])
    """
    jacobian = np.asarray(jacobian, dtype=np.float64)
    spatial = np.zeros((*jacobian.shape[:-2], 6, jacobian.shape[-1]))
    spatial[..., [0, 1, 5], :] = jacobian
    return spatial


def three_link_position(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the position and direction of the tip of the three-link arm.

    x = l₁ c₁ + l₂ c₁₂ + l₃ c₁₂₃, y = l₁ s₁ + l₂ s₁₂ + l₃ s₁₂₃, rz = θ₁ + θ₂ + θ₃
    [Khatib08].

    Args:
        lengths: l₁, l₂, l₃, (..., 3) [m]; l₃ = 0 gives the wrist point.
        q: θ₁, θ₂, θ₃, (..., 3) [rad].

    Returns:
        [x, y, rz], (..., 3) [m, m, rad].

    Example:
        >>> three_link_position([2, 1, 1], np.radians([0, 90, 0])).round(3)
        array([2.   , 2.   , 1.571])
    """
    (l1, l2, l3), (q1, q2, q3) = each_of(lengths), each_of(q)
    q12, q123 = q1 + q2, q1 + q2 + q3
    x = l1 * np.cos(q1) + l2 * np.cos(q12) + l3 * np.cos(q123)
    y = l1 * np.sin(q1) + l2 * np.sin(q12) + l3 * np.sin(q123)
    return np.stack(np.broadcast_arrays(x, y, q123), axis=-1)


def three_link_jacobian(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of the three-link arm's tip, in frame {0}.

    The columns (−l₁ s₁ − l₂ s₁₂ − l₃ s₁₂₃, l₁ c₁ + l₂ c₁₂ + l₃ c₁₂₃, 1) and so on; its determinant
    l₁ l₂ s₂ does not depend on the third link [Khatib08].

    Args:
        lengths: l₁, l₂, l₃, (..., 3) [m]; l₃ = 0 gives J_W at the wrist point.
        q: θ₁, θ₂, θ₃, (..., 3) [rad].

    Returns:
        Rows x, y, rz, (..., 3, 3).

    Example:
        At (0, 90°, 0) an error of 0.1 rad in θ₂ moves the tip by (−(l₂ + l₃)/10, 0):

        >>> J = three_link_jacobian([2, 1, 1], np.radians([0, 90, 0]))
        >>> (J @ [0, 0.1, 0]).round(3) + 0.0
        array([-0.2,  0. ,  0.1])
    """
    (l1, l2, l3), (q1, q2, q3) = each_of(lengths), each_of(q)
    q12, q123 = q1 + q2, q1 + q2 + q3
    x3, y3 = l3 * np.cos(q123), l3 * np.sin(q123)
    x2, y2 = l2 * np.cos(q12) + x3, l2 * np.sin(q12) + y3
    x1, y1 = l1 * np.cos(q1) + x2, l1 * np.sin(q1) + y2
    columns = [np.stack([-y, x, np.ones_like(x)], axis=-1) for x, y in ((x1, y1), (x2, y2), (x3, y3))]
    return np.stack(columns, axis=-1)


def planar_rp_chain() -> DHChain:
    """Return the arm's modified table; Q is the point (0, 0, r₀) of frame 2.

    The sliding joint's axis is z of its frame: along the rod.

    Returns:
        The chain of rows (α_i-1, a_i-1, d_i, θ_i).

    Example:
        >>> (planar_rp_chain().frames([0, 0.5])[2] @ [0, 0, 1, 1]).round(3) + 0.0
        array([1.5, 0. , 0. , 1. ])
    """
    square = np.pi / 2
    return DHChain(table=((0.0, 0.0, 0.0, square), (square, 0.0, 0.0, 0.0)), kinds=("revolute", "prismatic"))


def planar_rp_position(q: ArrayLike, home_reach: ArrayLike = 1.0) -> NDArray[np.float64]:
    """Return the position of Q: (r cos θ, r sin θ) with r = r₀ + d [Selig92, exercise 6.3].

    Args:
        q: θ, d, (..., 2) [rad, m].
        home_reach: r₀, (...) [m].

    Returns:
        [x, y], (..., 2) [m].

    Example:
        >>> planar_rp_position([np.pi / 2, 0.5]).round(3)
        array([0. , 1.5])
    """
    q = np.asarray(q, dtype=np.float64)
    r = np.asarray(home_reach, dtype=np.float64) + q[..., 1]
    return np.stack([r * np.cos(q[..., 0]), r * np.sin(q[..., 0])], axis=-1)


def planar_rp_jacobian(q: ArrayLike, home_reach: ArrayLike = 1.0) -> NDArray[np.float64]:
    """Return the Jacobian of Q: the column of a sliding joint is its direction, without a rotation.

    J = [[−r sin θ, cos θ], [r cos θ, sin θ], [1, 0]] with r = r₀ + d [Selig92, exercise 6.3].

    Args:
        q: θ, d, (..., 2) [rad, m].
        home_reach: r₀, (...) [m].

    Returns:
        Rows x, y, rz in frame {0}, (..., 3, 2).

    Example:
        >>> planar_rp_jacobian([0, 0.5]).round(3) + 0.0
        array([[0. , 1. ],
               [1.5, 0. ],
               [1. , 0. ]])
    """
    q = np.asarray(q, dtype=np.float64)
    x, y = np.moveaxis(planar_rp_position(q, home_reach), -1, 0)
    c, s, zero, one = np.cos(q[..., 0]), np.sin(q[..., 0]), np.zeros_like(x), np.ones_like(x)
    rows = ((-y, c), (x, s), (one, zero))
    return np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)


def planar_rp_determinant(q: ArrayLike, home_reach: ArrayLike = 1.0) -> NDArray[np.float64]:
    """Return det J = −r = −(r₀ + d), of the rows x and y: singular where Q is on the pivot.

    There the rotation does not move Q. It is not a boundary, because Q can leave it along the rod in both
    directions.

    Args:
        q: θ, d, (..., 2) [rad, m].
        home_reach: r₀, (...) [m].

    Returns:
        det J, (...) [m].

    Example:
        >>> planar_rp_determinant([0.3, -1.0])
        np.float64(0.0)
    """
    return np.asarray(-np.asarray(home_reach, dtype=np.float64) - np.asarray(q, dtype=np.float64)[..., 1])[()]


def platform_leg_lengths(base: ArrayLike, platform: ArrayLike, pose: ArrayLike) -> NDArray[np.float64]:
    """Return the lengths of the legs that hold the platform in a pose.

    d_i = |p + R(φ) b_i − a_i|: the inverse kinematics [Selig92, exercise 6.2].

    Args:
        base: Hinges a_i on the ground, (..., 3, 2) [m].
        platform: Hinges b_i in the frame of the platform, (..., 3, 2) [m].
        pose: [x, y, φ] of the platform's frame, (..., 3) [m, m, rad].

    Returns:
        d_1..d_3, (..., 3) [m].

    Example:
        >>> base, platform = [[0, 0], [6, 0], [3, 5]], [[-1, -1], [1, -1], [0, 1]]
        >>> platform_leg_lengths(base, platform, [3, 2, 0]).round(3)
        array([2.236, 2.236, 2.   ])
    """
    legs, _ = _legs(base, platform, pose)
    return np.asarray(np.linalg.norm(legs, axis=-1))


def platform_inverse_jacobian(base: ArrayLike, platform: ArrayLike, pose: ArrayLike) -> NDArray[np.float64]:
    """Return K with ḋ = K (ẋ, ẏ, φ̇), the inverse of the Jacobian of the platform.

    Row i is the line of leg i: its unit vector u_i from the ground to the platform, and its moment
    (R b_i) × u_i about the origin of the platform's frame [Selig92, exercise 6.2]. K loses rank if the three
    lines meet in one point or are parallel. The platform can then move although all legs are locked.

    Args:
        base: Hinges a_i on the ground, (..., 3, 2) [m].
        platform: Hinges b_i in the frame of the platform, (..., 3, 2) [m].
        pose: [x, y, φ] of the platform's frame, (..., 3) [m, m, rad].

    Returns:
        K, columns x, y, φ, (..., 3, 3) [1, 1, m].

    Raises:
        numpy.linalg.LinAlgError: A leg has length 0, and therefore no line.

    Example:
        Three vertical legs lift or tilt the platform, but do not move it along x:

        >>> base, platform = [[-1, 0], [0, 0], [1, 0]], [[-1, 0], [0, 0], [1, 0]]
        >>> platform_inverse_jacobian(base, platform, [0, 2, 0])
        array([[ 0.,  1., -1.],
               [ 0.,  1.,  0.],
               [ 0.,  1.,  1.]])
    """
    legs, arms = _legs(base, platform, pose)
    length = np.linalg.norm(legs, axis=-1, keepdims=True)
    if np.any(length == 0.0):
        raise np.linalg.LinAlgError("3-RPR platform: a leg has length 0 and no line; move its hinges apart")
    u = legs / length
    moment = arms[..., :1] * u[..., 1:] - arms[..., 1:] * u[..., :1]
    return np.concatenate([u, moment], axis=-1)


def _legs(
    base: ArrayLike, platform: ArrayLike, pose: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the legs as vectors, and the hinges on the platform from its origin, along frame {0}."""
    base, b, pose = (np.asarray(value, dtype=np.float64) for value in (base, platform, pose))
    c, s = np.cos(pose[..., 2])[..., None], np.sin(pose[..., 2])[..., None]
    arms = np.stack([c * b[..., 0] - s * b[..., 1], s * b[..., 0] + c * b[..., 1]], axis=-1)
    return pose[..., None, :2] + arms - base, arms
