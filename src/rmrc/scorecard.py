"""The scorecard: what a run did, in figures, and what a scenario expects of them.

A figure has one flat name with dots, such as `joint_rate.peak` or `joint_rate.shoulder.peak`. Which
figures there are depends on the joints and the task axes alone, never on what happened: what a run
is too short to tell is NaN, or "" for a name. Equal columns give equal figures; only `wall_time`
and `speed` differ from one execution to the next.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rmrc.control.choices import Status
from rmrc.errors import ScenarioError, did_you_mean
from rmrc.run import COLUMNS, Run
from rmrc.scenario import Check, Scenario
from rmrc.spatial import AXES, pose_error

# How near the last wanted pose must be to the first to end where it began [m, rad]: above what a start is off
# that was rounded to 0.01 deg, and far below any path.
CLOSED = 1e-3

_Array = NDArray[np.float64]
_Figures = Iterator[tuple[str, "Figure"]]


@dataclass(frozen=True)
class Figure:
    """One figure of merit.

    Attributes:
        value: A number (NaN: undefined for this run), or the name of a joint.
        unit: SI, `1` for a plain number, "" for a name.
        meaning: In a few words.
    """

    value: float | str
    unit: str
    meaning: str


@dataclass(frozen=True, eq=False)
class Scorecard(Mapping[str, Figure]):
    """The figures of one run by name, in the order in which they are shown.

    Attributes:
        name: Of the scenario.
        joints: Names of the joints that figures are named after.
        figures: By flat name.
    """

    name: str
    joints: tuple[str, ...]
    figures: Mapping[str, Figure]

    def __getitem__(self, name: str) -> Figure:
        """Return a figure by its flat name."""
        return self.figures[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.figures)

    def __len__(self) -> int:
        """Return the number of figures."""
        return len(self.figures)

    def nested(self) -> dict[str, object]:
        """Return the values as dicts within dicts, ready for strict JSON.

        A name is split at its dots, except where what is before a dot is a figure itself (a joint
        may be called `peak`). JSON has neither NaN nor infinity: an undefined number or name
        becomes None, an infinite number the text "inf" or "-inf", which `float` reads.
        """
        tree: dict[str, object] = {}
        for name, figure in self.figures.items():
            branch, start, parts = tree, 0, name.split(".")
            for end in range(1, len(parts)):
                if ".".join(parts[:end]) not in self.figures:
                    key, start = ".".join(parts[start:end]), end
                    branch = branch.setdefault(key, {})  # type: ignore[assignment]
            branch[".".join(parts[start:])] = _json_value(figure.value)
        return tree


@dataclass(frozen=True)
class Outcome:
    """How one expectation was met.

    Attributes:
        name: Of the figure.
        value: Of the figure.
        wanted: In words, with the unit: `below 3 rad/s`.
        missed_by: Distance to the nearest value allowed: positive if the value is too high,
            negative if too low, 0 if it is allowed or exactly at a strict bound, NaN if undefined.
        ok: Whether the value is allowed; an undefined one never is.
    """

    name: str
    value: float
    wanted: str
    missed_by: float
    ok: bool

    def __str__(self) -> str:
        """Return one line: `joint_rate.peak: expected below 3 rad/s, got 3.21, 0.21 too high`."""
        text = f"{self.name}: expected {self.wanted}"
        if math.isnan(self.value):
            return f"{text}, but it is undefined for this run"
        text += f", got {self.value:.6g}"
        if self.ok:
            return text
        if self.missed_by == 0.0:
            return f"{text}, exactly the bound"
        return f"{text}, {abs(self.missed_by):.3g} too {'high' if self.missed_by > 0 else 'low'}"

    def facts(self) -> dict[str, object]:
        """Return the attributes and the line as a dict for strict JSON, as in `Scorecard.nested`."""
        values = {name: _json_value(value) for name, value in vars(self).items()}
        return {**values, "text": str(self)}


def scorecard(run: Run) -> Scorecard:
    """Return the figures of a run of any length, none included."""
    time = run["time"]
    rate_units = tuple(f"{run.joint_unit(j)}/s" for j in range(len(run.joints)))
    acceleration_units = tuple(f"{unit}²" for unit in rate_units)
    tau_units = tuple("N" if slides else "N·m" for slides in run.is_slide)
    # A difference belongs to the later of its two ticks: that is when it can first be seen.
    acceleration = np.diff(run["qdot"], axis=0) / run.period
    parts = (
        _joints(run, "joint_rate", "measured rate", run["qdot"], time, rate_units, is_rate=True),
        _joints(
            run, "joint_rate_cmd", "commanded rate", run["qdot_cmd"], time, rate_units, is_rate=True
        ),
        _joints(
            run, "joint_acceleration", "difference quotient of the measured rate",
            acceleration, time[1:], acceleration_units,
        ),
        _joints(run, "tau", "actuator torque or force", run["tau"], time, tau_units),
        _errors(run),
        _return(run),
        _singularity(run),
        _status_times(run),
        _effort(run),
    )  # fmt: skip
    figures = {name: figure for part in parts for name, figure in part}
    return Scorecard(run.name, run.joints, figures)


def figure_names(joints: Sequence[str], axes: Sequence[str]) -> list[str]:
    """Return the names of all figures of a run.

    Args:
        joints: Names of the joints.
        axes: Task axes that count.
    """
    return list(_blank(tuple(joints), tuple(axes)))


def refused(names: Iterable[str], joints: Sequence[str], axes: Sequence[str]) -> dict[str, str]:
    """Return why some figures cannot be expected, before anything moves.

    Args:
        names: Of figures, as a scenario's `expect` has them.
        joints: Names of the joints.
        axes: Task axes that count.

    Returns:
        For each name that is refused, in order, the reason; it follows the key in a message.
    """
    return _refused(names, _blank(tuple(joints), tuple(axes)))


def refuse_unknown(scenario: Scenario, joints: Sequence[str]) -> None:
    """Refuse a scenario that expects what its run will not have.

    Args:
        scenario: Its `expect` and task are looked at.
        joints: Names of the joints.

    Raises:
        ScenarioError: All names that are refused, each with its place in the scenario.
    """
    problems = refused(scenario.expect, joints, scenario.task.axes)
    if problems:
        raise ScenarioError([f"{scenario.locate(f'expect.{name}')}: {why}" for name, why in problems.items()])


def check(card: Scorecard, expect: Mapping[str, Check]) -> list[Outcome]:
    """Hold figures against what is expected of them.

    `below` and `above` are strict: the bound itself is a miss. `equals` allows `within` on both
    sides, the ends included. An undefined figure (NaN) meets nothing.

    Args:
        card: The figures.
        expect: Checks by name of figure.

    Returns:
        One outcome a check, in the order of `expect`.

    Raises:
        ScenarioError: Names that are no figures of this run, or not numbers; all of them.
    """
    problems = _refused(expect, card)
    if problems:
        raise ScenarioError([f"expect.{name}: {why}" for name, why in problems.items()])
    return [_outcome(name, card[name], one) for name, one in expect.items()]


def joint_changes(run: Run) -> _Array:
    """Return how far each joint is from where it started, after a path that ends where it began.

    Revolute joints by the shortest angle, so that a full turn is no change.

    Args:
        run: Complete, and its reference closed: the controlled rows of the last pose equal the first.

    Returns:
        Magnitudes, (n,) [rad or m]; NaN for a run that is not so.
    """
    q, pose_ref = run["q"], run["pose_ref"]
    if not (len(run) and run.is_complete):
        return np.full(len(run.joints), math.nan)
    gap = pose_error(pose_ref[-1], pose_ref[0]) * [axis in run.axes for axis in AXES]
    if not np.abs(gap).max() <= CLOSED:
        return np.full(len(run.joints), math.nan)
    change = q[-1] - q[0]
    shortest = (change + math.pi) % (2.0 * math.pi) - math.pi
    changes: _Array = np.abs(np.where(run.is_slide, change, shortest))
    return changes


# Figures ----------------------------------------------------------------------------------------


def _joints(
    run: Run,
    group: str,
    what: str,
    values: _Array,
    time: _Array,
    units: tuple[str, ...],
    *,
    is_rate: bool = False,
) -> _Figures:
    """Yield the largest magnitude of all joints, when and where it was, and that of each joint.

    Rates also have an rms over time; that of all joints is the largest of the joints' own.
    """
    size = np.abs(values)
    peaks = [_extreme(size[:, j], time) for j in range(len(run.joints))]
    rms = [_rms(size[:, j]) for j in range(len(run.joints))]
    fastest = int(np.argmax([peak for peak, _ in peaks]))
    (largest, when), joint = peaks[fastest], run.joints[fastest] if len(size) else ""
    unit = " or ".join(dict.fromkeys(units))  # where some slide, it is that of the joint
    yield f"{group}.peak", Figure(largest, unit, f"largest {what}, of all joints and ticks")
    yield f"{group}.peak_time", Figure(when, "s", f"when the largest {what} was reached first")
    yield f"{group}.peak_joint", Figure(joint, "", f"which joint had the largest {what}")
    if is_rate:
        yield f"{group}.rms", Figure(max(rms), unit, f"largest of the joints' rms {what}")
    for j, (name, unit) in enumerate(zip(run.joints, units, strict=True)):
        largest, when = peaks[j]
        yield f"{group}.{name}.peak", Figure(largest, unit, f"largest {what} of {name}")
        if is_rate:
            yield f"{group}.{name}.peak_time", Figure(when, "s", f"when {name} was fastest first")
            yield f"{group}.{name}.rms", Figure(rms[j], unit, f"{what} of {name}, rms over time")


def _errors(run: Run) -> _Figures:
    """Yield the position and orientation errors, and the task error along and across u_min.

    The task error has the controlled rows only, angles times L. It is split at each tick by that
    tick's u_min, the direction that the arm is losing: along it |u·e|, across it ‖e − u (u·e)‖.
    With task weights, u_min is a direction of the weighted rows.
    """
    e = run["pose_error"] * [axis in run.axes for axis in AXES]
    if set(run.axes) & set(AXES[:3]):
        yield from _error(run, "position_error", "m", "distance to the wanted position", e[:, :3])
    if set(run.axes) & set(AXES[3:]):
        what = "angle to the wanted orientation"
        yield from _error(run, "orientation_error", "rad", what, e[:, 3:])
    e = e * np.repeat([1.0, run.length], 3)
    u = run["u_min"]
    along = np.sum(u * e, axis=1, keepdims=True)
    what = "task error (angles times L)"
    yield from _error(run, "error_along", "m", f"{what} along u_min", along)
    yield from _error(run, "error_across", "m", f"{what} across u_min", e - u * along)
    second = run["secondary_error"][:, None]
    yield from _error(run, "secondary_error", "m, rad", "error of the second task", second)


def _error(run: Run, group: str, unit: str, what: str, e: _Array) -> _Figures:
    size = np.linalg.norm(e, axis=1)
    largest, when = _extreme(size, run["time"])
    end = float(size[-1]) if len(size) else math.nan
    yield f"{group}.rms", Figure(_rms(size), unit, f"{what}, rms over time")
    yield f"{group}.max", Figure(largest, unit, f"{what}, largest")
    yield f"{group}.max_time", Figure(when, "s", f"{what}, when it was largest first")
    yield f"{group}.end", Figure(end, unit, f"{what}, at the last tick")


def _return(run: Run) -> _Figures:
    """Yield how far the joints are from the start, where the path leads back to it."""
    changes = joint_changes(run)
    largest, joint = float(changes.max()), run.joints[int(np.argmax(changes))]
    unit = " or ".join(dict.fromkeys(run.joint_unit(j) for j in range(len(run.joints))))
    what = "from the first tick to the last, of a path that ends where it began"
    yield "return.joint_change", Figure(largest, unit, f"largest change of a joint {what}")
    name = "" if math.isnan(largest) else joint
    yield "return.change_joint", Figure(name, "", f"which joint changed most {what}")


def _singularity(run: Run) -> _Figures:
    time = run["time"]
    sigma, when = _extreme(run["sigma"][:, -1], time, np.argmin)
    yield "sigma.min", Figure(sigma, "1", "smallest singular value of the run")
    yield "sigma.min_time", Figure(when, "s", "when the smallest singular value was reached first")
    condition, _ = _extreme(run["condition"], time)
    yield "condition.max", Figure(condition, "1", "largest κ = σ₁/σ_k")
    manipulability, _ = _extreme(run["manipulability"], time, np.argmin)
    yield "manipulability.min", Figure(manipulability, "1", "smallest w = ∏σ")
    damping, _ = _extreme(run["damping"], time)
    yield "damping.max", Figure(damping, "1", "largest λ")
    pace, _ = _extreme(run["path_rate"], time, np.argmin)
    yield "path_rate.min", Figure(pace, "1", "smallest pace along the path")
    left, _ = _extreme(run["secondary_sigma"], time, np.argmin)
    yield "secondary_sigma.min", Figure(left, "1", "least that the first task left to the second")


def _status_times(run: Run) -> _Figures:
    status = run["status"].astype(np.int64)
    for one in (Status.OK, *Status):
        ticks = np.count_nonzero(status & one if one else status == 0)
        what = f"time with status {one.name}" if one else "time with no status at all"
        yield f"status_time.{one.name}", Figure(float(ticks) * run.period, "s", what)


def _effort(run: Run) -> _Figures:
    duration = len(run) * run.period
    completed = run.completed if run.planned else math.nan
    speed = duration / run.wall_time if run.wall_time > 0.0 else math.nan
    yield "duration", Figure(duration, "s", "simulated time, one period a tick")
    yield "ticks", Figure(len(run), "1", "control ticks recorded")
    yield "completed", Figure(completed, "1", "share of the path that was run; 1: all")
    yield "wall_time", Figure(run.wall_time, "s", "time that the stepping took")
    yield "speed", Figure(speed, "1", "simulated time over wall time")


def _extreme(
    values: _Array, time: _Array, where: Callable[[_Array], np.intp] = np.argmax
) -> tuple[float, float]:
    """Return the first extreme value and its time; NaN for no ticks."""
    if not len(values):
        return math.nan, math.nan
    i = where(values)
    return float(values[i]), float(time[i])


def _rms(values: _Array) -> float:
    return math.sqrt(np.mean(np.square(values))) if len(values) else math.nan


# Expectations -----------------------------------------------------------------------------------


@lru_cache(maxsize=16)  # asked for each of thousands of variants
def _blank(joints: tuple[str, ...], axes: tuple[str, ...]) -> Scorecard:
    """Return the scorecard of a run without ticks: all its figures, none of its values."""
    width = {"n": len(joints), "k": min(len(joints), len(axes)), "6": 6, "7": 7}
    columns = {
        name: np.empty((0, width[column.width]) if column.width else 0) for name, column in COLUMNS.items()
    }
    slides = (False,) * len(joints)
    return scorecard(Run("", joints, slides, axes, 1.0, 1.0, columns, 0))


# The number that belongs to a name, where it is not called alike.
_NUMBERS = {"return.change_joint": "return.joint_change"}


def _refused(names: Iterable[str], card: Scorecard) -> dict[str, str]:
    reasons = {}
    for name in names:
        if name not in card:
            reasons[name] = _unknown(name, card)
        elif isinstance(card[name].value, str):
            number = _NUMBERS.get(name, name.removesuffix("_joint"))
            reasons[name] = f"names a joint, and only numbers can be expected, such as {number}"
    return reasons


def _unknown(name: str, card: Scorecard) -> str:
    """Return why there is no such figure, and the way out."""
    group, _, rest = name.partition(".")
    for rows, error in ((AXES[:3], "position_error"), (AXES[3:], "orientation_error")):
        if group == error and f"error_along.{rest}" in card:
            return f"needs one of {', '.join(rows)} in task.axes"
    groups = ", ".join(dict.fromkeys(known.partition(".")[0] for known in card))
    return "no such figure" + (did_you_mean(name, card) or f"; figures begin with {groups}")


def _outcome(name: str, figure: Figure, wanted: Check) -> Outcome:
    value = float(figure.value)
    words, misses = [], []
    # `not value < bound` instead of `value >= bound`: NaN must miss.
    if wanted.above is not None:
        words.append(f"above {wanted.above:.12g}")
        if not value > wanted.above:
            misses.append(value - wanted.above)
    if wanted.below is not None:
        words.append(f"below {wanted.below:.12g}")
        if not value < wanted.below:
            misses.append(value - wanted.below)
    if wanted.equals is not None and wanted.within is not None:
        words.append(f"{wanted.equals:.12g} within {wanted.within:.12g}")
        off = value - wanted.equals
        if not abs(off) <= wanted.within:
            misses.append(off - math.copysign(wanted.within, off))
    text = " and ".join(words) + ("" if figure.unit == "1" else f" {figure.unit}")
    return Outcome(name, value, text, max(misses, key=abs, default=0.0), not misses)


def _json_value(value: float | str) -> float | str | None:
    if isinstance(value, str):
        return value or None
    if math.isnan(value):
        return None
    return str(value) if math.isinf(value) else value
