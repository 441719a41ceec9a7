"""The planar 3-RPR platform: a triangle on three legs that slide, hinged at both ends.

For a parallel mechanism, the inverse kinematics is a function: the pose of the platform determines the
lengths of the legs. The inverse Jacobian therefore has a closed form.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


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
