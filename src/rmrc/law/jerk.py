"""A bounded jerk: the motion of a joint in this tick that keeps it able to stay within all its limits.

The state of a joint is its position, the last rate that was sent, and the last change of that rate, its
course. The bounds on the rates of this tick look ahead: from the next state on, the change must be able to
reach zero before the rate limit, and the joint to rest before the position limit [DelPrete18]. From a state
within the bounds there is always a next one, so they are never empty. Where a measurement or a limit of
higher rank leaves no room, jerk gives way to acceleration, and acceleration to rate and position.
"""

import math

from rmrc.law.braking import brake, brake_gently, is_far, largest_change, steady_stop, stops_within
from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.scenario.choices import Status

ACCELERATION_LIMITED, POSITION_LIMITED, JERK_LIMITED = map(
    int, (Status.ACCELERATION_LIMITED, Status.POSITION_LIMITED, Status.JERK_LIMITED)
)

# A step of jerk counts as exceeded beyond this relative slack: third differences are mostly rounding.
SLACK = 1e-9
ALL = 1.0 - SLACK
# No stop within a jerk limit needs a deceleration of this many steps of jerk.
HARD = 1e9
# Whatever the lengths of ticks, changes add up to no more than in ticks that are all this many times as long
# as this one.
SPREAD = 2.0
# In ticks ahead that stand for shorter ones, an acceleration seems to change earlier than it can, by so many
# steps of jerk, which are added to it.
EARLY = 0.5
# The lag of a joint behind its commands is estimated from this much of its past [s], enough to contain some
# motions, and is at most this long [s]: actuators take milliseconds, the slowest known a third of a second.
REMEMBERED, LONGEST_LAG = 2.0, 0.5
# A rate that exceeds its limit so many times is no measurement, nor is one beyond the second number [rad/s or
# m/s].
IMPOSSIBLE, LARGEST = 10.0, 1e10


@compiled
def is_within_jerk(world: Record, rates: Array) -> bool:
    """Return whether all limits are kept, now and later; False while the rates still approach a wish."""
    limits, memory, stretch = world.limits, world.memory, world.limits.stretch
    T, spread = stretch * world.period, min(stretch, SPREAD)
    for j in range(world.n):
        rate, step, most = rates[j], limits.jerk_step[j], limits.change[j]
        change = rate - memory.qdot_cmd[j]
        if abs(memory.lag[j]) > step or abs(change - memory.course[j]) > step or abs(change) > most:
            return False
        last = memory.qdot_cmd[j]
        left = limits.rate[j] - (last if change > 0.0 else -last)
        spare = step * (2.0 * left - 0.25 * spread * spread * step)
        if abs(change) * (abs(change) + spread * step) > spare and abs(change) > brake(left, step, spread):
            return False
        braking, change, step = limits.braking[j] * T, stretch * change, stretch * stretch * step
        early = EARLY * step if stretch > 1.0 else 0.0
        if not is_far(room(world, j, 1.0), rate, change + early, braking, step, T):
            return False
        if not is_far(room(world, j, -1.0), -rate, early - change, braking, step, T):
            return False
    return True


@compiled
def foresee(world: Record) -> None:
    """Write how far each joint moves after its commands have come to rest: its rate times its lag.

    The lag of an actuator is the ratio of its distance behind its commands to its rate, by least squares,
    both without their values of long ago. The delay of a command counts as a lag.
    """
    memory, bounds = world.memory, world.bounds
    T, sums = world.period, memory.behind
    kept = max(0.0, 1.0 - T / REMEMBERED)
    for j in range(world.n):
        qdot, bounds.coast[j] = world.state.qdot[j], 0.0
        if not abs(qdot) <= min(IMPOSSIBLE * world.limits.rate[j], LARGEST):  # or it is not known
            continue
        behind, rate = kept * sums[0, j] + T * (memory.qdot_cmd[j] - qdot), qdot - sums[1, j]
        sums[0, j], sums[1, j] = behind, kept * sums[1, j] + (1.0 - kept) * qdot
        sums[2, j] = kept * sums[2, j] + behind * rate
        sums[3, j] = kept * sums[3, j] + rate * rate
        lag = sums[2, j] / sums[3, j] if sums[3, j] > 0.0 else 0.0
        bounds.coast[j] = min(max(lag, 0.0), LONGEST_LAG) * qdot


