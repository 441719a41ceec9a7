"""A bounded jerk: the motion of a joint in this tick that keeps it able to stay within all its limits.

The state of a joint is its position, the last rate that was sent, and the last change of that rate, its
course. The bounds on the rates of this tick look ahead: from the next state on, the change must be able to
reach zero before the rate limit, and the joint to rest before the position limit [DelPrete18]. From a state
within the bounds there is always a next one, so they are never empty. Where a measurement or a limit of
higher rank leaves no room, jerk gives way to acceleration, and acceleration to rate and position.
"""

import math

from rmrc.law.braking import brake, brake_gently, is_far, largest_change, steady_stop, stops_within
from rmrc.law.jit import Array, Record, apart, compiled
from rmrc.scenario.choices import Status

ACCELERATION_LIMITED, POSITION_LIMITED, JERK_LIMITED = map(
    int, (Status.ACCELERATION_LIMITED, Status.POSITION_LIMITED, Status.JERK_LIMITED)
)

# A step of jerk counts as exceeded beyond this relative slack: third differences are mostly rounding.
SLACK = 1e-9
ALL = 1.0 - SLACK
# No stop within a jerk limit needs a deceleration of this many steps of jerk.
HARD = 1e9
# The lag of a joint behind its commands is estimated from this much of its past [s], enough to contain some
# motions, and is at most this long [s]: actuators take milliseconds, the slowest known a third of a second.
REMEMBERED, LONGEST_LAG = 2.0, 0.5
# The largest rate that counts as measured [rad/s or m/s].
LARGEST = 1e10


@compiled
def is_within_jerk(world: Record, rates: Array) -> bool:
    """Return whether all limits are kept, now and later; False while the rates still approach a wish."""
    for j in range(world.n):
        rate, step, most = rates[j], world.jerk_step[j], world.change_limit[j]
        change = rate - world.qdot_cmd_last[j]
        if abs(world.lag[j]) > step or abs(change - world.course[j]) > step or abs(change) > most:
            return False
        last, T = world.qdot_cmd_last[j], world.period
        left = world.rate_limit[j] - (last if change > 0.0 else -last)
        if abs(change) * (abs(change) + step) > step * (2.0 * left - 0.25 * step) and (
            abs(change) > brake(left, step, 1.0)
        ):
            return False
        braking = world.braking[j] * T
        if not is_far(room(world, j, 1.0), rate, change, braking, step, T):
            return False
        if not is_far(room(world, j, -1.0), -rate, -change, braking, step, T):
            return False
    return True


@compiled
def foresee(world: Record) -> None:
    """Write how far each joint moves after its commands have come to rest: its rate times its lag.

    The lag of an actuator is the ratio of its distance behind its commands to its rate, by least squares,
    both without their values of long ago. The delay of a command counts as a lag.
    """
    T, sums = world.period, world.behind
    kept = max(0.0, 1.0 - T / REMEMBERED)
    for j in range(world.n):
        qdot, world.coast[j] = world.qdot[j], 0.0
        if not abs(qdot) <= LARGEST:  # the caller may have given no rates
            continue
        behind, rate = kept * sums[0, j] + T * (world.qdot_cmd_last[j] - qdot), qdot - sums[1, j]
        sums[0, j], sums[1, j] = behind, kept * sums[1, j] + (1.0 - kept) * qdot
        sums[2, j] = kept * sums[2, j] + behind * rate
        sums[3, j] = kept * sums[3, j] + rate * rate
        lag = sums[2, j] / sums[3, j] if sums[3, j] > 0.0 else 0.0
        world.coast[j] = min(max(lag, 0.0), LONGEST_LAG) * qdot


@compiled
def room(world: Record, j: int, side: float) -> float:
    """Return how far commands may take a joint towards an end of its range (side 1 or -1)."""
    left = world.position_limit[1, j] - world.q[j] if side > 0.0 else world.q[j] - world.position_limit[0, j]
    return float(left - max(0.0, side * world.coast[j]))


@apart("call_rest_bounds", is_eased=())
def rest_bounds(world: Record) -> None:
    """Write the largest and smallest rate that each joint may keep and still stop before its limits."""
    for j in range(world.n):
        limit, T, braking, step = (
            world.rate_limit[j], world.period, world.braking[j] * world.period, world.jerk_step[j],
        )  # fmt: skip
        world.rest_upper[j] = min(limit, steady_stop(max(0.0, room(world, j, 1.0)), braking, step, T))
        world.rest_lower[j] = -min(limit, steady_stop(max(0.0, room(world, j, -1.0)), braking, step, T))


