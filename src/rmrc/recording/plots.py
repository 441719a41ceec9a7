"""The plots of a recording: their curves, limits and ranges, and the colors of the curves.

Every curve keeps its least and its largest value where many ticks share a pixel, so that a peak of one tick
is drawn as high as it is.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from rmrc.results.run import Run
from rmrc.show.palette import GRAY

# A curve may leave its plot where it exceeds its limit, or its usual size, by this factor.
CLIP = 3.0
# In a window of 1280 × 720 points: width and height of the plots, height of the title and the times of a
# plot, and the space left of its numbers.
WIDTH, HEIGHT, AROUND, LEFT = 766.0, 652.0, 45.0, 9.0
# Height of a number. The viewer writes numbers at powers of ten, or at tenths of them that are this far
# apart.
NUMBER, SECOND = 21.0, 64.0
# Widths of a letter of the legend, a letter of the strip, a digit, and the frame of a legend's line; height
# of that line.
LETTER, LABEL, DIGIT, ENTRY, LINE = 5.3, 6.7, 7.0, 46.0, 23.0
# Share of a plot that a legend may fill before it scrolls, and the height of its frame.
FILLED, FRAME = 0.8, 12.0
# The viewer's steps of the time axis [s].
STEPS = (*(10.0**power for power in range(-9, 2)), 60.0, 600.0, 3600.0, 36000.0)
# Share of a plot that a run keeps beside a long legend, and the factor by which three numbers may lengthen
# it.
BESIDE, LONGER = 0.75, 1.2
# Largest number of times on a ruler after 0.
RULED = 8
# Width of the plots in a window of 1600 points, over that in one of 1280.
WIDEST = 1.25
# Number of dashes and gaps of a curve over a run.
DASHES = 120
# Values whose usual size is needed.
USUAL = ("qdot_cmd", "fastest_cmd")
# A smaller σ is drawn as this value: its logarithm has no lower end.
FLOOR = 1e-6

Colors = Sequence[int]


@dataclass(frozen=True)
class Curve:
    """A component of an entity as curves: one for each of its numbers.

    Attributes:
        entity: Its path, without a slash before it.
        source: Component, and field of it: `columns.qdot[]` are all numbers of the field `qdot`.
        names: Names in the legend, which has each once, in the color that comes first.
        colors: 0xRRGGBBAA.
        width: Width of the lines, or of each [points].
        marker: Shape of points to draw instead of lines.
        spare: Other names for a legend without room; a single one is that of all curves.
    """

    entity: str
    source: str
    names: Sequence[str]
    colors: Colors
    width: float | Sequence[float] = 2.0
    marker: Literal["up", "down", "diamond"] | None = None
    spare: Sequence[str] = ()

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
        widths = np.broadcast_to(self.width, len(names))
        if self.marker is not None:
            points = rr.SeriesPoints(names=names, colors=colors, markers=self.marker, marker_sizes=widths)
            return points.visualizer(mappings=[source])
        lines = rr.SeriesLines(
            names=names,
            colors=colors,
            widths=widths,
            aggregation_policy=rr.components.AggregationPolicy.MinMax,
        )
        return lines.visualizer(mappings=[source])


@dataclass(frozen=True)
class Panel:
    """A plot.

    Attributes:
        title: Its quantity, with its unit.
        curves: In the order in which they are drawn.
        range: Range of its axis; None: the whole data.
        is_key: Whether its legend serves the other plots too, and stays even if it is too long.
        has_legend: Whether it has one.
        alone: Its title if there is no legend, with the names of the curves; "": the same title.
    """

    title: str
    curves: Sequence[Curve]
    range: tuple[float, float] | None = None
    is_key: bool = False
    has_legend: bool = True
    alone: str = ""

    @property
    def names(self) -> set[str]:
        """The texts of the legend."""
        return {name for curve in self.curves for name in curve.names} if self.has_legend else set()

    @property
    def least(self) -> set[str]:
        """The shortest texts of the legend."""
        return {name for one in self.curves for name in one.spare or one.names}

    @property
    def legend(self) -> float:
        """Width of the legend [points]."""
        return max((ENTRY + LETTER * len(name) for name in self.names), default=0.0)

    def fitted(self, height: float) -> "Panel":
        """Return it with a legend that fits into a plot of this height, or without one that is too long."""
        room, panel = int((FILLED * height - FRAME) // LINE), self
        for i, one in enumerate(self.curves):
            if len(panel.names) > room and one.spare:
                curves = [*panel.curves]
                names = one.spare if len(one.spare) > 1 else [*one.spare] * len(one.names)
                curves[i] = replace(one, names=names)
                panel = replace(panel, curves=curves)
        has_legend = panel.is_key or len(panel.names) <= room
        title = panel.title if has_legend else panel.alone or panel.title
        return replace(panel, title=title, has_legend=has_legend)

    def numbers(self, height: float) -> float:
        """Return the width of the numbers beside the axis [points]."""
        low, high = self.range or (-1.0, 1.0)
        power = math.ceil(math.log10((high - low) * NUMBER / height) - 1e-9)
        ticks = range(math.ceil(low / 10.0**power), math.floor(high / 10.0**power) + 1)
        texts = [f"{tick * 10.0**power:.{max(0, -power)}f}" for tick in ticks]
        return max((DIGIT * len(text) - DIGIT / 2 * ("." in text) for text in texts), default=DIGIT)

    def view(self, axis: rrb.TimeAxis) -> rrb.TimeSeriesView:
        """Return it in the viewer's form."""
        drawn: dict[Any, list[rrb.Visualizer]] = {}
        for curve in self.curves:
            drawn.setdefault(curve.entity, []).append(curve.visualizer())
        return rrb.TimeSeriesView(
            name=self.title,
            contents=[f"/{entity}" for entity in drawn],
            overrides=drawn,
            axis_x=axis,
            axis_y=rrb.ScalarAxis(range=self.range) if self.range else None,
            plot_legend=rrb.PlotLegend("RightTop", visible=None if self.has_legend else False),
        )


