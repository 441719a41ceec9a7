"""Small dense matrices: the singular value decomposition of the whole law.

Index loops live here and nowhere else. Sizes are those of arms: at most six task rows, a few joints.
"""

import math

import numpy as np

from rmrc.law.jit import Array, compiled, entry, inlined

# Two vectors count as orthogonal when their cosine is at the rounding of a dot product of a dozen terms.
ORTHOGONAL = 3e-15
# Rotations below this leave cosines of their square, 1e-13.
SMALL = 3e-7
# For values alone: rotations below this leave others of their square, which move a value by that squared.
SMALL_FOR_VALUES = 1e-4
# Number of matrices that are decomposed side by side, with the same entry of all of them adjacent in memory,
# so that the processor works on several at once: enough to make up for the start of a loop, few enough for
# its nearest memory.
LANES = 64
# Below this tangent the neglected terms of the cosine's series, 5/16 t⁶, are below rounding.
SERIES = 1e-3
# Quadratic convergence needs 3 to 6 sweeps from a cold start; more means the input is not finite.
SWEEPS_MAX = 30
# Below this fraction of sigma_1 a singular value is rounding, and its long vector is noise.
RANK_FLOOR = 1e-14
# Products of two sums of squares must stay in range, and also the smallest of them that counts; a matrix
# whose sum of squares is beyond these bounds is scaled first.
TINY, HUGE = 1e-120, 1e120


@compiled
def dot(a: Array, b: Array, size: int) -> float:
    """Return the inner product of the first `size` entries."""
    total = 0.0
    for i in range(size):
        total += a[i] * b[i]
    return total


@compiled
def project(basis: Array, vector: Array, k: int, size: int, along: Array) -> None:
    """Write the inner product of each of the k rows with a vector."""
    for i in range(k):
        along[i] = dot(basis[i], vector, size)


@compiled
def product(values: Array, count: int) -> float:
    """Return the product of the first values, the last first.

    With singular values it meets a zero before it can overflow.
    """
    found = 1.0
    for i in range(count - 1, -1, -1):
        found *= values[i]
    return found


@compiled
def combine(gain: Array, along: Array, basis: Array, k: int, size: int, total: Array) -> None:
    """Write the sum of the k rows, each times its gain and its component."""
    for j in range(size):
        total[j] = 0.0
    for i in range(k):
        amount = gain[i] * along[i]
        for j in range(size):
            total[j] += amount * basis[i, j]


@compiled
def set_identity(basis: Array, size: int) -> None:
    """Write the identity into the leading (size, size) block."""
    for i in range(size):
        for j in range(size):
            basis[i, j] = 1.0 if i == j else 0.0


@compiled
def orthogonalize_row(rows: Array, i: int, size: int) -> None:
    """Remove from row i its components along the orthonormal rows before it, and normalize it."""
    for p in range(i):
        along = dot(rows[i], rows[p], size)
        for j in range(size):
            rows[i, j] -= along * rows[p, j]
    norm = math.sqrt(dot(rows[i], rows[i], size))
    for j in range(size):
        rows[i, j] /= norm


@compiled
def orthonormalize(basis: Array, size: int) -> None:
    """Make the rows of a nearly orthonormal (size, size) block orthonormal again (Gram-Schmidt)."""
    for i in range(size):
        orthogonalize_row(basis, i, size)


@compiled
def rotate_rows(rows: Array, p: int, q: int, c: float, s: float, size: int) -> None:
    """Rotate rows p and q of a matrix by the angle with cosine c and sine s."""
    for j in range(size):
        a, b = rows[p, j], rows[q, j]
        rows[p, j] = c * a - s * b
        rows[q, j] = s * a + c * b


