"""Limits on what is sent: joint positions, rates and accelerations."""

import math

from rmrc.control.choices import OnExcess, Status
from rmrc.control.compiled import Array, Record, compiled
from rmrc.control.redistribution import ROUNDING, redistribute

NONE, CLAMP, REDISTRIBUTE = int(OnExcess.NONE), int(OnExcess.CLAMP), int(OnExcess.REDISTRIBUTE)
RATE_LIMITED, ACCELERATION_LIMITED, POSITION_LIMITED = map(
    int, (Status.RATE_LIMITED, Status.ACCELERATION_LIMITED, Status.POSITION_LIMITED)
)


@compiled
def limit(world: Record, tick: Record) -> int:
    """Bring the rates within the bounds of every joint; return the status bits of the limits that act.

    scale         all rates by one factor: the direction of motion is kept, the tip gets slower
    clamp         each on its own: the tip leaves its direction, here as the contrast
    redistribute  what a saturated joint cannot do, the others take over               [Flacco15]
    """
    rates = tick.qdot_cmd
    if world.on_excess == NONE or is_within(world, rates):
        return 0
    bounds(world)
    acting = exceeded(world, rates)
    if world.on_excess == REDISTRIBUTE and redistribute(world, tick):
        for j in range(world.n):
            if world.held[j] > 0.0 and rates[j] == world.qdot0[j]:
                acting |= kind(world, j, 1 if rates[j] == world.upper[j] else -1)
        confine(world, rates)
    elif world.on_excess == CLAMP:
        confine(world, rates)
    else:
        acting = scale(world, rates)
    return acting


@compiled
def is_within(world: Record, rates: Array) -> bool:
    """Say whether no limit is exceeded, which is so at most ticks.

    Braking from a rate r takes r (r + b T)/(2 b) and up to b T²/8 more, which needs no root as long as there
    is more room.
    """
    T = world.period
    for j in range(world.n):
        rate, braking = rates[j], world.braking[j]
        speed = abs(rate)
        to_lower, to_upper = world.q[j] - world.position_limit[0, j], world.position_limit[1, j] - world.q[j]
        left = to_upper if rate > 0.0 else to_lower
        if speed > world.rate_limit[j]:
            return False
        if abs(rate - world.qdot_cmd_last[j]) > world.acceleration_limit[j] * T:
            return False
        if speed * (speed + braking * T) > braking * (2.0 * left - 0.25 * braking * T * T) and (
            speed > brake(left, braking, T)
        ):
            return False
    return True


@compiled
def exceeded(world: Record, rates: Array) -> int:
    """Return the bits of the limits whose bounds are exceeded by more than rounding."""
    bits = 0
    for j in range(world.n):
        slack = ROUNDING * abs(rates[j])
        if rates[j] > world.upper[j] + slack:
            bits |= kind(world, j, 1)
        elif rates[j] < world.lower[j] - slack:
            bits |= kind(world, j, -1)
    return bits


@compiled
def kind(world: Record, j: int, side: int) -> int:
    """Return the bit of the limit that gave a joint its upper (side 1) or lower (side -1) bound."""
    lowest, highest = rest_bounds(world, j)
    bound, chosen = (highest, world.upper[j]) if side > 0 else (-lowest, -world.lower[j])
    if chosen != bound:
        return ACCELERATION_LIMITED
    return RATE_LIMITED if bound == world.rate_limit[j] else POSITION_LIMITED


@compiled
def bounds(world: Record) -> None:
    """Write the largest and smallest rate of each joint within its position, rate and acceleration limits.

    Acceleration has precedence: a joint that cannot brake in time goes on braking.
    """
    for j in range(world.n):
        lowest, highest = rest_bounds(world, j)
        change = world.acceleration_limit[j] * world.period
        least, most = world.qdot_cmd_last[j] - change, world.qdot_cmd_last[j] + change
        world.upper[j] = max(least, min(highest, most))
        world.lower[j] = min(most, max(lowest, least))


@compiled
def rest_bounds(world: Record, j: int) -> tuple[float, float]:
    """Return the smallest and largest rate of a joint by its position and rate limits; 0 is between them."""
    q, fastest, braking = world.q[j], world.rate_limit[j], world.braking[j]
    down = brake(q - world.position_limit[0, j], braking, world.period)
    up = brake(world.position_limit[1, j] - q, braking, world.period)
    return -min(fastest, down), min(fastest, up)


@compiled
def brake(distance: float, braking: float, period: float) -> float:
    """Return the largest rate that can be braked within a distance, tick by tick.

    N ticks that begin with a rate r, each slower by b T than the one before, take N T (r − (N − 1) b T/2),
    and N is the least with N (N + 1)/2 · b T² >= distance.
    """
    if distance <= 0.0:
        return 0.0
    if distance == math.inf:
        return math.inf
    ticks = max(1.0, math.ceil(math.sqrt(0.25 + 2.0 * distance / (braking * period * period)) - 0.5))
    return distance / (ticks * period) + 0.5 * braking * period * (ticks - 1.0)


@compiled
def confine(world: Record, rates: Array) -> None:
    """Bring each rate within its own bounds."""
    for j in range(world.n):
        rates[j] = min(max(rates[j], world.lower[j]), world.upper[j])


@compiled
def scale(world: Record, rates: Array) -> int:
    """Scale all rates, then their change, by one factor each; return the bits of the limits that acted.

    Scaling the change may leave a joint without the braking that it needs, which is then given to it alone.
    """
    n, bits, factor = world.n, 0, 1.0
    for j in range(n):
        lowest, highest = rest_bounds(world, j)
        bound = highest if rates[j] > 0.0 else -lowest
        if abs(rates[j]) > bound * (1.0 + ROUNDING):
            bits |= RATE_LIMITED if bound == world.rate_limit[j] else POSITION_LIMITED
            factor = min(factor, bound / abs(rates[j]))
    part = 1.0
    for j in range(n):
        rates[j] *= factor
        change, most = abs(rates[j] - world.qdot_cmd_last[j]), world.acceleration_limit[j] * world.period
        if change > most * (1.0 + ROUNDING):
            bits |= ACCELERATION_LIMITED
            part = min(part, most / change)
    if part < 1.0:
        for j in range(n):
            rates[j] = world.qdot_cmd_last[j] + part * (rates[j] - world.qdot_cmd_last[j])
        bits |= exceeded(world, rates)
    confine(world, rates)
    return bits
