"""Curves over time for a page with cursor and zoom."""

import base64
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.show.axes import (
    APART,
    CLIPPED,
    FAR,
    Array,
    applies,
    decades,
    error_rows,
    error_units,
    grouped,
    in_words,
    off,
    on_paper,
    paints,
    rate_unit,
    statuses,
    torque_unit,
)
from rmrc.show.figures import DASHES
from rmrc.show.palette import GOLD, GREEN, INDIGO, MAGENTA, SLATE, WHITE, distinct, mix, of_status

# Largest number of values of a panel. In a longer run, each span of time keeps the least and the largest
# value.
ROOM = 60_000
# Decades of a logarithmic axis, and the share of the largest down to which singular values are drawn.
DECADES, LEAST = 6, 1e-9
# Colors of the curves of a baseline, on a light and on a dark page.
GRAYS = ("#8c8c8c", "#a6a6a6")
# Colors of the errors along the path, across it, and of rotation.
ERRORS = (GOLD, INDIGO, SLATE)
# Colors of the palette are paler by this part on a dark page.
PALER = 0.08


@dataclass(frozen=True, eq=False)
class Trace:
    """A curve.

    Attributes:
        label: Its name.
        values: (T,); values that are not finite are not drawn.
        color: Number of its color among those of joints or runs; unused with `paint`.
        dash: Number of its dashes.
        width: Width of the line [px].
        is_shown: Whether it is drawn before a click on its name.
        is_gray: Whether it is gray, whatever its color: it belongs to a baseline.
        paint: Its color, 0xRRGGBBAA, if the curve belongs to no joint or run.
    """

    label: str
    values: Array
    color: int = 0
    dash: int = 0
    width: float = 1.5
    is_shown: bool = True
    is_gray: bool = False
    paint: int | None = None

    def colors(self, count: int) -> tuple[str, str]:
        """Return its colors on a light and on a dark page with this many joints or runs."""
        if self.is_gray:
            return GRAYS
        if self.paint is not None:
            return on_paper(self.paint), f"#{mix(self.paint, WHITE, PALER) >> 8:06x}"
        return paints(count)[self.color], f"#{distinct(count)[self.color] >> 8:06x}"


