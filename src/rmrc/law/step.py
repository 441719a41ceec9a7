"""One call of the law from Python: kinematics, a target in any frame, the law, and checks of the input.

    input         --receive--> q, pose, J; target pose and twist along world axes
                  --aim, resolve--> qdot_cmd     or: a motion of the joints, or the way to rest
                  --send--> memory, q_cmd

It is the law of a run: with the same input, a loop outside a run gives the same rates to the bit.
A loop may say how long ago its last step was.
"""

import math

from rmrc.law.compiling import Array, Method, Record, call, compiled
from rmrc.law.jerk import keep_change
from rmrc.law.joint_motion import POSITION_TARGET, RATE_TARGET, brake_blindly, is_outside
from rmrc.law.kinematics import BASE, SITE, carry, turn_of, turn_twist
from rmrc.law.law import resolve
from rmrc.law.measurement import JACOBIAN_ALONE, is_held, look, read_state
from rmrc.law.metric import INERTIA, factor
from rmrc.law.record import POSE, TWIST, UNCHANGED, UNLIMITED
from rmrc.law.svd import clear, copy
from rmrc.scenario.choices import Status

# Bit of `input.given`: `input.dt` is the time since the last step.
TIMED = 64

# A time outside of these counts as the nearer one [s]: two steps at once are no reason to divide by nothing,
# and after a pause an arm shall not jump to where it could have been. A loop with a period of more than half
# of the longest may be as late as two periods.
SHORTEST_PERIOD, LONGEST_PERIOD, PERIODS = 1e-9, 0.1, 2.0
# The longest tick is forgotten in this time [s]: more than any pattern of periods takes, and yet a pause
# makes an arm careful for some seconds only.
REMEMBERED = 10.0


@compiled
def is_time(dt: float) -> bool:
    """Return whether a number can be the time between two steps."""
    return 0.0 < dt < math.inf


@compiled
def begin_tick(world: Record, is_late: bool) -> None:
    """Set the length of this tick: the time since the last step where it is given, or else the period.

    The time ahead is unknown. Stops are planned for ticks of twice the longest one, as then a joint stops in
    time whatever the lengths of the ticks are, up to that.

    Args:
        world: Its input and memory.
        is_late: Whether commands have been braked meanwhile, up to one period ago at most.
    """
    input_, memory, period = world.input, world.memory, world.input.period
    if not input_.given & TIMED or not is_time(input_.dt):
        set_tick(world, period)
        return
    dt = min(max(input_.dt, SHORTEST_PERIOD), max(LONGEST_PERIOD, PERIODS * period))
    dt = min(dt, period) if is_late else dt
    if dt != period or memory.longest > 0.0:
        memory.longest = max(dt, period, memory.longest * (1.0 - min(1.0, dt / REMEMBERED)))
    set_tick(world, dt)


@compiled
def set_tick(world: Record, dt: float) -> None:
    """Set the length of this tick, and express limits and memory in it: changes stay as steep as they are."""
    limits, memory = world.limits, world.memory
    limits.stretch = 2.0 * memory.longest / dt if memory.longest > 0.0 else 1.0
    if dt == world.period:
        return
    ratio, world.period = dt / world.period, dt
    for j in range(world.n):
        limits.change[j] = limits.hardest[j] * dt
        if limits.is_eased:
            limits.jerk_step[j] = min(max(limits.jerk[j] * (dt * dt), UNCHANGED), UNLIMITED)
        memory.change[j] *= ratio
        memory.course[j] *= ratio
        memory.slope[j] *= ratio


INVALID, OVERDUE, STOPPED = int(Status.INVALID_INPUT), int(Status.OVERDUE), int(Status.STOPPED)
POSITION_LIMITED = int(Status.POSITION_LIMITED)

# The largest position, velocity or command; MuJoCo calls larger ones bad (its mjMAXVAL).
LARGEST = 1e10
# A shorter quaternion is no rotation.
SHORTEST = 1e-3


