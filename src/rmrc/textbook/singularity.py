"""What a Jacobian can do: its velocity ellipsoid, the dual for forces, manipulability, and its rank.

The rank comes from the minors, by determinants alone, and from the singular values.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """An ellipsoid around the tip.

    Attributes:
        axes: Its axes as columns, orthonormal, (..., m, m).
        half_axes: Half its length along each of them; 0 where it is flat, infinite where it has no
            end, (..., m).
    """

    axes: NDArray[np.float64]
    half_axes: NDArray[np.float64]


def velocity_ellipsoid(jacobian: ArrayLike) -> Ellipsoid:
    """Return the velocities reachable with unit-norm joint rates: half axes σ_i along u_i.

    ξᵀ (J Jᵀ)⁻¹ ξ = 1 with J = Σ σ_i u_i v_iᵀ [Yoshikawa85]. For m ≥ n, unit rates give points on the
    ellipsoid. For m < n they also give points inside it, because a part of the rates may have no effect. A
    lost direction has 0.

    Args:
        jacobian: J, (..., m, n); rows of one unit, or the lengths mean nothing.

    Returns:
        Half axes falling.

    Example:
        At a right angle of two links of 1 m: fastest at 1.618 m/s, slowest at 0.618 m/s.

        >>> from rmrc.textbook.two_link import two_link_jacobian
        >>> velocity_ellipsoid(two_link_jacobian([1, 1], np.radians([0, 90]))).half_axes.round(3)
        array([1.618, 0.618])
    """
    J = np.asarray(jacobian, dtype=np.float64)
    u, sigma, _ = np.linalg.svd(J)
    lost = sigma <= max(J.shape[-2:]) * np.finfo(float).eps * sigma[..., :1]
    half_axes = np.zeros((*J.shape[:-2], J.shape[-2]))
    half_axes[..., : sigma.shape[-1]] = np.where(lost, 0.0, sigma)
    return Ellipsoid(u, half_axes)


def force_ellipsoid(jacobian: ArrayLike) -> Ellipsoid:
    """Return the forces that unit-norm joint torques can hold: half axes 1/σ_i along the same u_i.

    Fᵀ (J Jᵀ) F = 1, because τ = Jᵀ F [Yoshikawa85]. In slow directions the tip is strong, and a lost
    direction holds any force. For m < n not all torques are those of a force.

    Args:
        jacobian: J, (..., m, n); rows of one unit, or the lengths mean nothing.

    Returns:
        Half axes rising, infinite along lost directions.

    Example:
        >>> from rmrc.textbook.two_link import two_link_jacobian
        >>> force_ellipsoid(two_link_jacobian([1, 1], [0, 0])).half_axes.round(3)
        array([0.447,   inf])
    """
    dual = velocity_ellipsoid(jacobian)
    half_axes = np.full_like(dual.half_axes, np.inf)
    np.divide(1.0, dual.half_axes, out=half_axes, where=dual.half_axes > 0.0)
    return Ellipsoid(dual.axes, half_axes)


def holding_jacobian(moving: ArrayLike, held: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of some rows while others are held at 0: M = J_a (1 − J_b⁺ J_b).

    The projector keeps the joint rates that leave the held rows at rest [Liegeois77].

    Args:
        moving: J_a, (..., a, n).
        held: J_b, (..., b, n); b may be 0.

    Returns:
        M, (..., a, n).

    Example:
        A planar arm of three links of 1 m along x: its tip still moves along y with a fixed orientation.

        >>> holding_jacobian([[0, 0, 0], [3, 2, 1]], [[1, 1, 1]]).round(3) + 0.0
        array([[ 0.,  0.,  0.],
               [ 1.,  0., -1.]])
    """
    M, rows = np.asarray(moving, dtype=np.float64), np.asarray(held, dtype=np.float64)
    # a lost row has only rounding left, which is no row
    return M - M @ np.linalg.pinv(rows, rcond=1e-6) @ rows if rows.shape[-2] else M