@dataclass(frozen=True)
class Span:
    """The common time axis of all plots, whose cursors are in line.

    Attributes:
        end: End of the run [s].
        last: Time at the right end of the plots, which have the legend there, and at least three numbers [s].
        numbers: Largest width of the numbers beside an axis [points].
        ruler: Times in a lane of their own, if the plots have fewer than three [s].
    """

    end: float
    last: float
    numbers: float
    ruler: tuple[float, ...] = ()

    @classmethod
    def of(cls, end: float, legend: float, numbers: float) -> "Span":
        """Return the span of a run, given the widest of its legends and numbers [points]."""
        width = WIDTH - LEFT - numbers
        last = end * width / max(width - legend, 0.4 * width)
        step, ruled = _step(width, last), ruler(end)
        last = last if ruled else max(last, 2.05 * step)
        edge = 18.0 * last / width
        for one in (step, _step(WIDEST * width, last)):  # no number is cut in two in either window
            whole = one * round(last / one)
            last = whole + edge if abs(last - whole) < edge else last
        return cls(end, last, numbers, ruled)

    @property
    def letters(self) -> float:
        """Number of letters that fit into the strip of the run."""
        return (WIDTH - LEFT - self.numbers) * self.end / self.last / LABEL

    def axis(self, points: float) -> rrb.TimeAxis:
        """Return the time of a view whose own numbers are narrower than those of others by so much."""
        begin = -points * self.last / (WIDTH - LEFT - self.numbers)
        first, last = (rrb.TimeRangeBoundary.absolute(seconds=second) for second in (begin, self.last))
        return rrb.TimeAxis(view_range=rr.TimeRange(start=first, end=last))

    def under(self) -> rrb.TimeAxis:
        """Return the time of the strip below the plots, which has no numbers at its left."""
        return self.axis(LEFT + self.numbers)


def _step(width: float, last: float) -> float:
    """Return the time between two numbers of an axis with this width [points] and length [s]."""
    return next((one for one in STEPS if width * one >= SECOND * last), STEPS[-1])


