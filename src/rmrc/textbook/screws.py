"""Instantaneous screws: a column for each kind of joint, and the arm as a product of screw motions.

A screw is [ω; v] with v the velocity of the body's point at the *origin*, the order of the notes; a
twist elsewhere in this program is [v; ω] with v at the tip. `geometric_from_screws` goes from one to
the other.

The pitch h is in m/rad: the advance of a joint per radian. The notes' p is the
advance of a full turn, h = p/2π. h = 0 is a revolute joint, and h = inf a prismatic one, whose position is in
m. Any other h is a helical joint, whose position is in rad.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError
from rmrc.support.spatial import exp_rotation, normalize, quat_to_matrix, shift_twist, wrench_transform

Array = NDArray[np.float64]


def joint_screw(axis: ArrayLike, point: ArrayLike, pitch: ArrayLike = 0.0) -> Array:
    """Return the screw of a joint per unit of its rate: (ẑ; u × ẑ + h ẑ), or (0; ẑ) if it slides.

    ẑ is its axis and u any point on it; h = p/2π [Selig92, §6.6]. For an infinite pitch the unit of position
    is the advance instead of the angle, which gives (0; ẑ).

    Args:
        axis: Along the joint, of any length but 0, (..., 3).
        point: u, (..., 3) [m].
        pitch: h: 0 revolute, inf prismatic, else helical, (...) [m/rad].

    Returns:
        [ω; v at the origin], (..., 6) [rad and m per unit of joint position].

    Raises:
        ModelError: If a pitch is nan or −inf.
        ValueError: If an axis is zero or not finite.

    Example:
        A spindle along z through (2, 0, 0) that advances 0.5 m per turn, and a slide along x:

        >>> joint_screw([0, 0, 1], [2, 0, 0], pitch=0.5 / (2 * np.pi)).round(3) + 0.0
        array([ 0.  ,  0.  ,  1.  ,  0.  , -2.  ,  0.08])
        >>> joint_screw([1, 0, 0], [2, 0, 0], pitch=np.inf)
        array([0., 0., 0., 1., 0., 0.])
    """
    axis, point, pitch = normalize(axis), np.asarray(point, dtype=np.float64), np.asarray(pitch, dtype=float)
    if np.any(np.isnan(pitch) | np.isneginf(pitch)):
        raise ModelError("joint pitch: nan or -inf; give 0 if revolute, inf if prismatic, else m/rad")
    slides = np.isinf(pitch)[..., None]
    advance = np.where(slides, 0.0, pitch[..., None])
    v = np.where(slides, axis, np.cross(point, axis) + advance * axis)
    return np.concatenate([np.broadcast_to(np.where(slides, 0.0, axis), v.shape), v], axis=-1)


def transform_screw(screw: ArrayLike, R: ArrayLike, t: ArrayLike) -> Array:
    """Return the screw of a joint after the joint was turned by R and then moved by t.

    [ω'; v'] = [[R, 0], [T R, R]] [ω; v] with T = skew(t) [Selig92, exercise 6.6]. As a screw is
    written [line; moment], this is the matrix that a wrench [f; n] has,
    `rmrc.support.spatial.wrench_transform`.

    Args:
        screw: [ω; v at the origin], (..., 6).
        R: (..., 3, 3).
        t: (..., 3) [m].

    Returns:
        [ω'; v' at the origin], (..., 6).

    Example:
        >>> transform_screw(joint_screw([0, 0, 1], [0, 0, 0]), np.eye(3), [2, 0, 0])
        array([ 0.,  0.,  1.,  0., -2.,  0.])
    """
    return _times(wrench_transform(R, t), np.asarray(screw, dtype=np.float64))


def exp_screw(screw: ArrayLike, q: ArrayLike) -> Array:
    """Return the motion along a screw: exp([ω]× q, v q; 0, 0).

    R = exp([φ]×) and t = (sin θ/θ) ρ + ((1 − cos θ)/θ²) φ × ρ + ((1 − sin θ/θ)/θ²) φ (φ·ρ), with
    φ = ω q, ρ = v q, θ = |φ| [Lynch17, §3.3.3]. For a joint screw of the axis ẑ through u this is the
    notes' t = h q ẑ + (I − R) u [Selig92, §6.6], and t = q ẑ if it slides.

    Args:
        screw: [ω; v at the origin], of any size, (..., 6).
        q: Joint position, (...) [rad; m for a slide].

    Returns:
        Pose, (..., 4, 4).

    Example:
        Half a turn about an axis at (1, 0, 0), which advances 0.2 m per radian:

        >>> exp_screw(joint_screw([0, 0, 1], [1, 0, 0], pitch=0.2), np.pi).round(3) + 0.0
        array([[-1.   ,  0.   ,  0.   ,  2.   ],
               [ 0.   , -1.   ,  0.   ,  0.   ],
               [ 0.   ,  0.   ,  1.   ,  0.628],
               [ 0.   ,  0.   ,  0.   ,  1.   ]])
    """
    motion = np.asarray(screw, dtype=np.float64) * np.asarray(q, dtype=np.float64)[..., None]
    phi, rho = motion[..., :3], motion[..., 3:]
    theta = np.linalg.norm(phi, axis=-1, keepdims=True)
    # numpy's sinc(x) is sin(πx)/(πx). The last ratio only appears times θ², so that neither its
    # rounding near 0 nor the limit 1/6 matters.
    sinc, half = np.sinc(theta / np.pi), np.sinc(theta / (2 * np.pi))
    last = np.divide(1.0 - sinc, theta**2, out=np.full_like(theta, 1 / 6), where=theta**2 > 0)
    along = last * np.sum(phi * rho, axis=-1, keepdims=True) * phi
    T = np.zeros((*motion.shape[:-1], 4, 4))
    T[..., :3, :3] = quat_to_matrix(exp_rotation(phi))
    T[..., :3, 3] = sinc * rho + 0.5 * half**2 * np.cross(phi, rho) + along
    T[..., 3, 3] = 1.0
    return T


def product_of_exponentials(screws: ArrayLike, q: ArrayLike, home: ArrayLike) -> Array:
    """Return the pose of the tip: T(q) = exp(S₁ q₁) exp(S₂ q₂) … exp(S_n q_n) M [Lynch17, §4.1].

    Args:
        screws: S_i of each joint at q = 0, in frame {0}, (..., n, 6).
        q: Joint positions, (..., n) [rad; m for a slide].
        home: M, pose of the tip at q = 0, (..., 4, 4).

    Returns:
        T_0_tip, (..., 4, 4).

    Raises:
        ModelError: If there is not one position for each screw.

    Example:
        Two links of 1 m at (90°, −90°):

        >>> screws = joint_screw([0, 0, 1], [[0, 0, 0], [1, 0, 0]])
        >>> home = np.eye(4)
        >>> home[0, 3] = 2.0
        >>> product_of_exponentials(screws, [np.pi / 2, -np.pi / 2], home)[:3, 3].round(3) + 0.0
        array([1., 1., 0.])
    """
    T = np.asarray(home, dtype=np.float64)
    for motion in reversed(_motions(screws, q)):
        T = motion @ T
    return T


def space_jacobian(screws: ArrayLike, q: ArrayLike) -> Array:
    """Return the screws of all joints at q: the Jacobian of the notes.

    Column i is S_i, transformed by the motion exp(S₁ q₁) … exp(S_i-1 q_i-1) of the joints before it
    [Selig92, §6.6] [Lynch17, §5.1.1].

    Args:
        screws: S_i of each joint at q = 0, in frame {0}, (..., n, 6).
        q: Joint positions, (..., n) [rad; m for a slide].

    Returns:
        Rows [ω; v at the origin of {0}], (..., 6, n).

    Raises:
        ModelError: If there is not one position for each screw.

    Example:
        >>> screws = joint_screw([0, 0, 1], [[0, 0, 0], [1, 0, 0]])
        >>> space_jacobian(screws, [np.pi / 2, 0.0]).round(3)[[2, 3, 4]] + 0.0
        array([[1., 1.],
               [0., 1.],
               [0., 0.]])
    """
    screws, motions = np.asarray(screws, dtype=np.float64), _motions(screws, q)
    so_far, columns = np.eye(4), []
    for i, motion in enumerate(motions):
        column = transform_screw(screws[..., i, :], so_far[..., :3, :3], so_far[..., :3, 3])
        columns.append(np.broadcast_to(column, (*motion.shape[:-2], 6)))
        so_far = so_far @ motion
    return np.stack(columns, axis=-1)


def geometric_from_screws(jacobian: ArrayLike, tip: ArrayLike) -> Array:
    """Return the geometric Jacobian of a Jacobian of screws: rows exchanged, reference point moved.

    [ω; s] becomes [s + ω × p; ω] for a tip at p [Selig92, §6.6].

    Args:
        jacobian: Rows [ω; v at the origin of {0}], (..., 6, n).
        tip: p in {0}, (..., 3) [m].

    Returns:
        Rows [v at the tip; ω] along the axes of {0}, (..., 6, n).

    Example:
        Two links of 1 m, stretched out along x:

        >>> screws = joint_screw([0, 0, 1], [[0, 0, 0], [1, 0, 0]])
        >>> geometric_from_screws(screws.T, [2, 0, 0])[[0, 1, 5]]
        array([[0., 0.],
               [2., 1.],
               [1., 1.]])
    """
    screws = np.swapaxes(np.asarray(jacobian, dtype=np.float64), -1, -2)
    to_origin = -np.asarray(tip, dtype=np.float64)[..., None, :]
    return np.swapaxes(shift_twist(np.roll(screws, 3, axis=-1), to_origin), -1, -2)


def _motions(screws: ArrayLike, q: ArrayLike) -> list[Array]:
    screws, q = np.asarray(screws, dtype=np.float64), np.asarray(q, dtype=np.float64)
    if screws.shape[-2] != q.shape[-1]:
        raise ModelError(f"screws: {screws.shape[-2]} joints but {q.shape[-1]} positions; give one per joint")
    return list(np.moveaxis(exp_screw(screws, q), -3, 0))


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])