def ellipsoid_points(ellipsoid: Ellipsoid, count: int = 64) -> NDArray[np.float64]:
    """Return points on one ellipse or ellipsoid, for drawing it.

    x = Σ a_i e_i w_i for w on the unit circle or sphere, a_i the half axes and e_i the axes.

    Args:
        ellipsoid: Ellipsoid of m = 2 or 3, without leading axes, finite.
        count: Points around; the last is the first again. From pole to pole there are as many.

    Returns:
        (count, 2), or (count, count, 3): around, and from pole to pole.

    Raises:
        ModelError: If m is another, or a half axis is infinite.

    Example:
        >>> ellipse = Ellipsoid(np.eye(2), np.array([2.0, 1.0]))
        >>> ellipsoid_points(ellipse, 5).round(3).T + 0.0
        array([[ 2.,  0., -2.,  0.,  2.],
               [ 0.,  1.,  0., -1.,  0.]])
    """
    if ellipsoid.half_axes.shape not in {(2,), (3,)}:
        raise ModelError(f"ellipsoid: can draw 2 or 3 half axes, got shape {ellipsoid.half_axes.shape}")
    if not np.all(np.isfinite(ellipsoid.half_axes)):
        raise ModelError("ellipsoid: a half axis is infinite; bring it to the length that shall be drawn")
    around = np.linspace(0.0, 2 * np.pi, count)
    if ellipsoid.half_axes.shape == (2,):
        unit = np.stack([np.cos(around), np.sin(around)], axis=-1)
    else:
        polar = np.linspace(0.0, np.pi, count)
        circle = np.stack(
            [np.cos(around), np.sin(around), np.zeros(count)],
            axis=-1,
        )[:, None]
        unit = np.sin(polar)[:, None] * circle + np.cos(polar)[:, None] * np.array([0.0, 0.0, 1.0])
    return np.asarray((unit * ellipsoid.half_axes) @ ellipsoid.axes.T)


def manipulability(jacobian: ArrayLike) -> NDArray[np.float64]:
    """Return w = √det(J Jᵀ): the product of the half axes of the velocity ellipsoid [Yoshikawa85].

    The function computes that product, because the determinant of J Jᵀ loses half of the digits.

    Args:
        jacobian: J, (..., m, n). For m > n it is 0: some direction cannot move at all.

    Returns:
        w, (...).

    Example:
        Of two links it is |l₁ l₂ s₂|, greatest at the right angle:

        >>> from rmrc.textbook.two_link import two_link_jacobian
        >>> manipulability(two_link_jacobian([1, 0.5], np.radians([20, 90]))).round(3)
        np.float64(0.5)
    """
    J = np.asarray(jacobian, dtype=np.float64)
    if J.shape[-2] > J.shape[-1]:
        return np.zeros(J.shape[:-2])[()]
    return np.asarray(np.prod(np.linalg.svd(J, compute_uv=False), axis=-1))[()]


# Rank is lost where a singular value is below this part of the largest: determinants of a 6 x 6 are
# rounded at 1e-15 of the product of their columns' lengths, so this leaves three digits.
DEPENDENT = 1e-12


def minors(jacobian: ArrayLike, size: int) -> NDArray[np.float64]:
    """Return the determinants of all square submatrices of a size.

    J has rank r if some minor of size r is not zero and all larger ones are [Selig92, §6.2].

    Args:
        jacobian: J, (..., m, n).
        size: Size of the submatrices, 1..min(m, n).

    Returns:
        One row for each choice of rows of J, one column for each choice of its columns, both in
        lexical order (the compound matrix), (..., C(m, size), C(n, size)).

    Raises:
        ModelError: If J has no submatrices of that size.

    Example:
        Stretched out, a planar arm has lost the motion along itself: all minors of size 2 vanish.

        >>> from rmrc.textbook.planar import planar_jacobian
        >>> J = planar_jacobian([2, 1, 1], [0, 0, 0])[:2]
        >>> minors(J, 1)[1], minors(J, 2)[0] + 0.0
        (array([4., 2., 1.]), array([0., 0., 0.]))
    """
    J = np.asarray(jacobian, dtype=np.float64)
    m, n = J.shape[-2:]
    if not 1 <= size <= min(m, n):
        raise ModelError(f"minors: size must be 1 to {min(m, n)} for a {m} x {n} matrix, got {size}")
    # Numbers below the smallest normal one have no reciprocal, and cannot be pivots.
    J = np.where(np.abs(J) < np.finfo(float).tiny, 0.0, J)
    rows, columns = (np.array(list(combinations(range(count), size))) for count in (m, n))
    return np.asarray(np.linalg.det(J[..., rows[:, None, :, None], columns[None, :, None, :]]))


