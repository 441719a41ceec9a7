"""Planar arms with revolute joints: n links in general, three as printed in the notes.

All links move in the x-y plane, joint axes along +z, q = 0 stretched out along x. The rows of a
planar Jacobian are x, y and the rotation about z; `lengths` is l_1..l_n in m, `q` is in radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


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
    (l1, l2, l3), (q1, q2, q3) = _each(lengths), _each(q)
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
    (l1, l2, l3), (q1, q2, q3) = _each(lengths), _each(q)
    q12, q123 = q1 + q2, q1 + q2 + q3
    x3, y3 = l3 * np.cos(q123), l3 * np.sin(q123)
    x2, y2 = l2 * np.cos(q12) + x3, l2 * np.sin(q12) + y3
    x1, y1 = l1 * np.cos(q1) + x2, l1 * np.sin(q1) + y2
    columns = [np.stack([-y, x, np.ones_like(x)], axis=-1) for x, y in ((x1, y1), (x2, y2), (x3, y3))]
    return np.stack(columns, axis=-1)


def _each(values: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    return tuple(np.moveaxis(np.asarray(values, dtype=np.float64), -1, 0))
