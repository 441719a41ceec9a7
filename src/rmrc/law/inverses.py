"""Every inverse as a filter g(σ), one function each.

All take the world (parameters, and A), the demand on each direction, Uᵀ S_x twist_cmd (k,), the singular
values (k,), descending, the right vectors as rows (k, n), and λ of this tick. They write the gains
g(σ_i), (k,), 0 where σ_i is zero to rounding, so that no result is NaN.
"""

import math

from rmrc.law.damping import fading, scheduled
from rmrc.law.jit import Array, Record, compiled, dispatch, inlined
from rmrc.law.svd import RANK_FLOOR, combine
from rmrc.scenario.choices import INVERSES

FILTERED, JPARSE = INVERSES.code("filtered"), INVERSES.code("jparse")
SCHEDULED = INVERSES.codes(lambda one: one.is_scheduled)

# The largest gain: its products with any command stay finite, so that no result is NaN.
LARGEST_GAIN = 1e150


@compiled
def damping(world: Record, asked: Array, sigma: Array) -> float:
    """Return λ for this tick, in the units of σ (not λ²); zero for methods without damping.

    For the method `filtered` it is the λ of the smallest σ.

    Args:
        world: Parameters.
        asked: Uᵀ S_x twist_cmd, the demand on each direction, (k,).
        sigma: Singular values, (k,).
    """
    if world.inverse_method in SCHEDULED:
        return scheduled(world, asked, sigma)
    return fading(world, sigma[world.k - 1]) if world.inverse_method == FILTERED else 0.0


@inlined
def inverse(world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array) -> None:
    """Write 1/σ."""
    invert_above(world, sigma, RANK_FLOOR * sigma[0], gain)


@inlined
def pseudoinverse(world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array) -> None:
    """Write 1/σ for σ > tolerance · σ_1, else 0 [Whitney69]."""
    invert_above(world, sigma, max(RANK_FLOOR, world.inverse_tolerance) * sigma[0], gain)


@inlined
def truncated(world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array) -> None:
    """Write 1/σ for σ > cutoff, else 0 [Golub13, §5.5]."""
    invert_above(world, sigma, max(RANK_FLOOR * sigma[0], world.inverse_cutoff), gain)


@compiled
def invert_above(world: Record, sigma: Array, floor: float, gain: Array) -> None:
    """Write 1/σ for σ > floor, else 0."""
    for i in range(world.k):
        gain[i] = 0.0 if sigma[i] <= floor else min(1.0 / sigma[i], LARGEST_GAIN)


@inlined
def transpose(world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array) -> None:
    """Write α σ with the α that leaves the smallest task residual [Wolovich84], [Buss05].

    All values are relative to σ_1 and to the largest entry, so that no square overflows or underflows.
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


@inlined
def damped(world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array) -> None:
    """Write σ/(σ² + λ²) [Nakamura86], [Wampler86]."""
    for i in range(world.k):
        gain[i] = damped_gain(sigma[i], RANK_FLOOR * sigma[0], damped)


@inlined
def filtered(world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array) -> None:
    """Write σ/(σ² + λ(σ)²): each direction has its own λ [Maciejewski88]."""
    for i in range(world.k):
        gain[i] = damped_gain(sigma[i], RANK_FLOOR * sigma[0], fading(world, sigma[i]))


@compiled
def damped_gain(sigma: float, floor: float, damped: float) -> float:
    """Return σ/(σ² + λ²) for σ > floor, else 0."""
    if sigma <= floor:
        return 0.0
    gain = sigma / (sigma * sigma + damped * damped) if damped > 0.0 else 1.0 / sigma
    return min(gain, LARGEST_GAIN)


@inlined
def selectively_damped(
    world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array
) -> None:
    """Write 1/σ, reduced to Buss and Kim's bounds for each direction and for their sum [Buss05].

    Where the joint motion of a direction moves the tip by less than the joints would one by one, as in a
    direction that becomes singular, the bound is smaller in proportion.
    """
    invert_above(world, sigma, RANK_FLOOR * sigma[0], gain)
    n, bound, scale = world.n, world.inverse_rate_bound, world.work
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


@inlined
def jparse(world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array) -> None:
    """Write 1/σ for σ >= γ σ_1, else σ/(γ σ_1)² [Guptasarma25]."""
    floor, fades_below = RANK_FLOOR * sigma[0], world.inverse_gamma * sigma[0]
    for i in range(world.k):
        if sigma[i] <= floor:
            gain[i] = 0.0
        elif sigma[i] < fades_below:
            gain[i] = min(sigma[i] / fades_below / fades_below, LARGEST_GAIN)
        else:
            gain[i] = min(1.0 / sigma[i], LARGEST_GAIN)


@compiled
def push_fading(world: Record, u: Array, task: Array, sigma: Array, asked: Array) -> None:
    """Weigh the linear and angular rows in the demand on directions that `jparse` fades: u_iᵀ K t."""
    linear, angular = world.inverse_push_position, world.inverse_push_rotation
    if world.inverse_method != JPARSE or (linear == 1.0 and angular == 1.0):
        return
    for i in range(world.k):
        if sigma[i] < world.inverse_gamma * sigma[0]:
            asked[i] = 0.0
            for r in range(world.m):
                asked[i] += u[i, r] * task[r] * (linear if world.row[r] < 3 else angular)


gains = inlined(dispatch(INVERSES, like=inverse, field="call_gains"))