# Bits of `input.given`, the parts of the input of a step besides pose, twist, time and the targets of joints;
# PLACED stands for positions. The frame of pose and twist is added, times FRAME.
RATES, REFUSED, PLACED, FRAME = 4, 32, 128, 256
# Bits of `input.refused`, its unusable parts: not finite, too large, or no rotation.
BAD_CALL, BAD_POSITIONS, BAD_RATES, BAD_KINEMATICS, BAD_POSE, BAD_TWIST, BAD_TARGET, BAD_METRIC, BAD_TIME = (
    1 << bit for bit in range(9)
)


@Method
def step(world: Record) -> None:
    """Turn the input of a world into `tick.qdot_cmd`. Nothing is raised."""
    tick, input_ = world.tick, world.input
    read_state(world)
    late = brake_while_late(world)
    begin_tick(world, late != 0)
    input_.refused = receive(world)
    if input_.refused == 0:
        if input_.sites == JACOBIAN_ALONE:
            take_twist(world)
        if input_.has_servos:
            enter_reach(world)
        if is_outside(world) or input_.given & (POSITION_TARGET | RATE_TARGET) != 0:
            call(world.methods.move_joints, world)
        else:
            call(world.methods.control, world)
    if input_.refused != 0 or not is_bounded(tick.qdot_cmd, world.n):
        forget(world)
        brake_blindly(world)
        tick.status = STOPPED | INVALID if input_.refused != 0 else STOPPED
    tick.status |= late | input_.saturated
    send(world)


@compiled
def enter_reach(world: Record) -> None:
    """Bring the position limits to what servos can still take, as their commands are ahead of the joints."""
    input_, limits = world.input, world.limits.position
    for j in range(world.n):
        ahead = 0.0 if math.isnan(input_.q_cmd[j]) else input_.q_cmd[j] - world.state.q[j]
        limits[0, j] = max(input_.range[0, j], input_.servo[0, j] - ahead)
        limits[1, j] = min(input_.range[1, j], input_.servo[1, j] - ahead)


@Method
def resolve_alone(world: Record) -> None:
    """Resolve `scratch.twist_cmd` with J in `state`: the method `control` where a twist is given."""
    resolve(world)


@compiled
def brake_while_late(world: Record) -> int:
    """Brake for the periods without a step, as the sender has done; return OVERDUE if there are any.

    The last of them belongs to this step.
    """
    tick, input_ = world.tick, world.input
    if input_.late == 0:
        return 0
    set_tick(world, input_.period)
    tick.path_rate = 0.0
    for _ in range(input_.late - 1):
        brake_blindly(world)
        send(world)
        moves = 0.0
        for j in range(world.n):
            moves += abs(tick.qdot_cmd[j]) + abs(world.memory.course[j])
        if moves == 0.0:
            break
    input_.late = 0
    return OVERDUE


@compiled
def send(world: Record) -> None:
    """Remember the command; for joints that take positions, integrate it within their range.

    The integral starts at the first positions of a step that is not refused. It waits while the actuators
    cannot give more towards it.
    """
    memory, tick, input_ = world.memory, world.tick, world.input
    starts = input_.refused == 0 and input_.given & PLACED != 0
    for j in range(world.n):
        input_.change_before[j] = memory.change[j]
        position, rate = input_.q_cmd[j], tick.qdot_cmd[j]
        position = world.state.q[j] if starts and math.isnan(position) else position
        goal = position + world.period * (0.0 if is_held(world, j, rate) else rate)
        if not math.isnan(goal) and not input_.servo[0, j] <= goal <= input_.servo[1, j]:
            tick.status |= POSITION_LIMITED
        if rate > 0.0:
            goal = max(position, min(goal, input_.range[1, j], input_.servo[1, j]))
        elif rate < 0.0:
            goal = min(position, max(goal, input_.range[0, j], input_.servo[0, j]))
        input_.q_cmd[j] = goal
        keep_change(world, j, rate)
        memory.qdot_cmd[j] = rate
    memory.path_tick += tick.path_rate


