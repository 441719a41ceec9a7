"""The input of a scorecard as running sums: from tick records to one small record per world.

The records can be added in pieces of any size. Each tick is added to the sums of its own world in the order
of time, so that a metric has the same bits whatever the pieces, the threads and the worlds beside it.
"""

import math
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.law.jit import Record, compiled, entry, machine_code
from rmrc.law.record import capacity
from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.scenario.profile import Profile
from rmrc.support.spatial import AXES

# Rows of a tally's fields; of EXTREMES, the first four are smallest values.
JOINTS = (
    "joint_rate",
    "joint_rate_cmd",
    "joint_rate_plain",
    "joint_acceleration",
    "joint_acceleration_cmd",
    "joint_jerk_cmd",
    "tau",
    "tau_total",
)
RATE, COMMAND, PLAIN, ACCELERATION, ACCELERATION_CMD, JERK_CMD, TAU, TAU_TOTAL = range(8)
ERRORS = (
    "position_error",
    "orientation_error",
    "position_error_along",
    "orientation_error_along",
    "position_error_across",
    "orientation_error_across",
    "secondary_error",
)
WHOLE, ALONG, ACROSS, SECONDARY = 0, 2, 4, 6  # first rows: positions, and next orientations
EXTREMES = ("sigma", "manipulability", "path_rate", "secondary_sigma", "condition", "damping")
SIGMA, MANIPULABILITY, PACE, LEFT, CONDITION, DAMPING = range(6)
# The conditions of a profile: the index of each here is its code.
CONDITIONS = ("position", "rate", "acceleration", "jerk")
POSITION_BOUND, RATE_BOUND, ACCELERATION_BOUND, JERK_BOUND = range(4)

# A command whose acceleration changes its sign twice within this time shakes the arm [s]: 5 Hz. On a smooth
# path, changes are farther apart; a loop that oscillates, or a law that switches, takes some ticks.
CHATTER_TIME = 0.1
# An acceleration up to this does not count where a joint has no limits [rad/s² or m/s²]. With limits the
# bound is the smaller of the acceleration to its largest rate in a second and a tenth of its largest
# acceleration. Encoder noise of 1e-5 rad stays below it: at K = 20 /s and 1 ms it is 20 · 1e-5 · √2/0.001 =
# 0.3 rad/s² rms.
CHATTER_FLOOR = 1.0

BITS = len(IN_RUNS)
STUCK, TORQUE_LIMITED = int(Status.STUCK), int(Status.TORQUE_LIMITED)


def tally_type(n: int) -> np.dtype[np.void]:
    """Return the record of one world with n joints so far.

    Rows are those of JOINTS, ERRORS and EXTREMES. Extremes are the largest magnitudes, or for EXTREMES the
    largest values, with a minus sign for the first four; each has the time at which it was first reached.
    They are NaN before the first tick. `status` counts the ticks without a status, then those with each bit;
    `status_time` holds the first time of each. `limited` is the joint of the first actuator at its limit,
    or -1.

    The differences of commands begin at rest: before the first tick, rate and acceleration are 0. `chatter`
    counts changes of sign. `broken` counts the ticks that break a condition of the profile; the first one
    broke `broken_condition`, an index into CONDITIONS, at `broken_joint`.
    """
    return _tally_type(capacity(n))


