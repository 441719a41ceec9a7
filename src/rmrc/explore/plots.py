"""A run as plots over time, with a strip of its statuses; another run beside it, in gray."""

import html
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.show import traces
from rmrc.show.figures import DASHES
from rmrc.show.palette import of_status
from rmrc.show.panels import grouped, in_words, statuses
from rmrc.show.traces import GRAYS, ROOM, Panel, Trace, kept

Array = NDArray[np.float64]

# Rows of the plots of `rmrc.show.traces` on the page: rates, singular values, errors.
SHOWN = 3
# Room beyond the largest value of an axis that no limit bounds.
MARGIN = 1.08
# Least value of a logarithmic axis: uPlot writes less as 0.
LEAST = 1e-3
# Points of a curve that moves: about one for each pixel.
POINTS = 310
# Ends of the axes of plots that move: of rates, in limits, and at least [rad/s or m/s]; of errors, at least
# [mm or mrad].
LIMIT, LEAST_RATE, LEAST_ERROR = 1.25, 0.1, 1.0
# Dashes of limits and bounds, and of the rates of the plain inverse [px].
DOTS, PLAIN = (2.0, 4.0), (7.0, 4.0)
# Left and right of the data of a plot [px]: the lanes have them too, so that times are in line.
AREA = (59, 25)
# Metrics of the table: name in the scorecard, words, factor to the unit, unit.
FIGURES = (
    ("joint_rate_cmd.peak", "largest rate commanded", 1.0, ""),
    ("joint_rate_plain.peak", "… by the plain inverse", 1.0, ""),
    ("sigma.min", "least σ_min", 1.0, ""),
    ("damping.max", "largest λ", 1.0, ""),
    ("position_error.max", "largest position error", 1e3, "mm"),
    ("orientation_error.max", "largest rotation error", 1e3, "mrad"),
    ("duration", "duration", 1.0, ""),
)  # fmt: skip


class Plot(NamedTuple):
    """A plot in uPlot's form.

    Attributes:
        title: The title above it.
        data: Time, then the values of each curve, (T,) each.
        series: The style of each curve, time first.
        scales: The scales of its axes.
        axes: The labels of its axes.
    """

    title: str
    data: tuple[Array, ...]
    series: tuple[dict[str, Any], ...]
    scales: dict[str, Any]
    axes: tuple[dict[str, Any], ...]


def plots(
    run: Run, other: Run | None, *, dark: bool, with_plain: bool, seconds: float | None = None
) -> list[Plot]:
    """Return the plots of a run: its rates, singular values and errors.

    Args:
        run: The run, of one tick at least.
        other: The run in gray beside it.
        dark: Whether the page is dark.
        with_plain: Whether to draw the rates of the plain inverse.
        seconds: The length of the time axes of plots that move [s], whose other axes stand still if
            possible; None: the length of the run.
    """
    found = traces.of_run(replace(run, baseline=other))
    rates, sigma, errors = found.panels[:SHOWN]
    if other is not None:
        gray = Trace("before, σ_min", _at(sigma.time, other, other["sigma"][:, -1]), 0, is_gray=True)
        sigma = replace(sigma, traces=[*sigma.traces, gray])
    rates = replace(rates, traces=[one for one in rates.traces if _is_drawn(one, with_plain)])
    panels = [rates, sigma, errors]
    if seconds is not None:
        panels = [_thinned(one, max(1, round(seconds / run.period / POINTS))) for one in panels]
    drawn = [_plot(panel, found.colors, dark) for panel in panels]
    if seconds is not None:
        for plot in drawn:
            plot.scales["x"]["range"] = (0.0, seconds)
        if rates.lines:
            most = LIMIT * max(rates.lines)
            drawn[0].scales["y"]["range"] = (-most, most)
        for plot, least in ((drawn[0], LEAST_RATE), (drawn[2], LEAST_ERROR)):
            low, high = plot.scales["y"]["range"]
            plot.scales["y"]["range"] = (low and min(low, -least), max(high, least))
    return drawn


