"""The panels of a recording as plots: their curves, limits, peaks beyond the axis, and the marked instant.

Curves that are columns of a run are drawn from these. The others are in the component `curves` of the same
entity, as float32. The viewer has no logarithmic axis, and gets common logarithms. Lines keep the least and
the largest value of each pixel, so that a peak of one tick is drawn as high as it is.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.blueprint.encodings import VisualizerComponentMapping

from rmrc.recording.picture import Stream
from rmrc.results.columns import COLUMNS
from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.scenario.sections import LookSection
from rmrc.show.palette import RED, of_status
from rmrc.show.panels import Curve, Panel, grouped, in_words
from rmrc.simulation.prepare import Prepared

Array = NDArray[np.float64]

# Widths of curves by their roles, and size of marks [points].
WIDTHS, MARK = {"measured": 3.0, "commanded": 1.3, "plain": 1.5, "baseline": 1.5}, 7.0
# Length of the time axis over that of the runs: the legend is beside the curves.
LONGER = 1.25
# Where a peak beyond the axis has its mark, as a share of the end of the axis.
EDGE = 0.97
# Panels of the quantities to look at that have another name, and roles of the curves that count there.
ERRORS, ROLES = ("error", "turn_error"), ("measured", "commanded")
PANELS = {"rotation": ("turn_error",), "status": ("rates",), "error": ERRORS, "path": ERRORS}
# Begins the entities of a baseline.
BASELINE = "baseline/"

Marker = Literal["up", "down", "diamond"]


class Plot:
    """A panel in the viewer.

    Attributes:
        panel: The panel.
        instants: Ticks that are marked, by the labels of their runs.
    """

    def __init__(
        self, panel: Panel, runs: Mapping[str, Run], prefixes: Mapping[str, str], look: LookSection | None
    ) -> None:
        """Arrange the curves.

        Args:
            panel: The panel.
            runs: The runs by the labels of their curves.
            prefixes: Begins the entities of each run, by its label.
            look: Where the scenario asks to look.
        """
        self.panel, self._runs, self._prefixes = panel, runs, prefixes
        self.instants = _instants(look, panel, runs)
        self._end = max(float(run["time"][-1]) for run in runs.values()) or 1.0  # of a single tick
        # a color has one entry in the legend, with the name of its first curve
        names = {curve.color: curve.label for curve in reversed(panel.curves)}
        self._names, self._curves = names, dict[tuple[str, str, str], list[Curve]]()
        for curve in panel.curves:
            named = replace(curve, name=names[curve.color])
            self._curves.setdefault(self._source(curve), []).append(named)

    def _source(self, curve: Curve) -> tuple[str, str, str]:
        """Return prefix, component and selector of the values of a curve."""
        prefix = BASELINE if curve.role == "baseline" else self._prefixes[curve.run]
        if curve.source is None or self.panel.is_logarithmic:
            return prefix, "curves", f".{self.panel.name}[]"
        column, _ = curve.source
        return prefix, "columns", f".{column}" + "[]" * bool(COLUMNS[column].width)

    def curves(self, prefix: str) -> dict[str, NDArray[np.float32]]:
        """Return the curves of a run that are no columns, (T, k), as they are drawn, by the panel's name."""
        curves = self._curves.get((prefix, "curves", f".{self.panel.name}[]"))
        values = [self._scaled(curve.values) for curve in curves or ()]
        return {self.panel.name: np.column_stack(values).astype(np.float32)} if curves else {}

    def write(self, stream: Stream, period: float) -> None:
        """Write limits and marks; ticks have this period [s]."""
        for path, curves, _ in self._marks():
            time, values = curves[0].time, [self._scaled(curve.values) for curve in curves]
            ticks = np.rint(time / period).astype(np.int64)
            stream.send(path, ticks, time, rr.Scalars.columns(scalars=np.column_stack(values)))

    def view(self) -> rrb.TimeSeriesView:
        """Return it in the viewer's form, with everything beyond the axis in its title."""
        panel, looks = self.panel, dict[Any, Any]()
        for (prefix, component, selector), curves in self._curves.items():
            values = VisualizerComponentMapping(
                "Scalars:scalars", "SourceComponent", source_component=component, selector=selector
            )
            looks.setdefault(f"{prefix}columns", []).append(_look(curves, None, values))
        looks |= {path: [_look(curves, marker)] for path, curves, marker in self._marks()}
        unit = "" if panel.unit == "1" else f" [{panel.unit}]"
        thin = ", commanded thin" * any(curve.role == "commanded" for curve in panel.curves)
        title = f"{panel.title}{unit}{', as log₁₀' * panel.is_logarithmic}{thin}"
        return rrb.TimeSeriesView(
            name="; ".join([title, *panel.beyond]),
            contents=[f"/{entity}" for entity in looks],
            overrides=looks,
            axis_x=self.time_axis(),
            axis_y=rrb.ScalarAxis(range=self._scaled(np.array(panel.range))),
            plot_legend=rrb.PlotLegend("RightTop"),
        )

    def time_axis(self) -> rrb.TimeAxis:
        """Return the time that all plots have in common."""
        begin, end = (rrb.TimeRangeBoundary.absolute(seconds=time) for time in (0.0, LONGER * self._end))
        return rrb.TimeAxis(view_range=rr.TimeRange(start=begin, end=end))

    def _marks(self) -> Iterator[tuple[str, list[Curve], Marker | None]]:
        """Yield limits and marks as curves over a few times: their entity, and the shape of points."""
        panel, ends = self.panel, np.array([0.0, self._end])
        levels = [
            Curve(line.name.removeprefix("limit, "), ends, np.full(2, line.value), line.color, role="plain")
            for line in panel.levels
        ]
        if levels:
            yield f"levels/{panel.name}", levels, None
        for i, peak in enumerate(panel.peaks):
            time, edge = np.array([peak.time]), np.array([EDGE * panel.range[int(peak.is_up)]])
            mark = Curve(self._names[peak.color], time, edge, peak.color)
            yield f"peaks/{panel.name}/{i}", [mark], "up" if peak.is_up else "down"
        for label, row in self.instants.items():
            curves = [curve for curve in panel.curves if curve.run == label and curve.role == "measured"]
            marks = [replace(curve, time=curve.time[[row]], values=curve.values[[row]]) for curve in curves]
            yield f"{self._prefixes[label]}look/{panel.name}", marks, "diamond"

    def _scaled(self, values: Array) -> Array:
        """Return values as they are drawn; on a logarithmic axis the smallest are at its lower end."""
        if not self.panel.is_logarithmic:
            return values
        return np.asarray(np.log10(np.maximum(values, self.panel.range[0])))


