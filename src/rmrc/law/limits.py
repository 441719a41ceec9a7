"""Limits on the commands: joint positions, rates and accelerations; `rmrc.law.jerk` limits jerk.

Where they contradict each other, position and rate come before acceleration, and acceleration before jerk.
"""

from rmrc.law.braking import brake, brake_gently
from rmrc.law.inverses import SCHEDULED
from rmrc.law.jerk import ease, foresee, is_within_jerk, look_back, rest_bounds
from rmrc.law.jit import Array, Record, apart, compiled, dispatch, inlined
from rmrc.law.optimal import OPTIMAL, best_within, largest_share
from rmrc.law.redistribution import ROUNDING, saturate
from rmrc.law.stops import give_way, given_back, is_beyond, resolve_free
from rmrc.scenario.choices import LIMITS, Status

# A limit counts as broken beyond this relative slack and rounding. Rounding of rates adds up, twice, while a
# change comes to zero over hundreds of ticks, to this share of the rate.
ALL_OF, ADDED_UP = 1.0 + 1e-9, 1e-10
NONE, CLAMP = LIMITS.code("none"), LIMITS.code("clamp")
RATE_LIMITED, ACCELERATION_LIMITED, POSITION_LIMITED = map(
    int, (Status.RATE_LIMITED, Status.ACCELERATION_LIMITED, Status.POSITION_LIMITED)
)
ACCELERATION_EXCEEDED, JERK_EXCEEDED = int(Status.ACCELERATION_EXCEEDED), int(Status.JERK_EXCEEDED)


