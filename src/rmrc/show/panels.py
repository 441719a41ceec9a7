"""What a run shows: panels of curves over time, with units, limits, axes, and the peaks beyond them.

The viewer, the figures, the page and the films draw these panels, so that a curve has the same color, axis
and words everywhere. A run alone is shown joint by joint, and runs side by side by their largest values.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.show.palette import GOLD, GRAY, GREEN, INDIGO, MAGENTA, SLATE, distinct, of_status
from rmrc.support.spatial import AXES, Array

Runs = Mapping[str, Run]

# Panels over time, in their order from the top. `joints` is drawn only where it is named.
NAMES = ("rates", "sigma", "error", "turn_error", "torque", "pace", "belief", "joints")
# A curve of the run may leave its panel where it exceeds its limit by this factor. Curves beside it, of the
# plain inverse and of the baseline, may lengthen the axis by the second factor.
CLIP, BESIDE = 3.0, 1.35
# The plain inverse is drawn where its peak exceeds that of the run by this factor: otherwise they coincide.
MORE = 1.05
# Runs side by side have a logarithmic axis where their peaks differ by this factor; it has so many decades.
# Without a limit, a curve leaves its panel where it exceeds its usual size by as much.
APART, DECADES = 30.0, 6
# The share of the values that the usual size bounds.
USUAL = 0.9
# A smaller singular value is drawn as this one.
FLOOR = 1e-6
# A path that is no longer than this is a point [m].
POINT = 1e-6

# Without colors, these distinguish neighbors: lengths of dashes and gaps, in widths of a line.
DASHES: tuple[tuple[float, ...], ...] = (
    (), (5, 2), (2, 1), (6, 1.5, 1.5, 1.5), (9, 3), (3, 1, 1, 1, 1, 1), (1, 1), (6, 1, 2, 1, 2, 1),
)  # fmt: skip

Role = Literal["measured", "commanded", "plain", "baseline"]
# Width [pt] and dashes of the curves of a role; those of measured ones go by their number.
LOOKS: Mapping[Role, tuple[float, tuple[float, ...]]] = {
    "measured": (1.4, ()), "commanded": (0.5, ()), "plain": (0.9, (2, 1.2)), "baseline": (0.7, (4, 2)),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve over time.

    Attributes:
        name: What it is: a joint, a run, or a quantity.
        time: (T,) [s].
        values: (T,), in the unit of the panel; NaN: a gap.
        color: 0xRRGGBBAA.
        number: Number of the joint or run, for dashes that distinguish curves without color.
        role: How it is drawn: `measured` bold, `commanded` thin, and the others thin and dashed.
        run: Label of its run among several.
        source: Column of the run and number within it, if the values are those of the column.
    """

    name: str
    time: Array
    values: Array
    color: int
    number: int = 0
    role: Role = "measured"
    run: str = ""
    source: tuple[str, int] | None = None

    @property
    def label(self) -> str:
        """Its name among all curves of a panel."""
        return f"{self.name}, cmd" if self.role == "commanded" else self.name

    @property
    def dashes(self) -> tuple[float, ...]:
        """Lengths of its dashes and gaps, in widths of its line; none: it is solid."""
        return DASHES[self.number % len(DASHES)] if self.role == "measured" else LOOKS[self.role][1]


class Level(NamedTuple):
    """A constant line.

    Attributes:
        value: Where it is, in the unit of the panel.
        name: Its name.
        color: 0xRRGGBBAA.
    """

    value: float
    name: str
    color: int