@cache  # one object, as in rmrc.law.record
def _tally_type(c: int) -> np.dtype[np.void]:
    f = np.float64
    return np.dtype(
        [
            # given: joints, singular values, S_x of the six rows, with 0 for those that do not count; period
            ("n", np.int64), ("k", np.int64), ("scale", f, (6,)), ("period", f), ("torque_limit", f, (c,)),
            ("chatter_floor", f, (c,)), ("chatter_ticks", np.int64),
            # given, of a profile: whether there is one, and its bounds, infinite where it has none
            ("is_held", np.int64), ("position_bound", f, (2, c)), ("rate_bound", f, (c,)),
            ("acceleration_bound", f, (c,)), ("jerk_bound", f, (c,)),
            ("has_taper", np.int64), ("taper_end", f, (2, c)), ("taper_offset", f, (c,)),
            ("taper_deceleration", f, (c,)),
            # ticks that were added, and values of the first and of the last one
            ("ticks", np.int64), ("q_first", f, (c,)), ("q", f, (c,)), ("qdot", f, (c,)),
            ("qdot_cmd", f, (c,)), ("qddot_cmd", f, (c,)),
            ("pose_ref_first", f, (7,)), ("pose_ref", f, (7,)), ("path_time", f),
            # sums of squares, extremes, and their first times
            ("square", f, (len(JOINTS), c)), ("peak", f, (len(JOINTS), c)),
            ("peak_time", f, (len(JOINTS), c)),
            ("error_square", f, (len(ERRORS),)), ("error_max", f, (len(ERRORS),)),
            ("error_max_time", f, (len(ERRORS),)), ("error_end", f, (len(ERRORS),)),
            ("extreme", f, (len(EXTREMES),)), ("extreme_time", f, (len(EXTREMES),)),
            ("status", np.int64, (BITS + 1,)), ("status_time", f, (BITS + 1,)), ("limited", np.int64),
            # ticks in which the arm is stuck, in this stretch and in the longest so far, and their starts
            ("stuck", np.int64), ("stuck_began", f), ("stuck_longest", np.int64), ("stuck_time", f),
            # for each joint the sign of the last acceleration that counts, the tick at which it changed, and
            # how often it changed again soon
            ("chatter_sign", np.int64, (c,)), ("chatter_tick", np.int64, (c,)), ("chatter", np.int64, (c,)),
            ("broken", np.int64), ("broken_condition", np.int64), ("broken_joint", np.int64),
            ("broken_value", f), ("broken_bound", f), ("broken_time", f),
        ]
    )  # fmt: skip


def begin(
    n: int,
    axes: Sequence[Sequence[str]],
    length: Sequence[float],
    weights: Sequence[Sequence[float]],
    period: Sequence[float],
    torque_limit: Sequence[Sequence[float]] = (),
    chatter_floor: Sequence[Sequence[float]] = (),
    profiles: Sequence[Profile | None] = (),
) -> NDArray[np.void]:
    """Return the tallies of worlds before their first ticks, (w,).

    Args:
        n: Number of joints.
        axes: Task axes that count in each world.
        length: Characteristic length of each task [m].
        weights: Task weights of each world, one per axis; none: all 1.
        period: Control periods [s].
        torque_limit: Torque limits of the joints of each world, infinite without one; none: no joint has one.
        chatter_floor: Chatter floor of the joints of each world; none: CHATTER_FLOOR.
        profiles: The profiles that the commands of each world are checked against, if any.

    >>> begin(2, [["x", "rz"]], [0.5], [[1.0, 4.0]], [0.001])["scale"]
    array([[2., 0., 0., 0., 0., 2.]])
    """
    tallies = np.zeros(len(axes), tally_type(n))
    for name in ("peak", "peak_time", "error_max", "error_max_time", "error_end", "extreme", "extreme_time"):
        tallies[name] = math.nan
    tallies["stuck_time"] = tallies["status_time"] = math.nan
    tallies["broken_value"] = tallies["broken_bound"] = tallies["broken_time"] = math.nan
    tallies["limited"], tallies["torque_limit"] = -1, math.inf
    tallies["broken_condition"] = tallies["broken_joint"] = -1
    tallies["chatter_floor"], tallies["chatter_tick"] = CHATTER_FLOOR, -(2**62)
    tallies["n"], tallies["k"] = n, [min(n, len(one)) for one in axes]
    for w, one in enumerate(axes):
        rows = [AXES.index(axis) for axis in one]
        meters = [length[w] if row < 3 else 1.0 for row in rows]
        tallies["scale"][w, rows] = np.sqrt(weights[w] or np.ones(len(rows))) / meters
        if torque_limit and torque_limit[w]:
            tallies["torque_limit"][w, :n] = torque_limit[w]
        if chatter_floor and chatter_floor[w]:
            tallies["chatter_floor"][w, :n] = chatter_floor[w]
        if profiles and (profile := profiles[w]):
            _hold(tallies[w], profile, n)
    tallies["period"] = period
    tallies["chatter_ticks"] = np.round(CHATTER_TIME / tallies["period"])
    return tallies


def _hold(tally: np.void, profile: Profile, n: int) -> None:
    """Write the bounds of a profile."""
    tally["is_held"] = 1
    tally["position_bound"][:, :n] = np.array([[-math.inf], [math.inf]])
    if profile.position:
        tally["position_bound"][:, :n] = profile.position.lower, profile.position.upper
    for name in ("rate", "acceleration", "jerk"):
        published = getattr(profile, name)
        tally[f"{name}_bound"][:n] = published.value if published else math.inf
    if taper := profile.rate_near_ends:
        tally["has_taper"] = 1
        tally["taper_end"][:, :n] = taper.lower, taper.upper
        tally["taper_offset"][:n], tally["taper_deceleration"][:n] = taper.offset, taper.deceleration