def _thinned(panel: Panel, every: int) -> Panel:
    """Return a panel with one value of each curve for so many ticks: the largest, so that peaks stay."""
    count = len(panel.time) // every * every
    if every == 1 or not count:
        return panel

    def largest(values: Array) -> Array:
        spans = values[-count:].reshape(-1, every)
        found: Array = spans[np.arange(len(spans)), np.abs(np.nan_to_num(spans)).argmax(axis=1)]
        return found

    traces = [replace(one, values=largest(one.values)) for one in panel.traces]
    return replace(panel, time=panel.time[-count::every], traces=traces)


def _is_drawn(trace: Trace, with_plain: bool) -> bool:
    return trace.is_shown or (with_plain and trace.label.endswith("plain inverse"))


def _at(time: Array, run: Run, values: Array) -> Array:
    """Return a curve of a run at other times; NaN after its end."""
    own = run["time"]
    return values if np.array_equal(time, own) else np.interp(time, own, values, right=math.nan)


def _plot(panel: Panel, colors: int, dark: bool) -> Plot:
    """Return a panel in uPlot's form. The curves of the run keep values beyond the axis."""
    # from the lowest layer up: the other run, the rates of the plain inverse, the run
    drawn = sorted(panel.traces, key=lambda one: (not one.is_gray, not one.label.endswith("plain inverse")))
    rows = kept([one.values for one in drawn], ROOM)
    time = panel.time[rows]
    data, series = [time], [dict[str, Any](label="t [s]")]
    for one in drawn:
        values = one.values[rows]
        data.append(np.where(values > 0.0, values, np.nan) if panel.is_logarithmic else values)
        is_plain = one.label.endswith("plain inverse")
        dashes = [2.0 * part for part in DASHES[one.dash % len(DASHES)]] if one.dash else ()
        dash = PLAIN if is_plain else dashes
        width = 2.0 if not (one.is_gray or is_plain) else 1.2
        series.append(_series(one.label, one.colors(colors)[dark], width, dash))
    for value in panel.lines:
        data.append(np.full(len(time), value))
        series.append(_series("ε" if panel.is_logarithmic else "limit", GRAYS[dark], 1.5, DOTS))
    low, high = panel.bounds or _range(data[1:])
    # near a singularity others go so far beyond the axis that unseen dashes would take the browser a second
    for i, one in enumerate(drawn, 1):
        if one.is_gray or one.label.endswith("plain inverse"):
            data[i] = data[i].clip(low - (high - low), high + (high - low))
    scale: dict[str, Any] = {"range": (low, high)}
    if panel.is_logarithmic:
        scale = {"range": (max(low, min(LEAST, 0.01 * high)), high), "distr": 3, "log": 10}
    plain = {"grid": {"show": False}, "ticks": {"show": False}} if panel.is_logarithmic else {}
    axes: tuple[dict[str, Any], ...] = (
        {"space": 60, "size": 26},
        {"size": 50, "space": 24, **plain},
    )
    title = f"{panel.title.partition('; dotted')[0]} {panel.unit[panel.unit.find('[') :]}"
    return Plot(title, tuple(data), tuple(series), {"x": {"time": False}, "y": scale}, axes)


def _series(label: str, stroke: str, width: float, dash: Sequence[float]) -> dict[str, Any]:
    found = {"label": label, "stroke": stroke, "width": width, "points": {"show": False}, "spanGaps": True}
    return found | ({"dash": tuple(dash)} if dash else {})


def _range(curves: Sequence[Array]) -> tuple[float, float]:
    """Return the ends of an axis, rounded, so that a small change does not move it."""
    values = np.concatenate([one[np.isfinite(one)] for one in curves])
    high = float(np.abs(values).max(initial=0.0)) * MARGIN or 1.0
    power = 10.0 ** math.floor(math.log10(high))
    end = next(part * power for part in (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0) if part * power >= high)
    return (-end if values.min(initial=0.0) < 0.0 else 0.0, end)