@compiled
def is_within(world: Record, rates: Array) -> bool:
    """Return whether no limit is exceeded, which is true at most ticks.

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
def held_by(world: Record) -> int:
    """Return the bits of the limits that hold joints at their bounds."""
    bits = 0
    for j in range(world.n):
        if world.held[j] != 0.0:
            bits |= kind(world, j, 1 if world.held[j] > 0.0 else -1)
    return bits


@compiled
def kind(world: Record, j: int, side: int) -> int:
    """Return the bit of the limit that gave a joint its upper (side 1) or lower (side -1) bound."""
    bound = world.rest_upper[j] if side > 0 else -world.rest_lower[j]
    chosen = world.upper[j] if side > 0 else -world.lower[j]
    if chosen != bound:
        return ACCELERATION_LIMITED
    return RATE_LIMITED if bound == world.rate_limit[j] else POSITION_LIMITED


@compiled
def bounds(world: Record) -> None:
    """Write the largest and smallest rate of each joint within its position, rate and acceleration limits.

    With a jerk limit `ease` handles acceleration.
    """
    if world.is_eased:
        rest_bounds(world)
    for j in range(0 if world.is_eased else world.n):
        q, fastest, braking = world.q[j], world.rate_limit[j], world.braking[j]
        world.rest_lower[j] = -min(fastest, brake(q - world.position_limit[0, j], braking, world.period))
        world.rest_upper[j] = min(fastest, brake(world.position_limit[1, j] - q, braking, world.period))
    reach(world)


@compiled
def forget_stops(world: Record) -> None:
    """Write the bounds from rate and acceleration limits alone."""
    for j in range(world.n):
        world.rest_upper[j] = world.rate_limit[j]
        world.rest_lower[j] = -world.rate_limit[j]
    reach(world)


@compiled
def reach(world: Record) -> None:
    """Bring the bounds of position and rate within the rates that the acceleration limit lets a joint reach.

    A joint that cannot brake in time brakes at the limit, and harder only where it must.
    """
    for j in range(world.n):
        change = world.acceleration_limit[j] * world.period
        least, most = world.qdot_cmd_last[j] - change, world.qdot_cmd_last[j] + change
        if world.rest_upper[j] < least:
            distance = world.position_limit[1, j] - world.q[j]
            least = max(world.rest_upper[j], min(least, brake_gently(least + change, distance, world.period)))
        if world.rest_lower[j] > most:
            distance = world.q[j] - world.position_limit[0, j]
            most = min(world.rest_lower[j], max(most, -brake_gently(change - most, distance, world.period)))
        world.upper[j] = max(least, min(world.rest_upper[j], most))
        world.lower[j] = min(most, max(world.rest_lower[j], least))


@compiled
def confine(world: Record, rates: Array) -> None:
    """Bring each rate within its own bounds."""
    for j in range(world.n):
        rates[j] = min(max(rates[j], world.lower[j]), world.upper[j])


@compiled
def scale_change(world: Record, rates: Array) -> int:
    """Scale the change of all rates by one factor; return the bits of the limits that acted.

    The factor may leave a joint without its necessary braking, which that joint alone then gets.
    """
    bits, part = 0, 1.0
    for j in range(world.n):
        change, most = abs(rates[j] - world.qdot_cmd_last[j]), world.acceleration_limit[j] * world.period
        if change > most * (1.0 + ROUNDING):
            bits |= ACCELERATION_LIMITED
            part = min(part, most / change)
    if part < 1.0:
        for j in range(world.n):
            rates[j] = world.qdot_cmd_last[j] + part * (rates[j] - world.qdot_cmd_last[j])
        bits |= exceeded(world, rates)
    confine(world, rates)
    return bits


@compiled
def scale(world: Record, tick: Record, acting: int) -> int:
    """Scale all rates, let stops act, scale the change: the tip keeps its direction except at stops."""
    rates, bits, factor, stopped = tick.qdot_cmd, 0, 1.0, False
    for j in range(world.n):
        if abs(rates[j]) > world.rate_limit[j] * (1.0 + ROUNDING):
            factor = min(factor, world.rate_limit[j] / abs(rates[j]))
    for j in range(world.n):
        rates[j] *= factor
        stopped |= is_beyond(rates[j], world.rest_lower[j], world.rest_upper[j])
    if stopped:
        bits |= POSITION_LIMITED
        factor = given_back(world, rates, factor, world.rest_lower, world.rest_upper)
        for j in range(world.n):
            world.drift[j] *= factor
        give_way(world, tick, factor, world.rest_lower, world.rest_upper)
        for j in range(world.n):
            if world.held[j] != 0.0 and abs(rates[j]) == world.rate_limit[j]:
                bits |= RATE_LIMITED
    if factor < 1.0:
        bits |= RATE_LIMITED
    return bits | scale_change(world, rates)


@inlined
def clamp(world: Record, tick: Record, acting: int) -> int:
    """Bring each rate within its own bounds: the tip leaves its direction. It serves for comparison."""
    confine(world, tick.qdot_cmd)
    return acting


@inlined
def redistribute(world: Record, tick: Record, acting: int) -> int:
    """Let the other joints take over the part that a saturated joint cannot do [Flacco15]; else scale."""
    rates = tick.qdot_cmd
    forget_stops(world)
    share = saturate(world, tick)
    for j in range(world.n):
        if share >= 0.0 and world.held[j] > 0.0 and rates[j] == world.qdot0[j]:
            acting |= kind(world, j, 1 if rates[j] == world.upper[j] else -1)
    return leave_to_stops(world, tick, share, acting)


@compiled
def leave_to_stops(world: Record, tick: Record, share: float, acting: int) -> int:
    """Let stops act on the rates for a share of the task; scale where there is no share (-1)."""
    rates = tick.qdot_cmd
    bounds(world)
    if share < 0.0:
        return scale(world, tick, acting)
    if exceeded(world, rates) != 0:
        share = given_back(world, rates, share, world.lower, world.upper)
        give_way(world, tick, share, world.lower, world.upper)
        acting |= held_by(world)
    confine(world, rates)
    return acting


@compiled
def optimal(world: Record, tick: Record, acting: int) -> int:
    """Find the rates within the bounds that come nearest to the task.

    The measure is that of the damped inverse. Other inverses define no such measure; they get the rates
    nearest to their own. `keep_direction` takes the largest feasible share of the task and the smallest rates
    for it; a joint at its stop holds, and the others do the remaining part.
    """
    if world.keep_direction:
        forget_stops(world)
        if exceeded(world, tick.qdot_cmd) == 0:
            return leave_to_stops(world, tick, 1.0, acting)
        share = largest_share(world, tick)
        return leave_to_stops(world, tick, share, acting | held_by(world))
    if world.inverse_method in SCHEDULED:
        best_within(world, tick, world.task, 1.0, tick.damping)
        return acting | held_by(world)
    confine(world, tick.qdot_cmd)
    return acting


@compiled
def sns(world: Record, tick: Record, acting: int) -> int:
    """Do the largest share of the task within all bounds, by the smallest rates [Flacco15]; else scale."""
    share = largest_share(world, tick)
    return acting | held_by(world) if share >= 0.0 else scale(world, tick, acting)


@compiled
def reverse_priority(world: Record, tick: Record, acting: int) -> int:
    """Hold joints beyond a bound there, as a task of higher priority, and do the rest of the last [Flacco14].

    The first priority is position and rate limits, then acceleration limits. The joint farthest beyond is
    held, until all are within; no joint is released again.
    """
    rates, is_damped = tick.qdot_cmd, world.inverse_method in SCHEDULED
    damped = tick.damping if is_damped else 0.0
    for j in range(world.n):
        world.held[j], world.fade[j], world.part_b[j] = 0.0, 1.0, rates[j]
    while hold_farthest(world, world.rest_lower, world.rest_upper) or hold_farthest(
        world, world.lower, world.upper
    ):
        damped = resolve_free(world, 1.0, damped)
    for j in range(world.n):
        rates[j] = world.best[j] if world.held[j] != 0.0 else world.part_b[j]
    confine(world, rates)
    return acting | held_by(world)


@compiled
def hold_farthest(world: Record, lower: Array, upper: Array) -> bool:
    """Hold the free joint whose rate in part_b is farthest beyond some bounds; return whether any is."""
    chosen, farthest = -1, 0.0
    for j in range(world.n):
        rate = world.part_b[j]
        if world.held[j] == 0.0 and is_beyond(rate, lower[j], upper[j]):
            beyond = max(lower[j] - rate, rate - upper[j]) / world.joint_scale[j]
            if beyond > farthest:
                chosen, farthest = j, beyond
    if chosen < 0:
        return False
    rate = world.part_b[chosen]
    world.held[chosen] = 1.0 if rate > upper[chosen] else -1.0
    world.best[chosen] = min(max(rate, world.lower[chosen]), world.upper[chosen])
    world.fade[chosen] = min(1.0, abs(world.best[chosen] / rate))
    return True


# Brings rates that exceed a bound within the bounds by the chosen method.
confine_by_choice = inlined(dispatch(LIMITS, like=scale, field="call_limits"))


@compiled
def limit(world: Record, tick: Record) -> int:
    """Bring the rates within the bounds of every joint; return the status bits of the limits that act.

    The chosen method is for rate and acceleration limits. A joint at its position limit holds, and does not
    slow the others down: they do as much of the task as they can, possibly in another direction.
    """
    if world.limits_on_excess == NONE:
        return 0
    if world.is_eased:
        return limit_eased(world, tick)
    if is_within(world, tick.qdot_cmd):
        return 0
    bounds(world)
    bits = choose_rates(world, tick)
    return bits | broken(world, tick.qdot_cmd)


@apart("call_eased", is_eased=())
def limit_eased(world: Record, tick: Record) -> int:
    """Do the same as `limit` where jerk is limited as well."""
    foresee(world)
    if is_within_jerk(world, tick.qdot_cmd):
        look_back(world, tick.qdot_cmd, tick.qdot_cmd)
        return 0
    bounds(world)
    bits = choose_rates(world, tick)
    bits |= ease_by_choice(world, tick)
    look_back(world, world.wish, tick.qdot_cmd)
    return bits | broken(world, tick.qdot_cmd)


@compiled
def choose_rates(world: Record, tick: Record) -> int:
    """Bring rates that exceed a bound within the bounds; return the bits of the limits that act."""
    for j in range(world.n):
        world.drift[j] = world.qdot0[j]
    return confine_by_choice(world, tick, exceeded(world, tick.qdot_cmd))


@compiled
def ease_by_choice(world: Record, tick: Record) -> int:
    """Ease the rates by common factors, by factors for each joint, or by the best point between the two."""
    rates, is_free = tick.qdot_cmd, world.limits_on_excess == OPTIMAL and world.keep_direction == 0
    bits, differ = ease(world, rates, is_free or world.limits_on_excess == CLAMP), False
    if not is_free or world.inverse_method not in SCHEDULED:
        return bits
    for j in range(world.n):
        world.part_a[j], rates[j] = rates[j], world.wish[j]
    bits |= ease(world, rates, False)
    for j in range(world.n):
        differ |= rates[j] != world.part_a[j]
        world.lower[j], world.upper[j] = min(rates[j], world.part_a[j]), max(rates[j], world.part_a[j])
    if differ:
        best_within(world, tick, world.task, 1.0, tick.damping)
    return bits


@compiled
def broken(world: Record, rates: Array) -> int:
    """Return the bits of the limits that gave way to others."""
    bits = 0
    for j in range(world.n):
        change, rounding = rates[j] - world.qdot_cmd_last[j], ADDED_UP * abs(rates[j])
        if abs(change) > world.change_limit[j] * ALL_OF + rounding:
            bits |= ACCELERATION_EXCEEDED
        if abs(change - world.change_last[j]) > world.jerk_step[j] * ALL_OF + rounding:
            bits |= JERK_EXCEEDED
    return bits