# So many pixels are as long as a run, at most: a state that holds at one tick is as long as one of them.
PIXELS = 600


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves over the same time.

    Attributes:
        title: The title above it.
        unit: Unit of its vertical axis, with its quantity.
        time: (T,) [s].
        traces: Its curves.
        lines: Values at which horizontal lines are drawn.
        bounds: Ends of the vertical axis; None: from the curves.
        peak: Text beside the title about a curve that exceeds the axis; "": none.
        is_logarithmic: Whether its vertical axis is.
        lanes: Names of lanes 0, 1, ..., from below, where it has lanes instead of numbers.
        place: Name of its place on the page.
    """

    title: str
    unit: str
    time: Array
    traces: Sequence[Trace]
    lines: Sequence[float] = ()
    bounds: tuple[float, float] | None = None
    peak: str = ""
    is_logarithmic: bool = False
    lanes: Sequence[str] = ()
    place: str = field(default="")

    def json(self, colors: int) -> dict[str, Any]:
        """Return the data that the page draws.

        Args:
            colors: Number of colors of the page.
        """
        rows = kept([one.values for one in self.traces], ROOM)
        looks = [one.colors(colors) for one in self.traces]
        return {
            "place": self.place, "title": self.title, "unit": self.unit, "time": _packed(self.time[rows]),
            "lines": [{"value": value} for value in self.lines], "range": self.bounds, "lanes": self.lanes,
            "logarithmic": self.is_logarithmic,
            "series": [
                {
                    "label": one.label, "values": _packed(one.values[rows], self.is_logarithmic),
                    "light": light, "dark": dark, "width": one.width,
                    "dash": [2.0 * part for part in DASHES[one.dash % len(DASHES)]] if one.dash else [],
                    "shown": one.is_shown, "spans": not self.lanes and not self.is_logarithmic,
                }
                for one, (light, dark) in zip(self.traces, looks, strict=True)
            ],
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Traces:
    """The panels of a page.

    Attributes:
        panels: The panels, from the top.
        colors: Number of colors that they use.
    """

    panels: Sequence[Panel]
    colors: int

    def json(self) -> list[dict[str, Any]]:
        """Return the data that the page draws, as strict JSON."""
        return [panel.json(self.colors) for panel in self.panels]


def of_run(run: Run) -> Traces:
    """Return the curves of a run of one tick at least: joint by joint."""
    panels = [_rates(run), _sigma({"": run}), _errors(run)]
    if applies("torque", run):
        curves = [Trace(name, run["tau"][:, j], j, j) for j, name in enumerate(run.joints)]
        panels.append(Panel("Actuator torques", f"torque [{torque_unit(run)}]", run["time"], curves))
    panels += _pace({"": run}) + _lanes({"": run})
    return _placed(panels, len(run.joints))


def of_runs(runs: Mapping[str, Run]) -> Traces:
    """Return the curves of several runs of one tick at least: one for each run."""
    units, first = {rate_unit(run) for run in runs.values()}, next(iter(runs.values()))
    moved, turned = error_rows(first)
    rates = _curves(runs, {label: np.abs(run["qdot_cmd"]).max(axis=1) for label, run in runs.items()})
    panels = [
        _norms("Largest commanded rate of a joint", f"rate [{' or '.join(units)}]", rates),
        _sigma(runs),
    ]
    for rows, title, unit in ((moved, "Position error", "mm"), (turned, "Rotation error", "mrad")):
        if rows:
            errors = {
                label: 1e3 * np.linalg.norm(run["pose_error"][:, rows], axis=1) for label, run in runs.items()
            }
            panels.append(_norms(title, f"error [{unit}]", _curves(runs, errors)))
    if any(applies("torque", run) for run in runs.values()):
        torques = _curves(runs, {label: np.abs(run["tau"]).max(axis=1) for label, run in runs.items()})
        panels.append(_norms("Largest actuator torque", f"torque [{torque_unit(first)}]", torques))
    return _placed([*panels, *_pace(runs), *_lanes(runs)], len(runs))


def _placed(panels: Sequence[Panel], colors: int) -> Traces:
    return Traces([Panel(**{**vars(one), "place": f"plot-{i}"}) for i, one in enumerate(panels)], colors)


def _rates(run: Run) -> Panel:
    """Return commanded and measured rates, up to a bit more than their limits, and the baseline's."""
    time, place = _times(run)
    kinds = [("commanded", "qdot_cmd", 1.5), ("measured", "qdot", 0.8), ("plain inverse", "qdot_plain", 0.8)]
    traces = [
        Trace(f"{name}, {what}", place(run, run[column][:, j]), j, j, width, column == "qdot_cmd")
        for what, column, width in kinds
        for j, name in enumerate(run.joints)
        if column != "qdot_plain" or np.isfinite(run[column]).any()  # an older file without this column
    ]
    limits = sorted({limit for limit in run.rate_limit if math.isfinite(limit)})
    peak, bounds, told = float(np.abs(run["qdot_cmd"]).max()), None, list[str]()
    if limits and peak > CLIPPED * limits[-1]:
        bounds = (-CLIPPED * limits[-1], CLIPPED * limits[-1])
        told.append(f"peak {_peak(run)}")
    elif limits and limits[-1] < FAR * peak:
        bounds = (-1.1 * max(limits[-1], peak), 1.1 * max(limits[-1], peak))
    other = run.baseline
    if other is not None and len(other):
        traces += [
            Trace(f"{name}, baseline", place(other, other["qdot_cmd"][:, j]), j, 1, 1.0, is_gray=True)
            for j, name in enumerate(other.joints)
        ]
        bounds = bounds or _room([run["qdot_cmd"]], [other["qdot_cmd"]], -1.0)
        if bounds and float(np.abs(other["qdot_cmd"]).max()) > bounds[1]:
            told.append(f"baseline {_peak(other)}")
    drawn = [limit for limit in limits if limit <= (bounds[1] if bounds else peak)]
    lines, title = [side * limit for limit in drawn for side in (1.0, -1.0)], "Joint rates"
    if drawn:
        title += "; dotted: limits"
    elif limits:
        title += (
            f"; limit{'s from' * (len(limits) > 1)} {grouped(limits[0])} {rate_unit(run)} beyond the plot"
        )
    beyond = f"{', '.join(told)}, beyond the plot" if told else ""
    return Panel(title, f"rate [{rate_unit(run)}]", time, traces, lines, bounds, beyond)