def ruler(end: float) -> tuple[float, ...]:
    """Return the times for a lane of their own; none if the plots have enough without much more length.

    Args:
        end: End of the run [s].

    >>> ruler(5.2), ruler(13.4)
    ((), (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0))
    """
    if 2.05 * _step(BESIDE * WIDTH, end) <= LONGER * end or not 0.0 < end < STEPS[-1]:
        return ()
    decade = 10.0 ** math.floor(math.log10(end / RULED))
    step = next(one * decade for one in (1.0, 2.0, 5.0, 10.0) if end <= RULED * one * decade)
    return tuple(step * i for i in range(RULED + 1) if step * i <= end - 0.35 * step)


@dataclass(frozen=True)
class Peak:
    """The largest value of a quantity.

    Attributes:
        time: When [s].
        value: With its sign.
        which: The number of its curve.
    """

    time: float
    value: float
    which: int


@dataclass(frozen=True, eq=False)
class Mark:
    """The instant of a run at which its scenario asks to look.

    Attributes:
        time: When [s].
            values: Values of the plot there, (k,).
            instant: The run at that tick alone.
            worth: Measure of interest; the largest of a run is kept.
    """

    time: float
    values: NDArray[np.float64]
    instant: Run
    worth: float

    @classmethod
    def of(cls, part: Run, row: int, values: NDArray[np.float64], worth: float) -> "Mark":
        """Return the mark of a tick of a block, whose plot has values (T, k)."""
        columns = {name: column[row : row + 1].copy() for name, column in part.columns.items()}
        instant = replace(part, columns=columns, divergence=None)
        return cls(float(part["time"][row]), values[row].copy(), instant, worth)

    @property
    def text(self) -> str:
        """The text beside it."""
        return f"look: {spell(self.time)} s"


