"""Motion of the joints themselves within their limits: to positions, at rates, back into range, to rest.

Each joint is limited on its own. Only rate limits scale all joints alike, unless the law clamps.
"""

import math

from rmrc.law.braking import brake, steady_stop
from rmrc.law.compiling import Method, Record, call, compiled
from rmrc.law.jerk import SPREAD
from rmrc.law.kinematics import way_to
from rmrc.law.law import aim, record_measures, scale_task, singular_status
from rmrc.law.limits import limit
from rmrc.law.measurement import JACOBIAN_ALONE
from rmrc.scenario.choices import LIMITS, Status

# Bits of `input.given`: what the joints are brought to.
POSITION_TARGET, RATE_TARGET = 8, 16

NONE = LIMITS.code("none")
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
    tick.status = singular_status(world)
    if is_outside(world):
        come_back(world)
    else:
        follow_joints(world)
    record_measures(world)


@compiled
def follow_joints(world: Record) -> None:
    """Write the rates that bring the joints to their targets."""
    tick, input_ = world.tick, world.input
    to_positions, to_rates = input_.given & POSITION_TARGET != 0, input_.given & RATE_TARGET != 0
    for j in range(world.n):
        tick.qdot_cmd[j] = input_.qdot_target[j] if to_rates else 0.0
        if to_positions:
            way = way_to(world, j, input_.q_target[j])
            tick.qdot_cmd[j] += approach_rate(world, j, way, world.task.feedback)
    tick.path_rate = 1.0
    limit_joints(world)


@compiled
def come_back(world: Record) -> None:
    """Write the rates that bring joints back into range while the others come to rest."""
    limits, state, tick, ends = world.limits, world.state, world.tick, world.input.range
    tick.path_rate = 0.0
    tick.status |= POSITION_LIMITED | STOPPED
    for j in range(world.n):
        lower, upper, last = limits.position[0, j], limits.position[1, j], world.memory.qdot_cmd[j]
        inside, change, wish = min(MARGIN, 0.5 * (upper - lower)), limits.braking[j] * world.period, 0.0
        if world.input.returning[j] != 0.0:
            goal = min(max(state.q[j], lower + inside), upper - inside)
            wish = approach_rate(world, j, goal - state.q[j], RETURN_GAIN)
            wish = min(max(wish, -RETURN_RATE), RETURN_RATE)
            # its limits would stop it at once, however fast it moves
            limits.position[0, j], limits.position[1, j] = -math.inf, math.inf
        tick.qdot_cmd[j] = wish if limits.is_eased else min(max(wish, last - change), last + change)
    limit_joints(world)
    for j in range(world.n):
        limits.position[0, j], limits.position[1, j] = ends[0, j], ends[1, j]


@Method
def return_first(world: Record) -> None:
    """Replace the rates of a run that began outside the limits while a joint is on its way back."""
    if is_outside(world):
        pace = world.tick.path_rate  # the path does not wait
        come_back(world)
        world.tick.path_rate = pace


@compiled
def limit_joints(world: Record) -> None:
    """Bring the rates within the bounds of every joint."""
    methods = world.methods
    chosen = methods.limit
    methods.limit = methods.by_joint if chosen != 0 else 0
    limit(world)
    methods.limit = chosen


@compiled
def brake_blindly(world: Record) -> None:
    """Bring each joint nearer to rest from its last command, where nothing is known of the arm."""
    limits, memory = world.limits, world.memory
    spread = min(limits.stretch, SPREAD) if limits.is_eased else 1.0
    for j in range(world.n):
        last, course, step = memory.qdot_cmd[j], memory.course[j], limits.jerk_step[j]
        change = -math.copysign(min(brake(abs(last), step, spread), limits.braking[j] * world.period), last)
        world.tick.qdot_cmd[j] = last + min(max(change, course - step), course + step)
        memory.lag[j], memory.slope[j], memory.q_sent[j] = 0.0, 0.0, math.nan
