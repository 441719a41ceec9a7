"""Small dense matrices: the singular value decomposition of the whole law.

Sizes are those of arms: at most six task rows, a few joints.
"""

import math

from rmrc.law.compiling import Array, Method, Record, call, compiled

# The relative excess of a bound that is more than rounding.
ROUNDING = 1e-12
# Two vectors count as orthogonal when their cosine is at the rounding of a dot product of a dozen terms.
ORTHOGONAL = 3e-15
# Rotations below this leave cosines of their square, 1e-13.
SMALL = 3e-7
# Below this tangent the neglected terms of the cosine's series, 5/16 t⁶, are below rounding.
SERIES = 1e-3
# Quadratic convergence needs 3 to 6 sweeps from a cold start; more means the input is not finite.
SWEEPS_MAX = 30
# Rotations accumulate rounding in the warm start; after this many ticks it is made orthonormal again. In 64
# ticks of some 30 rotations it loses at most 1e-13.
REFRESH = 64
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
def copy(source: Array, target: Array, size: int) -> None:
    """Copy the first `size` entries."""
    for i in range(size):
        target[i] = source[i]


@compiled
def clear(values: Array, size: int) -> None:
    """Set the first `size` entries to 0."""
    for i in range(size):
        values[i] = 0.0


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
def begin_basis(basis: Array, k: int, age: int) -> None:
    """Write the identity into the leading (k, k) block at age 0; make it orthonormal again now and then."""
    for i in range(k if age == 0 else 0):
        for j in range(k):
            basis[i, j] = 1.0 if i == j else 0.0
    for i in range(k if age > 0 and age % REFRESH == 0 else 0):
        orthogonalize_row(basis, i, k)


