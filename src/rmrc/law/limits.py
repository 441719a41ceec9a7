"""Limits on the commands: joint positions, rates and accelerations; `rmrc.law.jerk` limits jerk.

Where they contradict each other, position and rate come before acceleration, and acceleration before jerk.
"""

from rmrc.law.active_set import best_within, is_beyond, largest_share, resolve_free, saturate, settle
from rmrc.law.braking import brake, brake_gently
from rmrc.law.compiling import Array, Method, Record, call, compiled
from rmrc.law.inverses import SCHEDULED
from rmrc.law.jerk import ease, foresee, is_within_jerk, look_back
from rmrc.law.svd import ROUNDING, copy
from rmrc.scenario.choices import LIMITS, Status

# A limit counts as broken beyond this relative slack and rounding. Rounding of rates adds up, twice, while a
# change comes to zero over hundreds of ticks, to this share of the rate.
ALL_OF, ADDED_UP = 1.0 + 1e-9, 1e-10
CLAMP = LIMITS.code("clamp")
# How a jerk limit eases the rates: by common factors, by factors for each joint, or by the best of both.
TOGETHER, EACH, BEST = range(3)
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
    limits, state = world.limits, world.state
    T = limits.stretch * world.period
    for j in range(world.n):
        rate, braking = rates[j], limits.braking[j]
        speed = abs(rate)
        to_lower, to_upper = state.q[j] - limits.position[0, j], limits.position[1, j] - state.q[j]
        left = to_upper if rate > 0.0 else to_lower
        if speed > limits.rate[j]:
            return False
        if abs(rate - world.memory.qdot_cmd[j]) > limits.acceleration[j] * world.period:
            return False
        if speed * (speed + braking * T) > braking * (2.0 * left - 0.25 * braking * T * T) and (
            speed > brake(left, braking, T)
        ):
            return False
    return True


@compiled
def exceeded(world: Record, rates: Array) -> int:
    """Return the bits of the limits whose bounds are exceeded by more than rounding.

    A rate limit counts even where another limit gives the tighter bound.
    """
    bounds = world.bounds
    bits = 0
    for j in range(world.n):
        slack = ROUNDING * abs(rates[j])
        if abs(rates[j]) > world.limits.rate[j] + slack:
            bits |= RATE_LIMITED
        if rates[j] > bounds.upper[j] + slack:
            bits |= limit_of(world, j, 1.0)
        elif rates[j] < bounds.lower[j] - slack:
            bits |= limit_of(world, j, -1.0)
    return bits


@compiled
def held_by(world: Record) -> int:
    """Return the bits of the limits that hold joints at their bounds."""
    bounds = world.bounds
    bits = 0
    for j in range(world.n):
        if bounds.held[j] != 0.0:
            bits |= limit_of(world, j, bounds.held[j])
    return bits


@compiled
def limit_of(world: Record, j: int, side: float) -> int:
    """Return the bit of the limit that gave a joint its upper (side 1) or lower (side -1) bound."""
    bounds = world.bounds
    bound = bounds.stop_upper[j] if side > 0.0 else -bounds.stop_lower[j]
    chosen = bounds.upper[j] if side > 0.0 else -bounds.lower[j]
    if chosen != bound:
        return ACCELERATION_LIMITED
    return RATE_LIMITED if bound == world.limits.rate[j] else POSITION_LIMITED


@compiled
def find_bounds(world: Record) -> None:
    """Write the largest and smallest rate of each joint within its position, rate and acceleration limits.

    With a jerk limit `ease` handles acceleration.
    """
    limits, bounds, T = world.limits, world.bounds, world.limits.stretch * world.period
    if limits.is_eased:
        call(world.methods.stops, world)
    for j in range(0 if limits.is_eased else world.n):
        q, fastest, braking = world.state.q[j], limits.rate[j], limits.braking[j]
        bounds.stop_lower[j] = -min(fastest, brake(q - limits.position[0, j], braking, T))
        bounds.stop_upper[j] = min(fastest, brake(limits.position[1, j] - q, braking, T))
    reach(world)