def _peak(run: Run) -> str:
    """Return the largest commanded rate and its joint."""
    rates = np.abs(run["qdot_cmd"]).max(axis=0)
    j = int(rates.argmax())
    return f"{grouped(float(rates[j]))} {run.joint_unit(j)}/s, of {run.joints[j]}"


def _times(run: Run) -> tuple[Array, Callable[[Run, Array], Array]]:
    """Return the times of a run and its baseline, and a function that places values of either there."""
    other = run.baseline
    if other is None or not len(other) or np.array_equal(other["time"], run["time"]):
        return run["time"], lambda _, values: values
    time = _common({"": run["time"], "baseline": other["time"]})
    return time, lambda of, values: _placed_at(time, of["time"], values)


def _room(own: Sequence[Array], beside: Sequence[Array], low: float) -> tuple[float, float] | None:
    """Return an axis for curves if those beside them would flatten them; None: they do not.

    Args:
        own: The curves.
        beside: Scorecard of the baseline.
        low: The lower end of the axis as a part of the upper one.
    """
    peak, most = (max(float(np.abs(one).max()) for one in some) for some in (own, beside))
    high = CLIPPED * peak
    return (low * high, high) if peak > 0.0 and most > FAR * peak else None


def _sigma(runs: Mapping[str, Run]) -> Panel:
    """Return the smallest singular value of each, and its damping."""
    sigma = _curves(runs, {label: run["sigma"][:, -1] for label, run in runs.items()}, "σ_min", paint=GREEN)
    damping = _curves(runs, {label: run["damping"] for label, run in runs.items()}, "λ", 1, paint=MAGENTA)
    shown = [one for one in damping[1] if (one.values > 0.0).any()]
    below = sorted({run.damping_below for run in runs.values() if run.damping_below > 0.0})
    drawn = [*(one.values for one in (*sigma[1], *shown)), np.array(below)]
    positive = np.concatenate([values[values > 0.0] for values in drawn])
    title = "Smallest singular value and damping" if shown else "Smallest singular value"
    if below:
        title += "; dotted: ε, below which damping begins"
    bounds = decades(np.maximum(positive, LEAST * positive.max())) if len(positive) else None
    unit = "σ, λ [1]" if shown else "σ [1]"
    return Panel(title, unit, sigma[0], [*sigma[1], *shown], below, bounds, is_logarithmic=True)


def _errors(run: Run) -> Panel:
    """Return the tracking error, and beside it that of the baseline."""
    (time, place), own, beside, other = _times(run), off(run), {}, run.baseline
    traces = [Trace(name, place(run, values), dash=i, paint=ERRORS[i]) for name, (values, i) in own.items()]
    bounds, told = None, ""
    if other is not None and len(other):
        beside = off(other)
        traces += [
            Trace(f"baseline, {name}", place(other, values), 0, i + 1, 1.0, is_gray=True)
            for name, (values, i) in beside.items()
        ]
        bounds = _room([one for one, _ in own.values()], [one for one, _ in beside.values()], -0.02)
    if bounds:
        name, (values, _) = max(beside.items(), key=lambda one: float(one[1][0].max()))
        told = f"baseline {grouped(float(values.max()))}, {name}, beyond the plot"
    return Panel("Tracking error", f"error [{', '.join(error_units(own))}]", time, traces, (), bounds, told)


def _pace(runs: Mapping[str, Run]) -> list[Panel]:
    if not any(applies("pace", run) for run in runs.values()):
        return []
    time, curves = _curves(runs, {label: run["path_rate"] for label, run in runs.items()}, "ṡ", paint=GOLD)
    return [Panel("Pace along the path", "ṡ [1]", time, curves, bounds=(-0.05, 1.1))]


