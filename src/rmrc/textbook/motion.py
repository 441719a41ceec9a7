"""Motion of points and bodies: velocities, small displacements, Euler angles, and other frames of a Jacobian.

A velocity has two frames. The *observer*'s frame is that of the differentiation, and the *writer*'s frame has
the axes of the components. In the notes, {B} observes ᴬ(ᴮV_Q) and {A} writes it; a single superscript stands
for both.

Small joint displacements move the tip by Taylor's theorem, and their errors spread through J.

Z-Y-Z Euler angles (α, β, γ) have R = Rot(z, α) Rot(y, β) Rot(z, γ): each rotation is about an axis of the
frame as rotated so far. At β = 0 and π the first and the last axis coincide. The *representation* is
singular there, for any arm: no rates of the angles give a rotation about the missing axis.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.spatial import matrix_of, normalize, shift_twist, skew

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


def shift_jacobian(jacobian: ArrayLike, p: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of another point of the same link, along the same axes.

    J_E = [[I, −P̂], [0, I]] J_W, since v_E = v_W + ω × P: each column is a twist [Khatib08].
    Where P is known in frame {n} but J along the axes of frame {0}, rotate it first:
    ⁰P = R ⁿP, which is the same as ⁰P̂ = R ⁿP̂ Rᵀ.

    Args:
        jacobian: J_W, rows [v; ω], (..., 6, n).
        p: P, from the point W of J to the new point E, along the axes of J, (..., 3) [m].

    Returns:
        J_E, rows [v; ω], (..., 6, n).

    Example:
        From the wrist point of a three-link arm to its end-effector, 1 m further along x:

        >>> from rmrc.textbook.planar import embed_planar_jacobian, planar_jacobian
        >>> wrist = embed_planar_jacobian(planar_jacobian([2, 1, 0], [0, 0, 0]))
        >>> shift_jacobian(wrist, [1, 0, 0])[[0, 1, 5]] + 0.0
        array([[0., 0., 0.],
               [4., 2., 1.],
               [1., 1., 1.]])
    """
    columns = np.swapaxes(np.asarray(jacobian, dtype=np.float64), -1, -2)
    back = -np.asarray(p, dtype=np.float64)[..., None, :]
    return np.swapaxes(shift_twist(columns, back), -1, -2)