class Peak(NamedTuple):
    """A value beyond the axis.

    Attributes:
        text: It in words, in the unit of the panel.
        time: When [s].
        is_up: Whether it is above the axis.
        color: 0xRRGGBBAA.
    """

    text: str
    time: float
    is_up: bool
    color: int


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves over the same time.

    Attributes:
        name: One of `NAMES`.
        title: Its quantity, without unit.
        unit: Unit of its axis.
        curves: In the order in which they are drawn.
        range: Ends of its axis.
        levels: Limits within the axis.
        beyond: Limits and peaks beyond the axis, in words.
        peaks: Where the curves have the peaks beyond the axis.
        is_logarithmic: Whether its axis is.
    """

    name: str
    title: str
    unit: str
    curves: Sequence[Curve]
    range: tuple[float, float]
    levels: Sequence[Level] = ()
    beyond: Sequence[str] = ()
    peaks: Sequence[Peak] = ()
    is_logarithmic: bool = False


class Lane(NamedTuple):
    """The times at which a run has a status.

    Attributes:
        name: Status in words, after the label of the run among several.
        color: 0xRRGGBBAA.
        spans: Begin and end of each [s].
    """

    name: str
    color: int
    spans: Sequence[tuple[float, float]]


def panels(runs: Run | Runs, names: Sequence[str] = ()) -> list[Panel]:
    """Return the panels of a run, or of runs side by side.

    Args:
        runs: A run, or runs by label; each has one tick at least.
        names: Those to return, in this order, if the runs have such a quantity; none: all that have data,
            but `joints`.
    """
    some = {"": runs} if isinstance(runs, Run) else dict(runs)
    if len(some) == 1:
        (run,) = some.values()
        found = {panel.name: panel for panel in _of_run(run, names)}
    else:
        found = {panel.name: panel for panel in _of_runs(some, names)}
    return [found[name] for name in names or NAMES if name in found]


def lanes(runs: Run | Runs) -> list[Lane]:
    """Return the statuses of a run, or of runs side by side, in their order."""
    some = {"": runs} if isinstance(runs, Run) else runs
    colors = distinct(len(some))
    found = []
    for i, (label, run) in enumerate(some.items()):
        for flag in statuses(run):
            name = f"{label}: {in_words(flag)}" if len(some) > 1 else in_words(flag)
            color = colors[i] if len(some) > 1 else of_status(int(flag))
            found.append(Lane(name, color, _spans(run, flag)))
    return found


def _of_run(run: Run, names: Sequence[str]) -> Iterator[Panel]:
    """Yield the panels of a run, joint by joint."""
    yield _rates(run)
    yield _sigma({"": run})
    yield from _errors(run)
    if "torque" in names or run["tau"].any():
        limit = _levels(run, run.torque_limit)
        yield _signed("torque", "Actuator torque tau", units(run, "N·m", "N"), _joints(run, "tau"), limit)
    if "pace" in names or (run["path_rate"] < 1.0).any():
        yield _pace({"": run})
    if "belief" in names or not np.array_equal(run["q_believed"], run["q"]):
        off = 1e3 * (run["q_believed"] - run["q"])
        curves = [
            Curve(name, run["time"], off[:, j], color, j)
            for j, (name, color) in enumerate(zip(run.joints, distinct(len(run.joints)), strict=True))
        ]
        yield _signed("belief", "Joints as believed, less true", units(run, "mrad", "mm"), curves)
    if "joints" in names:
        yield _signed("joints", "Joint positions q", units(run, "rad", "m"), _joints(run, "q"))


def _of_runs(runs: Runs, names: Sequence[str]) -> Iterator[Panel]:
    """Yield the panels of runs side by side, by their largest values."""
    first, *_ = runs.values()
    limits = {limit for run in runs.values() for limit in run.rate_limit}
    level = [Level(limits.pop(), "limit", GRAY)] if len(limits) == 1 and math.inf not in limits else []
    unit = units(first, "rad/s", "m/s")
    yield _sized("rates", "Largest rate qdot_cmd of a joint", unit, _each(runs, "qdot_cmd"), level)
    yield _sigma(runs)
    moved, turned = error_rows(first)
    for name, title, unit, rows in (
        ("error", "Position error", "mm", moved),
        ("turn_error", "Rotation error", "mrad", turned),
    ):
        if rows:
            sizes = {
                label: 1e3 * np.linalg.norm(run["pose_error"][:, rows], axis=1) for label, run in runs.items()
            }
            yield _sized(name, title, unit, _curves(runs, sizes))
    if "torque" in names or any(run["tau"].any() for run in runs.values()):
        yield _sized("torque", "Largest actuator torque tau", units(first, "N·m", "N"), _each(runs, "tau"))
    if "pace" in names or any((run["path_rate"] < 1.0).any() for run in runs.values()):
        yield _pace(runs)


def _rates(run: Run) -> Panel:
    """Return measured and commanded rates, and beside them the plain inverse and the baseline."""
    unit = units(run, "rad/s", "m/s")
    curves = [*_joints(run, "qdot"), *_joints(run, "qdot_cmd", "commanded")]
    most = _peak(curves)
    beside = [_fastest(run, "qdot_plain", "plain inverse", "plain", SLATE)]
    if _peak(beside) <= MORE * most:
        beside = []
    if run.baseline is not None and len(run.baseline):
        beside.append(_fastest(run.baseline, "qdot_cmd", "baseline", "baseline", GRAY))
    return _signed("rates", "Joint rates", unit, curves, _levels(run, run.rate_limit), beside)


def _fastest(run: Run, column: str, name: str, role: Role, color: int) -> Curve:
    """Return the rate of the joint that has the largest one of a column."""
    sizes = np.nan_to_num(np.abs(run[column]), nan=0.0, posinf=0.0).max(axis=0)
    j = int(sizes.argmax())
    return Curve(f"{name}, {run.joints[j]}", run["time"], run[column][:, j], color, j, role)


def _sigma(runs: Runs) -> Panel:
    """Return the smallest singular value and the damping of each run, on a logarithmic axis."""
    is_alone, colors = len(runs) == 1, distinct(len(runs))
    curves, below = list[Curve](), set[float]()
    for i, (label, run) in enumerate(runs.items()):
        last, time = run["sigma"].shape[1] - 1, run["time"]
        name, color = ("σ_min", GREEN) if is_alone else (label, colors[i])
        curves.append(Curve(name, time, run["sigma"][:, last], color, i, run=label))
        damping = np.where(run["damping"] > 0.0, run["damping"], np.nan)
        if not np.isnan(damping).all():
            name, color = ("λ", MAGENTA) if is_alone else (f"{label}, λ", colors[i])
            role: Role = "measured" if is_alone else "plain"
            curves.append(Curve(name, time, damping, color, is_alone + i, role, label))
        if is_alone and np.isfinite(run["secondary_sigma"]).any():
            curves.append(Curve("σ left to the second task", time, run["secondary_sigma"], SLATE, 2))
        below |= {run.damping_below} - {0.0}
    levels = [Level(epsilon, "ε", GRAY) for epsilon in sorted(below)]
    values = np.concatenate([*(curve.values for curve in curves), [level.value for level in levels]])
    shown = np.maximum(values[values > 0.0], FLOOR)
    ends = decades(float(shown.min()), float(shown.max())) if len(shown) else (FLOOR, 1.0)
    has_damping = any(curve.name.endswith("λ") for curve in curves)
    title = "Singular value σ_min" + ", damping λ" * has_damping
    return Panel("sigma", title, "1", curves, ends, levels, is_logarithmic=True)


def _errors(run: Run) -> Iterator[Panel]:
    """Yield the position error, split where the path has a direction, and the rotation error."""
    moved, turned = error_rows(run)
    time, norm = run["time"], 1e3 * np.linalg.norm(run["pose_error"][:, turned], axis=1)
    beside: Array | None = None
    if run.baseline is not None and len(run.baseline):
        beside = 1e3 * np.linalg.norm(run.baseline["pose_error"][:, moved], axis=1)
    if moved:
        if run.view.frame == "world" and not is_point(run["pose_ref"][:, :3]):
            along, across = split_error(run, moved)
            curves = [
                Curve("along the path", time, 1e3 * along, GOLD),
                Curve("across the path", time, 1e3 * across, INDIGO, 1),
            ]
        else:
            size = 1e3 * np.linalg.norm(run["pose_error"][:, moved], axis=1)
            curves = [Curve("position", time, size, GOLD)]
        others = []
        if beside is not None and run.baseline is not None:
            others = [Curve("baseline", run.baseline["time"], beside, GRAY, 2, "baseline")]
        yield _sized("error", "Position error", "mm", curves, (), others)
    if turned:
        yield _sized("turn_error", "Rotation error", "mrad", [Curve("rotation", time, norm, SLATE)])


def _pace(runs: Runs) -> Panel:
    colors = [GOLD] if len(runs) == 1 else distinct(len(runs))
    curves = [
        Curve(label or "ṡ", run["time"], run["path_rate"], colors[i], i, run=label, source=("path_rate", 0))
        for i, (label, run) in enumerate(runs.items())
    ]
    return Panel("pace", "Pace ṡ along the path", "1", curves, (-0.05, 1.1))


def _joints(run: Run, column: str, role: Role = "measured") -> list[Curve]:
    """Return a curve for each joint."""
    return [
        Curve(name, run["time"], run[column][:, j], color, j, role, source=(column, j))
        for j, (name, color) in enumerate(zip(run.joints, distinct(len(run.joints)), strict=True))
    ]


def _each(runs: Runs, column: str) -> list[Curve]:
    """Return the largest magnitude of a column in each run."""
    return _curves(runs, {label: np.abs(run[column]).max(axis=1) for label, run in runs.items()})


def _curves(runs: Runs, values: Mapping[str, Array]) -> list[Curve]:
    """Return a curve for each run."""
    colors = distinct(len(runs))
    return [
        Curve(label, runs[label]["time"], those, colors[i], i, run=label)
        for i, (label, those) in enumerate(values.items())
    ]


def _levels(run: Run, limits: Sequence[float]) -> list[Level]:
    """Return the finite limits of the joints: one line if all have the same."""
    if len(set(limits)) == 1 and math.isfinite(limits[0]):
        return [Level(limits[0], "limit", GRAY)]
    rows = zip(limits, run.joints, distinct(len(run.joints)), strict=False)
    return [Level(limit, f"limit, {name}", color) for limit, name, color in rows if math.isfinite(limit)]


# Axes -------------------------------------------------------------------------------------------


def _signed(
    name: str, title: str, unit: str, curves: Sequence[Curve],
    levels: Sequence[Level] = (), beside: Sequence[Curve] = (),
) -> Panel:  # fmt: skip
    """Return a panel around zero."""
    top = _top(curves, levels, beside, clips=True)
    both = [level._replace(value=side * level.value) for level in levels for side in (1.0, -1.0)]
    return _within(Panel(name, title, unit, [*beside, *curves], (-top, top), both))


def _sized(
    name: str, title: str, unit: str, curves: Sequence[Curve],
    levels: Sequence[Level] = (), beside: Sequence[Curve] = (),
) -> Panel:  # fmt: skip
    """Return a panel of magnitudes, whole: on a logarithmic axis if runs side by side differ by far."""
    peaks = [_peak([curve]) for curve in curves]
    if len({curve.run for curve in curves}) > 1 and max(peaks) > APART * max(min(peaks), 1e-12):
        _, high = decades(max(peaks), max(peaks))
        ends = (float(f"{high * 10.0**-DECADES:.0e}"), high)
        return _within(Panel(name, title, unit, curves, ends, levels, is_logarithmic=True))
    top = _top(curves, levels, beside, clips=False)
    return _within(Panel(name, title, unit, [*beside, *curves], (0.0, top), levels))


def _top(curves: Sequence[Curve], levels: Sequence[Level], beside: Sequence[Curve], clips: bool) -> float:
    """Return the end of an axis: the one rule by which every view clips.

    A limit is shown unless it would flatten the curves. The curves beside may lengthen the axis a bit.
    """
    peak, limit = _peak(curves), max((level.value for level in levels), default=0.0)
    sizes = np.concatenate([np.abs(curve.values) for curve in curves])
    usual = max(float(np.quantile(np.nan_to_num(sizes), USUAL)), 1e-9)
    top = peak if peak > 0.0 else 1.0
    if clips and limit:
        top = min(top, CLIP * limit)
    elif clips and peak > APART * usual:
        top = CLIP * usual
    if limit <= CLIP * peak:
        top = max(top, limit)
    return 1.05 * min(max(top, _peak(beside)), BESIDE * top)


def _within(panel: Panel) -> Panel:
    """Return a panel whose limits and peaks beyond its axis are in words."""
    low, high = panel.range
    levels = [level for level in panel.levels if low <= level.value <= high]
    far = sorted({level.value for level in panel.levels if level.value > high})
    beyond = [f"limit{'s from' * (len(far) > 1)} {grouped(far[0])} ↑"] if far else []
    most, peaks = "max" if panel.name in ("error", "turn_error") else "peak", []
    for role in ("measured", "commanded", "plain", "baseline"):
        curves = [curve for curve in panel.curves if curve.role == role]
        if _peak(curves) > high:
            curve = max(curves, key=lambda one: _peak([one]))
            size = np.nan_to_num(np.abs(curve.values), nan=0.0, posinf=0.0)
            row = int(size.argmax())
            text = f"{curve.label}: {most} {grouped(float(size[row]))}"
            is_up = bool(curve.values[row] > 0.0)
            peaks.append(Peak(f"{text} {'↑' if is_up else '↓'}", float(curve.time[row]), is_up, curve.color))
    beyond += [peak.text for peak in peaks]
    return Panel(
        panel.name, panel.title, panel.unit, panel.curves, panel.range, levels, beyond, peaks,
        panel.is_logarithmic,
    )  # fmt: skip


def _peak(curves: Sequence[Curve]) -> float:
    """Return the largest finite magnitude of some curves; 0 of none."""
    sizes = [np.nan_to_num(np.abs(curve.values), nan=0.0, posinf=0.0).max(initial=0.0) for curve in curves]
    return float(max(sizes, default=0.0))


def decades(least: float, largest: float) -> tuple[float, float]:
    """Return a range of whole decades around positive values: at least two, and at most `DECADES`."""
    low, high = math.floor(math.log10(least) + 1e-9), math.ceil(math.log10(largest) - 1e-9)
    return float(10.0 ** max(min(low, high - 2), high - DECADES)), float(10.0**high)


# Quantities -------------------------------------------------------------------------------------


def in_words(flag: Status) -> str:
    """Return the name of a status for a reader."""
    return str(flag.name).lower().replace("_", " ")


def statuses(run: Run) -> list[Status]:
    """Return the statuses that the run had, in their order."""
    bits = int(np.bitwise_or.reduce(run["status"].astype(np.int64))) if len(run) else 0
    return [flag for flag in Status if flag and int(flag) & bits]


def _spans(run: Run, flag: Status) -> list[tuple[float, float]]:
    """Return begin and end of each time at which a status holds [s]; one tick lasts one period."""
    holds = (run["status"].astype(np.int64) & int(flag)) != 0
    edges, time = np.flatnonzero(np.diff(np.concatenate([[0], holds, [0]]).astype(int))), run["time"]
    return [
        (float(time[begin]), float(time[end - 1]) + run.period)
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
    ]


def thinned(time: Array, values: Array, spans: int) -> tuple[Array, Array]:
    """Return a curve by the least and the largest value of each span of time, so that peaks stay."""
    rows = extremes(values, spans)
    return time[rows], values[rows]


def extremes(values: Array, spans: int) -> NDArray[np.intp]:
    """Return the rows of the least and the largest value of each span, and the ends; all of a short curve."""
    every = -(-len(values) // spans)
    if every <= 2:
        return np.arange(len(values))
    whole = len(values) // every * every
    filled = np.nan_to_num(values[:whole].reshape(-1, every), nan=0.0)
    ends = np.stack([filled.argmin(axis=1), filled.argmax(axis=1)], axis=1)
    rows = (np.arange(len(filled))[:, None] * every + ends).ravel()
    return np.unique(np.concatenate([[0], rows, np.arange(whole, len(values))]))


def split_error(run: Run, moved: Sequence[int]) -> tuple[Array, Array]:
    """Return the position error along the path and across, (T,) each [m].

    While the path rests, its last direction counts.
    """
    error = np.zeros((len(run), 3))
    error[:, moved] = (run["pose_ref"] - run["pose"])[:, moved]
    speed = np.linalg.norm(run["twist_ref"][:, :3], axis=1)
    moves = speed > 1e-9 * max(float(speed.max()), 1e-12)
    last = np.maximum.accumulate(np.where(moves, np.arange(len(run)), 0))
    along = run["twist_ref"][last, :3] / np.maximum(speed[last], 1e-300)[:, None]
    signed = (error * along).sum(axis=1)
    return np.abs(signed), np.linalg.norm(error - signed[:, None] * along, axis=1)


def error_rows(run: Run) -> tuple[list[int], list[int]]:
    """Return the rows of the pose error that the task has: those of the position, and of the rotation."""
    rows = [i for i, axis in enumerate(AXES) if axis in run.axes]
    return [i for i in rows if i < 3], [i for i in rows if i >= 3]


def is_point(path: Array) -> bool:
    """Return whether positions (T, 3) are all the same [m]."""
    return bool(np.ptp(path, axis=0).max() <= POINT)


def units(run: Run, turning: str, sliding: str) -> str:
    """Return the unit of a quantity of the joints, or both units."""
    slides = set(run.is_slide)
    return f"{turning}, {sliding}" if len(slides) > 1 else sliding if slides == {True} else turning


def grouped(value: float) -> str:
    """Return a number with four digits, or whole up to a million, with its thousands separated."""
    return f"{value:,.0f}" if 1e3 <= value < 1e6 else f"{value:.4g}"
