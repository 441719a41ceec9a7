"""The plots of a recording: which curves, against which limits, over which range, and told apart by what.

Every curve keeps its least and its largest value where many ticks share a pixel, so that a peak of one tick
is drawn as high as it is.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from rmrc.show.palette import GRAY

# A curve may leave its plot where it is this much larger than its limit, or than it mostly is.
CLIP = 3.0
# Numbers beside an axis that there is room for in the smaller plots of a window of 720 points; the viewer
# writes one at each power of ten, or at each tenth of that where these are 20 points apart.
STEPS, MORE_STEPS = 4.4, 8.0
# The time at the right of the run, as a share of it: there the legends are, beside all that is drawn.
LEGEND = 0.3
# The strip of the events has no numbers at its left. It begins so much earlier, as a share of the plots, that
# the cursors are in line.
NUMBERS = 0.035
# Dashes and gaps of a curve, over a run.
DASHES = 120
# σ below this is drawn there: its logarithm has no end.
FLOOR = 1e-6

Colors = Sequence[int]


@dataclass(frozen=True)
class Curve:
    """A component of an entity as curves: one for each of its numbers.

    Attributes:
        entity: Its path, without a slash before it.
        source: Component, and field of it: `columns.qdot[]` are all numbers of the field `qdot`.
        names: In the legend; an empty one is not there.
        colors: 0xRRGGBBAA.
        width: Of the lines [points].
        marker: Instead of lines, points of this shape.
    """

    entity: str
    source: str
    names: Sequence[str]
    colors: Colors
    width: float = 2.0
    marker: Literal["up", "down", "diamond"] | None = None

    def visualizer(self) -> rrb.Visualizer:
        """Return how the viewer draws it."""
        component, dot, field_ = self.source.partition(".")
        source = VisualizerComponentMapping(
            "Scalars:scalars",
            ComponentSourceKind.SourceComponent,
            source_component=component,
            selector=dot + field_,
        )
        names, colors = list(self.names), np.array(self.colors, np.uint32)
        if self.marker is not None:
            sizes = [self.width] * len(names)
            points = rr.SeriesPoints(names=names, colors=colors, markers=self.marker, marker_sizes=sizes)
            return points.visualizer(mappings=[source])
        lines = rr.SeriesLines(
            names=names,
            colors=colors,
            widths=[self.width] * len(names),
            aggregation_policy=rr.components.AggregationPolicy.MinMax,
        )
        return lines.visualizer(mappings=[source])


@dataclass(frozen=True)
class Panel:
    """A plot.

    Attributes:
        title: What it shows, with its unit.
        curves: In the order in which they are drawn.
        range: Of its axis; None: all that there is.
    """

    title: str
    curves: Sequence[Curve]
    range: tuple[float, float] | None = None

    def view(self, axis: rrb.TimeAxis) -> rrb.TimeSeriesView:
        """Return it as the viewer has it."""
        drawn: dict[Any, list[rrb.Visualizer]] = {}
        for curve in self.curves:
            drawn.setdefault(curve.entity, []).append(curve.visualizer())
        return rrb.TimeSeriesView(
            name=self.title,
            contents=[f"/{entity}" for entity in drawn],
            overrides=drawn,
            axis_x=axis,
            axis_y=rrb.ScalarAxis(range=self.range, zoom_lock=False),
            plot_legend=rrb.Corner2D.RightTop,
        )


@dataclass(frozen=True)
class Peak:
    """Where something was largest.

    Attributes:
        time: When [s].
        value: With its sign.
        which: Whose it was: the number of the curve.
    """

    time: float
    value: float
    which: int


@dataclass(frozen=True, eq=False)
class Mark:
    """The instant of a run that its scenario asks to look at.

    Attributes:
        time: When [s].
        values: That the plot has there, (k,).
        tip: Where the tip is, (3,) [m].
        worth: How much there is to see; the largest of a run is kept.
    """

    time: float
    values: NDArray[np.float64]
    tip: NDArray[np.float64]
    worth: float

    @property
    def text(self) -> str:
        """What is written beside it."""
        return f"look: {spell(self.time)} s"


class Seen:
    """What a run shows, tick by tick: the extremes that its plots have room for.

    Attributes:
        end: Time of the last tick [s].
        mark: What its scenario asks to look at, if that is there.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.end = 0.0
        self.mark: Mark | None = None
        self._peaks: dict[str, Peak] = {}
        self._least: dict[str, float] = {}
        self._sizes: dict[str, list[NDArray[np.float32]]] = {}

    def add(self, time: NDArray[np.float64], values: Mapping[str, NDArray[np.generic]]) -> None:
        """Take a block.

        Args:
            time: Of its ticks, (T,) [s].
            values: By name, (T,) or (T, width).
        """
        self.end = max(self.end, float(time[-1]))
        for name, found in values.items():
            wide = np.abs(np.nan_to_num(found.reshape(len(time), -1), nan=0.0))
            size = wide.max(axis=1)
            row = int(size.argmax())
            self._sizes.setdefault(name, []).append(size.astype(np.float32))
            if name not in self._peaks or size[row] > abs(self._peaks[name].value):
                which = int(wide[row].argmax())
                value = float(found.reshape(len(time), -1)[row, which])
                self._peaks[name] = Peak(float(time[row]), value, which)

    def peak(self, *names: str) -> Peak | None:
        """Return the largest value of some of what was taken, if there is any."""
        found = [self._peaks[name] for name in names if name in self._peaks]
        return max(found, key=lambda peak: abs(peak.value), default=None)

    def mostly(self, name: str) -> float:
        """Return how large something is at nine of ten ticks, at most."""
        sizes = self._sizes.get(name)
        return float(np.quantile(np.concatenate(sizes), 0.9)) if sizes else 0.0


