"""Every inverse as a filter g(sigma), and the schedules of its damping."""

import math

from rmrc.control.compiled import Array, Record, compiled
from rmrc.control.records import Method, Schedule
from rmrc.control.smallmat import RANK_FLOOR

# Enum members become plain integers in compiled code.
PSEUDOINVERSE, DAMPED = int(Method.PSEUDOINVERSE), int(Method.DAMPED)
SMALLEST_SINGULAR_VALUE = int(Schedule.SMALLEST_SINGULAR_VALUE)


@compiled
def damping(world: Record, sigma: Array) -> float:
    """Return λ for this tick, in the units of σ (not λ²); zero for the undamped methods.

    constant                  λ = λ_max                                          [Wampler86]
    smallest_singular_value   λ² = (1 − (σ_min/ε)²) λ_max² if σ_min < ε, else 0  [Chiaverini94]
    """
    if world.method != DAMPED:
        return 0.0
    if world.schedule == SMALLEST_SINGULAR_VALUE:
        ratio = sigma[world.k - 1] / world.damping_below
        return 0.0 if ratio >= 1.0 else math.sqrt(1.0 - ratio * ratio) * float(world.damping_maximum)
    return float(world.damping_maximum)


@compiled
def gains(world: Record, sigma: Array, damped: float, gain: Array) -> None:
    """Write g(σ_i) for i < k, σ falling.

    inverse         1/σ, and 0 where σ is zero to rounding, so that nothing is ever NaN
    pseudoinverse   1/σ for σ > tolerance · σ_1, else 0                           [Whitney69]
    damped          σ/(σ² + λ²)                                       [Nakamura86], [Wampler86]
    """
    smallest = RANK_FLOOR * sigma[0]
    if world.method == PSEUDOINVERSE:
        smallest = max(smallest, world.tolerance * sigma[0])
    for i in range(world.k):
        if damped > 0.0:
            gain[i] = sigma[i] / (sigma[i] * sigma[i] + damped * damped)
        else:
            gain[i] = 1.0 / sigma[i] if sigma[i] > smallest else 0.0