@compiled
def orthogonalize_rows(long: Array, basis: Array, norm2: Array, k: int, size: int) -> None:
    """Rotate the k rows of `long` until they are orthogonal, and `basis` along (one-sided Jacobi).

    The relative test makes small singular values as accurate as large ones [Demmel92]. A sweep whose
    largest rotation was SMALL leaves errors of its square, so no sweep is spent on confirming it. Pairs
    (p, q) with p + q constant modulo k have no row in common: the processor works on several at once.
    `norm2` holds the squared lengths of the rows, before and after.
    """
    for _ in range(SWEEPS_MAX):
        largest = 0.0
        for pairs in range(k):
            for p in range(k):
                q = pairs - p if pairs >= p else pairs - p + k
                if q <= p:
                    continue
                gamma = dot(long[p], long[q], size)
                if gamma * gamma <= ORTHOGONAL * ORTHOGONAL * norm2[p] * norm2[q]:
                    continue
                t, c = rotation(gamma, norm2[q] - norm2[p])
                rotate_rows(long, p, q, c, c * t, size)
                rotate_rows(basis, p, q, c, c * t, k)
                norm2[p] -= t * gamma
                norm2[q] += t * gamma
                largest = max(largest, abs(t))
        squared_norms(long, norm2, k, size)
        if largest <= SMALL:
            break


@compiled
def squared_norms(rows: Array, norm2: Array, k: int, size: int) -> None:
    """Write the squared length of each of the k rows."""
    for p in range(k):
        norm2[p] = dot(rows[p], rows[p], size)


@compiled
def rotation(gamma: float, difference: float) -> tuple[float, float]:
    """Return tangent and cosine of the smaller angle that zeroes the inner product `gamma`.

    t² + 2 ζ t = 1 with ζ = difference / (2 gamma) [Golub13, §8.5]. For the small angles of a warm start, the
    series needs one division instead of three, no root. The cosine is exact to rounding, as it must be; the
    tangent need not be, because the next sweep corrects it.
    """
    x = gamma / difference if difference != 0.0 else math.inf
    if abs(x) < SERIES:
        t = x * (1.0 - x * x)
        return t, 1.0 - t * t * (0.5 - 0.375 * t * t)
    zeta = 0.5 / x
    t = math.copysign(1.0, zeta) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
    return t, 1.0 / math.sqrt(1.0 + t * t)


@compiled
def swap_rows(rows: Array, p: int, q: int, size: int) -> None:
    """Exchange two rows of a matrix."""
    for j in range(size):
        rows[p, j], rows[q, j] = rows[q, j], rows[p, j]


@compiled
def sort_falling(sigma: Array, long: Array, basis: Array, k: int, size: int) -> None:
    """Sort singular values, largest first, and their vectors along; nearly sorted input is cheap."""
    for i in range(1, k):
        p = i
        while p > 0 and sigma[p - 1] < sigma[p]:
            sigma[p - 1], sigma[p] = sigma[p], sigma[p - 1]
            swap_rows(long, p - 1, p, size)
            swap_rows(basis, p - 1, p, k)
            p -= 1


@compiled
def complete_row(rows: Array, i: int, size: int) -> None:
    """Replace row i by a unit vector orthogonal to the rows before it.

    It starts from the coordinate axis that those rows cover least, so at least 1/size remains.
    """
    best, most = 0, -1.0
    for j in range(size):
        left = 1.0
        for p in range(i):
            left -= rows[p, j] * rows[p, j]
        if left > most + 1e-9:  # prefer the first axis among equals: rounding must not choose
            best, most = j, left
    for j in range(size):
        rows[i, j] = 1.0 if j == best else 0.0
    orthogonalize_row(rows, i, size)
    orthogonalize_row(rows, i, size)  # removes the cancellation errors of the first


@compiled
def continue_row(rows: Array, i: int, wish: Array, size: int) -> None:
    """Turn row i, any unit vector orthogonal to the rows before it, as near as possible to a wish."""
    left = dot(wish, wish, size)
    for p in range(i):
        along = dot(rows[p], wish, size)
        left -= along * along
    if left > 0.5:  # otherwise the rows before it have turned so far that the wish is meaningless
        for j in range(size):
            rows[i, j] = wish[j]
        orthogonalize_row(rows, i, size)


@compiled
def normalize_rows(sigma: Array, long: Array, k: int, size: int) -> None:
    """Divide each row by its singular value; where that is rounding, complete the basis instead."""
    for i in range(k):
        if sigma[i] > RANK_FLOOR * sigma[0]:
            inverse = 1.0 / sigma[i]
            for j in range(size):
                long[i, j] *= inverse
        else:
            complete_row(long, i, size)