@compiled
def forget_stops(world: Record) -> None:
    """Write the bounds from rate and acceleration limits alone."""
    limits, bounds = world.limits, world.bounds
    for j in range(world.n):
        bounds.stop_upper[j] = limits.rate[j]
        bounds.stop_lower[j] = -limits.rate[j]
    reach(world)


@compiled
def reach(world: Record) -> None:
    """Bring the bounds of position and rate within the rates that the acceleration limit lets a joint reach.

    A joint that cannot brake in time brakes at the limit, and harder only where it must.
    """
    limits, state, memory, bounds = world.limits, world.state, world.memory, world.bounds
    for j in range(world.n):
        change = limits.acceleration[j] * world.period
        least, most = memory.qdot_cmd[j] - change, memory.qdot_cmd[j] + change
        if bounds.stop_upper[j] < least:
            distance = limits.position[1, j] - state.q[j]
            gentle = brake_gently(least + change, distance, world.period)
            least = max(bounds.stop_upper[j], min(least, gentle))
        if bounds.stop_lower[j] > most:
            distance = state.q[j] - limits.position[0, j]
            most = min(bounds.stop_lower[j], max(most, -brake_gently(change - most, distance, world.period)))
        bounds.upper[j] = max(least, min(bounds.stop_upper[j], most))
        bounds.lower[j] = min(most, max(bounds.stop_lower[j], least))


@compiled
def confine(world: Record, rates: Array) -> None:
    """Bring each rate within its own bounds."""
    bounds = world.bounds
    for j in range(world.n):
        rates[j] = min(max(rates[j], bounds.lower[j]), bounds.upper[j])


@compiled
def scale_change(world: Record, rates: Array) -> int:
    """Scale the change of all rates by one factor; return the bits of the limits that acted.

    The factor may leave a joint without its necessary braking, which that joint alone then gets.
    """
    memory = world.memory
    bits, part = 0, 1.0
    for j in range(world.n):
        change, most = abs(rates[j] - memory.qdot_cmd[j]), world.limits.acceleration[j] * world.period
        if change > most * (1.0 + ROUNDING):
            bits |= ACCELERATION_LIMITED
            part = min(part, most / change)
    if part < 1.0:
        for j in range(world.n):
            rates[j] = memory.qdot_cmd[j] + part * (rates[j] - memory.qdot_cmd[j])
        bits |= exceeded(world, rates)
    confine(world, rates)
    return bits


@compiled
def scale_all(world: Record) -> None:
    """Scale all rates, let stops act, scale the change: the tip keeps its direction except at stops."""
    limits, bounds, rates = world.limits, world.bounds, world.tick.qdot_cmd
    factor, is_stopped, bounds.acting = 1.0, False, 0
    for j in range(world.n):
        if abs(rates[j]) > limits.rate[j] * (1.0 + ROUNDING):
            factor = min(factor, limits.rate[j] / abs(rates[j]))
    for j in range(world.n):
        rates[j] *= factor
        bounds.lower[j], bounds.upper[j] = bounds.stop_lower[j], bounds.stop_upper[j]
        is_stopped |= is_beyond(rates[j], bounds.lower[j], bounds.upper[j])
    if is_stopped:
        bounds.acting |= POSITION_LIMITED
        factor = returned_share(world, factor)
        for j in range(world.n):
            bounds.drift[j] *= factor
        settle(world, factor)
        for j in range(world.n):
            if bounds.held[j] != 0.0 and abs(rates[j]) == limits.rate[j]:
                bounds.acting |= RATE_LIMITED
    if factor < 1.0:
        bounds.acting |= RATE_LIMITED
    reach(world)
    bounds.acting |= scale_change(world, rates)


