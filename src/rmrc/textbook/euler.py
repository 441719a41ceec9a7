"""Z-Y-Z Euler angles (α, β, γ), their rates, and the Jacobian that has these rates as its rows.

R = Rot(z, α) Rot(y, β) Rot(z, γ): each rotation is about an axis of the frame as rotated so far. At β = 0 and
π the first and the last axis coincide. The *representation* is singular there, for any arm: no rates of the
angles give a rotation about the missing axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SINGULAR = 1e-12
"""Largest |sin β| at which α and γ count as inseparable: the sine of a rounded π is 1.2e-16, and R has
similar errors."""


def zyz_matrix(angles: ArrayLike) -> Array:
    """Return the rotation of Z-Y-Z Euler angles: R = Rot(z, α) Rot(y, β) Rot(z, γ) [Craig05, §2.8].

    Args:
        angles: (α, β, γ), (..., 3) [rad].

    Returns:
        R, (..., 3, 3).

    Example:
        >>> zyz_matrix(np.radians([90, 90, 0])).round(3) + 0.0
        array([[ 0., -1.,  0.],
               [ 0.,  0.,  1.],
               [-1.,  0.,  0.]])
    """
    (ca, cb, cg), (sa, sb, sg) = _cosines_and_sines(angles)
    return _matrix(
        [ca * cb * cg - sa * sg, -ca * cb * sg - sa * cg, ca * sb],
        [sa * cb * cg + ca * sg, -sa * cb * sg + ca * cg, sa * sb],
        [-sb * cg, sb * sg, cb],
    )


def zyz_angles(R: ArrayLike, *, flip: bool = False) -> Array:
    """Return the Z-Y-Z Euler angles of a rotation.

    α = atan2(r₂₃, r₁₃), β = atan2(√(r₁₃² + r₂₃²), r₃₃) in [0, π], and γ from the row of
    Rot(z, α)ᵀ R that is (s_γ, c_γ, 0) [Craig05, §2.8]. The other branch is (α + π, −β, γ + π).
    Where sin β vanishes, only α + γ (β = 0) or α − γ (β = π) is determined, and α = 0.

    Args:
        R: Rotations, (..., 3, 3).
        flip: Take the other branch, with β in [−π, 0].

    Returns:
        (α, β, γ), α and γ in [−π, π], (..., 3) [rad].

    Example:
        >>> np.degrees(zyz_angles(zyz_matrix(np.radians([20, 30, 40])))).round(6)
        array([20., 30., 40.])
        >>> np.degrees(zyz_angles(zyz_matrix(np.radians([20, 30, 40])), flip=True)).round(6)
        array([-160.,  -30., -140.])
        >>> np.degrees(zyz_angles(zyz_matrix(np.radians([20, 0, 40])))).round(6)
        array([ 0.,  0., 60.])
    """
    R = np.asarray(R, dtype=np.float64)
    sine = np.hypot(R[..., 0, 2], R[..., 1, 2])
    alpha = np.where(sine > SINGULAR, np.arctan2(R[..., 1, 2], R[..., 0, 2]), 0.0)
    beta = np.arctan2(sine, R[..., 2, 2])
    # γ follows from α, so that the angles reproduce R even if α is inaccurate.
    ca, sa = np.cos(alpha), np.sin(alpha)
    gamma = np.arctan2(ca * R[..., 1, 0] - sa * R[..., 0, 0], ca * R[..., 1, 1] - sa * R[..., 0, 1])
    if flip:
        alpha, beta, gamma = _opposite(alpha), -beta, _opposite(gamma)
    return np.stack([alpha, beta, gamma], axis=-1)


def zyz_rate_matrix(angles: ArrayLike) -> Array:
    """Return the matrix E from the rates of Z-Y-Z angles to the angular velocity: Ω = E Θ̇.

    E = [[0, −s_α, c_α s_β], [0, c_α, s_α s_β], [1, 0, c_β]]: its columns are the three axes, along
    the axes of the frame at rest [Craig05, example 5.2].

    Args:
        angles: Θ = (α, β, γ), (..., 3) [rad].

    Returns:
        E, (..., 3, 3).

    Example:
        >>> zyz_rate_matrix(np.radians([0, 90, 50])).round(3) + 0.0
        array([[0., 0., 1.],
               [0., 1., 0.],
               [1., 0., 0.]])
    """
    (ca, cb, _), (sa, sb, _) = _cosines_and_sines(angles)
    zero, one = np.zeros_like(ca), np.ones_like(ca)
    return _matrix([zero, -sa, ca * sb], [zero, ca, sa * sb], [one, zero, cb])


def zyz_determinant(angles: ArrayLike) -> Array:
    """Return det E = −sin β: zero where the representation is singular, at β = 0 and π.

    Args:
        angles: (α, β, γ), (..., 3) [rad].

    Returns:
        det E, (...).

    Example:
        >>> zyz_determinant(np.radians([20, 30, 40])).round(6)
        np.float64(-0.5)
    """
    return np.asarray(-np.sin(np.asarray(angles, dtype=np.float64)[..., 1]))[()]


def zyz_is_singular(angles: ArrayLike) -> NDArray[np.bool_]:
    """Return whether the representation, not the arm, is singular: |sin β| at most 1e-12.

    Args:
        angles: (α, β, γ), (..., 3) [rad].

    Returns:
        (...).

    Example:
        >>> zyz_is_singular(np.radians([[20, 30, 40], [20, 0, 40], [20, 180, 40]]))
        array([False,  True,  True])
    """
    return np.asarray(np.abs(zyz_determinant(angles)) <= SINGULAR)[()]


def analytic_jacobian(jacobian: ArrayLike, angles: ArrayLike) -> Array:
    """Return the analytic Jacobian: the rows of ω become the rates of the Z-Y-Z angles.

    J_a = T⁻¹ J with T = [[I, 0], [0, E]] [Lynch17, §5.1.5].

    Args:
        jacobian: Geometric J, rows [v; ω] along the axes of frame {0}, (..., 6, n).
        angles: (α, β, γ) of the frame that J moves, in frame {0}, (..., 3) [rad].

    Returns:
        Rows [ṗ; α̇; β̇; γ̇], (..., 6, n).

    Raises:
        numpy.linalg.LinAlgError: If the representation is singular, |sin β| at most 1e-12.

    Example:
        The joints of a wrist with axes z, y and z are the angles themselves:

        >>> angles = np.radians([20, 30, 40])
        >>> wrist = np.vstack([np.zeros((3, 3)), zyz_rate_matrix(angles)])
        >>> analytic_jacobian(wrist, angles)[3:].round(12) + 0.0
        array([[1., 0., 0.],
               [0., 1., 0.],
               [0., 0., 1.]])
    """
    jacobian = np.asarray(jacobian, dtype=np.float64)
    if np.any(zyz_is_singular(angles)):
        raise np.linalg.LinAlgError(
            f"Z-Y-Z angles: |sin(beta)| is {np.min(np.abs(zyz_determinant(angles))):.2g}, at most "
            f"{SINGULAR:g}: the representation is singular, not the arm; use the geometric Jacobian"
        )
    rates = np.linalg.solve(zyz_rate_matrix(angles), jacobian[..., 3:, :])
    linear = np.broadcast_to(jacobian[..., :3, :], rates.shape)
    return np.concatenate([linear, rates], axis=-2)


def _cosines_and_sines(angles: ArrayLike) -> tuple[Array, Array]:
    each = np.moveaxis(np.asarray(angles, dtype=np.float64), -1, 0)
    return np.cos(each), np.sin(each)


def _opposite(angle: Array) -> Array:
    return np.asarray(np.where(angle > 0, angle - np.pi, angle + np.pi))


def _matrix(*rows: list[Array]) -> Array:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