@compiled
def svd(a: Array, m: int, n: int, u: Array, sigma: Array, v: Array) -> None:
    """Decompose the leading (m, n) block of `a` as sum_i sigma_i u_i v_iᵀ, sigma falling.

    One-sided Jacobi on the shorter side [Hestenes58] rotates the rows of the smaller of `u` (k, m) and
    `v` (k, n). Any orthonormal basis that they hold from the last tick is the warm start. Between neighboring
    ticks about two sweeps are then enough, and the signs of the vectors stay continuous. Vectors of singular
    values that are zero to rounding complete the basis.

    Args:
        a: Matrix, at least (m, n).
        m: Rows.
        n: Columns.
        u: Left vectors as rows, at least (k, m), k = min(m, n). Read if m <= n.
        sigma: Singular values, at least (k,).
        v: Right vectors as rows, at least (k, n). Read if m > n.
    """
    k = min(m, n)
    if m <= n:
        for i in range(k):
            for j in range(n):
                v[i, j] = u[i, 0] * a[0, j]
            for r in range(1, m):
                for j in range(n):
                    v[i, j] += u[i, r] * a[r, j]
        decompose(v, u, sigma, k, n)
    else:
        for i in range(k):
            for r in range(m):
                u[i, r] = dot(a[r], v[i], n)
        decompose(u, v, sigma, k, m)


@entry
def svd_alone(a: Array, m: int, n: int, u: Array, sigma: Array, v: Array) -> None:
    """Do what `svd` does, for Python."""
    svd(a, m, n, u, sigma, v)


@inlined
def svd_from_scratch(a: Array, m: int, n: int, u: Array, sigma: Array, v: Array) -> None:
    """Decompose a matrix as `svd` does, without a warm start."""
    if m <= n:
        set_identity(u, m)
    else:
        set_identity(v, n)
    svd(a, m, n, u, sigma, v)


@inlined
def decompose(long: Array, basis: Array, sigma: Array, k: int, size: int) -> None:
    """Turn `long` = basis @ matrix into orthonormal rows, their lengths into `sigma`."""
    squared_norms(long, sigma, k, size)
    scale = tame(long, sigma, k, size)
    orthogonalize_rows(long, basis, sigma, k, size)
    for i in range(k):
        sigma[i] = math.sqrt(sigma[i])
    sort_falling(sigma, long, basis, k, size)
    normalize_rows(sigma, long, k, size)
    if scale != 1.0:
        for i in range(k):
            sigma[i] *= scale


@compiled
def tame(rows: Array, norm2: Array, k: int, size: int) -> float:
    """Divide the rows by their largest entry if squares would leave the range; return the divisor."""
    total = 0.0
    for p in range(k):
        total += norm2[p]
    if TINY < total < HUGE:
        return 1.0
    largest = 0.0
    for p in range(k):
        for j in range(size):
            largest = max(largest, abs(rows[p, j]))
    if largest == 0.0:
        return 1.0
    for p in range(k):
        for j in range(size):
            rows[p, j] /= largest
    squared_norms(rows, norm2, k, size)
    return largest


def cold_svd(a: Array) -> tuple[Array, Array, Array]:
    """Return u (k, m), sigma (k,), v (k, n) of one matrix (m, n), vectors as rows, from a cold start.

    >>> u, sigma, v = cold_svd(np.array([[3.0, 0.0], [4.0, 0.0]]))
    >>> sigma.round(12).tolist()
    [5.0, 0.0]
    """
    m, n = a.shape
    k = min(m, n)
    u, sigma, v = np.eye(k, m), np.zeros(k), np.eye(k, n)
    svd_alone(np.ascontiguousarray(a, np.float64), m, n, u, sigma, v)
    return u, sigma, v


