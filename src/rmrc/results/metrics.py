"""The metrics of a run, each declared once: name, value, unit and meaning, in the order of display.

Each is computed by numpy from the whole columns of the run. Their names depend on the joints and the task axes
alone, never on the events of the run: a metric that a run is too short to determine is NaN, or "" for a name.
So a run without ticks has all names. Arrays are (joints, ticks), each row contiguous over time.
"""

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.results.columns import Recorded
from rmrc.results.events import CHATTER_FLOOR, CONDITIONS, Violation, chatter, refused, stretches
from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.support.spatial import AXES

Array: TypeAlias = NDArray[np.float64]
# Name, value, unit and meaning of each metric.
Metrics: TypeAlias = Iterator[tuple[str, float | str, str, str]]

# A path is closed if its last wanted pose is this near to the first [m, rad]: above the error of a start that
# was rounded to 0.01 deg, and far below any path.
CLOSED = 1e-3
# The lost direction has no linear or no angular part where that part of u_min is smaller: it is rounding.
NO_PART = 1e-9


def metrics(run: Recorded) -> Metrics:
    """Yield the metrics of a run of any length, even 0."""
    q, qdot, qdot_cmd, qdot_plain, tau, gravity = (
        np.ascontiguousarray(run[name].T)
        for name in ("q", "qdot", "qdot_cmd", "qdot_plain", "tau", "tau_gravity")
    )
    # difference quotients, each at the later of its ticks; commands begin at rest
    acceleration = np.diff(qdot) / run.period
    acceleration_cmd = np.diff(qdot_cmd, prepend=0.0) / run.period
    jerk_cmd = np.diff(acceleration_cmd, prepend=0.0) / run.period
    status = run.columns["status"].astype(np.int64)

    measured, quotient = (f"difference quotient of the {of} rate" for of in ("measured", "commanded"))
    force, total = "actuator torque or force", "torque or force with that of gravity compensation"
    yield from _joints(run, "joint_rate", "measured rate", qdot, "/s", "rms times")
    yield from _joints(run, "joint_rate_cmd", "commanded rate", qdot_cmd, "/s", "rms times")
    yield from _joints(run, "joint_rate_plain", "rate of the plain inverse", qdot_plain, "/s")
    yield from _joints(run, "joint_acceleration", measured, acceleration, "/s²", "each")
    yield from _joints(run, "joint_acceleration_cmd", quotient, acceleration_cmd, "/s²", "rms")
    yield from _joints(run, "joint_jerk_cmd", f"second {quotient}", jerk_cmd, "/s³")
    yield from _chatter(run, acceleration_cmd)
    yield from _joints(run, "tau", force, tau, "", "each share")
    yield from _joints(run, "tau_total", total, tau + gravity, "", "share")
    yield from _errors(run)
    yield from _return(run)
    yield from _singularity(run)
    yield from _statuses(run, status)
    yield from _loads(run, status, tau)
    yield from _profile(run, q, qdot_cmd, acceleration_cmd, jerk_cmd)
    yield from _effort(run)