def adder(tallies: NDArray[np.void], ticks: NDArray[np.void]) -> Callable[[NDArray[np.int64]], None]:
    """Return a function that adds to each tally the missing ticks of its world, up to an end.

    It is compiled if necessary, which takes a second, once. Its argument is `ends`, (w,): one past the last
    tick to add of each world.

    Args:
        tallies: One per world, (w,); written.
        ticks: Tick records, (w, rows): tick t is in row t modulo rows.
    """
    return partial(machine_code(add, tallies, ticks, np.zeros(len(tallies), np.int64)), tallies, ticks)


# Compiled ---------------------------------------------------------------------------------------


@entry
def add(tallies: Record, ticks: Record, ends: NDArray[np.int64]) -> None:
    """Add ticks to tallies, see `adder`."""
    for w in range(tallies.shape[0]):
        for t in range(tallies[w].ticks, ends[w]):
            _add_tick(tallies[w], ticks[w, t % ticks.shape[1]])


@compiled
def _add_tick(tally: Record, tick: Record) -> None:
    if tally.is_held:
        _add_conditions(tally, tick)
    _add_joints(tally, tick)
    _add_errors(tally, tick)
    _add_extremes(tally, tick)
    _add_status(tally, tick)
    if tick.status & STUCK:
        if tally.stuck == 0:
            tally.stuck_began = tick.time
        tally.stuck += 1
        if tally.stuck > tally.stuck_longest:
            tally.stuck_longest, tally.stuck_time = tally.stuck, tally.stuck_began
    else:
        tally.stuck = 0
    for i in range(7):
        if tally.ticks == 0:
            tally.pose_ref_first[i] = tick.pose_ref[i]
        tally.pose_ref[i] = tick.pose_ref[i]
    tally.path_time = tick.path_time
    tally.ticks += 1


@compiled
def _add_status(tally: Record, tick: Record) -> None:
    """Count the bits; the first actuator at its limit is the one nearest to it at that tick."""
    left, bit = tick.status, 0
    while bit == 0 or left:
        if left & 1 if bit else left == 0:
            if tally.status[bit] == 0:
                tally.status_time[bit] = tick.time
            tally.status[bit] += 1
        left >>= bit > 0
        bit += 1
    if tally.limited < 0 and tick.status & TORQUE_LIMITED:
        most = 0.0
        for j in range(tally.n):
            share = abs(tick.tau[j]) / tally.torque_limit[j]
            if share > most:
                most, tally.limited = share, j


@compiled
def _add_joints(tally: Record, tick: Record) -> None:
    """Add rates, torques and the difference quotients of the rates, each at the later of its ticks."""
    for j in range(tally.n):
        acceleration = (tick.qdot_cmd[j] - tally.qdot_cmd[j]) / tally.period
        for row in range(len(JOINTS)):
            value = _of_joint(tally, tick, row, j, acceleration)
            before = tally.ticks - (row == ACCELERATION)  # values before this one
            if before < 0:
                continue
            if before == 0 or _exceeds(abs(value), tally.peak[row, j]):
                tally.peak[row, j], tally.peak_time[row, j] = abs(value), tick.time
            tally.square[row, j] += value * value
        if tally.ticks == 0:
            tally.q_first[j] = tick.q[j]
        tally.q[j], tally.qdot[j] = tick.q[j], tick.qdot[j]
        tally.qdot_cmd[j], tally.qddot_cmd[j] = tick.qdot_cmd[j], acceleration
        if abs(acceleration) > tally.chatter_floor[j]:
            _add_chatter(tally, j, 1 if acceleration > 0.0 else -1)


@compiled
def _of_joint(tally: Record, tick: Record, row: int, j: int, acceleration: float) -> Any:
    """Return the value that a row adds up; the acceleration is that of the command."""
    if row == RATE:
        return tick.qdot[j]
    if row in (COMMAND, PLAIN):
        return tick.qdot_cmd[j] if row == COMMAND else tick.qdot_plain[j]
    if row == ACCELERATION:
        return (tick.qdot[j] - tally.qdot[j]) / tally.period
    if row == ACCELERATION_CMD:
        return acceleration
    if row == JERK_CMD:
        return (acceleration - tally.qddot_cmd[j]) / tally.period
    return tick.tau[j] if row == TAU else tick.tau[j] + tick.tau_gravity[j]