@compiled
def returned_share(world: Record, share: float) -> float:
    """Return the share of the task to do where rates for a given share take joints beyond their stops.

    The given share keeps a direction that is lost at a stop, and a joint that hardly moves may have caused
    it. The result is 1 where the joint that would move fastest stands still, and the given share where a
    joint begins to be held, so that the rates do not jump there.
    """
    rates, bounds, scale = world.tick.qdot_cmd, world.bounds, world.task.joint_scale
    fastest, most = 0.0, 0.0
    for j in range(world.n):
        fastest = max(fastest, abs(rates[j]) / scale[j])
    for j in range(world.n):
        beyond = max(rates[j] - bounds.upper[j], bounds.lower[j] - rates[j])
        if beyond > 0.0:
            most = max(most, beyond / min(world.limits.rate[j], scale[j] * fastest))
    return float(share + (1.0 - share) * min(1.0, most))


@compiled
def leave_to_stops(world: Record, share: float) -> None:
    """Let stops act on the rates for a share of the task; scale where there is no share (-1)."""
    find_bounds(world)
    if share < 0.0:
        scale_all(world)
    elif exceeded(world, world.tick.qdot_cmd) != 0:
        settle(world, returned_share(world, share))
        world.bounds.acting |= held_by(world)
    else:
        confine(world, world.tick.qdot_cmd)


@compiled
def hold_farthest(world: Record, lower: Array, upper: Array) -> bool:
    """Hold the free joint whose rate in part_b is farthest beyond some bounds; return whether any is."""
    bounds, rates, chosen, farthest = world.bounds, world.scratch.part_b, -1, 0.0
    for j in range(world.n):
        if bounds.held[j] == 0.0 and is_beyond(rates[j], lower[j], upper[j]):
            beyond = max(lower[j] - rates[j], rates[j] - upper[j]) / world.task.joint_scale[j]
            if beyond > farthest:
                chosen, farthest = j, beyond
    if chosen >= 0:
        bounds.held[chosen] = 1.0 if rates[chosen] > upper[chosen] else -1.0
        bounds.best[chosen] = min(max(rates[chosen], bounds.lower[chosen]), bounds.upper[chosen])
        bounds.fade[chosen] = min(1.0, abs(bounds.best[chosen] / rates[chosen]))
    return chosen >= 0


@compiled
def begin(world: Record) -> None:
    """Find the bounds and the limits whose bounds the rates exceed."""
    find_bounds(world)
    copy(world.scratch.qdot0, world.bounds.drift, world.n)
    world.bounds.acting = exceeded(world, world.tick.qdot_cmd)
    world.bounds.eased = TOGETHER


# Methods ----------------------------------------------------------------------------------------
# Each brings rates that exceed a bound within the bounds. `bounds.acting` holds the bits of the limits that
# the rates exceed, and then of those that act; `bounds.eased` says how a jerk limit then eases the rates.


@Method
def scale(world: Record) -> None:
    """Scale all joints alike."""
    begin(world)
    scale_all(world)


@Method
def by_joint(world: Record) -> None:
    """Bring each rate within its own bounds; unless these clamp, first scale to the rate limits.

    It is for a motion of the joints themselves.
    """
    begin(world)
    rates, limits, factor = world.tick.qdot_cmd, world.limits, 1.0
    for j in range(world.n if world.law.limits_on_excess != CLAMP else 0):
        if abs(rates[j]) > limits.rate[j]:
            factor = min(factor, limits.rate[j] / abs(rates[j]))
    for j in range(world.n):
        rates[j] *= factor
    confine(world, rates)
    world.bounds.eased = EACH


# The tip leaves its direction: it serves for comparison.
clamp = by_joint


@Method
def redistribute(world: Record) -> None:
    """Let the other joints take over the part that a saturated joint cannot do [Flacco15]; else scale."""
    begin(world)
    forget_stops(world)
    share = saturate(world)
    world.bounds.acting |= held_by(world)
    leave_to_stops(world, share)


@Method
def optimal(world: Record) -> None:
    """Find the rates within the bounds that come nearest to the task.

    The measure is that of the damped inverse. Other inverses define no such measure; they get the rates
    nearest to their own. `keep_direction` takes the largest feasible share of the task and the smallest rates
    for it; a joint at its stop holds, and the others do the remaining part.
    """
    begin(world)
    bounds, first, rates, share = world.bounds, world.first, world.tick.qdot_cmd, 1.0
    if world.limits.keep_direction:
        forget_stops(world)
        if exceeded(world, rates) != 0:
            share = largest_share(world)
            bounds.acting |= held_by(world)
        leave_to_stops(world, share)
    elif world.law.inverse_method in SCHEDULED:
        best_within(world, first.task, first.damping)
        bounds.acting |= held_by(world)
        bounds.eased = BEST
    else:
        confine(world, rates)
        bounds.eased = EACH


