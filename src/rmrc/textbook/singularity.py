"""Rank of a Jacobian from its minors, by determinants alone, and from its singular values."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError

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
        >>> from rmrc.textbook.stanford import stanford_jacobian
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