@compiled
def _add_chatter(tally: Record, j: int, sign: int) -> None:
    """Count a change of sign that comes soon after the previous one."""
    if tally.chatter_sign[j] == -sign:
        if tally.ticks - tally.chatter_tick[j] <= tally.chatter_ticks:
            tally.chatter[j] += 1
        tally.chatter_tick[j] = tally.ticks
    tally.chatter_sign[j] = sign


@compiled
def _add_conditions(tally: Record, tick: Record) -> None:
    """Check a command against the profile, before it becomes the last one; keep the first violation.

    A bound is broken where it is reached, and by NaN.
    """
    is_broken = False
    for condition in range(len(CONDITIONS)):
        for j in range(tally.n):
            acceleration = (tick.qdot_cmd[j] - tally.qdot_cmd[j]) / tally.period
            if condition == POSITION_BOUND:
                value, lower, upper = tick.q[j], tally.position_bound[0, j], tally.position_bound[1, j]
            elif condition == RATE_BOUND:
                value, upper = tick.qdot_cmd[j], tally.rate_bound[j]
                lower = -upper
                if tally.has_taper:
                    lower = max(lower, -_tapered(tally, j, tick.q[j] - tally.taper_end[0, j]))
                    upper = min(upper, _tapered(tally, j, tally.taper_end[1, j] - tick.q[j]))
            elif condition == ACCELERATION_BOUND:
                value, upper = acceleration, tally.acceleration_bound[j]
                lower = -upper
            else:
                value = (acceleration - tally.qddot_cmd[j]) / tally.period
                upper = tally.jerk_bound[j]
                lower = -upper
            if value > lower and value < upper:
                continue
            if tally.broken == 0 and not is_broken:
                tally.broken_condition, tally.broken_joint, tally.broken_time = condition, j, tick.time
                tally.broken_value, tally.broken_bound = value, lower if value <= lower else upper
            is_broken = True
    tally.broken += is_broken


@compiled
def _tapered(tally: Record, j: int, distance: float) -> float:
    """Return the largest rate toward an end of a joint's range at this distance: see `Taper`."""
    fastest = math.sqrt(max(0.0, 2.0 * tally.taper_deceleration[j] * distance)) - tally.taper_offset[j]
    return float(max(0.0, fastest))


@compiled
def _add_errors(tally: Record, tick: Record) -> None:
    """Add the sizes of the errors of the rows that count: whole, along u_min, and across it.

    u_min is a direction of the scaled rows S_x e. The part along it is scaled back, so that translations are
    in meters and rotations in radians again.
    """
    size = tally.error_end
    for row in range(len(ERRORS)):
        size[row] = 0.0
    along = 0.0
    for i in range(6):
        if tally.scale[i] > 0.0:
            along += tick.u_min[i] * (tally.scale[i] * tick.pose_error[i])
    for i in range(6):
        if tally.scale[i] > 0.0:
            kind = 0 if i < 3 else 1
            e, lost = tick.pose_error[i], tick.u_min[i] * along / tally.scale[i]
            size[WHOLE + kind] += e * e
            size[ALONG + kind] += lost * lost
            size[ACROSS + kind] += (e - lost) * (e - lost)
    size[SECONDARY] = tick.secondary_error
    for row in range(len(ERRORS)):
        size[row] = abs(size[row]) if row == SECONDARY else math.sqrt(size[row])
        tally.error_square[row] += size[row] * size[row]
        if tally.ticks == 0 or _exceeds(size[row], tally.error_max[row]):
            tally.error_max[row], tally.error_max_time[row] = size[row], tick.time


@compiled
def _add_extremes(tally: Record, tick: Record) -> None:
    for row in range(len(EXTREMES)):
        if row == SIGMA:
            value = -tick.sigma[tally.k - 1]
        elif row == MANIPULABILITY:
            value = -tick.manipulability
        elif row == PACE:
            value = -tick.path_rate
        elif row == LEFT:
            value = -tick.secondary_sigma
        elif row == CONDITION:
            value = tick.condition
        else:
            value = tick.damping
        if tally.ticks == 0 or _exceeds(value, tally.extreme[row]):
            tally.extreme[row], tally.extreme_time[row] = value, tick.time


@compiled
def _exceeds(value: float, extreme: float) -> bool:
    """Whether a value is the new extreme: the first of equals stays, and the first NaN for good."""
    return value > extreme or (math.isnan(value) and not math.isnan(extreme))
