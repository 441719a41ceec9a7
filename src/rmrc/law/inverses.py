"""Every inverse as a filter g(sigma), and the schedules of its damping."""

import math

from rmrc.law.jit import Array, Record, compiled
from rmrc.law.svd import RANK_FLOOR, combine
from rmrc.scenario.choices import Method, Schedule

# Enum members become plain integers in compiled code.
PSEUDOINVERSE, TRUNCATED, TRANSPOSE, DAMPED, FILTERED, SELECTIVELY_DAMPED, JPARSE = map(
    int,
    (
        Method.PSEUDOINVERSE, Method.TRUNCATED, Method.TRANSPOSE, Method.DAMPED, Method.FILTERED,
        Method.SELECTIVELY_DAMPED, Method.JPARSE,
    ),
)  # fmt: skip
SMALLEST_SINGULAR_VALUE, MANIPULABILITY, ERROR, RATE_BOUND = map(
    int,
    (Schedule.SMALLEST_SINGULAR_VALUE, Schedule.MANIPULABILITY, Schedule.ERROR, Schedule.RATE_BOUND),
)

# No gain is larger: its products with any command then stay finite, so that nothing is ever NaN.
LARGEST_GAIN = 1e150
# Newton's iteration for the least damping ends at this accuracy of the norm. From its starting point it takes
# three to six steps; a hundred random problems of each size took ten at the most.
ACCURACY, STEPS_MAX = 1e-12, 30


@compiled
def damping(world: Record, asked: Array, sigma: Array) -> float:
    """Return λ for this tick, in the units of σ (not λ²); zero for the methods that have none.

    constant                  λ = λ_max                                          [Wampler86]
    manipulability            λ = λ_max (1 − w/w₀) if w < w₀, else 0             [Nakamura86]
    smallest_singular_value   λ² = (1 − (σ_min/ε)²) λ_max² if σ_min < ε, else 0  [Chiaverini94]
    error                     λ = error_gain · ‖S_x pose_error‖                  [Levenberg44]
    rate_bound                the least λ with ‖S_q⁻¹ qdot‖ <= rate_bound        [Deo92]

    Of the method `filtered` it is that of the smallest σ.

    Args:
        world: Parameters.
        asked: Uᵀ S_x twist_cmd, what the task asks of each direction, (k,).
        sigma: Singular values, (k,).
    """
    method, schedule = world.method, world.schedule
    if method == FILTERED or (method == DAMPED and schedule == SMALLEST_SINGULAR_VALUE):
        return spectral_damping(world, sigma[world.k - 1])
    if method != DAMPED:
        return 0.0
    if schedule == MANIPULABILITY:
        w = manipulability(world, sigma)
        return float(max(0.0, 1.0 - w / world.manipulability_below) * world.damping_maximum)
    if schedule == ERROR:
        return float(world.error_gain * world.error)
    if schedule == RATE_BOUND:
        return least_damping(world, asked, sigma)
    return float(world.damping_maximum)


@compiled
def manipulability(world: Record, sigma: Array) -> float:
    """Return w = Π σ_i [Yoshikawa85], smallest first, so that no product overflows before it meets a zero."""
    product = 1.0
    for i in range(world.k - 1, -1, -1):
        product *= sigma[i]
    return product


@compiled
def spectral_damping(world: Record, sigma: float) -> float:
    """Return λ(σ) that rises from 0 at σ = ε to λ_max at σ = 0 [Chiaverini94]."""
    ratio = sigma / world.damping_below
    return 0.0 if ratio >= 1.0 else math.sqrt(1.0 - ratio * ratio) * float(world.damping_maximum)


@compiled
def least_damping(world: Record, asked: Array, sigma: Array) -> float:
    """Return the smallest λ that keeps ‖S_q⁻¹ qdot‖ within the bound [Maciejewski88], [Deo92].

    Newton on 1/bound − 1/‖S_q⁻¹ qdot(μ)‖ over μ = λ², from a μ that is never beyond the root [More83].
    """
    bound, floor, mu = world.rate_bound, RANK_FLOOR * sigma[0], 0.0
    for i in range(world.k):
        if sigma[i] > floor:
            mu = max(mu, sigma[i] * (abs(asked[i]) / bound - sigma[i]))
    for _ in range(STEPS_MAX):
        total, slope = 0.0, 0.0
        for i in range(world.k):
            if sigma[i] > floor:
                pivot = sigma[i] + mu / sigma[i]
                rate = asked[i] / (pivot * bound)
                total += rate * rate
                slope += rate * rate / (pivot * sigma[i])
        excess = math.sqrt(total) - 1.0
        if not excess > ACCURACY:
            break
        mu += total / slope * excess
    return math.sqrt(mu)


