"""Motion of the joints themselves within their limits: to positions, at rates, back into range, to rest.

Each joint is limited on its own. Only rate limits scale all joints alike, unless the law clamps.
"""

import math

from rmrc.law.braking import steady_stop
from rmrc.law.compiling import Method, Record, call, compiled
from rmrc.law.jerk import come_to_rest, ease, foresee, is_within_jerk, look_back
from rmrc.law.kinematics import way_to
from rmrc.law.law import aim, record_measures, scale_task, singular_status
from rmrc.law.limits import broken, confine, exceeded, find_bounds, is_within
from rmrc.law.sight import JACOBIAN_ALONE
from rmrc.scenario.choices import LIMITS, Status

# Bits of `input.given`: what the joints are brought to.
POSITION_TARGET, RATE_TARGET = 8, 16

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
    limits, state, input_ = world.limits, world.state, world.input
    outside = False
    for j in range(world.n if world.law.limits_on_excess != NONE else 0):
        beyond = max(state.q[j] - limits.position[1, j], limits.position[0, j] - state.q[j])
        if beyond > MARGIN:
            input_.returning[j] = 1.0
        elif beyond <= 0.0:
            input_.returning[j] = 0.0
        outside |= input_.returning[j] != 0.0
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
    limits = world.limits
    distance, braking, T = abs(way), limits.braking[j], world.period
    rate = gain * distance
    if gain > 0.0 and distance > braking / (gain * gain):
        rate = math.sqrt(2.0 * braking * (distance - 0.5 * braking / (gain * gain)))
    if limits.is_eased:
        rate = min(rate, steady_stop(distance, braking * T, limits.jerk_step[j], T))
    return math.copysign(min(rate, limits.rate[j]), way)


@Method
def move_joints(world: Record) -> None:
    """Write the rates of a motion of the joints: back into their range, or to their targets."""
    tick, first = world.tick, world.first
    if world.input.sites != JACOBIAN_ALONE:
        aim(world)
    scale_task(world)
    call(world.methods.decompose, world, first)
    for i in range(world.k):
        first.gain[i] = math.nan
    for j in range(world.n):
        tick.qdot_plain[j] = math.nan
    first.damping = tick.secondary_error = tick.secondary_sigma = math.nan
    status = singular_status(world)
    tick.status = status | (come_back(world) if is_outside(world) else follow_joints(world))
    record_measures(world)


@compiled
def follow_joints(world: Record) -> int:
    """Write the rates that bring the joints to their targets; return the status."""
    tick, input_ = world.tick, world.input
    to_positions, to_rates = input_.given & POSITION_TARGET != 0, input_.given & RATE_TARGET != 0
    for j in range(world.n):
        tick.qdot_cmd[j] = input_.qdot_target[j] if to_rates else 0.0
        if to_positions:
            way = way_to(world, j, input_.q_target[j])
            tick.qdot_cmd[j] += approach_rate(world, j, way, world.task.feedback)
    tick.path_rate = 1.0
    return limit_joints(world)


@compiled
def come_back(world: Record) -> int:
    """Write the rates that bring joints back into range while the others come to rest; return the status."""
    state, scratch, tick, input_ = world.state, world.scratch, world.tick, world.input
    tick.path_rate, status = 0.0, POSITION_LIMITED | STOPPED
    for j in range(world.n):
        lower, upper, last = (
            world.limits.position[0, j],
            world.limits.position[1, j],
            world.memory.qdot_cmd[j],
        )
        inside, change, wish = min(MARGIN, 0.5 * (upper - lower)), world.limits.braking[j] * world.period, 0.0
        if input_.returning[j] != 0.0:
            goal = min(max(state.q[j], lower + inside), upper - inside)
            wish = approach_rate(world, j, goal - state.q[j], RETURN_GAIN)
            wish = min(max(wish, -RETURN_RATE), RETURN_RATE)
        tick.qdot_cmd[j] = wish if world.limits.is_eased else min(max(wish, last - change), last + change)
        scratch.part_a[j], scratch.part_b[j] = lower, upper
        if input_.returning[j] != 0.0:  # its limits would stop it at once, however fast it moves
            world.limits.position[0, j], world.limits.position[1, j] = -math.inf, math.inf
    status |= limit_joints(world)
    for j in range(world.n):
        world.limits.position[0, j], world.limits.position[1, j] = scratch.part_a[j], scratch.part_b[j]
    return status


@compiled
def limit_joints(world: Record) -> int:
    """Bring the rates within the bounds of every joint; return the status bits of the limits that act."""
    rates = world.tick.qdot_cmd
    if world.law.limits_on_excess == NONE:
        return 0
    if world.limits.is_eased:
        call(world.methods.ease_joints, world)
        return int(world.bounds.acting)
    return 0 if is_within(world, rates) else limit_each(world) | broken(world, rates)


@Method
def ease_joints(world: Record) -> None:
    """Do the same where jerk is limited as well; each joint has its own factors."""
    rates, bounds = world.tick.qdot_cmd, world.bounds
    foresee(world)
    if is_within_jerk(world, rates):
        look_back(world, rates, rates)
        bounds.acting = 0
        return
    bits = limit_each(world) | ease(world, rates, True)
    look_back(world, bounds.wish, rates)
    bounds.acting = bits | broken(world, rates)


@compiled
def limit_each(world: Record) -> int:
    """Bring each rate within its bounds, after all are scaled to the rate limits; return status bits."""
    rates, limits = world.tick.qdot_cmd, world.limits
    find_bounds(world)
    bits, factor = exceeded(world, rates), 1.0
    for j in range(world.n if world.law.limits_on_excess != CLAMP else 0):
        if abs(rates[j]) > limits.rate[j]:
            factor = min(factor, limits.rate[j] / abs(rates[j]))
    for j in range(world.n):
        rates[j] *= factor
    confine(world, rates)
    return bits


@compiled
def brake_blindly(world: Record) -> None:
    """Bring each joint nearer to rest from its last command, where nothing is known of the arm."""
    limits, tick = world.limits, world.tick
    if limits.is_eased:
        come_to_rest(world, tick.qdot_cmd)
    for j in range(0 if limits.is_eased else world.n):
        last = world.memory.qdot_cmd[j]
        tick.qdot_cmd[j] = math.copysign(max(0.0, abs(last) - limits.braking[j] * world.period), last)