@compiled
def tame(rows: Array, norm2: Array, k: int, size: int) -> float:
    """Write the squared lengths of k rows; divide the rows first if these would leave the range.

    Return the divisor.
    """
    total, largest = 0.0, 0.0
    for p in range(k):
        norm2[p] = dot(rows[p], rows[p], size)
        total += norm2[p]
        for j in range(size):
            largest = max(largest, abs(rows[p, j]))
    if TINY < total < HUGE or largest == 0.0:
        return 1.0
    for p in range(k):
        for j in range(size):
            rows[p, j] /= largest
        norm2[p] = dot(rows[p], rows[p], size)
    return float(largest)


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

    The relative test makes small singular values as accurate as large ones [Demmel92]. The smaller angle that
    zeroes the inner product γ of two rows has t² + 2 ζ t = 1, ζ = (|b|² − |a|²)/(2 γ) [Golub13, §8.5]. For
    the small angles of a warm start, the series needs no root; the cosine is exact to rounding, as it must
    be, and the next sweep corrects the tangent. A sweep whose largest rotation was SMALL leaves errors of its
    square, so no sweep is spent on confirming it. Pairs (p, q) with p + q constant modulo k have no row in
    common: the processor works on several at once.
    """
    for _ in range(SWEEPS_MAX):
        largest = 0.0
        for pair in range(k):
            for p in range(k):
                q = pair - p if pair >= p else pair - p + k
                if q <= p:
                    continue
                gamma, difference = dot(long[p], long[q], size), norm2[q] - norm2[p]
                if gamma * gamma <= ORTHOGONAL * ORTHOGONAL * norm2[p] * norm2[q]:
                    continue
                x = gamma / difference if difference != 0.0 else math.inf
                if abs(x) < SERIES:
                    t = x * (1.0 - x * x)
                    c = 1.0 - t * t * (0.5 - 0.375 * t * t)
                else:
                    zeta = 0.5 / x
                    t = math.copysign(1.0, zeta) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                    c = 1.0 / math.sqrt(1.0 + t * t)
                rotate_rows(long, p, q, c, c * t, size)
                rotate_rows(basis, p, q, c, c * t, k)
                norm2[p] -= t * gamma
                norm2[q] += t * gamma
                largest = max(largest, abs(t))
        for p in range(k):
            norm2[p] = dot(long[p], long[p], size)
        if largest <= SMALL:
            break


@compiled
def sort_falling(sigma: Array, long: Array, basis: Array, k: int, size: int) -> None:
    """Sort singular values, largest first, and their vectors along; nearly sorted input is cheap."""
    for i in range(1, k):
        p = i
        while p > 0 and sigma[p - 1] < sigma[p]:
            sigma[p - 1], sigma[p] = sigma[p], sigma[p - 1]
            for j in range(size):
                long[p - 1, j], long[p, j] = long[p, j], long[p - 1, j]
            for j in range(k):
                basis[p - 1, j], basis[p, j] = basis[p, j], basis[p - 1, j]
            p -= 1


@compiled
def least_covered(rows: Array, count: int, size: int) -> int:
    """Return the coordinate axis that the first rows cover least."""
    best, most = 0, -1.0
    for j in range(size):
        uncovered = 1.0
        for p in range(count):
            uncovered -= rows[p, j] * rows[p, j]
        if uncovered > most + 1e-9:  # prefer the first axis among equals: rounding must not choose
            best, most = j, uncovered
    return best


@Method
def complete(world: Record, spectrum: Record) -> None:
    """Replace vectors of singular values that are zero to rounding by unit vectors orthogonal to the others.

    Each starts from the coordinate axis that the others cover least, so at least 1/size remains. But the last
    v goes on from its value of the last tick, as it would hold slightly away from the singularity.
    """
    m, n, sigma = spectrum.rows, world.n, spectrum.sigma
    k, size, rows = min(m, n), max(m, n), spectrum.v if m <= n else spectrum.u
    for i in range(k):
        if sigma[i] > RANK_FLOOR * sigma[0]:
            continue
        best = least_covered(rows, i, size)
        for j in range(size):
            rows[i, j] = 1.0 if j == best else 0.0
        orthogonalize_row(rows, i, size)
        orthogonalize_row(rows, i, size)  # removes the cancellation errors of the first
    if m <= n and spectrum.age > 0:
        uncovered = dot(spectrum.v_last, spectrum.v_last, n)
        for p in range(k - 1):
            along = dot(rows[p], spectrum.v_last, n)
            uncovered -= along * along
        if uncovered > 0.5:  # otherwise the others have turned so far that the last value is meaningless
            copy(spectrum.v_last, rows[k - 1], n)
            orthogonalize_row(rows, k - 1, n)


@compiled
def svd(a: Array, m: int, n: int, u: Array, sigma: Array, v: Array) -> None:
    """Decompose the leading (m, n) block of `a` as sum_i sigma_i u_i v_iᵀ, sigma falling.

    One-sided Jacobi on the shorter side [Hestenes58] rotates the rows of the smaller of `u` (k, m) and `v`
    (k, n). Any orthonormal basis that they hold is the warm start. Between neighboring ticks about two sweeps
    are then enough, and the signs of the vectors stay continuous.

    Args:
        a: Matrix, at least (m, n).
        m: Rows.
        n: Columns.
        u: Left vectors as rows, at least (k, m), k = min(m, n). Read if m <= n.
        sigma: Singular values, at least (k,).
        v: Right vectors as rows, at least (k, n). Read if m > n. Where a singular value is zero to rounding,
            the vector on the longer side is rounding too.
    """
    k, size = min(m, n), max(m, n)
    long, basis = (v, u) if m <= n else (u, v)
    for i in range(k):
        for j in range(size):
            long[i, j] = 0.0
            for r in range(k):
                long[i, j] += basis[i, r] * (a[r, j] if m <= n else a[j, r])
    divisor = tame(long, sigma, k, size)
    orthogonalize_rows(long, basis, sigma, k, size)
    for i in range(k):
        sigma[i] = math.sqrt(sigma[i])
    sort_falling(sigma, long, basis, k, size)
    floor = RANK_FLOOR * sigma[0]
    for i in range(k):
        for j in range(size if sigma[i] > floor else 0):
            long[i, j] *= 1.0 / sigma[i]
        sigma[i] *= divisor


@Method
def decompose(world: Record, spectrum: Record) -> None:
    """Decompose the matrix of a spectrum, (rows, n), warm-started from its vectors unless its age is 0."""
    m, n, sigma = spectrum.rows, world.n, spectrum.sigma
    k = min(m, n)
    begin_basis(spectrum.u if m <= n else spectrum.v, k, spectrum.age)
    svd(spectrum.matrix, m, n, spectrum.u, sigma, spectrum.v)
    if sigma[k - 1] <= RANK_FLOOR * sigma[0]:
        call(world.methods.complete, world, spectrum)
    copy(spectrum.v[k - 1], spectrum.v_last, n)
    spectrum.age += 1


@compiled
def decompose_afresh(world: Record, m: int) -> None:
    """Decompose `rest.matrix`, (m, n), without a warm start.

    It holds the columns of A that remain for the free joints, or a second task's A.
    """
    world.rest.age, world.rest.rows = 0, m
    call(world.methods.decompose, world, world.rest)
