"""Velocities of points and bodies: observer, writer, and angular velocity.

A velocity has two frames. The *observer*'s frame is that of the differentiation, and the *writer*'s frame has
the axes of the components. In the notes, {B} observes ᴬ(ᴮV_Q) and {A} writes it; a single superscript stands
for both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.spatial import normalize, skew

Array = NDArray[np.float64]


def written_in(R_a_b: ArrayLike, vector_b: ArrayLike) -> Array:
    """Return a vector along the axes of another frame: another writer, the same observer.

    ᴬ(ᴮV_Q) = ᴬR_B ᴮV_Q [Craig05, §5.2]. It is not ᴬV_Q: an observer in {A} sees {B} move as well,
    see `point_velocity`.

    Args:
        R_a_b: Rotation of b in a, (..., 3, 3).
        vector_b: Along the axes of b, (..., 3).

    Returns:
        Along the axes of a, (..., 3).

    Example:
        >>> written_in([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [2.0, 0.0, 0.0])
        array([0., 2., 0.])
    """
    R, vector = np.asarray(R_a_b, dtype=np.float64), np.asarray(vector_b, dtype=np.float64)
    return np.asarray(np.einsum("...ij,...j->...i", R, vector))


def point_velocity(
    velocity_a_b: ArrayLike, R_a_b: ArrayLike, velocity_b: ArrayLike, omega_a_b: ArrayLike, point_b: ArrayLike
) -> Array:
    """Return the velocity of a point that moves in a moving frame, observed in the frame at rest.

    ᴬV_Q = ᴬV_BORG + ᴬR_B ᴮV_Q + ᴬΩ_B × ᴬR_B ᴮQ [Craig05, §5.3].

    Args:
        velocity_a_b: ᴬV_BORG, velocity of b's origin in a, along a, (..., 3) [m/s].
        R_a_b: Rotation of b in a, (..., 3, 3).
        velocity_b: ᴮV_Q, velocity of the point as b observes and writes it, (..., 3) [m/s].
        omega_a_b: ᴬΩ_B, angular velocity of b in a, along a, (..., 3) [rad/s].
        point_b: ᴮQ, the point in b, (..., 3) [m].

    Returns:
        ᴬV_Q, observed and written by a, (..., 3) [m/s].

    Example:
        A bead slides outward at 1 m/s on a rod that turns at 3 rad/s, 2 m from the axis. At this instant the
        rod is along y, and its axis moves along x at 5 m/s:

        >>> rod = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        >>> point_velocity([5, 0, 0], rod, [1, 0, 0], [0, 0, 3], [2, 0, 0])
        array([-1.,  1.,  0.])
    """
    carried = np.cross(np.asarray(omega_a_b, dtype=np.float64), written_in(R_a_b, point_b))
    return np.asarray(velocity_a_b, dtype=np.float64) + written_in(R_a_b, velocity_b) + carried


def angular_velocity_matrix(R: ArrayLike, R_rate: ArrayLike) -> Array:
    """Return the angular-velocity matrix S = Ṙ Rᵀ.

    R Rᵀ = I gives S + Sᵀ = 0, and S p = Ω × p for every p [Craig05, §5.4] [Selig92, exercise 6.5].

    Args:
        R: Rotation of b in a, (..., 3, 3).
        R_rate: Its derivative Ṙ, (..., 3, 3) [1/s].

    Returns:
        S along the axes of a, skew if R and Ṙ are consistent, (..., 3, 3) [rad/s].

    Example:
        >>> angular_velocity_matrix(np.eye(3), [[0, -2, 0], [2, 0, 0], [0, 0, 0]])
        array([[ 0., -2.,  0.],
               [ 2.,  0.,  0.],
               [ 0.,  0.,  0.]])
    """
    R, R_rate = np.asarray(R, dtype=np.float64), np.asarray(R_rate, dtype=np.float64)
    return np.asarray(R_rate @ np.swapaxes(R, -1, -2))


def vee(S: ArrayLike, tolerance: float = 1e-9) -> Array:
    """Return the vector Ω of a skew matrix, S p = Ω × p: the inverse of `rmrc.support.spatial.skew`.

    Each component is the mean of its two entries, Ω_x = (s₃₂ − s₂₃)/2 and so on. The mean ignores the
    symmetric part, so the function first checks that this part is only rounding.

    Args:
        S: (..., 3, 3) [rad/s].
        tolerance: The largest entry of the symmetric part, at most, over the largest of S. 1e-9 is far above
            rounding and far below any mistake. A difference quotient needs a larger one.

    Returns:
        Ω, (..., 3) [rad/s].

    Raises:
        ValueError: S is not skew: it is no angular velocity.

    Example:
        >>> vee([[0, -3, 2], [3, 0, -1], [-2, 1, 0]])
        array([1., 2., 3.])
    """
    S = np.asarray(S, dtype=np.float64)
    transposed = np.swapaxes(S, -1, -2)
    symmetric = np.abs(S + transposed).max(axis=(-2, -1)) / 2
    size = np.abs(S).max(axis=(-2, -1))
    # Written so that nan is refused as well.
    if not np.all(symmetric <= tolerance * size):
        relative = np.max(symmetric / np.where(size > 0, size, 1.0))
        raise ValueError(
            f"angular-velocity matrix: its symmetric part is {relative:.3g} of it, at most {tolerance:.3g} "
            "is rounding; R and its derivative do not belong together"
        )
    half = (S - transposed) / 2
    return np.stack([half[..., 2, 1], half[..., 0, 2], half[..., 1, 0]], axis=-1)


def angular_velocity(R: ArrayLike, R_rate: ArrayLike) -> Array:
    """Return the angular velocity from the nine products that the notes print.

    Ω_x = ṙ₃₁ r₂₁ + ṙ₃₂ r₂₂ + ṙ₃₃ r₂₃, Ω_y = ṙ₁₁ r₃₁ + ṙ₁₂ r₃₂ + ṙ₁₃ r₃₃,
    Ω_z = ṙ₂₁ r₁₁ + ṙ₂₂ r₁₂ + ṙ₂₃ r₁₃: one of the two entries of S for each component, where `vee`
    takes the mean of both [Craig05, §5.4].

    Args:
        R: Rotation of b in a, (..., 3, 3).
        R_rate: Its derivative Ṙ, (..., 3, 3) [1/s].

    Returns:
        ᴬΩ_B along the axes of a, (..., 3) [rad/s].

    Example:
        >>> angular_velocity(np.eye(3), [[0, -2, 0], [2, 0, 0], [0, 0, 0]])
        array([0., 0., 2.])
    """
    r, rate = np.asarray(R, dtype=np.float64), np.asarray(R_rate, dtype=np.float64)
    rows = [(2, 1), (0, 2), (1, 0)]
    return np.stack([np.sum(rate[..., i, :] * r[..., j, :], axis=-1) for i, j in rows], axis=-1)


def rotation_rate(R: ArrayLike, omega: ArrayLike) -> Array:
    """Return the derivative of a rotation: Ṙ = skew(Ω) R.

    At R = I it is skew(Ω) itself [Craig05, §5.4] [Selig92, §6.5].

    Args:
        R: Rotation of b in a, (..., 3, 3).
        omega: ᴬΩ_B along the axes of a, (..., 3) [rad/s].

    Returns:
        Ṙ, (..., 3, 3) [1/s].

    Example:
        >>> vee(rotation_rate(np.eye(3), [1.0, 2.0, 3.0]))
        array([1., 2., 3.])
    """
    return np.asarray(skew(omega) @ np.asarray(R, dtype=np.float64))


def instantaneous_axis(omega: ArrayLike) -> tuple[Array, Array]:
    """Return the axis K and the speed θ̇ of a turning body: Ω = θ̇ K [Craig05, §5.4].

    Args:
        omega: Ω, (..., 3) [rad/s].

    Returns:
        K, of length 1, (..., 3), and θ̇ > 0, (...) [rad/s].

    Raises:
        ValueError: A body does not turn, so it has no axis.

    Example:
        >>> instantaneous_axis([0.0, 3.0, -4.0])
        (array([ 0. ,  0.6, -0.8]), np.float64(5.0))
    """
    omega = np.asarray(omega, dtype=np.float64)
    return normalize(omega), np.linalg.norm(omega, axis=-1)