def rounded(largest: float, steps: float = STEPS) -> float:
    """Return the end of an axis from 0 that shows so much, and three numbers at least.

    >>> [round(rounded(x), 3) for x in (0.004, 1.5, 3.0, 4.3, 7.0, 0.0)]
    [0.004, 2.05, 3.15, 4.4, 20.5, 2.05]
    """
    if not (largest > 0.0 and math.isfinite(largest)):
        return 2.05
    decade = 10.0 ** math.floor(math.log10(largest))
    if largest <= 2.0 * decade:
        return 2.05 * decade
    return min(1.05 * largest, steps * decade) if largest <= steps * decade else 20.5 * decade


def both_ways(largest: float, steps: float = STEPS) -> tuple[float, float]:
    """Return the ends of an axis around 0 that shows so much, and three numbers at least.

    >>> both_ways(1.0), both_ways(3.0)
    ((-1.05, 1.05), (-10.5, 10.5))
    """
    if not (largest > 0.0 and math.isfinite(largest)):
        return -1.05, 1.05
    decade = 10.0 ** math.floor(math.log10(largest))
    end = 1.05 * largest if 2.1 * largest <= steps * decade else 10.5 * decade
    return -end, end


def clipped(peak: float, limit: float, mostly: float) -> float:
    """Return how much a plot shows of what reaches a peak: a few times its limit, or what it mostly is.

    Args:
        peak: Largest magnitude.
        limit: Largest finite limit, or 0.
        mostly: Magnitude at nine of ten ticks.
    """
    usual = limit or max(mostly, 1e-9)
    if peak <= CLIP * usual:
        return max(peak, 1.1 * limit if limit <= CLIP * peak else 0.0)
    return CLIP * usual


def decades(least: float, largest: float) -> tuple[float, float]:
    """Return the ends of an axis of common logarithms, three powers of ten at least and six at most."""
    top = math.log10(max(largest, 100 * FLOOR)) + 0.15
    bottom = math.floor(math.log10(max(least, FLOOR)) + 1e-9) - 0.1
    return max(min(bottom, math.floor(top) - 2.1), top - 5.2), top


def logarithm(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return common logarithms, of nothing below the floor."""
    return np.asarray(np.log10(np.maximum(values, FLOOR)))


def dashes(time: NDArray[np.float64], values: NDArray[np.float64], duration: float) -> NDArray[np.float64]:
    """Return a curve as dashes: with gaps, but for where it is largest in a block.

    Args:
        time: Of a block, (T,) [s].
        values: (T, n).
        duration: Of the run [s].
    """
    dash = np.floor(time / (duration / DASHES)).astype(np.int64)
    size = np.nan_to_num(np.abs(values), nan=0.0, posinf=np.inf).max(axis=1)
    is_drawn = (dash % 2 == 0) | (dash == dash[size.argmax()])
    return np.where(is_drawn[:, None], values, np.nan)


def limit_lines(
    limits: Iterable[float], joints: Sequence[str], hues: Colors
) -> tuple[list[float], list[str], list[int]]:
    """Return the limits that a plot shows, both ways, with names and colors: one line if all are the same.

    Args:
        limits: Of each joint, infinite where it has none.
        joints: Their names.
        hues: Their colors.
    """
    rows = zip(limits, joints, hues, strict=True)
    known = [row for row in rows if math.isfinite(row[0])]
    if len({limit for limit, *_ in known}) == 1 and len(known) == len(hues):
        known = [(known[0][0], "limit", GRAY)]
    both = [(sign * limit, name, color) for limit, name, color in known for sign in (1.0, -1.0)]
    return [one[0] for one in both], [one[1] for one in both], [one[2] for one in both]


def spell(number: float) -> str:
    """Return a number for a title.

    >>> spell(12658.02), spell(3.1416), spell(0.07123)
    ('12,658', '3.14', '0.0712')
    """
    return f"{number:,.0f}" if abs(number) >= 1000 else f"{number:.3g}"


def over_time(end: float) -> rrb.TimeAxis:
    """Return the time of a plot: from 0 to the end of the run, and room for the legend."""
    return _axis(0.0, (1.0 + LEGEND) * end)


def under_time(end: float) -> rrb.TimeAxis:
    """Return the time of the strip below the plots."""
    return _axis(-NUMBERS * (1.0 + LEGEND) * end, (1.0 + LEGEND) * end)


def _axis(begin: float, end: float) -> rrb.TimeAxis:
    first, last = (rrb.TimeRangeBoundary.absolute(seconds=second) for second in (begin, end))
    return rrb.TimeAxis(view_range=rr.TimeRange(start=first, end=last))