@compiled
def gains(world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array) -> None:
    """Write g(σ_i) for i < k, σ falling; 0 where σ_i is zero to rounding, so that nothing is ever NaN.

    inverse             1/σ
    pseudoinverse       1/σ for σ > tolerance · σ_1, else 0                       [Whitney69]
    truncated           1/σ for σ > cutoff, else 0                                [Golub13, §5.5]
    transpose           α σ with the best α                                       [Wolovich84]
    damped              σ/(σ² + λ²)                                   [Nakamura86], [Wampler86]
    filtered            σ/(σ² + λ(σ)²), each direction by its own λ               [Maciejewski88]
    selectively_damped  1/σ, clamped by what each direction may ask of the joints [Buss05]
    jparse              1/σ for σ >= γ σ_1, else σ/(γ σ_1)²                       [Guptasarma25]

    Args:
        world: Parameters, and A.
        asked: Uᵀ S_x twist_cmd, what the task asks of each direction, (k,).
        sigma: Singular values, (k,).
        v: Right vectors as rows, (k, n).
        damped: λ of this tick.
        gain: Written, (k,).
    """
    method, floor = world.method, smallest_inverted(world, sigma[0])
    fading = world.gamma * sigma[0] if method == JPARSE else 0.0
    for i in range(world.k):
        s = sigma[i]
        if method == FILTERED:
            damped = spectral_damping(world, s)
        if s <= floor:
            gain[i] = 0.0
        elif damped > 0.0:
            gain[i] = min(s / (s * s + damped * damped), LARGEST_GAIN)
        elif s < fading:
            gain[i] = min(s / fading / fading, LARGEST_GAIN)
        else:
            gain[i] = min(1.0 / s, LARGEST_GAIN)
    if method == TRANSPOSE:
        transpose_gains(world, asked, sigma, gain)
    elif method == SELECTIVELY_DAMPED:
        clamp_directions(world, asked, sigma, v, gain)


@compiled
def smallest_inverted(world: Record, largest: float) -> float:
    """Return the σ up to which directions are given up."""
    if world.method == TRUNCATED:
        return float(max(RANK_FLOOR * largest, world.cutoff))
    if world.method == PSEUDOINVERSE:
        return float(max(RANK_FLOOR, world.tolerance) * largest)
    return RANK_FLOOR * largest


@compiled
def transpose_gains(world: Record, asked: Array, sigma: Array, gain: Array) -> None:
    """Write α σ_i with the α that leaves the smallest task residual [Wolovich84], [Buss05].

    All is taken relative to σ_1 and to the largest entry, so that no square leaves the range.
    """
    largest = 0.0
    for i in range(world.k):
        gain[i] = asked[i] * (sigma[i] / sigma[0]) if sigma[0] > 0.0 else 0.0
        largest = max(largest, abs(gain[i]))
    above, below = 0.0, 0.0
    for i in range(world.k):
        share = sigma[i] / sigma[0] if sigma[0] > 0.0 else 0.0
        moved = gain[i] / largest if largest > 0.0 else 0.0
        above += moved * moved
        below += share * moved * share * moved
        gain[i] = share
    alpha = above / below / sigma[0] if below > 0.0 else 0.0
    for i in range(world.k):
        gain[i] = min(gain[i] * alpha, LARGEST_GAIN) if gain[i] > RANK_FLOOR else 0.0


@compiled
def clamp_directions(world: Record, asked: Array, sigma: Array, v: Array, gain: Array) -> None:
    """Lessen the gains 1/σ_i by what Buss and Kim allow each direction, and all of them together [Buss05].

    A direction whose joint motion moves the tip by less than the joints would one by one, which is one that
    dies, gets as much less of the bound.
    """
    n, bound, scale = world.n, world.rate_bound, world.work
    for j in range(n):
        total = 0.0
        for r in range(world.m):
            total += world.A[r, j] * world.A[r, j]
        scale[j] = math.sqrt(total)
    for i in range(world.k):
        peak, alone = 0.0, 0.0
        for j in range(n):
            peak = max(peak, abs(v[i, j]))
            alone += abs(v[i, j]) * scale[j]
        rate = abs(asked[i]) * gain[i] * peak
        allowed = bound * min(1.0, sigma[i] / alone) if alone > 0.0 else 0.0
        if rate > allowed:
            gain[i] *= allowed / rate
    combine(gain, asked, v, world.k, n, scale)
    largest = 0.0
    for j in range(n):
        largest = max(largest, abs(scale[j]))
    if largest > bound:
        for i in range(world.k):
            gain[i] *= bound / largest