def _lanes(runs: Mapping[str, Run]) -> list[Panel]:
    """Return the times of each status, with one lane per status."""
    lanes: list[tuple[str, Status, Run]] = [
        (f"{label}: {in_words(flag)}" if label else in_words(flag), flag, run)
        for label, run in reversed(list(runs.items()))
        for flag in reversed(statuses(run))
    ]
    if not lanes:
        return []
    holds = {}
    for i, (name, flag, run) in enumerate(lanes):
        state = (run["status"].astype(np.int64) & int(flag)) != 0
        seen = np.convolve(state, np.ones(len(state) // PIXELS + 2))[: len(state)] > 0.0
        holds[name] = np.where(seen, float(i), math.nan)
    time = _common({name: run["time"] for name, _, run in lanes})
    traces = [
        Trace(name, _placed_at(time, run["time"], holds[name]), width=12.0, paint=of_status(int(flag)))
        for name, flag, run in lanes
    ]
    names = [name for name, _, _ in lanes]
    return [Panel("Status", "", time, traces, bounds=(-0.6, len(names) - 0.4), lanes=names)]


def _curves(
    runs: Mapping[str, Run],
    values: Mapping[str, Array],
    what: str = "",
    dash: int = 0,
    paint: int | None = None,
) -> tuple[Array, list[Trace]]:
    """Return the times of all runs, and the curve of each at these; that of a single run has a paint."""
    time = _common({label: run["time"] for label, run in runs.items()})
    return time, [
        Trace(", ".join(filter(None, (label, what))), _placed_at(time, runs[label]["time"], one),
              i, dash if dash else i, paint=paint if len(runs) == 1 else None)
        for i, (label, one) in enumerate(values.items())
    ]  # fmt: skip


def _common(times: Mapping[str, Array]) -> Array:
    """Return all times, to the nanosecond."""
    return np.unique(np.round(np.concatenate(list(times.values())), 9))


def _placed_at(time: Array, own: Array, values: Array) -> Array:
    """Return values at all times; NaN where there is none."""
    spread = np.full(len(time), math.nan)
    spread[np.searchsorted(time, np.round(own, 9))] = values
    return spread


def _norms(title: str, unit: str, curves: tuple[Array, list[Trace]]) -> Panel:
    """Return a panel of values that are not negative: logarithmic if one curve dwarfs the others."""
    peaks = [float(np.nanmax(one.values)) for one in curves[1]]
    if max(peaks) <= APART * max(min(peaks), 1e-12):
        return Panel(title, unit, *curves)
    _, high = decades(np.array([max(peaks)]))
    return Panel(title, unit, *curves, bounds=(high * 10.0**-DECADES, high), is_logarithmic=True)


def kept(curves: Sequence[Array], room: int) -> NDArray[np.intp]:
    """Return the rows to draw.

    These are all, or those around the ends of the gaps if the curves are constant between them, or those with
    the least and largest value of each span of time.
    """
    count = len(curves[0])
    if count * (len(curves) + 1) <= room:
        return np.arange(count)
    changes = [np.flatnonzero((one[1:] != one[:-1]) & ~np.isnan(one[1:] + one[:-1])) for one in curves]
    if not any(len(one) for one in changes):
        ends = [np.flatnonzero(np.diff(np.isnan(one))) for one in curves]
        few = np.unique(np.concatenate([[0, count - 1], *ends, *(one + 1 for one in ends)]))
        if len(few) * (len(curves) + 1) <= room:
            return few
    spans = max(1, room // ((len(curves) + 1) * 2 * len(curves)))
    every = -(-count // spans)
    whole = count // every * every
    starts = np.arange(0, whole, every)
    rows = [np.array([0, count - 1]), np.arange(whole, count)]
    for one in curves:
        blocks = np.nan_to_num(one[:whole].reshape(-1, every), nan=0.0)
        rows += [starts + blocks.argmin(axis=1), starts + blocks.argmax(axis=1)]
    return np.unique(np.concatenate(rows))


def _packed(values: Array, is_logarithmic: bool = False) -> str:
    """Return values as little-endian 32-bit floats in base64; on a logarithmic axis 0 becomes NaN."""
    shown = np.where(values > 0.0, values, np.nan) if is_logarithmic else values
    with np.errstate(over="ignore"):  # values beyond the range have no place in a plot
        return base64.b64encode(shown.astype("<f4").tobytes()).decode()