@compiled
def room(world: Record, j: int, side: float) -> float:
    """Return how far commands may take a joint towards an end of its range (side 1 or -1).

    The end of a servo's range is one of its commands, which do not lag.
    """
    end, q, coast = int(side > 0.0), world.state.q[j], max(0.0, side * world.bounds.coast[j])
    left = side * (world.limits.position[end, j] - q)
    if world.input.has_servos:
        to_stop = side * (world.input.range[end, j] - q)
        if left < to_stop:
            return float(min(left, to_stop - coast))
    return float(left - coast)


@Method
def rest_bounds(world: Record) -> None:
    """Write the largest and smallest rate that each joint may keep and still stop before its limits."""
    limits, bounds, stretch = world.limits, world.bounds, world.limits.stretch
    T = stretch * world.period
    for j in range(world.n):
        limit, braking, step = limits.rate[j], limits.braking[j] * T, stretch * stretch * limits.jerk_step[j]
        bounds.stop_upper[j] = min(limit, steady_stop(max(0.0, room(world, j, 1.0)), braking, step, T))
        bounds.stop_lower[j] = -min(limit, steady_stop(max(0.0, room(world, j, -1.0)), braking, step, T))


@compiled
def stopping_rate(world: Record, j: int, side: float) -> float:
    """Return the largest rate towards an end of its range (side 1 or -1) from which a joint can stop in time.

    Where necessary, the joint brakes harder than configured, as hard as jerk and acceleration allow. Where
    even that is too late, the joint has strayed: since the last tick at which it could stop, some disturbance
    has moved it farther than its commands. It is enough that the commanded motion can still stop in time.
    Only where it cannot, jerk gives way, to the braking rate or to the least deceleration of all.
    """
    limits, memory, bounds, stretch = world.limits, world.memory, world.bounds, world.limits.stretch
    limit, T, jerk_step = limits.rate[j], stretch * world.period, limits.jerk_step[j]
    distance = room(world, j, side)
    if distance == math.inf:
        return float(limit)
    distance = max(0.0, distance)
    last, course = side * memory.qdot_cmd[j], side * memory.course[j]
    braking, step = limits.braking[j] * T, stretch * stretch * jerk_step
    most, least = course + jerk_step, max(course - jerk_step, min(course, -limits.change[j]))
    early = EARLY if stretch > 1.0 else 0.0
    if stops_within(distance, last + most, stretch * most + early * step, braking, step, T):
        return float(limit)
    if stops_within(distance, last + least, stretch * least + early * step, braking, step, T):
        change = largest_change(distance, last, least, most, braking, step, T, stretch, early)
        return float(min(limit, last + change))
    bounds.strayed[j] = 1
    T = max(0.5 * T, world.period)  # without the reserve for ticks longer than any before
    stretch = T / world.period
    step = stretch * stretch * jerk_step
    surprise = side * (world.state.q[j] + bounds.coast[j] - memory.q_sent[j])
    surprise -= (stretch - 1.0) * world.period * abs(last)  # which ticks of other lengths explain
    distance += surprise if surprise > 0.0 else 0.0
    hardest = min(stretch * limits.change[j], HARD * step)
    if stops_within(distance, last + least, stretch * least + early * step, hardest, step, T):
        return float(min(limit, last + least))
    in_time = max(
        brake(distance, max(limits.braking[j], -course / world.period), T),
        min(last - limits.change[j], brake_gently(last, distance, world.period)),
    )
    return float(min(limit, last + least, in_time))


