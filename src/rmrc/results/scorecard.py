"""The scorecard: a run in metrics, and the expectations of a scenario about them.

A metric has one flat name with dots, such as `joint_rate.peak` or `joint_rate.shoulder.peak`. The set of
metrics depends on the joints and the task axes alone, never on the events of the run: a metric that a run is
too short to determine is NaN, or "" for a name. Equal ticks give equal metrics, whether their columns were
kept or not; only `wall_time` and `speed` differ from one execution to the next.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.law.record import tick_type
from rmrc.law.task import View
from rmrc.results import notebook
from rmrc.results.columns import COLUMNS, Recorded
from rmrc.results.tally import CONDITIONS, ERRORS, EXTREMES, JOINTS, adder, begin
from rmrc.scenario import Check, Scenario
from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.scenario.sections import PROFILE
from rmrc.support.brief import brief
from rmrc.support.errors import ScenarioError, did_you_mean
from rmrc.support.problems import Problem
from rmrc.support.spatial import AXES

# A path is closed if its last wanted pose is this near to the first [m, rad]: above the error of a start that
# was rounded to 0.01 deg, and far below any path.
CLOSED = 1e-3

# Ticks whose records are made at once: few enough for the processor's caches.
_ROWS = 256

_Array = NDArray[np.float64]
# Name, value in each world, unit and meaning of each metric.
_Figures = Iterator[tuple[str, Sequence[float | str], str, str]]


class Figure(NamedTuple):
    """One metric.

    Attributes:
        value: A number (NaN: undefined for this run), or the name of a joint.
        unit: SI, `1` for a plain number, "" for a name.
        meaning: A short description.
    """

    value: float | str
    unit: str
    meaning: str


@brief
@dataclass(frozen=True, eq=False)
class Scorecard(Mapping[str, Figure]):
    """The metrics of one run by name, in the order of display.

    Attributes:
        name: Name of the scenario.
        joints: Names of the joints in the names of metrics.
        figures: By flat name.
    """

    name: str
    joints: tuple[str, ...]
    figures: Mapping[str, Figure]

    def __getitem__(self, name: str) -> Figure:
        """Return a metric by its flat name."""
        return self.figures[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.figures)

    def __len__(self) -> int:
        """Return the number of metrics."""
        return len(self.figures)

    def to_pandas(self) -> Any:
        """Return the metrics as a DataFrame, one row each, with value, unit and meaning.

        Raises:
            QuestionError: pandas is not installed.
        """
        return notebook.pandas().DataFrame.from_dict(
            {name: figure._asdict() for name, figure in self.items()}, orient="index"
        )

    def _repr_html_(self) -> str:
        """Return the defined metrics, for a notebook."""
        return notebook.figures(self.name, self)

    def nested(self) -> dict[str, object]:
        """Return the values as dicts within dicts, ready for strict JSON.

        A name is split at its dots, except where the part before a dot is a metric itself (a joint
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
    """The outcome of one expectation.

    Attributes:
        name: Name of the metric.
        value: Value of the metric.
        wanted: In words, with the unit: `below 3 rad/s`.
        missed_by: Distance to the nearest value allowed: positive if the value is too high,
            negative if too low, 0 if it is allowed or exactly at a strict bound, NaN if undefined.
        ok: Whether the value is allowed; an undefined one never is.
        got: Description of an outcome that has no value; "": the value describes it.
    """

    name: str
    value: float
    wanted: str
    missed_by: float
    ok: bool
    got: str = ""

    def __str__(self) -> str:
        """Return one line: `joint_rate.peak: expected below 3 rad/s, got 3.21, 0.21 too high`."""
        text = f"{self.name}: expected {self.wanted}"
        if math.isnan(self.value):
            return f"{text}, but it is undefined for this run"
        if self.got:
            return f"{text}, got {self.got}"
        text += f", got {self.value:.6g}"
        if self.ok:
            return text
        if self.missed_by == 0.0:
            return f"{text}, exactly the bound"
        return f"{text}, {abs(self.missed_by):.3g} too {'high' if self.missed_by > 0 else 'low'}"

    def facts(self) -> dict[str, object]:
        """Return the attributes and the line as a dict for strict JSON, as in `Scorecard.nested`."""
        values = {name: _json_value(value) for name, value in vars(self).items() if name != "got"}
        return {**values, "text": str(self)}


def scorecard(run: Recorded) -> Scorecard:
    """Return the metrics of a run of any length, even 0.

    It adds up the columns as `rmrc.results.tally` adds up the ticks of a run without columns: both give the
    same bits.
    """
    tally = tallies_of([run])
    rows = np.zeros((1, _ROWS), tick_type(len(run.joints)))
    add = adder(tally, rows)
    for first in range(0, len(run), _ROWS):
        last = min(first + _ROWS, len(run))
        for name in filter(COLUMNS.__contains__, rows.dtype.names or ()):
            column = run[name][first:last]
            field = rows[name][0, : last - first]
            field[(..., slice(column.shape[1])) if column.ndim == 2 else ...] = column
        add(np.array([last]))
    return figures([run], tally)[0]


def tallies_of(runs: Sequence[Recorded]) -> NDArray[np.void]:
    """Return the tallies of runs of one arm before their first ticks, (w,).

    Args:
        runs: Their columns are not read.
    """
    return begin(
        len(runs[0].joints),
        [run.axes for run in runs],
        [run.length for run in runs],
        [run.weights for run in runs],
        [run.period for run in runs],
        [run.torque_limit for run in runs],
        [run.chatter_floor for run in runs],
        [run.profile for run in runs],
    )


def figures(runs: Sequence[Recorded], tallies: NDArray[np.void]) -> list[Scorecard]:
    """Return the metrics of tallies.

    Args:
        runs: Their facts, all of one arm; their columns are not read.
        tallies: With their ticks added, (w,).
    """
    alike: dict[tuple[tuple[str, ...], View], list[int]] = {}
    for w, run in enumerate(runs):
        alike.setdefault((run.axes, run.view), []).append(w)
    cards: dict[int, Scorecard] = {}
    for members in alike.values():
        cards |= zip(members, _figures([runs[w] for w in members], tallies[members]), strict=True)
    return [cards[w] for w in range(len(runs))]


def _figures(runs: Sequence[Recorded], tallies: NDArray[np.void]) -> list[Scorecard]:
    """Return the metrics of runs that have the same ones."""
    arm = runs[0]
    rate_units = tuple(f"{arm.joint_unit(j)}/s" for j in range(len(arm.joints)))
    acceleration_units = tuple(f"{unit}²" for unit in rate_units)
    quotient = "difference quotient of the commanded rate"
    jerk_units = tuple(f"{unit}³" for unit in rate_units)
    tau_units = tuple("N" if slides else "N·m" for slides in arm.is_slide)
    parts = (
        _joints(arm, tallies, "joint_rate", "measured rate", rate_units, is_rate=True),
        _joints(arm, tallies, "joint_rate_cmd", "commanded rate", rate_units, is_rate=True),
        _peak(
            arm, tallies, "joint_rate_plain", "rate of the plain inverse", rate_units
        ),
        _joints(
            arm, tallies, "joint_acceleration", "difference quotient of the measured rate", acceleration_units
        ),
        _peak(arm, tallies, "joint_acceleration_cmd", quotient, acceleration_units),
        _largest_rms(tallies, "joint_acceleration_cmd", quotient, acceleration_units),
        _peak(arm, tallies, "joint_jerk_cmd", f"second {quotient}", jerk_units),
        _chatter(arm, tallies),
        _joints(arm, tallies, "tau", "actuator torque or force", tau_units),
        _share(runs, tallies, "tau", "actuator torque or force"),
        _peak(arm, tallies, "tau_total", "torque or force with that of gravity compensation", tau_units),
        _share(runs, tallies, "tau_total", "torque or force with that of gravity compensation"),
        _errors(arm, tallies),
        _return(runs, tallies),
        _singularity(tallies),
        _status_times(tallies),
        _loads(runs, tallies),
        _profile(runs, tallies),
        _effort(runs, tallies),
    )  # fmt: skip
    columns = (column for part in parts for column in part)
    names, values, units, meanings = zip(*columns, strict=True)
    make: Any = partial(tuple.__new__, Figure)  # a sweep makes many, and `_make` checks each
    return [
        Scorecard(
            run.name,
            run.joints,
            dict(zip(names, map(make, zip(row, units, meanings, strict=True)), strict=True)),
        )
        for run, *row in zip(runs, *values, strict=True)
    ]


def figure_names(joints: Sequence[str], axes: Sequence[str]) -> list[str]:
    """Return the names of all metrics of a run.

    Args:
        joints: Names of the joints.
        axes: Task axes that count.
    """
    return list(_blank(tuple(joints), tuple(axes)))


def refused(names: Iterable[str], joints: Sequence[str], axes: Sequence[str]) -> dict[str, str]:
    """Return why some metrics cannot be expected, before the run starts.

    Args:
        names: Names of metrics, as a scenario's `expect` has them.
        joints: Names of the joints.
        axes: Task axes that count.

    Returns:
        For each name that is refused, in order, the reason; it follows the key in a message.
    """
    return _refused(names, _blank(tuple(joints), tuple(axes)))


def refuse_unknown(scenario: Scenario, joints: Sequence[str]) -> None:
    """Refuse a scenario that expects metrics that its run will not have.

    Args:
        scenario: Its `expect` and task are read.
        joints: Names of the joints.

    Raises:
        ScenarioError: All names that are refused, each with its place in the scenario.
    """
    problems = refused(scenario.expect, joints, scenario.task.axes)
    if problems:
        raise ScenarioError(scenario.problem(f"expect.{name}", why) for name, why in problems.items())


def check(card: Scorecard, expect: Mapping[str, Check | str]) -> list[Outcome]:
    """Compare metrics with their expectations.

    `below` and `above` are strict: the bound itself is a miss. `equals` allows `within` on both
    sides, the ends included. An undefined metric (NaN) never passes.

    Args:
        card: The scorecard.
        expect: Checks by name of metric; for `profile` the profile that the run was checked against.

    Returns:
        One outcome per check, in the order of `expect`.

    Raises:
        ScenarioError: Names that are no metrics of this run, or not numbers; all of them.
    """
    problems = _refused(expect, card)
    if problems:
        raise ScenarioError(Problem(("expect", name), why) for name, why in problems.items())
    return [
        _accepted(card, one) if isinstance(one, str) else _outcome(name, card[name], one)
        for name, one in expect.items()
    ]


def joint_changes(run: Recorded) -> _Array:
    """Return how far each joint is from its start, after a path that ends where it began.

    Revolute joints by the shortest angle, so that a full turn is no change.

    Args:
        run: A complete run with a closed reference: the controlled rows of the last pose equal the first.

    Returns:
        Magnitudes, (n,) [rad or m]; NaN for any other run.
    """
    if not len(run):
        return np.full(len(run.joints), math.nan)
    q, pose_ref = (run[name][[0, -1], None] for name in ("q", "pose_ref"))
    changes: _Array = _changes(run, np.array([run.is_complete]), q, pose_ref)[0]
    return changes


def _changes(run: Recorded, complete: NDArray[np.bool_], q: _Array, pose_ref: _Array) -> _Array:
    """Return `joint_changes` of runs, (w, n), from the first and the last row of both columns, (2, w, …)."""
    gap = run.view.error(pose_ref[1, complete], pose_ref[0, complete]) * [axis in run.axes for axis in AXES]
    closed = complete.copy()
    closed[complete] = np.abs(gap).max(axis=-1) <= CLOSED
    change = q[1] - q[0]
    shortest = (change + math.pi) % (2.0 * math.pi) - math.pi
    changes: _Array = np.abs(np.where(run.is_slide, change, shortest))
    changes[~closed] = math.nan
    return changes


# Figures ----------------------------------------------------------------------------------------


def _joints(
    arm: Recorded,
    tallies: NDArray[np.void],
    group: str,
    what: str,
    units: tuple[str, ...],
    *,
    is_rate: bool = False,
) -> _Figures:
    """Yield the largest magnitude of all joints, its time and joint, and that of each joint.

    Rates also have an rms over time; the rms of all joints is the largest of the joints' own.
    """
    row, n = JOINTS.index(group), len(arm.joints)
    peaks, times = tallies["peak"][:, row, :n], tallies["peak_time"][:, row, :n]
    rms = _rms(tallies["square"][:, row, :n], tallies)
    yield from _peak(arm, tallies, group, what, units)
    if is_rate:
        yield from _largest_rms(tallies, group, what, units)
    for j, (name, unit) in enumerate(zip(arm.joints, units, strict=True)):
        yield f"{group}.{name}.peak", peaks[:, j].tolist(), unit, f"largest {what} of {name}"
        if is_rate:
            yield f"{group}.{name}.peak_time", times[:, j].tolist(), "s", f"when {name} was fastest first"
            yield f"{group}.{name}.rms", rms[:, j].tolist(), unit, f"{what} of {name}, rms over time"


def _peak(
    arm: Recorded, tallies: NDArray[np.void], group: str, what: str, units: tuple[str, ...]
) -> _Figures:
    """Yield the largest magnitude of all joints, its time and its joint."""
    row, n = JOINTS.index(group), len(arm.joints)
    peaks, times = tallies["peak"][:, row, :n], tallies["peak_time"][:, row, :n]
    where = [*range(len(tallies))], peaks.argmax(axis=1)
    when = times[where].tolist()
    yield f"{group}.peak", peaks[where].tolist(), _either(units), f"largest {what}, of all joints and ticks"
    yield f"{group}.peak_time", when, "s", f"when the largest {what} was reached first"
    yield f"{group}.peak_joint", _named(arm, where[1], when), "", f"joint with the largest {what}"


def _largest_rms(tallies: NDArray[np.void], group: str, what: str, units: tuple[str, ...]) -> _Figures:
    """Yield the largest of the joints' rms over time."""
    rms = _rms(tallies["square"][:, JOINTS.index(group), : len(units)], tallies).max(axis=1)
    yield f"{group}.rms", rms.tolist(), _either(units), f"largest of the joints' rms {what}"


def _either(units: tuple[str, ...]) -> str:
    """Return the unit of a value of any joint: the joint's own where some slide."""
    return " or ".join(dict.fromkeys(units))


def _named(arm: Recorded, joints: NDArray[np.intp], values: Sequence[float]) -> list[str]:
    """Return the names of joints, or "" where the value is undefined."""
    return ["" if math.isnan(value) else arm.joints[j] for j, value in zip(joints, values, strict=True)]


def _chatter(arm: Recorded, tallies: NDArray[np.void]) -> _Figures:
    """Yield the rate of quick sign changes of the commanded acceleration, see `tally`."""
    ticks, n = tallies["ticks"], len(arm.joints)
    seconds = np.where(ticks, ticks, math.nan) * tallies["period"]
    counts = tallies["chatter"][:, :n]
    most = (counts.max(axis=1) / seconds).tolist()
    what = "sign changes of the commanded acceleration per second, counting those in quick succession"
    yield "chatter", most, "1/s", f"{what}; of the joint with the most"
    joints = _named(arm, counts.argmax(axis=1), np.where(counts.any(axis=1), most, math.nan).tolist())
    yield "chatter_joint", joints, "", "joint with the most chatter"


def _share(runs: Sequence[Recorded], tallies: NDArray[np.void], group: str, what: str) -> _Figures:
    """Yield the largest share of its limit that a joint's torque took, over joints with a limit."""
    n = len(runs[0].joints)
    peaks = tallies["peak"][:, JOINTS.index(group), :n]
    limits = np.array([run.torque_limit or (math.inf,) * n for run in runs])
    limited = np.isfinite(limits) & (limits > 0.0)
    shares = np.where(limited, peaks / np.where(limited, limits, 1.0), -math.inf).max(axis=1)
    shares[~limited.any(axis=1)] = math.nan
    meaning = f"largest {what} as a share of its joint's limit; undefined without a limit"
    yield f"{group}.share_of_limit", shares.tolist(), "1", meaning


def _errors(arm: Recorded, tallies: NDArray[np.void]) -> _Figures:
    """Yield the position and orientation errors, and their parts along u_min and across it.

    u_min is the direction of the scaled rows that the arm is losing at that tick. With the error e of the
    controlled rows, e_along = S_x⁻¹ u_min (u_minᵀ S_x e), and the rest is across: `docs/theory.md`.
    """
    units = {"position": "m", "orientation": "rad"}
    what = {
        "position": "distance to the reference position",
        "orientation": "angle to the reference orientation",
    }
    kinds = [
        kind
        for kind, axes in (("position", AXES[:3]), ("orientation", AXES[3:]))
        if set(arm.axes) & set(axes)
    ]
    for kind in kinds:
        yield from _error(tallies, f"{kind}_error", units[kind], what[kind])
    for kind in kinds:
        for part in ("along", "across"):
            meaning = f"{kind} error {part} u_min"
            yield from _error(tallies, f"{kind}_error_{part}", units[kind], meaning)
    yield from _error(tallies, "secondary_error", "m, rad", "error of the second task")


def _error(tallies: NDArray[np.void], group: str, unit: str, what: str) -> _Figures:
    row = ERRORS.index(group)
    largest, when, end = (
        tallies[name][:, row].tolist() for name in ("error_max", "error_max_time", "error_end")
    )
    rms = _rms(tallies["error_square"][:, [row]], tallies)[:, 0].tolist()
    yield f"{group}.rms", rms, unit, f"{what}, rms over time"
    yield f"{group}.max", largest, unit, f"{what}, largest"
    yield f"{group}.max_time", when, "s", f"{what}, when it was largest first"
    yield f"{group}.end", end, unit, f"{what}, at the last tick"


def _return(runs: Sequence[Recorded], tallies: NDArray[np.void]) -> _Figures:
    """Yield the distance of the joints from the start, if the path leads back to it."""
    arm, n = runs[0], len(runs[0].joints)
    complete = np.array(_completed(runs, tallies)) == 1.0
    q = np.array([tallies["q_first"][:, :n], tallies["q"][:, :n]])
    pose_ref = np.array([tallies["pose_ref_first"], tallies["pose_ref"]])
    changes = _changes(arm, complete, q, pose_ref)
    largest = changes.max(axis=1).tolist()
    unit = " or ".join(dict.fromkeys(arm.joint_unit(j) for j in range(n)))
    what = "from the first tick to the last, of a closed path"
    yield "return.joint_change", largest, unit, f"largest change of a joint {what}"
    joints = _named(arm, changes.argmax(axis=1), largest)
    yield "return.change_joint", joints, "", f"joint with the largest change {what}"


def _singularity(tallies: NDArray[np.void]) -> _Figures:
    # the smallest are kept as the largest of the negatives
    extreme = tallies["extreme"].T
    value, lowest = (dict(zip(EXTREMES, rows.tolist(), strict=True)) for rows in (extreme, -extreme))
    when = tallies["extreme_time"][:, EXTREMES.index("sigma")].tolist()
    yield "sigma.min", lowest["sigma"], "1", "smallest singular value of the run"
    yield "sigma.min_time", when, "s", "when the smallest singular value was reached first"
    yield "condition.max", value["condition"], "1", "largest κ = σ₁/σ_k"
    yield "manipulability.min", lowest["manipulability"], "1", "smallest w = ∏σ"
    yield "damping.max", value["damping"], "1", "largest λ"
    yield "path_rate.min", lowest["path_rate"], "1", "smallest pace along the path"
    what = "smallest singular value left to the second task"
    yield "secondary_sigma.min", lowest["secondary_sigma"], "1", what


def _status_times(tallies: NDArray[np.void]) -> _Figures:
    for one in (Status.OK, *IN_RUNS):
        times = tallies["status"][:, one.bit_length()] * tallies["period"]
        what = f"time with status {one.name}" if one else "time without any status"
        yield f"status_time.{one.name}", times.tolist(), "s", what
    stuck, longest = tallies["status"][:, Status.STUCK.bit_length()], tallies["stuck_longest"]
    yield (
        "stuck.longest",
        (longest * tallies["period"]).tolist(),
        "s",
        "longest time stuck without interruption",
    )
    yield "stuck.longest_time", tallies["stuck_time"].tolist(), "s", "when that began"
    share = stuck / np.where(tallies["ticks"], tallies["ticks"], math.nan)
    yield "stuck.share", share.tolist(), "1", "fraction of the ticks in which it is stuck"


def _loads(runs: Sequence[Recorded], tallies: NDArray[np.void]) -> _Figures:
    """Yield duration and start of contacts and of actuators at their limit, with bodies and joints."""

    def times(one: Status) -> tuple[list[float], list[float]]:
        seconds = tallies["status"][:, one.bit_length()] * tallies["period"]
        return seconds.tolist(), tallies["status_time"][:, one.bit_length()].tolist()

    seconds, first = times(Status.CONTACT)
    bodies = [" – ".join(run.touching) for run in runs]
    yield "contact.time", seconds, "s", "time in contact"
    yield "contact.first_time", first, "s", "time of the first contact"
    yield "contact.first_bodies", bodies, "", "bodies of the first contact"
    seconds, first = times(Status.TORQUE_LIMITED)
    joints = _named(runs[0], tallies["limited"], first)
    yield "torque_limited.time", seconds, "s", "time with an actuator at its limit"
    yield "torque_limited.first_time", first, "s", "first time with an actuator at its limit"
    yield "torque_limited.first_joint", joints, "", "joint whose actuator was at its limit first"


def _profile(runs: Sequence[Recorded], tallies: NDArray[np.void]) -> _Figures:
    """Yield the number of commands that a profile refuses, and the condition that the first violates."""
    is_held, broken = tallies["is_held"] == 1, tallies["broken"]
    where, what = tallies["broken_joint"], tallies["broken_condition"]
    counts = np.where(is_held, broken, math.nan)
    joints = [arm.joints[j] if j >= 0 else "" for arm, j in zip(runs, where, strict=True)]
    conditions = [CONDITIONS[one] if one >= 0 else "" for one in what]
    first = "the first command that the profile refuses"
    yield (
        "profile.refused",
        counts.tolist(),
        "1",
        "number of commands that the profile refuses; undefined without a profile",
    )
    yield "profile.first_time", tallies["broken_time"].tolist(), "s", f"when {first} was sent"
    yield "profile.first_joint", joints, "", f"joint of {first}"
    broke = f"condition that {first} violates: {', '.join(CONDITIONS)}"
    yield "profile.first_condition", conditions, "", broke
    yield "profile.first_value", tallies["broken_value"].tolist(), "SI", f"value of {first}"
    yield "profile.first_bound", tallies["broken_bound"].tolist(), "SI", f"bound that {first} violates"


def _effort(runs: Sequence[Recorded], tallies: NDArray[np.void]) -> _Figures:
    durations = (tallies["ticks"] * tallies["period"]).tolist()
    walls = [run.wall_time for run in runs]
    speeds = [time / wall if wall > 0.0 else math.nan for time, wall in zip(durations, walls, strict=True)]
    yield "duration", durations, "s", "simulated time, one period per tick"
    yield "ticks", tallies["ticks"].tolist(), "1", "control ticks recorded"
    yield "completed", _completed(runs, tallies), "1", "completed fraction of the path; 1: all"
    yield "wall_time", walls, "s", "wall time of the stepping"
    yield "speed", speeds, "1", "simulated time over wall time"


def _completed(runs: Sequence[Recorded], tallies: NDArray[np.void]) -> list[float]:
    """Return the completed share of each path; NaN without a path."""
    ended = zip(runs, tallies["ticks"].tolist(), tallies["path_time"].tolist(), strict=True)
    return [run.share(time) if ticks else 0.0 if run.planned else math.nan for run, ticks, time in ended]


def _rms(squares: _Array, tallies: NDArray[np.void]) -> _Array:
    """Return the root of the mean over ticks of sums of squares, (w, …); NaN without ticks."""
    ticks = tallies["ticks"][:, None]
    return np.sqrt(squares / np.where(ticks, ticks, math.nan))


# Expectations -----------------------------------------------------------------------------------


@lru_cache(maxsize=16)  # used again for each of thousands of variants
def _blank(joints: tuple[str, ...], axes: tuple[str, ...]) -> Scorecard:
    """Return the scorecard of a run without ticks: all its metrics without values."""
    run = Recorded("", joints, (False,) * len(joints), axes, 1.0, 1.0, {}, 0)
    return figures([run], tallies_of([run]))[0]


# The facts about the first command that a profile refuses, and units by condition.
_FIRST = ("joint", "condition", "time", "value", "bound")
_PER = dict(zip(CONDITIONS, ("", "/s", "/s²", "/s³"), strict=True))

# The number of a profile that a condition checks, where its name differs.
_NUMBERS = {
    "profile.first_joint": "profile.refused",
    "profile.first_condition": "profile.refused",
    "return.change_joint": "return.joint_change",
    "contact.first_bodies": "contact.time",
    "torque_limited.first_joint": "torque_limited.time",
}
# Earlier names of metrics.
_BEFORE = {"tau.share": "tau.share_of_limit"}


def _refused(names: Iterable[str], card: Scorecard) -> dict[str, str]:
    reasons = {}
    for name in names:
        if name == PROFILE:
            continue
        if name not in card:
            reasons[name] = _unknown(name, card)
        elif isinstance(card[name].value, str):
            number = _NUMBERS.get(name, name.removesuffix("_joint"))
            kinds = {"_joint": "a joint", "_condition": "a condition", "_bodies": "bodies"}
            what = next(words for end, words in kinds.items() if name.endswith(end))
            reasons[name] = f"names {what}; an expectation needs a number, such as {number}"
    return reasons


def _unknown(name: str, card: Scorecard) -> str:
    """Return why there is no such metric, and the remedy."""
    kinds = {"position_error": AXES[:3], "orientation_error": AXES[3:]}
    for (error, rows), other in zip(kinds.items(), reversed(kinds), strict=True):
        if name.startswith(error) and name.replace(error, other) in card:
            return f"needs one of {', '.join(rows)} in task.axes"
    if name in _BEFORE:
        return f"is now called {_BEFORE[name]}"
    # the earlier names, when meters and radians were added up
    split = [f"{kind.removesuffix('error')}{name}" for kind in kinds]
    parts = [f'"{part}"' for part in split if part in card]
    if parts:
        return f"no such metric; did you mean {' or '.join(parts)}?"
    groups = ", ".join(dict.fromkeys(known.partition(".")[0] for known in card))
    return "no such metric" + (did_you_mean(name, card) or f"; metrics begin with {groups}")


def _accepted(card: Scorecard, profile: str) -> Outcome:
    """Return whether a profile accepts all commands, and the first violation."""
    count, all_of_them = float(card["profile.refused"].value), card["ticks"].value
    got = f"{all_of_them} that it accepts"
    if count > 0.0:
        joint, condition, time, value, bound = (card[f"profile.first_{name}"].value for name in _FIRST)
        unit = card[f"joint_rate.{joint}.peak"].unit.removesuffix("/s") + _PER[str(condition)]
        got = (
            f'{condition} {value:.6g} {unit} of "{joint}" at {time:.6g} s, which must stay within '
            f"{bound:.6g}; {count:g} of {all_of_them} commands are refused"
        )
    return Outcome(PROFILE, count, f"commands that {Path(profile).stem} accepts", count, count == 0.0, got)


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