def peaks(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the largest values (c,) of some quantities, and when each was first reached (c,) [s].

    NaN is above all numbers; its time is NaN. Both are NaN without ticks.

    Args:
        time: Time of each tick [s], (T,).
        values: The quantities at these ticks, or at the last of them, (c, T).
    """
    count, ticks = values.shape
    if not ticks:
        return np.full(count, math.nan), np.full(count, math.nan)
    first = values.argmax(axis=1)
    peak = values[np.arange(count), first]
    return peak, np.where(np.isnan(peak), math.nan, time[first - ticks])


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
    n = len(run.joints)
    units = [f"{run.joint_unit(j)}{per}" if per else ("N·m", "N")[run.is_slide[j]] for j in range(n)]
    unit = " or ".join(dict.fromkeys(units))
    each, times = peaks(run["time"], np.abs(values))
    peak, time, name = _largest(run, each, times)
    yield f"{group}.peak", peak, unit, f"largest {what}, of all joints and ticks"
    yield f"{group}.peak_time", time, "s", f"when the largest {what} was reached first"
    yield f"{group}.peak_joint", name, "", f"joint with the largest {what}"
    rms = _rms(values) if "rms" in more else each
    if "rms" in more:
        yield f"{group}.rms", float(rms.max()), unit, f"largest of the joints' rms {what}"
    for j, name in enumerate(run.joints if "each" in more or "times" in more else ()):
        yield f"{group}.{name}.peak", float(each[j]), units[j], f"largest {what} of {name}"
        if "times" in more:
            yield f"{group}.{name}.peak_time", float(times[j]), "s", f"when {name} was fastest first"
            yield f"{group}.{name}.rms", float(rms[j]), units[j], f"{what} of {name}, rms over time"
    if "share" in more:
        limit = np.array(run.torque_limit or (math.inf,) * n)
        shares = (each / limit)[np.isfinite(limit) & (limit > 0.0)]
        meaning = f"largest {what} as a share of its joint's limit; undefined without a limit"
        yield f"{group}.share_of_limit", float(shares.max()) if len(shares) else math.nan, "1", meaning


def _largest(run: Recorded, each: Array, times: Array) -> tuple[float, float, str]:
    """Return the largest value of all joints, its time, and the name of its joint."""
    j = int(each.argmax())
    return float(each[j]), float(times[j]), "" if math.isnan(each[j]) else run.joints[j]


def _rms(values: Array) -> Array:
    """Return the root of the mean square over the ticks, of (c, T)."""
    return np.asarray(np.sqrt(np.einsum("ct,ct->c", values, values) / (values.shape[1] or math.nan)))


def _chatter(run: Recorded, acceleration: Array) -> Metrics:
    """Yield the rate of quick sign changes of the commanded acceleration, (n, T)."""
    floor = np.array(run.chatter_floor or (CHATTER_FLOOR,) * len(run.joints))
    counts = chatter(acceleration, floor, run.period)
    joint = int(counts.argmax())
    rate = int(counts[joint]) / (len(run) * run.period) if len(run) else math.nan
    what = "sign changes of the commanded acceleration per second, counting those in quick succession"
    yield "chatter", rate, "1/s", f"{what}; of the joint with the most"
    yield "chatter_joint", run.joints[joint] if counts[joint] else "", "", "joint with the most chatter"


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
    change, _, name = _largest(run, changes, changes)
    unit = " or ".join(dict.fromkeys(run.joint_unit(j) for j in range(len(run.joints))))
    what = "from the first tick to the last, of a closed path"
    yield "return.joint_change", change, unit, f"largest change of a joint {what}"
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
            size, *sides = _split(errors[rows], scale[rows, None] * u[rows], _norm(u[rows]))
            groups.append((name, unit, what, size))
            for side, values in zip(("along", "across"), sides, strict=True):
                meaning = f"{name.replace('_', ' ')} {side} the {half} part of the lost direction"
                parts.append((f"{name}_{side}", unit, meaning, values))
    groups += [
        *parts,
        ("secondary_error", "m, rad", "error of the second task", np.abs(run["secondary_error"])),
    ]
    values = np.vstack([values for *_, values in groups])
    (peak, times), rms = peaks(run["time"], values), _rms(values)
    for i, (group, unit, what, _) in enumerate(groups):
        yield f"{group}.rms", float(rms[i]), unit, f"{what}, rms over time"
        yield f"{group}.max", float(peak[i]), unit, f"{what}, largest"
        yield f"{group}.max_time", float(times[i]), "s", f"{what}, when it was largest first"
        yield (
            f"{group}.end",
            float(values[i, -1]) if len(run) else math.nan,
            unit,
            f"{what}, at the last tick",
        )


def error_sizes(run: Recorded) -> tuple[Array, Array]:
    """Return the errors of positions and of orientations at each tick, of the controlled axes, (T,) each."""
    linear, angular = (
        [AXES.index(axis) for axis in run.axes if axis in some] for some in (AXES[:3], AXES[3:])
    )
    return _norm(run["pose_error"][:, linear].T), _norm(run["pose_error"][:, angular].T)


def _split(error: Array, lost: Array, share: Array) -> tuple[Array, Array, Array]:
    """Return the norm of an error, and of its parts along and across the direction that is lost, (T,) each.

    Args:
        error: Rows of one unit, (r, T).
        lost: The part of the lost direction in these rows, (r, T).
        share: Norm of this part of u_min, whose norm is 1, (T,).
    """
    size = _norm(error)
    direction = np.where(share > NO_PART, lost / _norm(lost), 0.0)
    along = np.einsum("rt,rt->t", direction, error)
    # rounding makes no part larger than the whole
    return size, np.minimum(np.abs(along), size), np.minimum(_norm(error - along * direction), size)


def _norm(rows: Array) -> Array:
    """Return the norms of vectors, (r, T)."""
    return np.asarray(np.sqrt(np.einsum("rt,rt->t", rows, rows)))


def _singularity(run: Recorded) -> Metrics:
    """Yield the extremes of the measures of singularity, of the pace, and of the second task."""
    smallest, time = _extreme(run, -run["sigma"][:, -1])
    yield "sigma.min", -smallest, "1", "smallest singular value of the run"
    yield "sigma.min_time", time, "s", "when the smallest singular value was reached first"
    yield "condition.max", _extreme(run, run["condition"])[0], "1", "largest κ = σ₁/σ_k"
    yield "manipulability.min", -_extreme(run, -run["manipulability"])[0], "1", "smallest w = ∏σ"
    yield "damping.max", _extreme(run, run["damping"])[0], "1", "largest λ"
    yield "path_rate.min", -_extreme(run, -run["path_rate"])[0], "1", "smallest pace along the path"
    smallest = -_extreme(run, -run["secondary_sigma"])[0]
    yield "secondary_sigma.min", smallest, "1", "smallest singular value left to the second task"


def _extreme(run: Recorded, values: Array) -> tuple[float, float]:
    """Return the largest of some values, (T,), and its first time."""
    peak, time = peaks(run["time"], values[None])
    return float(peak[0]), float(time[0])


# Events -----------------------------------------------------------------------------------------


def _statuses(run: Recorded, status: NDArray[np.int64]) -> Metrics:
    """Yield the duration of each status, and the longest standstill."""
    counts = np.count_nonzero(status & np.array(IN_RUNS)[:, None], axis=1).tolist()
    without = len(run) - int(np.count_nonzero(status))
    yield "status_time.OK", without * run.period, "s", "time without any status"
    for one, count in zip(IN_RUNS, counts, strict=True):
        yield f"status_time.{one.name}", count * run.period, "s", f"time with status {one.name}"
    is_stuck = (status & Status.STUCK) != 0
    longest, time = 0, math.nan
    for first, end in stretches(is_stuck).tolist():
        if end - first > longest:
            longest, time = end - first, float(run["time"][first])
    share = int(np.count_nonzero(is_stuck)) / (len(run) or math.nan)
    yield "stuck.longest", longest * run.period, "s", "longest time stuck without interruption"
    yield "stuck.longest_time", time, "s", "when that began"
    yield "stuck.share", share, "1", "fraction of the ticks in which it is stuck"


def _loads(run: Recorded, status: NDArray[np.int64], tau: Array) -> Metrics:
    """Yield duration and start of contacts and of actuators at their limit, and the slip of followers."""
    seconds, first = _duration(run, (status & Status.CONTACT) != 0)
    yield "contact.time", seconds, "s", "time in contact"
    yield "contact.first_time", first, "s", "time of the first contact"
    yield "contact.first_bodies", " – ".join(run.touching), "", "bodies of the first contact"
    slip, time = _extreme(run, run["slip"])
    yield "slip.max", slip, "rad or m", "largest distance of a follower from its equality; undefined without"
    yield "slip.max_time", time, "s", "when the largest slip was reached first"
    is_limited = (status & Status.TORQUE_LIMITED) != 0
    seconds, first = _duration(run, is_limited)
    limit = np.array(run.torque_limit or (math.inf,) * len(run.joints))
    shares = np.nan_to_num(np.abs(tau[:, is_limited]) / limit[:, None])
    ticks = np.flatnonzero(shares.any(axis=0))
    joint = run.joints[shares[:, ticks[0]].argmax()] if len(ticks) else ""
    yield "torque_limited.time", seconds, "s", "time with an actuator at its limit"
    yield "torque_limited.first_time", first, "s", "first time with an actuator at its limit"
    yield "torque_limited.first_joint", joint, "", "joint whose actuator was at its limit first"


def _duration(run: Recorded, holds: NDArray[np.bool_]) -> tuple[float, float]:
    """Return how long something holds, and when first (NaN: never) [s]."""
    ticks = np.flatnonzero(holds)
    return len(ticks) * run.period, float(run["time"][ticks[0]]) if len(ticks) else math.nan


def _profile(run: Recorded, q: Array, rate: Array, acceleration: Array, jerk: Array) -> Metrics:
    """Yield the number of commands that a profile refuses, and the condition that the first violates."""
    count, violation = math.nan, Violation()
    if run.profile:
        count, violation = refused(run.profile, q, rate, acceleration, jerk)
    counted = "number of commands that the profile refuses; undefined without a profile"
    first = "the first command that the profile refuses"
    joint, time = ("", math.nan) if violation.tick < 0 else (
        run.joints[violation.joint], float(run["time"][violation.tick])
    )  # fmt: skip
    yield "profile.refused", float(count), "1", counted
    yield "profile.first_time", time, "s", f"when {first} was sent"
    yield "profile.first_joint", joint, "", f"joint of {first}"
    violated = f"condition that {first} violates: {', '.join(CONDITIONS)}"
    yield "profile.first_condition", violation.condition, "", violated
    yield "profile.first_value", violation.value, "SI", f"value of {first}"
    yield "profile.first_bound", violation.bound, "SI", f"bound that {first} violates"


def _effort(run: Recorded) -> Metrics:
    """Yield how much was simulated, and how fast."""
    duration, wall = len(run) * run.period, run.wall_time
    completed = run.completed if len(run) or run.planned else math.nan
    yield "duration", duration, "s", "simulated time, one period per tick"
    yield "ticks", len(run), "1", "control ticks recorded"
    yield "completed", completed, "1", "completed fraction of the path; 1: all"
    yield "wall_time", wall, "s", "wall time of the stepping"
    yield "speed", duration / wall if wall > 0.0 else math.nan, "1", "simulated time over wall time"
