"""The metrics of a run, each declared once: name, value, unit and meaning, in the order of display.

Each is computed by numpy from the whole columns of the run. Their names depend on the joints and the task
axes alone, never on the events of the run: a metric that a run is too short to determine is NaN, or "" for a
name. So a run without ticks has all names. Arrays are (joints, ticks), each row contiguous over time. Some
count the commands that a profile refuses, and those that chatter.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.results.columns import Recorded
from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.scenario.profile import Profile, Taper
from rmrc.support.spatial import AXES, Array

# The conditions of a profile.
CONDITIONS = ("position", "rate", "acceleration", "jerk")

# An acceleration up to this does not count where a joint has no limits [rad/s² or m/s²]. With limits the
# bound is the smaller of the acceleration to its largest rate in a second and a tenth of its largest
# acceleration. Encoder noise of 1e-5 rad stays below it: at K = 20 /s and 1 ms it is 20 · 1e-5 · √2/0.001 =
# 0.3 rad/s² rms.
CHATTER_FLOOR = 1.0


class Refused(NamedTuple):
    """The commands that a profile refuses.

    Attributes:
        number: How many; NaN: there is no profile.
        condition: The first violated condition of the first of them; "": there is none.
        joint: The first joint that violates it; -1: there is none.
        time: When the command was sent [s].
        value: Value that violates the condition.
        bound: Bound that it reaches.
    """

    number: float = math.nan
    condition: str = ""
    joint: int = -1
    time: float = math.nan
    value: float = math.nan
    bound: float = math.nan


def refused(
    profile: Profile, time: Array, q: Array, rate: Array, acceleration: Array, jerk: Array
) -> Refused:
    """Return the commands that a profile refuses. A bound that is reached is violated.

    Args:
        profile: The profile.
        time: Time of each tick [s], (T,).
        q: Joint positions, (n, T).
        rate: Commanded rates, and so on, (n, T) each.
        acceleration: Their difference quotients.
        jerk: Those of the accelerations.
    """

    def column(part: object, name: str, default: float) -> Array:
        return np.array(getattr(part, name) if part else [default] * len(q))[:, None]

    most = [column(part, "value", math.inf) for part in (profile.rate, profile.acceleration, profile.jerk)]
    bounds = [(-bound, bound) for bound in most]
    if profile.rate_near_ends:
        bounds[0] = _tapered(profile.rate_near_ends, q, most[0])
    ends = profile.position
    bounds.insert(0, (column(ends, "lower", -math.inf), column(ends, "upper", math.inf)))
    values = (q, rate, acceleration, jerk)
    violates = np.array([~((x > low) & (x < high)) for x, (low, high) in zip(values, bounds, strict=True)])
    ticks = np.flatnonzero(violates.any(axis=(0, 1)))  # of NaN as well
    if not len(ticks):
        return Refused(0.0)
    tick = ticks[0]
    i, j = np.argwhere(violates[:, :, tick])[0].tolist()
    value = float(values[i][j, tick])
    low, high = (float(np.broadcast_to(bound, q.shape)[j, tick]) for bound in bounds[i])
    bound = low if value <= low else high
    return Refused(float(len(ticks)), CONDITIONS[i], j, float(time[tick]), value, bound)


def _tapered(taper: Taper, q: Array, rate: Array) -> tuple[Array, Array]:
    """Return the bounds of rates at some positions, with the taper toward the ends, (n, T) each."""

    def most(distance: Array) -> Array:
        slowing = np.sqrt(np.maximum(0.0, 2.0 * np.array(taper.deceleration)[:, None] * distance))
        return np.asarray(np.minimum(rate, np.maximum(0.0, slowing - np.array(taper.offset)[:, None])))

    lower, upper = (np.array(end)[:, None] for end in (taper.lower, taper.upper))
    return -most(q - lower), most(upper - q)


# Name, value, unit and meaning of each metric.
Metrics: TypeAlias = Iterator[tuple[str, float | str, str, str]]

# A path is closed if its last wanted pose is this near to the first [m, rad]: above the error of a start that
# was rounded to 0.01 deg, and far below any path.
CLOSED = 1e-3
# A command whose acceleration changes its sign twice within this time shakes the arm [s]: 5 Hz. On a smooth
# path, changes are farther apart; a loop that oscillates, or a law that switches, takes some ticks.
CHATTER_TIME = 0.1
# The lost direction has no linear or no angular part where that part of u_min is smaller: it is rounding.
NO_PART = 1e-9


def metrics(run: Recorded) -> Metrics:
    """Yield the metrics of a run of any length, even 0."""
    names = ("q", "qdot", "qdot_cmd", "qdot_plain", "tau", "tau_gravity")
    q, qdot, qdot_cmd, qdot_plain, tau, gravity = (np.ascontiguousarray(run[name].T) for name in names)
    # difference quotients, each at the later of its ticks; commands begin at rest
    acceleration = np.diff(qdot) / run.period
    acceleration_cmd = np.diff(qdot_cmd, prepend=0.0) / run.period
    jerk_cmd = np.diff(acceleration_cmd, prepend=0.0) / run.period
    measured, sent = (f"difference quotient of the {rate} rate" for rate in ("measured", "commanded"))
    total = "torque or force with that of gravity compensation"
    yield from _joints(run, "joint_rate", "measured rate", qdot, "/s", "rms times")
    yield from _joints(run, "joint_rate_cmd", "commanded rate", qdot_cmd, "/s", "rms times")
    yield from _joints(run, "joint_rate_plain", "rate of the plain inverse", qdot_plain, "/s")
    yield from _joints(run, "joint_acceleration", measured, acceleration, "/s²", "each")
    yield from _joints(run, "joint_acceleration_cmd", sent, acceleration_cmd, "/s²", "rms")
    yield from _joints(run, "joint_jerk_cmd", f"second {sent}", jerk_cmd, "/s³")
    yield from _chatter(run, acceleration_cmd)
    yield from _joints(run, "tau", "actuator torque or force", tau, "", "each share")
    yield from _joints(run, "tau_total", total, tau + gravity, "", "share")
    yield from _errors(run)
    yield from _return(run)
    yield from _extremes(run)
    yield from _statuses(run, tau)
    yield from _profile(run, q, qdot_cmd, acceleration_cmd, jerk_cmd)
    yield from _effort(run)


def _peak(run: Recorded, values: Array) -> tuple[float, float]:
    """Return the largest value of a quantity, and when it was first reached [s].

    NaN is above all numbers; its time is NaN. Both are NaN without ticks.

    Args:
        run: The run.
        values: The quantity at its ticks, or at the last of them, (T,).
    """
    if not len(values):
        return math.nan, math.nan
    tick = int(values.argmax()) - len(values)
    value = float(values[tick])
    return value, math.nan if math.isnan(value) else float(run["time"][tick])


def _rms(values: Array) -> float:
    """Return the root of the mean square over the ticks, of (T,)."""
    # a product of long vectors would wake the threads of BLAS, which cost more than they save
    return float(np.sqrt(np.square(values).sum() / (len(values) or math.nan)))


# Joints -----------------------------------------------------------------------------------------


def _joints(run: Recorded, group: str, what: str, values: Array, per: str, more: str = "") -> Metrics:
    """Yield the metrics of a quantity that each joint has.

    Args:
        run: The run.
        group: First part of their names.
        what: The quantity.
        values: Its values, (n, T).
        per: What follows the unit of a joint; "": it is a torque or force.
        more: Metrics beside the peak: `rms`, the largest of the joints; `each` joint's peak, or these with
            their `times` and rms; `share` of the torque limit.
    """
    units = [f"{run.joint_unit(j)}{per}" if per else "N" if s else "N·m" for j, s in enumerate(run.is_slide)]
    unit = " or ".join(dict.fromkeys(units))
    each, times = np.array([_peak(run, row) for row in np.abs(values)]).T
    j = int(each.argmax())
    name = "" if math.isnan(each[j]) else run.joints[j]
    yield f"{group}.peak", float(each[j]), unit, f"largest {what}, of all joints and ticks"
    yield f"{group}.peak_time", float(times[j]), "s", f"when the largest {what} was reached first"
    yield f"{group}.peak_joint", name, "", f"joint with the largest {what}"
    if "rms" in more:
        rms = [_rms(row) for row in values]
        yield f"{group}.rms", float(np.max(rms)), unit, f"largest of the joints' rms {what}"
    for j, name in enumerate(run.joints if "each" in more or "times" in more else ()):
        yield f"{group}.{name}.peak", float(each[j]), units[j], f"largest {what} of {name}"
        if "times" in more:
            yield f"{group}.{name}.peak_time", float(times[j]), "s", f"when {name} was fastest first"
            yield f"{group}.{name}.rms", rms[j], units[j], f"{what} of {name}, rms over time"
    if "share" in more:
        limit = np.array(run.torque_limit or (math.inf,) * len(each))
        share = max((each / limit)[np.isfinite(limit) & (limit > 0.0)], default=math.nan)
        meaning = f"largest {what} as a share of its joint's limit; undefined without a limit"
        yield f"{group}.share_of_limit", float(share), "1", meaning


def _chatter(run: Recorded, acceleration: Array) -> Metrics:
    """Yield the rate of quick sign changes of the commanded acceleration, (n, T)."""
    floor = run.chatter_floor or (CHATTER_FLOOR,) * len(run.joints)
    counts = np.zeros(len(floor), int)
    for j, values in enumerate(acceleration):
        large = np.flatnonzero(np.abs(values) > floor[j])
        changes = large[1:][np.diff(values[large] > 0.0)]
        counts[j] = np.count_nonzero(np.diff(changes) <= round(CHATTER_TIME / run.period))
    count, name = int(counts.max()), run.joints[counts.argmax()]
    what = "sign changes of the commanded acceleration per second, counting those in quick succession"
    yield "chatter", count / (len(run) * run.period or math.nan), "1/s", f"{what}; of the joint with the most"
    yield "chatter_joint", name if count else "", "", "joint with the most chatter"


def joint_changes(run: Recorded) -> Array:
    """Return how far each joint is from its start, after a path that ends where it began.

    Revolute joints by the shortest angle, so that a full turn is no change.

    Args:
        run: A complete run with a closed reference: the controlled rows of the last pose equal the first.

    Returns:
        Magnitudes, (n,) [rad or m]; NaN for any other run.
    """
    if len(run) and run.is_complete:
        gap = run.view.error(run["pose_ref"][-1], run["pose_ref"][0])[[AXES.index(axis) for axis in run.axes]]
        if np.abs(gap).max() <= CLOSED:
            change = run["q"][-1] - run["q"][0]
            shortest = (change + math.pi) % (2.0 * math.pi) - math.pi
            return np.asarray(np.abs(np.where(run.is_slide, change, shortest)))
    return np.full(len(run.joints), math.nan)


def _return(run: Recorded) -> Metrics:
    """Yield the distance of the joints from the start, if the path leads back to it."""
    changes = joint_changes(run)
    j = int(changes.argmax())
    name = "" if math.isnan(changes[j]) else run.joints[j]
    unit = " or ".join(dict.fromkeys(map(run.joint_unit, range(len(changes)))))
    what = "from the first tick to the last, of a closed path"
    yield "return.joint_change", float(changes[j]), unit, f"largest change of a joint {what}"
    yield "return.change_joint", name, "", f"joint with the largest change {what}"


# Task -------------------------------------------------------------------------------------------


def _errors(run: Recorded) -> Metrics:
    """Yield the errors of positions and orientations, with their parts; of a second task.

    The arm is losing the direction S_x u_min at that tick. Its linear part splits the error of positions into
    parts along and across it, and its angular part that of orientations.
    """
    axes = np.array([AXES.index(axis) for axis in run.axes])
    scale = np.sqrt(run.weights or np.ones(len(axes))) / np.where(axes < 3, run.length, 1.0)  # S_x
    errors, u = (np.ascontiguousarray(run[name].T[axes]) for name in ("pose_error", "u_min"))
    groups, parts = [], []
    for name, unit, what, half, rows in (
        ("position_error", "m", "distance to the reference position", "linear", axes < 3),
        ("orientation_error", "rad", "angle to the reference orientation", "angular", axes >= 3),
    ):
        if rows.any():
            size, along, across = _split(errors[rows], u[rows], scale[rows])
            groups.append((name, unit, what, size))
            lost = f"{name.replace('_', ' ')} {{}} the {half} part of the lost direction"
            parts.append((f"{name}_along", unit, lost.format("along"), along))
            parts.append((f"{name}_across", unit, lost.format("across"), across))
    second = np.abs(run["secondary_error"])
    groups += [*parts, ("secondary_error", "m, rad", "error of the second task", second)]
    for name, unit, what, values in groups:
        peak, time = _peak(run, values)
        yield f"{name}.rms", _rms(values), unit, f"{what}, rms over time"
        yield f"{name}.max", peak, unit, f"{what}, largest"
        yield f"{name}.max_time", time, "s", f"{what}, when it was largest first"
        yield f"{name}.end", float(values[-1]) if len(run) else math.nan, unit, f"{what}, at the last tick"


def _split(error: Array, u: Array, scale: Array) -> tuple[Array, Array, Array]:
    """Return the norm of an error, and of its parts along and across the direction that is lost, (T,) each.

    Args:
        error: Rows of one unit, (r, T).
        u: The part of u_min in these rows, (r, T).
        scale: Its scale S_x, (r,).
    """
    size, lost = np.linalg.norm(error, axis=0), scale[:, None] * u
    is_lost = np.linalg.norm(u, axis=0) > NO_PART
    direction = np.where(is_lost, lost / np.linalg.norm(lost, axis=0), 0.0)
    along = np.sum(direction * error, axis=0)
    across = np.linalg.norm(error - direction * along, axis=0)
    return size, np.minimum(np.abs(along), size), np.minimum(across, size)  # rounding makes no part larger


def _extremes(run: Recorded) -> Metrics:
    """Yield the extremes of the measures of singularity, of the pace, and of the second task."""
    second = "smallest singular value left to the second task"
    for name, sign, values, meaning in (
        ("sigma.min", -1.0, run["sigma"][:, -1], "smallest singular value of the run"),
        ("condition.max", 1.0, run["condition"], "largest κ = σ₁/σ_k"),
        ("manipulability.min", -1.0, run["manipulability"], "smallest w = ∏σ"),
        ("damping.max", 1.0, run["damping"], "largest λ"),
        ("path_rate.min", -1.0, run["path_rate"], "smallest pace along the path"),
        ("secondary_sigma.min", -1.0, run["secondary_sigma"], second),
    ):
        value, time = _peak(run, sign * values)
        yield name, sign * value, "1", meaning
        if name == "sigma.min":
            yield f"{name}_time", time, "s", "when the smallest singular value was reached first"


# Events -----------------------------------------------------------------------------------------


def _statuses(run: Recorded, tau: Array) -> Metrics:
    """Yield the duration of each status, and of standstill, contact, slip and actuators at their limit."""
    status = run.columns["status"].astype(np.int64)
    ticks = {one: np.flatnonzero(status & one) for one in IN_RUNS}

    def seconds(ticks: NDArray[np.int64]) -> float:
        return run.period * len(ticks)

    def first_time(ticks: NDArray[np.int64]) -> float:
        return float(run["time"][ticks[0]]) if len(ticks) else math.nan

    yield "status_time.OK", seconds(np.flatnonzero(status == 0)), "s", "time without any status"
    for one in IN_RUNS:
        yield f"status_time.{one.name}", seconds(ticks[one]), "s", f"time with status {one.name}"
    stuck, contact, limited = ticks[Status.STUCK], ticks[Status.CONTACT], ticks[Status.TORQUE_LIMITED]
    longest = max(np.split(stuck, np.flatnonzero(np.diff(stuck) > 1) + 1), key=len)
    yield "stuck.longest", seconds(longest), "s", "longest time stuck without interruption"
    yield "stuck.longest_time", first_time(longest), "s", "when that began"
    share = len(stuck) / (len(run) or math.nan)
    yield "stuck.share", share, "1", "fraction of the ticks in which it is stuck"
    yield "contact.time", seconds(contact), "s", "time in contact"
    yield "contact.first_time", first_time(contact), "s", "time of the first contact"
    yield "contact.first_bodies", " – ".join(run.touching), "", "bodies of the first contact"
    pairs = "pairs of bodies that touch from the start, which is no contact while it lasts"
    yield "contact.resting", float(len(run.resting)), "1", pairs
    slip, time = _peak(run, run["slip"])
    yield "slip.max", slip, "rad or m", "largest distance of a follower from its equality; undefined without"
    yield "slip.max_time", time, "s", "when the largest slip was reached first"
    limit = np.array(run.torque_limit or (math.inf,) * len(tau))[:, None]
    shares = np.fmax(0.0, np.abs(tau[:, limited]) / limit)
    shares = shares[:, shares.any(axis=0)]
    name = run.joints[shares[:, 0].argmax()] if shares.size else ""
    yield "torque_limited.time", seconds(limited), "s", "time with an actuator at its limit"
    yield "torque_limited.first_time", first_time(limited), "s", "first time with an actuator at its limit"
    yield "torque_limited.first_joint", name, "", "joint whose actuator was at its limit first"


def _profile(run: Recorded, q: Array, rate: Array, acceleration: Array, jerk: Array) -> Metrics:
    """Yield the number of commands that a profile refuses, and the condition that the first violates."""
    answer, first = Refused(), "the first command that the profile refuses"
    if run.profile:
        answer = refused(run.profile, run["time"], q, rate, acceleration, jerk)
    counted = "number of commands that the profile refuses; undefined without a profile"
    violated = f"condition that {first} violates: {', '.join(CONDITIONS)}"
    yield "profile.refused", answer.number, "1", counted
    yield "profile.first_time", answer.time, "s", f"when {first} was sent"
    yield "profile.first_joint", run.joints[answer.joint] if answer.condition else "", "", f"joint of {first}"
    yield "profile.first_condition", answer.condition, "", violated
    yield "profile.first_value", answer.value, "SI", f"value of {first}"
    yield "profile.first_bound", answer.bound, "SI", f"bound that {first} violates"


def _effort(run: Recorded) -> Metrics:
    """Yield how much was simulated, and how fast."""
    duration, wall = len(run) * run.period, run.wall_time
    yield "duration", duration, "s", "simulated time, one period per tick"
    yield "ticks", len(run), "1", "control ticks recorded"
    yield "completed", run.completed, "1", "completed fraction of the path; 1: all"
    yield "wall_time", wall, "s", "wall time of the stepping"
    yield "speed", duration / (wall or math.nan), "1", "simulated time over wall time"