class Seen:
    """Extremes of a run, tick by tick, for the ranges of its plots.

    Attributes:
        end: Time of the last tick [s].
        mark: The instant that its scenario asks to look at, if any.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.end = 0.0
        self.mark: Mark | None = None
        self._peaks: dict[str, Peak] = {}
        self._least: dict[str, float] = {}
        self._sizes: dict[str, list[NDArray[np.float64]]] = {}
        self._mostly: dict[str, float] = {}

    def add(self, time: NDArray[np.float64], values: Mapping[str, NDArray[np.generic]]) -> None:
        """Take a block.

        Args:
            time: Time of its ticks, (T,) [s].
            values: By name, (T,) or (T, width).
        """
        self.end = max(self.end, float(time[-1]))
        self._mostly.clear()
        for name, found in values.items():
            wide = found.reshape(len(time), -1)
            if name in USUAL:
                self._sizes.setdefault(name, []).append(np.fmax.reduce(np.abs(wide), axis=1))
            size = max(-float(np.fmin.reduce(wide, axis=None)), float(np.fmax.reduce(wide, axis=None)))
            known = self._peaks.get(name)
            if not math.isnan(size) and (known is None or size > abs(known.value)):
                row, which = divmod(int((np.abs(wide) == size).argmax()), wide.shape[1])
                self._peaks[name] = Peak(float(time[row]), float(wide[row, which]), which)

    def peak(self, *names: str) -> Peak | None:
        """Return the largest of some recorded values, if there are any."""
        found = [self._peaks[name] for name in names if name in self._peaks]
        return max(found, key=lambda peak: abs(peak.value), default=None)

    def mostly(self, name: str) -> float:
        """Return the bound of a quantity of `USUAL` that holds at nine of ten ticks."""
        sizes = self._sizes.get(name)
        if sizes and name not in self._mostly:
            self._mostly[name] = float(np.quantile(np.nan_to_num(np.concatenate(sizes)), 0.9))
        return self._mostly.get(name, 0.0)


def rounded(largest: float, steps: float = 4.7) -> float:
    """Return the end of an axis from 0 with room for a value, and at least three labels.

    Args:
        largest: Largest value to show.
        steps: Possible steps between labels.

    >>> [round(rounded(x), 3) for x in (0.004, 1.5, 3.0, 4.3, 4.6, 7.0, 0.0)]
    [0.004, 2.2, 3.229, 4.515, 4.7, 22.0, 2.2]
    """
    below = 1.0 - 1.0 / (3.0 * steps)  # a number is not cut in two at the end
    two = max(2.2, 2.0 / below)
    if not (largest > 0.0 and math.isfinite(largest)):
        return two
    decade = 10.0 ** math.floor(math.log10(largest))
    if largest <= 2.0 * decade:
        return two * decade
    end = max(1.05 * largest, decade * math.floor(1.05 * largest / decade) / below)
    return min(end, steps * decade) if largest <= steps * decade else 10.0 * two * decade


def both_ways(largest: float, steps: float = 4.7) -> tuple[float, float]:
    """Return the ends of an axis around 0 with room for a value, and at least three labels.

    Args:
        largest: Largest magnitude to show.
        steps: Possible steps between labels.

    >>> [round(both_ways(x)[1], 3) for x in (1.0, 1.6, 3.0)]
    [1.165, 1.68, 11.653]
    """
    if not (largest > 0.0 and math.isfinite(largest)):
        return -1.05, 1.05
    decade = 10.0 ** math.floor(math.log10(largest))
    end, step = (1.05 * largest, decade) if 2.1 * largest <= steps * decade else (10.5 * decade, 10 * decade)
    whole = step * math.floor(end / step) / (1.0 - 1.0 / (1.5 * steps))  # no number is cut in two at the end
    end = max(end, min(whole, 0.5 * steps * step))
    return -end, end


def clipped(peak: float, limit: float, mostly: float) -> float:
    """Return how much of a curve with a peak a plot shows: a few times its limit, or of its usual values.

    Args:
        peak: Largest magnitude.
        limit: Largest finite limit, or 0.
        mostly: Magnitude at nine of ten ticks.
    """
    usual = limit or max(mostly, 1e-9)
    if peak <= CLIP * usual:
        return max(peak, limit if limit <= CLIP * peak else 0.0)
    return CLIP * usual


def decades(least: float, largest: float, steps: float = 5.2) -> tuple[float, float]:
    """Return the ends of an axis of common logarithms, three powers of ten at least and six at most.

    Args:
        least: Smallest value to show.
        largest: Largest value to show.
        steps: Number of powers of ten whose numbers fit on the axis.
    """
    top = math.log10(max(largest, 100 * FLOOR)) + 0.15
    bottom = math.floor(math.log10(max(least, FLOOR)) + 1e-9) - 0.1
    return max(min(bottom, math.floor(top) - 2.1), top - min(5.2, steps)), top


def below(least: float, axis: tuple[float, float]) -> str:
    """Return the part of a title that names the least value, if it is below an axis of logarithms."""
    return "" if math.log10(max(least, FLOOR)) >= axis[0] else f"; least σ_min {spell(least)} ↓"


def logarithm(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return common logarithms, with a floor."""
    return np.asarray(np.log10(np.maximum(values, FLOOR)))


def dashes(time: NDArray[np.float64], values: NDArray[np.float64], duration: float) -> NDArray[np.float64]:
    """Return a curve as dashes: with gaps, except where it is largest in a block.

    Args:
        time: Time of a block, (T,) [s].
        values: (T, n).
        duration: Duration of the run [s].
    """
    dash = np.floor(time / (duration / DASHES)).astype(np.int64)
    size = np.fmax.reduce(np.abs(values), axis=1, initial=0.0)
    is_drawn = (dash % 2 == 0) | (dash == dash[size.argmax()])
    return np.where(is_drawn[:, None], values, np.nan)


def limit_lines(
    limits: Iterable[float], joints: Sequence[str], hues: Colors
) -> tuple[list[float], list[str], list[int]]:
    """Return the limits in a plot, in both directions, with names and colors: one line if all are the same.

    Args:
        limits: Limits of each joint, infinite where it has none.
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