@compiled
def receive(world: Record) -> int:
    """Find the kinematics, and turn pose and twist to world axes; return the bits of `input.refused`."""
    state, tick, input_, given = world.state, world.tick, world.input, world.input.given
    if given & REFUSED:
        return BAD_CALL
    if not is_bounded(state.q, world.n):
        return BAD_POSITIONS
    refused = BAD_RATES if given & RATES and not is_bounded(state.qdot, world.n) else 0
    if given & TIMED and not is_time(input_.dt):
        refused |= BAD_TIME
    look(world)
    known = is_bounded(state.pose, 7)
    for i in range(6):
        known = known and is_bounded(state.J[i], world.n)
    if not known:
        return refused | BAD_KINEMATICS
    copy(state.pose, tick.pose, 7)
    if given & POSITION_TARGET and not is_bounded(input_.q_target, world.n):
        refused |= BAD_TARGET
    if given & RATE_TARGET and not is_bounded(input_.qdot_target, world.n):
        refused |= BAD_TARGET
    return refused | read_wanted(world)


@compiled
def read_wanted(world: Record) -> int:
    """Write target pose and twist along world axes; return the unusable parts.

    Without a pose it is that of the site, which has no error.
    """
    state, tick, input_, given, refused = world.state, world.tick, world.input, world.input.given, 0
    pose, frame = tick.pose_ref, given // FRAME
    clear(tick.twist_ref, 0 if given & TWIST else 6)
    if not is_bounded(tick.twist_ref, 6):
        refused = BAD_TWIST
    if input_.sites == JACOBIAN_ALONE:
        return refused if world.law.inverse_metric != INERTIA or takes_metric(world) else refused | BAD_METRIC
    copy(state.pose, pose, 0 if given & POSE else 7)
    norm2 = pose[3] * pose[3] + pose[4] * pose[4] + pose[5] * pose[5] + pose[6] * pose[6]
    if not (is_bounded(pose, 7) and norm2 >= SHORTEST * SHORTEST):
        return refused | BAD_POSE
    if frame == BASE:
        turn_to_world(world, world.task.base)
    elif frame == SITE:
        turn_to_world(world, state.pose)
    return refused


@compiled
def turn_to_world(world: Record, frame: Array) -> None:
    """Turn the given pose and twist from a frame, whose pose is (7,), to world axes."""
    tick, given = world.tick, world.input.given
    if given & POSE:
        carry(frame, tick.pose_ref, tick.pose_ref)
    if given & TWIST:
        turn_twist(turn_of(frame), tick.twist_ref)


@compiled
def take_twist(world: Record) -> None:
    """Take the rows of a twist as given; its caller has included the feedback, and gives `scratch.error`."""
    scratch, tick = world.scratch, world.tick
    for i in range(6):
        scratch.twist_ref[i] = tick.twist_ref[i]
        scratch.twist_cmd[i] = world.memory.pace * tick.twist_ref[i]
        tick.pose_error[i] = math.nan


@compiled
def takes_metric(world: Record) -> bool:
    """Factor the given inertia, of which only the lower triangle is read; return whether it is positive."""
    n, links, is_positive = world.n, world.links, True
    for i in range(n):
        for j in range(i + 1):
            links.metric[j, i] = links.root[i, j] = links.metric[i, j]
    factor(links.root, n)
    for i in range(n):
        is_positive = is_positive and 0.0 < links.root[i, i] <= LARGEST
    return is_positive


@compiled
def is_bounded(values: Array, count: int) -> bool:
    """Return whether the first values are finite and within the largest possible magnitude."""
    bounded = True
    for i in range(count):
        bounded = bounded and abs(values[i]) <= LARGEST
    return bounded


@compiled
def forget(world: Record) -> None:
    """Mark this tick as one without measures; no decomposition starts from it."""
    tick, first = world.tick, world.first
    for i in range(world.k):
        first.sigma[i] = first.gain[i] = math.nan
    for i in range(6):
        tick.pose_error[i] = tick.u_min[i] = math.nan
    for j in range(world.n):
        tick.v_min[j] = tick.qdot_plain[j] = math.nan
    first.damping = tick.manipulability = tick.condition = math.nan
    tick.path_rate, first.age = 0.0, 0
