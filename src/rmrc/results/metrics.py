"""The metrics of a run, each declared once: name, value, unit and meaning, in the order of display.

The set of metrics depends on the joints and the task axes alone, never on the events of the run: a metric
that a run is too short to determine is NaN, or "" for a name.
"""

import math
from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.results.columns import Recorded
from rmrc.results.events import CONDITIONS
from rmrc.results.tally import Tally
from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.support.spatial import AXES

# A path is closed if its last wanted pose is this near to the first [m, rad]: above the error of a start that
# was rounded to 0.01 deg, and far below any path.
CLOSED = 1e-3

# Name, value, unit and meaning of each metric.
Metrics: TypeAlias = Iterator[tuple[str, float | str, str, str]]


def metrics(run: Recorded, tally: Tally) -> Metrics:
    """Yield the metrics of a run.

    Args:
        run: The facts about it; its columns are not read.
        tally: With its ticks added.
    """
    rates, accelerations, jerks = (
        [f"{run.joint_unit(j)}{per}" for j in range(len(run.joints))] for per in ("/s", "/s²", "/s³")
    )
    torques = ["N" if slides else "N·m" for slides in run.is_slide]
    quotient, force = "difference quotient of the commanded rate", "actuator torque or force"
    total = "torque or force with that of gravity compensation"
    for group, what in (("joint_rate", "measured rate"), ("joint_rate_cmd", "commanded rate")):
        yield from _peak(run, tally, group, what, rates)
        yield from _rms(tally, group, what, rates)
        yield from _each_rate(run, tally, group, what, rates)
    yield from _peak(run, tally, "joint_rate_plain", "rate of the plain inverse", rates)
    measured = "difference quotient of the measured rate"
    yield from _peak(run, tally, "joint_acceleration", measured, accelerations)
    yield from _each_peak(run, tally, "joint_acceleration", measured, accelerations)
    yield from _peak(run, tally, "joint_acceleration_cmd", quotient, accelerations)
    yield from _rms(tally, "joint_acceleration_cmd", quotient, accelerations)
    yield from _peak(run, tally, "joint_jerk_cmd", f"second {quotient}", jerks)
    yield from _chatter(run, tally)
    yield from _peak(run, tally, "tau", force, torques)
    yield from _each_peak(run, tally, "tau", force, torques)
    yield from _share(run, tally, "tau", force)
    yield from _peak(run, tally, "tau_total", total, torques)
    yield from _share(run, tally, "tau_total", total)
    yield from _errors(run, tally)
    yield from _return(run, tally)
    yield from _singularity(tally)
    yield from _statuses(run, tally)
    yield from _loads(run, tally)
    yield from _profile(run, tally)
    yield from _effort(run, tally)


def joint_changes(run: Recorded) -> NDArray[np.float64]:
    """Return how far each joint is from its start, after a path that ends where it began.

    Revolute joints by the shortest angle, so that a full turn is no change.

    Args:
        run: A complete run with a closed reference: the controlled rows of the last pose equal the first.

    Returns:
        Magnitudes, (n,) [rad or m]; NaN for any other run.
    """
    if not len(run):
        return np.full(len(run.joints), math.nan)
    return _changes(run, run.is_complete, run["q"][[0, -1]], run["pose_ref"][[0, -1]])