@compiled
def stopping_rate(world: Record, j: int, side: float) -> float:
    """Return the largest rate towards an end of its range (side 1 or -1) from which a joint can stop in time.

    Where necessary, the joint brakes harder than configured, as hard as jerk and acceleration allow. Where
    even that is too late, the joint has strayed: since the last tick at which it could stop, some disturbance
    has moved it farther than its commands. It is enough that the commanded motion can still stop in time.
    Only where it cannot, jerk gives way, to the braking rate or to the least deceleration of all.
    """
    limit, T, step = world.rate_limit[j], world.period, world.jerk_step[j]
    distance = room(world, j, side)
    if distance == math.inf:
        return float(limit)
    distance = max(0.0, distance)
    last, course = side * world.qdot_cmd_last[j], side * world.course[j]
    braking = world.braking[j] * T
    most, least = course + step, max(course - step, min(course, -world.change_limit[j]))
    if stops_within(distance, last + most, most, braking, step, T):
        return float(limit)
    if stops_within(distance, last + least, least, braking, step, T):
        return float(min(limit, last + largest_change(distance, last, least, most, braking, step, T)))
    world.strayed[j] = 1
    surprise = side * (world.q[j] + world.coast[j] - world.q_sent[j])
    distance += surprise if surprise > 0.0 else 0.0
    if stops_within(distance, last + least, least, min(world.change_limit[j], HARD * step), step, T):
        return float(min(limit, last + least))
    in_time = max(
        brake(distance, max(world.braking[j], -course / T), T),
        min(last - world.change_limit[j], brake_gently(last, distance, T)),
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
    reach_by_jerk(world)
    for j in range(world.n):
        rate, limit = rates[j], world.rate_limit[j]
        is_held = (rate >= world.rest_upper[j]) * (world.rest_upper[j] < limit)
        is_held += (rate <= world.rest_lower[j]) * (world.rest_lower[j] > -limit)
        world.wish[j], world.group[j] = rate, j + 1 if is_held or alone else 0
    bits = approach(world, rates, 0)
    for j in range(world.n):
        if world.group[j] > 0:
            bits |= approach(world, rates, j + 1)
    for j in range(world.n):
        rate = min(max(rates[j], world.lower[j]), world.upper[j])
        upper, lower = stopping_rate(world, j, 1.0), -stopping_rate(world, j, -1.0)
        # A range that is too short has no stop; then the limit that the joint moves towards comes first.
        if world.qdot_cmd_last[j] > 0.0:
            rates[j] = min(max(rate, lower), upper)
        else:
            rates[j] = max(min(rate, upper), lower)
        if rates[j] != rate and abs(rates[j]) < world.rate_limit[j]:
            bits |= POSITION_LIMITED
    return bits


@compiled
def look_back(world: Record, wish: Array, rates: Array) -> None:
    """Remember the wish, and the positions of the joints if they had obeyed since they strayed."""
    for j in range(world.n):
        world.slope[j] = wish[j] - world.qdot_cmd_last[j] - world.lag[j]
        world.lag[j] = wish[j] - rates[j]
        if not (world.strayed[j] and math.isfinite(world.q_sent[j])):
            world.q_sent[j] = world.q[j] + world.coast[j]
        world.q_sent[j] += world.period * rates[j]
        world.strayed[j] = 0


@compiled
def reach_by_jerk(world: Record) -> None:
    """Write the bounds of each rate from acceleration and jerk, and from the rate limit ahead.

    Acceleration comes before jerk, and jerk before limits ahead, which a joint within all bounds never has
    to break.
    """
    for j in range(world.n):
        last, course, step, most = (
            world.qdot_cmd_last[j], world.course[j], world.jerk_step[j], world.change_limit[j],
        )  # fmt: skip
        up, down = min(course + step, change_to_rate(world, j, 1.0)), -change_to_rate(world, j, -1.0)
        up, down = max(course - step, up), min(course + step, max(course - step, down))
        world.upper[j], world.lower[j] = last + min(most, max(-most, up)), last + max(-most, min(most, down))


@compiled
def change_to_rate(world: Record, j: int, side: float) -> float:
    """Return the largest change that jerk can bring to zero before a rate limit (side 1 or -1) is reached."""
    return brake(float(world.rate_limit[j] - side * world.qdot_cmd_last[j]), world.jerk_step[j], 1.0)


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
    share, moves = 1.0, True
    for j in range(world.n):
        slope = rates[j] - world.qdot_cmd_last[j] - world.lag[j]
        if world.group[j] == group and abs(slope - world.slope[j]) > world.jerk_step[j] * (1.0 + SLACK):
            moves = False
    for j in range(world.n):
        way = abs(world.lag[j] if moves else rates[j] - world.qdot_cmd_last[j])
        if world.group[j] == group and way > world.jerk_step[j]:
            share = min(share, brake(way, world.jerk_step[j], 1.0) / way)
    for j in range(world.n if share < 1.0 else 0):
        if world.group[j] == group:
            rates[j] -= (1.0 - share) * (world.lag[j] if moves else rates[j] - world.qdot_cmd_last[j])
    return JERK_LIMITED if share < ALL else 0


@compiled
def scale_to_changes(world: Record, rates: Array, group: int) -> int:
    """Scale the change of rates until acceleration limits allow it and it can end before rate limits."""
    bits, part = 0, 1.0
    for j in range(world.n):
        change = rates[j] - world.qdot_cmd_last[j]
        most = change_to_rate(world, j, math.copysign(1.0, change))
        bound, slack = min(most, world.change_limit[j]), SLACK * world.jerk_step[j]
        if world.group[j] == group and abs(change) > bound + slack:
            bits |= ACCELERATION_LIMITED if bound < most else JERK_LIMITED
            part = min(part, (bound + slack) / abs(change))
    for j in range(world.n if part < 1.0 else 0):
        if world.group[j] == group:
            rates[j] = world.qdot_cmd_last[j] + part * (rates[j] - world.qdot_cmd_last[j])
    return bits


@compiled
def scale_to_jerk(world: Record, rates: Array, group: int) -> int:
    """Scale the change of the change of rates, from a course that (nearly) all joints can keep.

    The course is the last change times the factor nearest to 1 that acceleration, jerk and rate limits allow.
    """
    least, most, part = -math.inf, math.inf, 1.0
    for j in range(world.n):
        course, last = world.course[j], world.qdot_cmd_last[j]
        if world.group[j] == group and course != 0.0:
            one, other = (world.lower[j] - last) / course, (world.upper[j] - last) / course
            least, most = max(least, min(one, other)), min(most, max(one, other))
    factor = min(max(1.0, least), most) if least <= most else 1.0
    for j in range(world.n):
        lower, upper, slack = world.lower[j], world.upper[j], SLACK * world.jerk_step[j]
        world.kept[j] = min(max(world.qdot_cmd_last[j] + factor * world.course[j], lower), upper)
        wanted = rates[j] - world.kept[j]
        room = slack + (upper - world.kept[j] if wanted > 0.0 else world.kept[j] - lower)
        if world.group[j] == group and abs(wanted) > room:
            part = min(part, room / abs(wanted))
    for j in range(world.n if part < 1.0 else 0):
        if world.group[j] == group:
            rates[j] = world.kept[j] + part * (rates[j] - world.kept[j])
    return JERK_LIMITED if part < ALL else 0


@compiled
def come_to_rest(world: Record, rates: Array) -> None:
    """Write the rates that bring each joint from its last rate to rest, within jerk and the braking limit."""
    for j in range(world.n):
        last, course, step = world.qdot_cmd_last[j], world.course[j], world.jerk_step[j]
        change = -math.copysign(min(brake(abs(last), step, 1.0), world.braking[j] * world.period), last)
        rates[j] = last + min(max(change, course - step), course + step)
        world.lag[j], world.slope[j], world.q_sent[j] = 0.0, 0.0, math.nan


@compiled
def keep_changes(world: Record, rates: Array) -> None:
    """Remember by how much each sent rate differs from the last one; the next change starts from there.

    After a change that breaks the jerk limit, the memory holds no more than braking: otherwise the change of
    an emergency stop would have to be kept for some time.
    """
    for j in range(world.n):
        change, course = rates[j] - world.qdot_cmd_last[j], world.course[j]
        world.change_last[j] = change
        if abs(change - course) > world.jerk_step[j] * (1.0 + SLACK):
            most = max(world.braking[j] * world.period, abs(course))
            change = min(max(change, -most), most)
        world.course[j] = change


@compiled
def remember(world: Record, rates: Array) -> None:
    """Remember the sent rates, and by how much they differ from the last ones."""
    keep_changes(world, rates)
    for j in range(world.n):
        world.qdot_cmd_last[j] = rates[j]