@compiled
def ease(world: Record, rates: Array, alone: bool) -> int:
    """Bring the rates towards the wished rates as acceleration and jerk allow; return status bits.

    Rate and position limits have already been applied to the wish. Changes, and changes of changes, are
    scaled by common factors for all joints, so that the tip keeps its direction, or by factors for each
    joint. A joint that its position limit holds moves independently.

    Args:
        world: Bounds, and the memory of the commands sent.
        rates: The wished rates; replaced, (n,).
        alone: Whether each joint has its own factors.
    """
    limits, bounds = world.limits, world.bounds
    reach_by_jerk(world)
    for j in range(world.n):
        rate, limit = rates[j], limits.rate[j]
        is_held = (rate >= bounds.stop_upper[j]) * (bounds.stop_upper[j] < limit)
        is_held += (rate <= bounds.stop_lower[j]) * (bounds.stop_lower[j] > -limit)
        bounds.wish[j], bounds.group[j] = rate, j + 1 if is_held or alone else 0
    bits = approach(world, rates, 0)
    for j in range(world.n):
        if bounds.group[j] > 0:
            bits |= approach(world, rates, j + 1)
    for j in range(world.n):
        rate = min(max(rates[j], bounds.lower[j]), bounds.upper[j])
        upper, lower = stopping_rate(world, j, 1.0), -stopping_rate(world, j, -1.0)
        # A range that is too short has no stop; then the limit that the joint moves towards comes first.
        if world.memory.qdot_cmd[j] > 0.0:
            rates[j] = min(max(rate, lower), upper)
        else:
            rates[j] = max(min(rate, upper), lower)
        if rates[j] != rate and abs(rates[j]) < limits.rate[j]:
            bits |= POSITION_LIMITED
    return bits


@compiled
def look_back(world: Record, wish: Array, rates: Array) -> None:
    """Remember the wish, and the positions of the joints if they had obeyed since they strayed."""
    memory, bounds = world.memory, world.bounds
    for j in range(world.n):
        memory.slope[j] = wish[j] - memory.qdot_cmd[j] - memory.lag[j]
        memory.lag[j] = wish[j] - rates[j]
        if not (bounds.strayed[j] and math.isfinite(memory.q_sent[j])):
            memory.q_sent[j] = world.state.q[j] + bounds.coast[j]
        memory.q_sent[j] += world.period * rates[j]
        bounds.strayed[j] = 0


@compiled
def reach_by_jerk(world: Record) -> None:
    """Write the bounds of each rate from acceleration and jerk, and from the rate limit ahead.

    Acceleration comes before jerk, and jerk before limits ahead, which a joint within all bounds never has
    to break.
    """
    limits, memory, bounds = world.limits, world.memory, world.bounds
    for j in range(world.n):
        last, course = memory.qdot_cmd[j], memory.course[j]
        step, most = limits.jerk_step[j], limits.change[j]
        up, down = min(course + step, change_to_rate(world, j, 1.0)), -change_to_rate(world, j, -1.0)
        up, down = max(course - step, up), min(course + step, max(course - step, down))
        bounds.upper[j] = last + min(most, max(-most, up))
        bounds.lower[j] = last + max(-most, min(most, down))


@compiled
def change_to_rate(world: Record, j: int, side: float) -> float:
    """Return the largest change that jerk can bring to zero before a rate limit (side 1 or -1) is reached."""
    limits = world.limits
    left = float(limits.rate[j] - side * world.memory.qdot_cmd[j])
    return brake(left, limits.jerk_step[j], min(limits.stretch, SPREAD))


@compiled
def approach(world: Record, rates: Array, group: int) -> int:
    """Bring the rates of some joints towards their wish by common factors; return status bits."""
    bits = catch_up(world, rates, group)
    bits |= scale_to_changes(world, rates, group)
    return bits | scale_to_jerk(world, rates, group)