def rotate_jacobian(jacobian: ArrayLike, R_a_b: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of the same point along the axes of another frame.

    ᴬJ = [[R, 0], [0, R]] ᴮJ: the determinant of a square J is the same in all frames, and so are
    its singular values [Craig05, §5.7] [Khatib08].

    Args:
        jacobian: ᴮJ, rows [v; ω], or only one of these, (..., 6 or 3, n).
        R_a_b: Rotation of b in a, (..., 3, 3).

    Returns:
        ᴬJ, (..., 6 or 3, n).

    Example:
        x of a frame that is turned by 90° about z is y of the other:

        >>> R = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        >>> rotate_jacobian([[3.0], [0.0], [0.0], [0.0], [0.0], [1.0]], R).T + 0.0
        array([[0., 3., 0., 0., 0., 1.]])
    """
    J, R = np.asarray(jacobian, dtype=np.float64), np.asarray(R_a_b, dtype=np.float64)
    return np.concatenate([R @ J[..., row : row + 3, :] for row in range(0, J.shape[-2], 3)], axis=-2)


def taylor_remainder(
    position: Callable[[Array], Array], jacobian: Callable[[Array], Array], q: ArrayLike, dq: ArrayLike
) -> Array:
    """Return the error of the linear approximation: k(q + Δ) − k(q) − J(q) Δ [Selig92, §6.1].

    Args:
        position: k, from joint positions (..., n) to task coordinates (..., m).
        jacobian: J, from joint positions (n,) to (m, n).
        q: Joint positions, (n,) [rad or m].
        dq: Δ, (..., n) [rad or m].

    Returns:
        (..., m), in the units of k.

    Example:
        A link of 1 m turned by 0.1 rad falls short of its tangent by 0.1²/2:

        >>> from rmrc.textbook.planar import planar_jacobian, planar_position
        >>> arm = (lambda q: planar_position([1], q), lambda q: planar_jacobian([1], q))
        >>> taylor_remainder(*arm, [0.0], [0.1]).round(6)
        array([-0.004996, -0.000167,  0.      ])
    """
    q, dq = np.asarray(q, dtype=np.float64), np.asarray(dq, dtype=np.float64)
    return position(q + dq) - position(q) - tip_error(jacobian(q), dq)


def taylor_order(
    position: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    q: ArrayLike,
    direction: ArrayLike,
    largest: float = 1e-2,
) -> float:
    """Return the order of the error of the linear approximation: 2 if J is the Jacobian of k.

    The slope of log ‖k(q + hΔ) − k(q) − h J Δ‖ over log h, for h from `largest` down to a tenth of
    it. It is 1 if J is wrong, and 3 or more where the second derivative along Δ happens to be 0
    [Selig92, §6.1].

    Args:
        position: k, from joint positions (..., n) to task coordinates (..., m).
        jacobian: J, from joint positions (n,) to (m, n).
        q: Joint positions, (n,) [rad or m].
        direction: Δ, (n,) [rad or m].
        largest: Largest of the factors h. With 1e-2 the remainder is some 1e-6 to 1e-4, far above rounding
            and far below the distance at which higher orders show.

    Returns:
        The slope, or infinity if k is linear along Δ except rounding.

    Example:
        >>> from rmrc.textbook.two_link import two_link_jacobian, two_link_position
        >>> arm = (lambda q: two_link_position([1, 1], q), lambda q: two_link_jacobian([1, 1], q))
        >>> round(taylor_order(*arm, [0.3, 0.5], [1.0, -0.7]), 2)
        2.0
    """
    h = np.geomspace(largest, 0.1 * largest, 6)
    q, direction = np.asarray(q, dtype=np.float64), np.asarray(direction, dtype=np.float64)
    missed = np.linalg.norm(taylor_remainder(position, jacobian, q, h[:, None] * direction), axis=-1)
    # Sums of some dozen terms of the size of k: less than this is their rounding.
    if missed[-1] <= 64 * np.finfo(float).eps * (1.0 + np.abs(position(q)).max()):
        return np.inf
    return float(np.polyfit(np.log(h), np.log(missed), 1)[0])


def tip_error(jacobian: ArrayLike, joint_error: ArrayLike) -> Array:
    """Return the error of the tip due to joint errors, to first order: Δx = J Δθ [Selig92, §6.2].

    Args:
        jacobian: J, (..., m, n).
        joint_error: Δθ, (..., n) [rad or m].

    Returns:
        Δx, in the rows of J, (..., m).

    Example:
        Stretched out along x, no joint error moves the tip along x; 0.1 rad in the second joint moves
        it along y by 0.1 (l₂ + l₃):

        >>> from rmrc.textbook.planar import planar_jacobian
        >>> tip_error(planar_jacobian([2, 1, 1], [0, 0, 0]), [0, 0.1, 0]).round(3)
        array([0. , 0.2, 0.1])
    """
    J, joint_error = np.asarray(jacobian, dtype=np.float64), np.asarray(joint_error, dtype=np.float64)
    return np.asarray((J @ joint_error[..., None])[..., 0])


def tip_covariance(jacobian: ArrayLike, joint_covariance: ArrayLike) -> Array:
    """Return the covariance of the tip's error for random joint errors: J Σ Jᵀ, to first order.

    From Δx = J Δθ and Σ = E[Δθ Δθᵀ] [Selig92, §6.2]. The square roots of its diagonal are the
    standard deviations of the rows. Joints with independent errors of standard deviation s_i have
    Σ = diag(s²).

    Args:
        jacobian: J, (..., m, n).
        joint_covariance: Σ, (..., n, n) [rad² or m²].

    Returns:
        J Σ Jᵀ, in the rows of J, (..., m, m).

    Example:
        Encoder errors of 1 mrad each, on two links of 1 m at a right angle, give 1.4 mm in x and 1 mm in y:

        >>> from rmrc.textbook.two_link import two_link_jacobian
        >>> J = two_link_jacobian([1, 1], np.radians([0, 90]))
        >>> np.sqrt(np.diag(tip_covariance(J, np.diag([1e-3, 1e-3]) ** 2))).round(4)
        array([0.0014, 0.001 ])
    """
    J = np.asarray(jacobian, dtype=np.float64)
    return np.asarray(J @ np.asarray(joint_covariance, dtype=np.float64) @ np.swapaxes(J, -1, -2))


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
    return matrix_of(
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
    return matrix_of([zero, -sa, ca * sb], [zero, ca, sa * sb], [one, zero, cb])


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