@compiled
def singular_values_of_lanes(long: Array, norm2: Array, k: int, size: int) -> None:
    """Write the squared singular values of LANES matrices at once, unsorted: `decompose` without any vectors.

    The rotations are the same, but all matrices proceed in step. A finished matrix is rotated by exactly
    nothing, so its bits do not depend on those beside it.

    Args:
        long: The k rows of each matrix, (k, size, LANES); overwritten.
        norm2: Written, (k, LANES).
        k: Rows.
        size: Columns, at least k.
    """
    sine, cosine, gamma = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    largest, left = np.empty(LANES), np.ones(LANES)
    squared_norms_of_lanes(long, norm2, k, size)
    for _ in range(SWEEPS_MAX):
        largest[:] = 0.0
        for p in range(k - 1):
            for q in range(p + 1, k):
                rotate_lanes(long, p, q, size, norm2, left, sine, cosine, gamma, largest)
        squared_norms_of_lanes(long, norm2, k, size)
        count = 0.0
        for w in range(LANES):
            if largest[w] <= SMALL_FOR_VALUES:
                left[w] = 0.0
            count += left[w]
        if count == 0.0:
            break


@compiled
def rotate_lanes(
    long: Array, p: int, q: int, size: int, norm2: Array, left: Array, sine: Array, cosine: Array,
    gamma: Array, largest: Array,
) -> None:  # fmt: skip
    """Rotate rows p and q of each unfinished matrix until they are orthogonal.

    Args:
        long: Rows of all matrices, (k, size, LANES).
        p: A row.
        q: Another.
        size: Columns.
        norm2: Squared lengths of the rows, (k, LANES); kept up.
        left: 1 where a matrix is unfinished, else 0, (LANES,).
        sine: Overwritten, (LANES,).
        cosine: Overwritten, (LANES,).
        gamma: Overwritten, (LANES,).
        largest: Largest tangent of this sweep, (LANES,); kept up.
    """
    for w in range(LANES):
        gamma[w] = 0.0
    for j in range(size):
        for w in range(LANES):
            gamma[w] += long[p, j, w] * long[q, j, w]
    for w in range(LANES):
        g, a, b = gamma[w], norm2[p, w], norm2[q, w]
        counts = (g * g > ORTHOGONAL * ORTHOGONAL * a * b) & (left[w] > 0.0)
        # As `rotation`, but without a branch, so that the processor can take several at once.
        t = 2.0 * g / (b - a + math.copysign(math.sqrt((b - a) * (b - a) + 4.0 * g * g), b - a))
        t = t if counts else 0.0
        cosine[w] = 1.0 / math.sqrt(1.0 + t * t)
        sine[w] = cosine[w] * t
        norm2[p, w], norm2[q, w] = a - t * g, b + t * g
        largest[w] = largest[w] if largest[w] > abs(t) else abs(t)
    for j in range(size):
        for w in range(LANES):
            a, b = long[p, j, w], long[q, j, w]
            long[p, j, w] = cosine[w] * a - sine[w] * b
            long[q, j, w] = sine[w] * a + cosine[w] * b


@compiled
def squared_norms_of_lanes(long: Array, norm2: Array, k: int, size: int) -> None:
    """Write the squared lengths of the k rows of each of LANES matrices, (k, LANES)."""
    for p in range(k):
        norm2[p, :] = 0.0
        for j in range(size):
            for w in range(LANES):
                norm2[p, w] += long[p, j, w] * long[p, j, w]


@compiled
def put_in_lane(a: Array, m: int, n: int, rows: Array, norm2: Array, long: Array, w: int) -> float:
    """Copy the leading (m, n) block of `a`, its shorter side as rows, into a lane; return its divisor.

    Args:
        a: Matrix, at least (m, n).
        m: Rows.
        n: Columns.
        rows: Overwritten, at least (min(m, n), max(m, n)).
        norm2: Overwritten, at least (min(m, n),).
        long: Rows of all lanes; one lane is written.
        w: Index of the lane.
    """
    k, size = min(m, n), max(m, n)
    for p in range(k):
        for j in range(size):
            rows[p, j] = a[p, j] if m <= n else a[j, p]
    squared_norms(rows, norm2, k, size)
    scale = tame(rows, norm2, k, size)
    for p in range(k):
        for j in range(size):
            long[p, j, w] = rows[p, j]
    return scale


@compiled
def take_from_lane(norm2: Array, k: int, w: int, scale: float, sigma: Array) -> None:
    """Write the singular values of a lane, descending, times the divisor of its matrix."""
    for i in range(k):
        value, p = scale * math.sqrt(norm2[i, w]), i
        while p > 0 and sigma[p - 1] < value:
            sigma[p] = sigma[p - 1]
            p -= 1
        sigma[p] = value