def rank_by_minors(jacobian: ArrayLike, tolerance: float = DEPENDENT) -> NDArray[np.int64]:
    """Return the rank of J as the size of its largest minor that does not vanish.

    With D_r the root of the sum of squares of all minors of size r, and k = min(m, n), D_r/D_r-1 lies
    between σ_r/√C(k, r−1) and σ_r √C(k, r): for up to six joints it is σ_r within a factor of 5. The
    minors of size r count as zero where D_r ≤ tolerance · D_1 · D_r-1, so that the answer does not
    depend on the unit of J as a whole [Selig92, §6.2]. Rows in meters and in radians have no common
    unit: scale them first.

    Args:
        jacobian: J, (..., m, n).
        tolerance: Relative to the largest singular value, about.

    Returns:
        0..min(m, n), (...).

    Example:
        >>> from rmrc.textbook.planar import planar_jacobian
        >>> [int(rank_by_minors(planar_jacobian([2, 1, 1], q)[:2])) for q in ([0, 0, 0], [0, 1.6, 0])]
        [1, 2]
    """
    J = np.asarray(jacobian, dtype=np.float64)
    largest = np.max(np.abs(J), axis=(-2, -1), keepdims=True)
    J = J / np.where(largest > 0.0, largest, 1.0)  # or products of many entries overflow or vanish
    rank = np.zeros(J.shape[:-2], dtype=np.int64)
    first = previous = np.asarray(_size_of_minors(J, 1))
    for r in range(1, min(J.shape[-2:]) + 1):
        current = np.asarray(_size_of_minors(J, r))
        rank += (rank == r - 1) & (current > (tolerance * first * previous if r > 1 else 0.0))
        previous = current
    return rank


def rank_by_singular_values(jacobian: ArrayLike, tolerance: float = DEPENDENT) -> NDArray[np.int64]:
    """Return the number of singular values above tolerance · σ₁ [Golub13, §5.5].

    Args:
        jacobian: J, (..., m, n).
        tolerance: Relative to the largest singular value.

    Returns:
        0..min(m, n), (...).

    Example:
        >>> from rmrc.textbook.six_joint import stanford_jacobian
        >>> int(rank_by_singular_values(stanford_jacobian([0.3, 1.0, 0.6, 0.7, 0.0, 0.2])))
        5
    """
    sigma = np.linalg.svd(np.asarray(jacobian, dtype=np.float64), compute_uv=False)
    return np.asarray(np.sum(sigma > tolerance * sigma[..., :1], axis=-1))


def manipulability_by_minors(jacobian: ArrayLike) -> NDArray[np.float64]:
    """Return w as the root of the sum of squares of all maximal minors: no square of J is formed.

    By Cauchy and Binet it is √det(J Jᵀ) for m ≤ n and √det(Jᵀ J) for m ≥ n [Yoshikawa85].

    Args:
        jacobian: J, (..., m, n).

    Returns:
        w, (...).

    Example:
        >>> manipulability_by_minors([[1, 0, 2], [0, 1, 2]])
        np.float64(3.0)
    """
    J = np.asarray(jacobian, dtype=np.float64)
    return _size_of_minors(J, min(J.shape[-2:]))


def _size_of_minors(J: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(minors(J, size), axis=(-2, -1)))[()]