def _changes(
    run: Recorded, is_complete: bool, q: NDArray[np.float64], pose_ref: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return `joint_changes` from the first and the last row of both columns, (2, …)."""
    if is_complete:
        gap = run.view.error(pose_ref[1], pose_ref[0])[[AXES.index(axis) for axis in run.axes]]
        if np.abs(gap).max() <= CLOSED:
            change = q[1] - q[0]
            shortest = (change + math.pi) % (2.0 * math.pi) - math.pi
            return np.asarray(np.abs(np.where(run.is_slide, change, shortest)))
    return np.full(len(run.joints), math.nan)


# Joints -----------------------------------------------------------------------------------------


def _peak(run: Recorded, tally: Tally, group: str, what: str, units: Sequence[str]) -> Metrics:
    """Yield the largest magnitude of all joints, its time and its joint."""
    peak = tally.peak(group)
    joint = int(peak.value.argmax())
    time = float(peak.time[joint])
    yield f"{group}.peak", float(peak.value[joint]), _any(units), f"largest {what}, of all joints and ticks"
    yield f"{group}.peak_time", time, "s", f"when the largest {what} was reached first"
    name = "" if math.isnan(time) else run.joints[joint]
    yield f"{group}.peak_joint", name, "", f"joint with the largest {what}"


def _rms(tally: Tally, group: str, what: str, units: Sequence[str]) -> Metrics:
    """Yield the largest of the joints' rms over time."""
    yield f"{group}.rms", float(tally.rms(group).max()), _any(units), f"largest of the joints' rms {what}"


def _each_peak(run: Recorded, tally: Tally, group: str, what: str, units: Sequence[str]) -> Metrics:
    """Yield the largest magnitude of each joint."""
    for name, peak, unit in zip(run.joints, tally.peak(group).value.tolist(), units, strict=True):
        yield f"{group}.{name}.peak", peak, unit, f"largest {what} of {name}"


def _each_rate(run: Recorded, tally: Tally, group: str, what: str, units: Sequence[str]) -> Metrics:
    """Yield the largest magnitude of each joint, its time, and the rms over time."""
    peak = tally.peak(group)
    values, times, rms = peak.value.tolist(), peak.time.tolist(), tally.rms(group).tolist()
    for j, (name, unit) in enumerate(zip(run.joints, units, strict=True)):
        yield f"{group}.{name}.peak", values[j], unit, f"largest {what} of {name}"
        yield f"{group}.{name}.peak_time", times[j], "s", f"when {name} was fastest first"
        yield f"{group}.{name}.rms", rms[j], unit, f"{what} of {name}, rms over time"


def _any(units: Sequence[str]) -> str:
    """Return the unit of a value of any joint."""
    return " or ".join(dict.fromkeys(units))


def _chatter(run: Recorded, tally: Tally) -> Metrics:
    """Yield the rate of quick sign changes of the commanded acceleration."""
    joint = int(tally.chatter.count.argmax())
    count = int(tally.chatter.count[joint])
    rate = count / (tally.ticks * run.period) if tally.ticks else math.nan
    what = "sign changes of the commanded acceleration per second, counting those in quick succession"
    yield "chatter", rate, "1/s", f"{what}; of the joint with the most"
    yield "chatter_joint", run.joints[joint] if count else "", "", "joint with the most chatter"


def _share(run: Recorded, tally: Tally, group: str, what: str) -> Metrics:
    """Yield the largest share of its limit that a joint's torque took."""
    limits = np.array(run.torque_limit or (math.inf,) * len(run.joints))
    is_limited = np.isfinite(limits) & (limits > 0.0)
    shares = tally.peak(group).value[is_limited] / limits[is_limited]
    meaning = f"largest {what} as a share of its joint's limit; undefined without a limit"
    yield f"{group}.share_of_limit", float(shares.max()) if len(shares) else math.nan, "1", meaning


def _return(run: Recorded, tally: Tally) -> Metrics:
    """Yield the distance of the joints from the start, if the path leads back to it."""
    changes = _changes(run, _completed(run, tally) == 1.0, tally.q, tally.pose_ref)
    joint = int(changes.argmax())
    change = float(changes[joint])
    unit = _any([run.joint_unit(j) for j in range(len(run.joints))])
    what = "from the first tick to the last, of a closed path"
    yield "return.joint_change", change, unit, f"largest change of a joint {what}"
    name = "" if math.isnan(change) else run.joints[joint]
    yield "return.change_joint", name, "", f"joint with the largest change {what}"


# Task -------------------------------------------------------------------------------------------


def _errors(run: Recorded, tally: Tally) -> Metrics:
    """Yield the errors of positions and orientations, with their parts; of a second task."""
    errors, half = [], {"m": "linear", "rad": "angular"}
    if set(run.axes) & set(AXES[:3]):
        errors.append(("position_error", "m", "distance to the reference position"))
    if set(run.axes) & set(AXES[3:]):
        errors.append(("orientation_error", "rad", "angle to the reference orientation"))
    errors += [
        (
            f"{group}_{side}", unit,
            f"{group.replace('_', ' ')} {side} the {half[unit]} part of the lost direction",
        )
        for group, unit, _ in errors
        for side in ("along", "across")
    ]  # fmt: skip
    errors.append(("secondary_error", "m, rad", "error of the second task"))
    for group, unit, what in errors:
        peak = tally.peak(group)
        yield f"{group}.rms", float(tally.rms(group)[0]), unit, f"{what}, rms over time"
        yield f"{group}.max", float(peak.value[0]), unit, f"{what}, largest"
        yield f"{group}.max_time", float(peak.time[0]), "s", f"{what}, when it was largest first"
        yield f"{group}.end", tally.last(group), unit, f"{what}, at the last tick"


def _singularity(tally: Tally) -> Metrics:
    sigma, time = tally.extreme("sigma")
    yield "sigma.min", sigma, "1", "smallest singular value of the run"
    yield "sigma.min_time", time, "s", "when the smallest singular value was reached first"
    for name, meaning in (
        ("condition.max", "largest κ = σ₁/σ_k"),
        ("manipulability.min", "smallest w = ∏σ"),
        ("damping.max", "largest λ"),
        ("path_rate.min", "smallest pace along the path"),
        ("secondary_sigma.min", "smallest singular value left to the second task"),
    ):
        yield name, tally.extreme(name.partition(".")[0])[0], "1", meaning


# Events -----------------------------------------------------------------------------------------


def _statuses(run: Recorded, tally: Tally) -> Metrics:
    for status in (Status.OK, *IN_RUNS):
        what = f"time with status {status.name}" if status else "time without any status"
        yield f"status_time.{status.name}", tally.statuses.count(status) * run.period, "s", what
    standstill = tally.standstill
    share = tally.statuses.count(Status.STUCK) / (tally.ticks or math.nan)
    yield "stuck.longest", standstill.longest * run.period, "s", "longest time stuck without interruption"
    yield "stuck.longest_time", standstill.time, "s", "when that began"
    yield "stuck.share", share, "1", "fraction of the ticks in which it is stuck"


def _loads(run: Recorded, tally: Tally) -> Metrics:
    """Yield duration and start of contacts and of actuators at their limit, and the slip of followers."""
    contact, limited = Status.CONTACT, Status.TORQUE_LIMITED
    yield "contact.time", tally.statuses.count(contact) * run.period, "s", "time in contact"
    yield "contact.first_time", tally.statuses.first_time(contact), "s", "time of the first contact"
    yield "contact.first_bodies", " – ".join(run.touching), "", "bodies of the first contact"
    slip, time = tally.extreme("slip")
    yield "slip.max", slip, "rad or m", "largest distance of a follower from its equality; undefined without"
    yield "slip.max_time", time, "s", "when the largest slip was reached first"
    seconds, first = tally.statuses.count(limited) * run.period, tally.statuses.first_time(limited)
    joint = run.joints[tally.limited] if tally.limited >= 0 else ""
    yield "torque_limited.time", seconds, "s", "time with an actuator at its limit"
    yield "torque_limited.first_time", first, "s", "first time with an actuator at its limit"
    yield "torque_limited.first_joint", joint, "", "joint whose actuator was at its limit first"


def _profile(run: Recorded, tally: Tally) -> Metrics:
    """Yield the number of commands that a profile refuses, and the condition that the first violates."""
    violation = tally.conditions.first
    counted = "number of commands that the profile refuses; undefined without a profile"
    first = "the first command that the profile refuses"
    violated = f"condition that {first} violates: {', '.join(CONDITIONS)}"
    joint = run.joints[violation.joint] if violation.joint >= 0 else ""
    yield "profile.refused", tally.conditions.refused, "1", counted
    yield "profile.first_time", violation.time, "s", f"when {first} was sent"
    yield "profile.first_joint", joint, "", f"joint of {first}"
    yield "profile.first_condition", violation.condition, "", violated
    yield "profile.first_value", violation.value, "SI", f"value of {first}"
    yield "profile.first_bound", violation.bound, "SI", f"bound that {first} violates"


def _effort(run: Recorded, tally: Tally) -> Metrics:
    duration, wall = tally.ticks * run.period, run.wall_time
    yield "duration", duration, "s", "simulated time, one period per tick"
    yield "ticks", tally.ticks, "1", "control ticks recorded"
    yield "completed", _completed(run, tally), "1", "completed fraction of the path; 1: all"
    yield "wall_time", wall, "s", "wall time of the stepping"
    yield "speed", duration / wall if wall > 0.0 else math.nan, "1", "simulated time over wall time"


def _completed(run: Recorded, tally: Tally) -> float:
    """Return the completed share of the path; NaN without a path."""
    if tally.ticks:
        return run.share(tally.path_time)
    return 0.0 if run.planned else math.nan
