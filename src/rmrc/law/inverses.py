"""Every inverse as a filter g(σ), one function each.

All take the world (parameters, and A) and a spectrum: the singular values, descending, the right vectors as
rows, the demand on each direction, Uᵀ S_x twist_cmd, and λ of this tick. They write its gains g(σ_i), 0 where
σ_i is zero to rounding, so that no result is NaN.
"""

import math

from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.law.damping import fading
from rmrc.law.svd import RANK_FLOOR, combine
from rmrc.scenario.choices import INVERSES

JPARSE = INVERSES.code("jparse")
SCHEDULED = INVERSES.codes(lambda one: one.is_scheduled)

# The largest gain: its products with any command stay finite, so that no result is NaN.
LARGEST_GAIN = 1e150


@Method
def inverse(world: Record, spectrum: Record) -> None:
    """Write 1/σ."""
    invert_above(world, spectrum, RANK_FLOOR * spectrum.sigma[0])


@Method
def pseudoinverse(world: Record, spectrum: Record) -> None:
    """Write 1/σ for σ > tolerance · σ_1, else 0 [Whitney69]."""
    invert_above(world, spectrum, max(RANK_FLOOR, world.law.inverse_tolerance) * spectrum.sigma[0])


@Method
def truncated(world: Record, spectrum: Record) -> None:
    """Write 1/σ for σ > cutoff, else 0 [Golub13, §5.5]."""
    invert_above(world, spectrum, max(RANK_FLOOR * spectrum.sigma[0], world.law.inverse_cutoff))


@compiled
def invert_above(world: Record, spectrum: Record, floor: float) -> None:
    """Write 1/σ for σ > floor, else 0."""
    for i in range(world.k):
        sigma = spectrum.sigma[i]
        spectrum.gain[i] = 0.0 if sigma <= floor else min(1.0 / sigma, LARGEST_GAIN)


@Method
def transpose(world: Record, spectrum: Record) -> None:
    """Write α σ with the α that leaves the smallest task residual [Wolovich84], [Buss05].

    All values are relative to σ_1 and to the largest entry, so that no square overflows or underflows.
    """
    sigma, asked, gain, largest = spectrum.sigma, spectrum.asked, spectrum.gain, 0.0
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


@Method
def damped(world: Record, spectrum: Record) -> None:
    """Write σ/(σ² + λ²) [Nakamura86], [Wampler86]."""
    floor = RANK_FLOOR * spectrum.sigma[0]
    for i in range(world.k):
        spectrum.gain[i] = damped_gain(spectrum.sigma[i], floor, spectrum.damping)


@Method
def filtered(world: Record, spectrum: Record) -> None:
    """Write σ/(σ² + λ(σ)²): each direction has its own λ [Maciejewski88]."""
    floor = RANK_FLOOR * spectrum.sigma[0]
    for i in range(world.k):
        sigma = spectrum.sigma[i]
        spectrum.gain[i] = damped_gain(sigma, floor, fading(world, sigma))


@compiled
def damped_gain(sigma: float, floor: float, damping: float) -> float:
    """Return σ/(σ² + λ²) for σ > floor, else 0."""
    if sigma <= floor:
        return 0.0
    gain = sigma / (sigma * sigma + damping * damping) if damping > 0.0 else 1.0 / sigma
    return min(gain, LARGEST_GAIN)


@Method
def selectively_damped(world: Record, spectrum: Record) -> None:
    """Write 1/σ, reduced to Buss and Kim's bounds for each direction and for their sum [Buss05].

    Where the joint motion of a direction moves the tip by less than the joints would one by one, as in a
    direction that becomes singular, the bound is smaller in proportion.
    """
    sigma, asked, gain, v = spectrum.sigma, spectrum.asked, spectrum.gain, spectrum.v
    n, bound, scale, A = world.n, world.law.inverse_rate_bound, world.scratch.work, world.scratch.A
    invert_above(world, spectrum, RANK_FLOOR * sigma[0])
    for j in range(n):
        total = 0.0
        for r in range(world.m):
            total += A[r, j] * A[r, j]
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


@Method
def jparse(world: Record, spectrum: Record) -> None:
    """Write 1/σ for σ >= γ σ_1, else σ/(γ σ_1)² [Guptasarma25]."""
    floor, fades_below = RANK_FLOOR * spectrum.sigma[0], world.law.inverse_gamma * spectrum.sigma[0]
    invert_above(world, spectrum, floor)
    for i in range(world.k):
        if floor < spectrum.sigma[i] < fades_below:
            spectrum.gain[i] = min(spectrum.sigma[i] / fades_below / fades_below, LARGEST_GAIN)


@compiled
def push_fading(world: Record, u: Array, task: Array, sigma: Array, asked: Array) -> None:
    """Weigh the linear and angular rows in the demand on directions that `jparse` fades: u_iᵀ K t."""
    linear, angular = world.law.inverse_push_position, world.law.inverse_push_rotation
    if world.law.inverse_method != JPARSE or (linear == 1.0 and angular == 1.0):
        return
    for i in range(world.k):
        if sigma[i] < world.law.inverse_gamma * sigma[0]:
            asked[i] = 0.0
            for r in range(world.m):
                asked[i] += u[i, r] * task[r] * (linear if world.task.row[r] < 3 else angular)
