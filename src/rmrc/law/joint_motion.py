"""Motion of the joints themselves within their limits: to positions, at rates, back into range, to rest.

Each joint is limited on its own. Only rate limits scale all joints alike, unless the law clamps.
"""

import math

from rmrc.law.braking import steady_stop
from rmrc.law.jerk import come_to_rest, ease, foresee, is_within_jerk, look_back
from rmrc.law.jit import Record, compiled
from rmrc.law.limits import bounds, broken, confine, exceeded, is_within
from rmrc.scenario.choices import LIMITS, Status

NONE, CLAMP = LIMITS.code("none"), LIMITS.code("clamp")
POSITION_LIMITED, STOPPED = int(Status.POSITION_LIMITED), int(Status.STOPPED)

# A joint is outside its range when it is so by more than an encoder's noise or a servo's lag. It comes back
# to this far inside [rad or m].
MARGIN = 1e-3
# The gain of the rate towards that position [1/s], and the largest rate [rad/s or m/s]: an arm at an
# impossible position moves slowly enough to be watched.
RETURN_GAIN, RETURN_RATE = 5.0, 0.5


@compiled
def is_outside(world: Record) -> bool:
    """Return whether a joint is on its way back into its range: from MARGIN outside until it is inside."""
    outside = False
    for j in range(world.n if world.limits_on_excess != NONE else 0):
        beyond = max(world.q[j] - world.position_limit[1, j], world.position_limit[0, j] - world.q[j])
        if beyond > MARGIN:
            world.returning[j] = 1.0
        elif beyond <= 0.0:
            world.returning[j] = 0.0
        outside |= world.returning[j] != 0.0
    return outside


@compiled
def approach_rate(world: Record, j: int, way: float, gain: float) -> float:
    """Return the rate towards a position from which the joint can stop there.

    It is gain · way near the position, and farther away √(2 b (way − b/(2 gain²))), which continues it
    smoothly and needs no more than the braking deceleration b; it is less where jerk is limited.

    Args:
        world: Limits.
        j: The joint.
        way: Distance to the position [rad or m].
        gain: Gain of the position error [1/s].
    """
    distance, braking, T = abs(way), world.braking[j], world.period
    rate = gain * distance
    if gain > 0.0 and distance > braking / (gain * gain):
        rate = math.sqrt(2.0 * braking * (distance - 0.5 * braking / (gain * gain)))
    if world.is_eased:
        rate = min(rate, steady_stop(distance, braking * T, world.jerk_step[j], T))
    return math.copysign(min(rate, world.rate_limit[j]), way)


@compiled
def follow_joints(world: Record, tick: Record, to_positions: bool, to_rates: bool) -> int:
    """Write the rates that bring the joints to their targets; return the status.

    Args:
        world: q, q_target and qdot_target, and limits.
        tick: qdot_cmd is written.
        to_positions: Whether there are target positions.
        to_rates: Whether there are target rates.
    """
    for j in range(world.n):
        tick.qdot_cmd[j] = world.qdot_target[j] if to_rates else 0.0
        if to_positions:
            tick.qdot_cmd[j] += approach_rate(world, j, world.q_target[j] - world.q[j], world.feedback)
    tick.path_rate = 1.0
    return limit_joints(world, tick)


@compiled
def come_back(world: Record, tick: Record) -> int:
    """Write the rates that bring joints back into range while the others come to rest; return the status."""
    tick.path_rate, status = 0.0, POSITION_LIMITED | STOPPED
    for j in range(world.n):
        lower, upper, last = world.position_limit[0, j], world.position_limit[1, j], world.qdot_cmd_last[j]
        inside, change, wish = min(MARGIN, 0.5 * (upper - lower)), world.braking[j] * world.period, 0.0
        if world.returning[j] != 0.0:
            aim = min(max(world.q[j], lower + inside), upper - inside)
            wish = approach_rate(world, j, aim - world.q[j], RETURN_GAIN)
            wish = min(max(wish, -RETURN_RATE), RETURN_RATE)
        tick.qdot_cmd[j] = wish if world.is_eased else min(max(wish, last - change), last + change)
        world.part_a[j], world.part_b[j] = lower, upper
        if world.returning[j] != 0.0:  # its limits would stop it at once, however fast it moves
            world.position_limit[0, j], world.position_limit[1, j] = -math.inf, math.inf
    status |= limit_joints(world, tick)
    for j in range(world.n):
        world.position_limit[0, j], world.position_limit[1, j] = world.part_a[j], world.part_b[j]
    return status


@compiled
def limit_joints(world: Record, tick: Record) -> int:
    """Bring the rates within the bounds of every joint; return the status bits of the limits that act."""
    rates, choice = tick.qdot_cmd, world.limits_on_excess
    if choice == NONE:
        return 0
    if world.is_eased:
        foresee(world)
    if is_within_jerk(world, rates) if world.is_eased else is_within(world, rates):
        if world.is_eased:
            look_back(world, rates, rates)
        return 0
    bounds(world)
    bits, factor = exceeded(world, rates), 1.0
    for j in range(world.n if choice != CLAMP else 0):
        if abs(rates[j]) > world.rate_limit[j]:
            factor = min(factor, world.rate_limit[j] / abs(rates[j]))
    for j in range(world.n):
        rates[j] *= factor
    confine(world, rates)
    if world.is_eased:
        bits |= ease(world, rates, True)  # each joint has its own factors
        look_back(world, world.wish, rates)
    return bits | broken(world, rates)


@compiled
def brake_blindly(world: Record, tick: Record) -> None:
    """Bring each joint nearer to rest from its last command, where nothing is known of the arm."""
    if world.is_eased:
        come_to_rest(world, tick.qdot_cmd)
    for j in range(0 if world.is_eased else world.n):
        last = world.qdot_cmd_last[j]
        tick.qdot_cmd[j] = math.copysign(max(0.0, abs(last) - world.braking[j] * world.period), last)