def _look(
    curves: Sequence[Curve], marker: Marker | None, values: VisualizerComponentMapping | None = None
) -> rrb.Visualizer:
    """Return how the viewer draws curves from some values: as lines, or as points."""
    names, colors = [curve.name for curve in curves], np.array([curve.color for curve in curves], np.uint32)
    if marker:
        shapes, sizes = [marker] * len(curves), [MARK] * len(curves)
        return rr.SeriesPoints(names=names, colors=colors, markers=shapes, marker_sizes=sizes).visualizer()
    widths, policy = [WIDTHS[curve.role] for curve in curves], rr.components.AggregationPolicy.MinMax
    lines = rr.SeriesLines(names=names, colors=colors, widths=widths, aggregation_policy=policy)
    return lines.visualizer(mappings=[values] if values else None)


def _instants(look: LookSection | None, panel: Panel, runs: Mapping[str, Run]) -> dict[str, int]:
    """Return the tick of each run to look at in a panel: the one that is asked for, or the worst one.

    A run that ended before it has none, and so has any other panel.
    """
    if look is None or panel.name not in PANELS.get(look.quantity, (look.quantity,)):
        return {}
    if look.at is not None:
        lasting = {label: run for label, run in runs.items() if look.at <= run["time"][-1] + run.period}
        return {label: int(np.abs(run["time"] - look.at).argmin()) for label, run in lasting.items()}
    rows = dict[str, int]()
    for label, run in runs.items():
        curves = [curve for curve in panel.curves if curve.run == label and curve.role in ROLES]
        sizes = np.abs(np.nan_to_num([curve.values for curve in curves])).max(axis=0)
        if look.quantity in ("sigma", "pace"):
            sizes = -curves[0].values
        rows[label] = int((run["status"] != 0 if look.quantity == "status" else sizes).argmax())
    return rows