@compiled
def catch_up(world: Record, rates: Array, group: int) -> int:
    """Go as far towards the wish as one tick can; return JERK_LIMITED if some of the way is left.

    The largest change is the one that steps of jerk can take back on the way, so that it ends when the wish
    is reached. A rate then goes from rest to a steady wish in the least time and without overshoot. A wish
    that itself moves within the jerk limit is followed as if it were steady.
    """
    limits, memory, bounds = world.limits, world.memory, world.bounds
    share, moves, spread = 1.0, True, min(world.limits.stretch, SPREAD)
    for j in range(world.n):
        slope = rates[j] - memory.qdot_cmd[j] - memory.lag[j]
        if bounds.group[j] == group and abs(slope - memory.slope[j]) > limits.jerk_step[j] * (1.0 + SLACK):
            moves = False
    for j in range(world.n):
        way = abs(memory.lag[j] if moves else rates[j] - memory.qdot_cmd[j])
        if bounds.group[j] == group and way > limits.jerk_step[j]:
            share = min(share, brake(way, limits.jerk_step[j], spread) / way)
    for j in range(world.n if share < 1.0 else 0):
        if bounds.group[j] == group:
            rates[j] -= (1.0 - share) * (memory.lag[j] if moves else rates[j] - memory.qdot_cmd[j])
    return JERK_LIMITED if share < ALL else 0


@compiled
def scale_to_changes(world: Record, rates: Array, group: int) -> int:
    """Scale the change of rates until acceleration limits allow it and it can end before rate limits."""
    limits, memory, bounds = world.limits, world.memory, world.bounds
    bits, part = 0, 1.0
    for j in range(world.n):
        change = rates[j] - memory.qdot_cmd[j]
        most = change_to_rate(world, j, math.copysign(1.0, change))
        bound, slack = min(most, limits.change[j]), SLACK * limits.jerk_step[j]
        if bounds.group[j] == group and abs(change) > bound + slack:
            bits |= ACCELERATION_LIMITED if bound < most else JERK_LIMITED
            part = min(part, (bound + slack) / abs(change))
    for j in range(world.n if part < 1.0 else 0):
        if bounds.group[j] == group:
            rates[j] = memory.qdot_cmd[j] + part * (rates[j] - memory.qdot_cmd[j])
    return bits


@compiled
def scale_to_jerk(world: Record, rates: Array, group: int) -> int:
    """Scale the change of the change of rates, from a course that (nearly) all joints can keep.

    The course is the last change times the factor nearest to 1 that acceleration, jerk and rate limits allow.
    """
    memory, bounds = world.memory, world.bounds
    least, most, part = -math.inf, math.inf, 1.0
    for j in range(world.n):
        course, last = memory.course[j], memory.qdot_cmd[j]
        if bounds.group[j] == group and course != 0.0:
            one, other = (bounds.lower[j] - last) / course, (bounds.upper[j] - last) / course
            least, most = max(least, min(one, other)), min(most, max(one, other))
    factor = min(max(1.0, least), most) if least <= most else 1.0
    for j in range(world.n):
        lower, upper, slack = bounds.lower[j], bounds.upper[j], SLACK * world.limits.jerk_step[j]
        bounds.kept[j] = min(max(memory.qdot_cmd[j] + factor * memory.course[j], lower), upper)
        wanted = rates[j] - bounds.kept[j]
        room = slack + (upper - bounds.kept[j] if wanted > 0.0 else bounds.kept[j] - lower)
        if bounds.group[j] == group and abs(wanted) > room:
            part = min(part, room / abs(wanted))
    for j in range(world.n if part < 1.0 else 0):
        if bounds.group[j] == group:
            rates[j] = bounds.kept[j] + part * (rates[j] - bounds.kept[j])
    return JERK_LIMITED if part < ALL else 0


@compiled
def keep_change(world: Record, j: int, rate: float) -> None:
    """Remember by how much a joint's sent rate differs from the last one; the next change starts from there.

    After a change that breaks the jerk limit, the memory holds no more than braking: otherwise the change of
    an emergency stop would have to be kept for some time.
    """
    limits, memory = world.limits, world.memory
    change, course = rate - memory.qdot_cmd[j], memory.course[j]
    memory.change[j] = change
    if abs(change - course) > limits.jerk_step[j] * (1.0 + SLACK):
        most = max(limits.braking[j] * world.period, abs(course))
        change = min(max(change, -most), most)
    memory.course[j] = change


@Method
def remember(world: Record) -> None:
    """Remember by how much the rates that are sent differ from the last ones."""
    for j in range(world.n):
        keep_change(world, j, world.tick.qdot_cmd[j])