def key(plot: Plot) -> str:
    """Return the names of a plot's curves with their strokes, as HTML: those of uPlot take too much room."""
    told, seen = list[str](), set[str]()
    for one in plot.series[1:]:
        name = _short(one["label"])
        if name in seen:
            continue
        seen.add(name)
        dash = one.get("dash")
        style = "dotted" if dash == DOTS else "dashed" if dash else "solid"
        told.append(
            '<span style="white-space:nowrap;margin-right:.8em"><span style="display:inline-block;'
            f"width:1.4em;border-top:{1.5 * one['width']:.1f}px {style} {one['stroke']};"
            f'vertical-align:middle"></span> {html.escape(name)}</span>'
        )
    return (
        f'<div style="font-size:.8em;line-height:1.35;padding:0 .3em"><b>{html.escape(plot.title)}</b><br>'
        + "".join(told) + "</div>"
    )  # fmt: skip


def _short(label: str) -> str:
    """Return the name of a curve: its joint if it is commanded, else its quantity for all joints."""
    name, _, what = label.rpartition(", ")
    if what == "plain inverse":
        return what
    if what == "baseline" or label.startswith(("baseline", "before")):
        return "before"
    return name if what == "commanded" else label


def strip(run: Run, at: float, end: float) -> str:
    """Return the statuses of a run as lanes over time, with a mark at an instant, as HTML.

    Args:
        run: The run, of one tick at least.
        at: The instant [s].
        end: The end of the lanes [s].
    """
    lanes = [_lane(in_words(flag), run, flag, end) for flag in statuses(run)]
    told = "".join(lanes) or '<div style="padding:.2em 0">nothing limited this run</div>'
    place = 100.0 * min(max(at / end, 0.0), 1.0) if end > 0.0 else 0.0
    style = f"position:absolute;left:{place:.2f}%;top:0;bottom:0;border-left:2px solid currentColor"
    mark = f'<div style="{style}"></div>'
    return (
        f'<div style="font-size:.75em;line-height:1.2;padding:0 {AREA[1]}px 0 {AREA[0]}px">'
        f'<div style="position:relative">{told}{mark}</div>'
        f'<div style="text-align:right">t = {at:.3f} s of {end:.2f} s</div></div>'
    )


def _lane(name: str, run: Run, flag: Status, end: float) -> str:
    holds = (run["status"].astype(np.int64) & int(flag)) != 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8)))
    color = f"#{of_status(int(flag)) >> 8:06x}"
    time, spans = run["time"], list[str]()
    for first, last in edges.reshape(-1, 2):
        left, width = time[first] / end, (time[last - 1] + run.period - time[first]) / end
        spans.append(f'<rect x="{1e3 * left:.1f}" width="{max(1e3 * width, 2.0):.1f}" height="10"/>')
    return (
        f'<div style="padding-left:4px">{html.escape(name)}</div>'
        '<svg viewBox="0 0 1000 10" preserveAspectRatio="none" style="display:block;width:100%;height:.6em;'
        f'background:#8883" fill="{color}" aria-label="{html.escape(name)}">{"".join(spans)}</svg>'
    )


def table(run: Run, other: Run | None, beside: str) -> str:
    """Return the metrics of a run, with those of another one, as HTML.

    Args:
        run: The run, of one tick at least.
        other: The run to compare with.
        beside: The name of the other run.
    """
    heads = ["metric", "now", *([beside] if other else [])]
    rows = [f"<tr>{''.join(f'<th>{html.escape(one)}</th>' for one in heads)}</tr>"]
    for name, said, factor, unit in FIGURES:
        cells = [_cell(one, name, factor, unit) if one is not None else "" for one in (run, other)]
        if cells[0]:
            rows.append(f"<tr><td>{said}</td><td><b>{cells[0]}</b></td><td>{cells[1]}</td></tr>")
    verdict = html.escape(replace(run, baseline=None).verdict)
    return (
        f'<div style="font-size:.85em;padding:.3em .5em"><p style="margin:.2em 0">{verdict}</p>'
        f'<table style="width:100%;text-align:left">{"".join(rows)}</table></div>'
    )


def _cell(run: Run, name: str, factor: float, unit: str) -> str:
    """Return a metric with its unit, or an empty text if the run lacks it."""
    figure = run.scorecard.get(name)
    if figure is None or not isinstance(figure.value, float) or not math.isfinite(figure.value):
        return ""
    told = unit or ("" if figure.unit == "1" else figure.unit)
    return html.escape(f"{grouped(factor * figure.value)} {told}".strip())
