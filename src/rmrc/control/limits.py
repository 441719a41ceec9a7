"""Limits on what is sent."""

from rmrc.control.compiled import Array, Record, compiled
from rmrc.control.records import OnExcess

NONE, SCALE = int(OnExcess.NONE), int(OnExcess.SCALE)


@compiled
def limit_rates(world: Record, rates: Array) -> bool:
    """Bring the rates within their limits; return whether that changed them.

    scale   all rates by one factor: the direction of motion is kept, the tip gets slower
    clamp   each on its own: the tip leaves its direction, here as the contrast
    """
    if world.on_excess == NONE:
        return False
    excess = 1.0
    for j in range(world.n):
        excess = max(excess, abs(rates[j]) / world.rate_limit[j])
    if excess <= 1.0:
        return False
    for j in range(world.n):
        if world.on_excess == SCALE:
            rates[j] /= excess
        else:
            rates[j] = min(max(rates[j], -world.rate_limit[j]), world.rate_limit[j])
    return True