# Statuses and numbers -----------------------------------------------------------------------------
#
# What a run says in words: its statuses, on a strip, and its numbers, in a line beside the picture.


def words(status: int) -> str:
    """Return a status in words.

    >>> words(Status.DAMPED | Status.RATE_LIMITED), words(0)
    ('damped, rate limited', 'OK')
    """
    return ", ".join(in_words(flag) for flag in Status if flag & status) or "OK"


def write_strip(stream: Stream, path: str, run: Run) -> None:
    """Write the statuses of a run, each as long as it lasts, and a divergence at its end."""
    status = run["status"].astype(np.int64)
    ticks = np.flatnonzero(np.diff(status, prepend=-1))
    time, states = run["time"][ticks], [words(bits) for bits in status[ticks].tolist()]
    colors = {words(bits): of_status(bits) for bits in np.unique(status).tolist()}
    if run.divergence is not None:
        ticks, time = np.append(ticks, len(run)), np.append(time, run.divergence.time)
        states.append(str(run.divergence))
        colors[str(run.divergence)] = RED
    names, tints = list(colors), np.array(list(colors.values()), np.uint32)
    stream.log(path, rr.StateConfiguration(values=names, colors=tints))
    stream.send(path, ticks, time, rr.StateChange.columns(state=states))


def write_numbers(stream: Stream, prepared: Prepared, run: Run, ticks: NDArray[np.int64]) -> None:
    """Write a line of numbers at some ticks, (F,).

    Near a singularity the wanted speed along u_min, with its feedback, needs rates of speed / σ_min. Both are
    scaled as the law does.
    """
    task, limit = prepared.task, prepared.law.rate_limit
    wanted = run["twist_ref"][ticks] + prepared.scenario.control.feedback * run["pose_error"][ticks]
    twist = task.turned(wanted, run["pose"][ticks])[:, task.rows] * task.row_scale
    speed = np.abs((run["u_min"][ticks][:, task.rows] * twist).sum(axis=1)).round(9)  # at rest 0, not 4e-30
    sigma, rates = run["sigma"][ticks, -1], np.abs(run["qdot_cmd"][ticks])
    fastest = (rates / limit if np.isfinite(limit).all() else rates).argmax(axis=1)
    texts = []
    for i, tick in enumerate(ticks):
        j = fastest[i]
        of = f" of {grouped(limit[j])}" if np.isfinite(limit[j]) else ""
        needed = grouped(float(f"{speed[i] / sigma[i]:.2g}")) if sigma[i] > 0.0 else "∞"
        texts.append(
            f"σ_min **{sigma[i]:.3g}** · κ {grouped(run['condition'][tick])} · "
            f"λ {run['damping'][tick]:.2g} · **{words(int(run['status'][tick]))}**\n\n"
            f"fastest: {run.joints[j]} {grouped(rates[i, j])}{of} {run.joint_unit(j)}/s · "
            f"along the worst direction: speed/σ_min = {needed}"
        )
    stream.log("now", rr.TextDocument.from_fields(media_type="text/markdown"))
    stream.send("now", ticks, run["time"][ticks], rr.TextDocument.columns(text=texts))
