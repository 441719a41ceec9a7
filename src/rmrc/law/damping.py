"""The schedules of the damping λ, in the units of σ (not λ²), one function each.

All take the world and a spectrum, with σ and the demand on each direction, Uᵀ S_x twist_cmd, and write its λ.
"""

import math

from rmrc.law.compiling import Method, Record, compiled
from rmrc.law.svd import RANK_FLOOR, product

# Newton's iteration for the least damping ends at this relative accuracy of the norm. From its starting point
# it takes three to six steps; a hundred random problems of each size took at most ten.
ACCURACY, STEPS_MAX = 1e-12, 30


@Method
def undamped(world: Record, spectrum: Record) -> None:
    """Write 0, for inverses without damping."""
    spectrum.damping = 0.0


@Method
def constant(world: Record, spectrum: Record) -> None:
    """Write λ_max [Wampler86]."""
    spectrum.damping = world.law.inverse_damping_maximum


@Method
def manipulability(world: Record, spectrum: Record) -> None:
    """Write λ_max (1 − w/w₀) for w = Π σ_i below w₀, else 0 [Nakamura86]."""
    share = 1.0 - product(spectrum.sigma, world.k) / world.law.inverse_damping_manipulability_below
    spectrum.damping = max(0.0, share) * world.law.inverse_damping_maximum


@Method
def smallest_singular_value(world: Record, spectrum: Record) -> None:
    """Write λ(σ_min) of `fading`."""
    spectrum.damping = fading(world, spectrum.sigma[world.k - 1])


@compiled
def fading(world: Record, sigma: float) -> float:
    """Return λ(σ), from 0 at σ = ε up to λ_max at σ = 0: λ² = (1 − (σ/ε)²) λ_max² [Chiaverini94]."""
    ratio = sigma / world.law.inverse_damping_below
    return 0.0 if ratio >= 1.0 else math.sqrt(1.0 - ratio * ratio) * float(world.law.inverse_damping_maximum)


@Method
def error(world: Record, spectrum: Record) -> None:
    """Write error_gain · ‖S_x pose_error‖ [Levenberg44]."""
    spectrum.damping = world.law.inverse_damping_error_gain * world.scratch.error


@Method
def rate_bound(world: Record, spectrum: Record) -> None:
    """Write the least λ that keeps ‖S_q⁻¹ qdot‖ within the bound [Maciejewski88], [Deo92].

    Newton's method on 1/bound − 1/‖S_q⁻¹ qdot(μ)‖ over μ = λ² starts from a μ that is never beyond the root
    [More83].
    """
    sigma, asked = spectrum.sigma, spectrum.asked
    bound, floor, mu = world.law.inverse_rate_bound, RANK_FLOOR * sigma[0], 0.0
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
    spectrum.damping = math.sqrt(mu)