@Method
def sns(world: Record) -> None:
    """Do the largest share of the task within all bounds, by the smallest rates [Flacco15]; else scale."""
    begin(world)
    if largest_share(world) >= 0.0:
        world.bounds.acting |= held_by(world)
    else:
        scale_all(world)


@Method
def reverse_priority(world: Record) -> None:
    """Hold joints beyond a bound there, as a task of higher priority, and do the rest of the last [Flacco14].

    The first priority is position and rate limits, then acceleration limits. The joint farthest beyond is
    held, until all are within; no joint is released again.
    """
    begin(world)
    bounds, rates, part_b = world.bounds, world.tick.qdot_cmd, world.scratch.part_b
    bounds.damping = world.first.damping if world.law.inverse_method in SCHEDULED else 0.0
    copy(world.first.task, bounds.task, world.m)
    for j in range(world.n):
        bounds.held[j], bounds.fade[j], part_b[j] = 0.0, 1.0, rates[j]
    while hold_farthest(world, bounds.stop_lower, bounds.stop_upper) or hold_farthest(
        world, bounds.lower, bounds.upper
    ):
        resolve_free(world)
    copy(part_b, rates, world.n)
    confine(world, rates)
    bounds.acting |= held_by(world)


# All together -----------------------------------------------------------------------------------


@compiled
def limit(world: Record) -> None:
    """Bring the rates within the bounds of every joint; note the limits that act in the status.

    The chosen method is for rate and acceleration limits. A joint at its position limit holds, and does not
    slow the others down: they do as much of the task as they can, possibly in another direction.
    """
    methods, tick = world.methods, world.tick
    if methods.limit == 0:
        return
    if world.limits.is_eased:
        call(methods.ease, world)
    elif not is_within(world, tick.qdot_cmd):
        call(methods.limit, world)
        tick.status |= world.bounds.acting | broken(world, tick.qdot_cmd)


@Method
def ease_rates(world: Record) -> None:
    """Do the same where jerk is limited as well."""
    rates, bounds = world.tick.qdot_cmd, world.bounds
    foresee(world)
    if is_within_jerk(world, rates):
        look_back(world, rates, rates)
        return
    call(world.methods.limit, world)
    bits = bounds.acting | ease_by_choice(world)
    look_back(world, bounds.wish, rates)
    world.tick.status |= bits | broken(world, rates)


@compiled
def ease_by_choice(world: Record) -> int:
    """Ease the rates by common factors, by factors for each joint, or by the best point between the two."""
    part_a, bounds, first, rates = world.scratch.part_a, world.bounds, world.first, world.tick.qdot_cmd
    bits = ease(world, rates, bounds.eased != TOGETHER)
    if bounds.eased != BEST:
        return bits
    for j in range(world.n):
        part_a[j], rates[j] = rates[j], bounds.wish[j]
    bits, differ = bits | ease(world, rates, False), False
    for j in range(world.n):
        differ |= rates[j] != part_a[j]
        bounds.lower[j], bounds.upper[j] = min(rates[j], part_a[j]), max(rates[j], part_a[j])
    if differ:
        best_within(world, first.task, first.damping)
    return bits


@compiled
def broken(world: Record, rates: Array) -> int:
    """Return the bits of the limits that gave way to others."""
    limits, memory = world.limits, world.memory
    bits = 0
    for j in range(world.n):
        change, rounding = rates[j] - memory.qdot_cmd[j], ADDED_UP * abs(rates[j])
        if abs(change) > limits.change[j] * ALL_OF + rounding:
            bits |= ACCELERATION_EXCEEDED
        if abs(change - memory.change[j]) > limits.jerk_step[j] * ALL_OF + rounding:
            bits |= JERK_EXCEEDED
    return bits
