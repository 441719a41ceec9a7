"""The panels of a recording as plots: their curves, limits, peaks beyond the axis, and the marked instant.

Curves that are columns of a run are drawn from these. The others are in the component `curves` of the same
entity, as float32. The viewer has no logarithmic axis, and gets common logarithms. Lines keep the least and
the largest value of each pixel, so that a peak of one tick is drawn as high as it is.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from rmrc.recording.look import instants
from rmrc.recording.stream import Stream
from rmrc.results.columns import COLUMNS
from rmrc.results.run import Run
from rmrc.scenario.sections import LookSection
from rmrc.show.panels import Curve, Panel

Array = NDArray[np.float64]

# Widths of curves by their roles, of limits, and of marks [points].
WIDTHS = {"measured": 3.0, "commanded": 1.3, "plain": 1.5, "baseline": 1.5, "second": 1.5}
LIMIT, MARK = 1.0, 7.0
# Length of the time axis over that of the runs: the legend is beside the curves.
LONGER = 1.25
# Distance of a peak's mark from the end of the axis, as a share of it.
EDGE = 0.03

# Begins the entities of a baseline.
BASELINE = "baseline/"
SOURCE = ComponentSourceKind.SourceComponent


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
        self.instants = instants(look, panel, runs)
        self._end = max(float(run["time"][-1]) for run in runs.values())
        self._curves = dict[tuple[str, str, str], list[Curve]]()
        for curve in panel.curves:
            self._curves.setdefault(self._source(curve), []).append(curve)
        # a color has one entry in the legend, with the name of its first curve
        self._names = {curve.color: curve.label for curve in reversed(panel.curves)}

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
        for path, times, values, _ in self._marks():
            time, each = np.array(times), np.tile(values, (len(times), 1))
            ticks = np.rint(time / period).astype(np.int64)
            stream.send(path, ticks, time, rr.Scalars.columns(scalars=each))

    def view(self) -> rrb.TimeSeriesView:
        """Return it in the viewer's form, with everything beyond the axis in its title."""
        panel, looks = self.panel, dict[Any, Any]()
        for (prefix, component, selector), curves in self._curves.items():
            values = VisualizerComponentMapping(
                "Scalars:scalars", SOURCE, source_component=component, selector=selector
            )
            colors, widths = [curve.color for curve in curves], [WIDTHS[curve.role] for curve in curves]
            look = _look([self._names[color] for color in colors], colors, widths, [values])
            looks.setdefault(f"{prefix}columns", []).append(look)
        looks |= {path: [look] for path, *_, look in self._marks()}
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

    def _marks(self) -> Iterator[tuple[str, list[float], Array, rrb.Visualizer]]:
        """Yield limits and marks: entity, times [s], values at each of them, and look."""
        panel, levels = self.panel, self.panel.levels
        if levels:
            names = [level.name.removeprefix("limit, ") for level in levels]
            values = np.array([level.value for level in levels])
            look = _look(names, [level.color for level in levels], [LIMIT] * len(levels))
            yield f"levels/{panel.name}", [0.0, self._end], self._scaled(values), look
        low, high = self._scaled(np.array(panel.range))
        for i, peak in enumerate(panel.peaks):
            name, edge = self._names[peak.color], EDGE * (high - low)
            look = _look([name], [peak.color], [MARK], marker="up" if peak.is_up else "down")
            value = np.array([high - edge if peak.is_up else low + edge])
            yield f"peaks/{panel.name}/{i}", [peak.time], value, look
        for label, row in self.instants.items():
            curves = [curve for curve in panel.curves if curve.run == label and curve.role == "measured"]
            colors, names = [curve.color for curve in curves], [self._names[curve.color] for curve in curves]
            values = np.array([curve.values[row] for curve in curves])
            look = _look(names, colors, [MARK] * len(curves), marker="diamond")
            path, time = f"{self._prefixes[label]}look/{panel.name}", float(self._runs[label]["time"][row])
            yield path, [time], self._scaled(values), look

    def _scaled(self, values: Array) -> Array:
        """Return values as they are drawn; on a logarithmic axis the smallest are at its lower end."""
        if not self.panel.is_logarithmic:
            return values
        return np.asarray(np.log10(np.maximum(values, self.panel.range[0])))


def _look(
    names: Sequence[str], colors: Sequence[int], sizes: Sequence[float],
    values: Sequence[VisualizerComponentMapping] = (), marker: Literal["up", "down", "diamond"] | None = None,
) -> rrb.Visualizer:  # fmt: skip
    """Return the look of lines, or of points."""
    tints = np.array(colors, np.uint32)
    if marker:
        shapes = [marker] * len(names)
        return rr.SeriesPoints(names=names, colors=tints, markers=shapes, marker_sizes=sizes).visualizer()
    policy = rr.components.AggregationPolicy.MinMax
    lines = rr.SeriesLines(names=names, colors=tints, widths=sizes, aggregation_policy=policy)
    return lines.visualizer(mappings=list(values))
