"""Plots of a sweep: distributions of metrics, and their relation to the varied keys."""

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure, FigureBase
from matplotlib.ticker import MaxNLocator

from rmrc.show.figures import LETTER, Picture, plain, save
from rmrc.show.panels import paints
from rmrc.show.sheets import number
from rmrc.study.swept import Array, Swept
from rmrc.support.errors import QuestionError

# Panels of a figure of a sweep, from the top.
PANELS = ("distributions", "parallel")
# Width of the report's pictures [in], and their font size [pt].
PAGE, LETTERS = 9.6, 9.0
# Most lines of the parallel coordinates, evenly chosen; more would hide each other.
LINES = 400
# Bins of a histogram; spread above which a scale is logarithmic.
BINS, WIDE = 20, 30.0


def _is_wide(values: Array) -> bool:
    """Return whether positive values span decades, which call for a logarithmic scale."""
    return len(values) > 0 and bool((values > 0.0).all()) and bool(values.max() > WIDE * values.min())


def plot(
    swept: Swept, path: Path | None, panels: Sequence[str] = (), width: float = 7.16, font: float = 8.0
) -> Figure:
    """Draw a sweep: distributions of its metrics, and parallel coordinates below.

    Args:
        swept: Its rows.
        path: File to write atomically: `.png`, `.svg` or `.pdf`; None: no file.
        panels: Panels among distributions and parallel; none: all that have data.
        width: Width of the figure [in].
        font: Font size [pt].

    Raises:
        QuestionError: There are no numbers to draw.
    """
    has = {"distributions": bool(swept.figures), "parallel": bool(swept.coordinates)}
    names = [name for name in PANELS if (name in panels if panels else has[name])]
    lacking = [name for name in names if not has[name]]
    if lacking or not names:
        which = f" for {lacking[0]}" if lacking else ""
        raise QuestionError(f"{swept.name}: no run has numbers{which}to draw")
    heights = [_height(name, swept, width, font) for name in names]
    with mpl.rc_context({"font.size": font}):
        picture = Picture(figsize=(width, sum(heights)), layout="constrained")
        parts = picture.subfigures(len(names), 1, height_ratios=heights, squeeze=False)[:, 0]
        for name, part in zip(names, parts, strict=True):
            _DRAW[name](part, swept, width, font)
        if path is not None:
            save(picture, [path])
    return picture


def histograms(swept: Swept) -> Figure:
    """Return the histograms for a report page: one per metric, with its median."""
    return _alone("distributions", swept, PAGE * min(3, len(swept.figures) or 1) / 3)


def parallel(swept: Swept) -> Figure:
    """Return the parallel coordinates for a report page: one line per run with all values."""
    return _alone("parallel", swept, max(6.0, 1.5 * len(swept.coordinates)))


def _alone(name: str, swept: Swept, width: float) -> Figure:
    with mpl.rc_context({"font.size": LETTERS}):
        picture = Figure(figsize=(width, _height(name, swept, width, LETTERS)), layout="constrained")
        _DRAW[name](picture, swept, width, LETTERS)
    return picture


def _height(name: str, swept: Swept, width: float, font: float) -> float:
    """Return the height of a panel [in]."""
    if name == "distributions":
        return -(-len(swept.figures) // _abreast(swept, width, font) or 1) * (1.55 + 0.07 * font)
    longest = max(map(len, swept.coordinates)) * LETTER * font / 72.0
    return 2.2 + 0.05 * font + longest * math.sin(_tilt(len(swept.coordinates), width, font))


def _abreast(swept: Swept, width: float, font: float) -> int:
    """Return the number of histograms per row, limited by the room for their names."""
    longest = max((len(f"{name} [{swept.units[name]}]") for name in swept.figures), default=1)
    return max(1, min(3, len(swept.figures), int(width / (LETTER * font / 72.0 * (longest + 6)))))


def _tilt(count: int, width: float, font: float) -> float:
    """Return the rotation of the axis names: vertical where room is short [rad]."""
    return math.radians(20.0 if width / count >= 9.0 * font / 72.0 else 90.0)


def _draw_histograms(into: FigureBase, swept: Swept, width: float, font: float) -> None:
    """Draw one histogram per metric, with its median."""
    columns = _abreast(swept, width, font)
    lines = -(-len(swept.figures) // columns) or 1
    for i, (name, values) in enumerate(swept.figures.items()):
        axes = into.add_subplot(lines, columns, i + 1)
        seen = values[np.isfinite(values)]
        scaled = np.log10(seen) if _is_wide(seen) else seen
        low, high = scaled.min(), scaled.max()
        edges = np.linspace(low, high, BINS + 1) if high > low else np.array([low - 0.5, low + 0.5])
        edges = 10.0**edges if _is_wide(seen) else edges
        edges[[0, -1]] = (
            min(edges[0], seen.min()),
            max(edges[-1], seen.max()),
        )  # the logarithm has rounded them
        axes.hist(seen, bins=edges.tolist(), color=paints(1)[0])
        axes.set_xscale("log" if _is_wide(seen) else "linear")
        axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))
        if not _is_wide(seen):  # few labels, as small numbers are long
            axes.xaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3))
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:.4g}")
        axes.axvline(float(np.median(seen)), color="black", linewidth=1.0, linestyle=(0, (3, 2)))
        axes.set_xlabel(f"{plain(name)} [{swept.units[name]}]")
        axes.set_ylabel("runs" if i % columns == 0 else "")
    into.suptitle("dashed: the median", fontsize=font)


def _draw_parallel(into: FigureBase, swept: Swept, width: float, font: float) -> None:
    """Draw one axis per column and one line per run: dark where the first metric is large."""
    columns, by = swept.coordinates, next(iter(swept.figures))
    rows = np.flatnonzero(np.all([np.isfinite(values) for values in columns.values()], axis=0))
    if len(rows) > LINES:
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, LINES).astype(int))]
    axes, shares, tilt = into.add_subplot(), {}, math.degrees(_tilt(len(columns), width, font))
    is_narrow = tilt == 90.0
    lift = 1.2 * font if is_narrow else 0.0  # every second label is raised, as neighbors would touch
    for i, (name, values) in enumerate(columns.items()):
        chosen = values[rows]
        scaled = np.log10(chosen) if _is_wide(chosen) else chosen
        low, high = (float(scaled.min()), float(scaled.max())) if len(rows) else (0.0, 0.0)
        shares[name] = (scaled - low) / (high - low) if high > low else np.full(len(rows), 0.5)
        axes.axvline(i, color="0.3", linewidth=0.8)
        words = swept.words(name) if name in swept.varied else []
        for j, word in enumerate(words):
            place = 0.5 if high == low else (j - low) / (high - low)
            axes.annotate(word, (i, place), (0.4 * font, 0.0), textcoords="offset points", va="center",
                          bbox={"fc": "white", "ec": "none", "pad": 0.5, "alpha": 0.8})  # fmt: skip
        for place, end, side in ((1.02, high, 1.0), (-0.02, low, -1.0)) if not words else ():
            told = number(10.0**end if _is_wide(chosen) else end)
            axes.annotate(
                told, (i, place), (0.0, side * (1.0 + i % 2 * lift)), textcoords="offset points",
                ha="center", va="bottom" if side > 0.0 else "top",
            )  # fmt: skip
        unit = f" [{swept.units[name]}]" if swept.units[name] not in ("", "1") else ""
        axes.annotate(
            plain(name.removeprefix("control.")) + unit, (i, -0.02), (0.0, -1.5 * font - lift),
            textcoords="offset points", ha="center" if is_narrow else "right", va="top", rotation=tilt,
            rotation_mode="default" if is_narrow else "anchor",
        )  # fmt: skip
    places, order = np.stack(list(shares.values()), axis=1), np.argsort(shares[by], kind="stable")
    lines = [np.column_stack([np.arange(len(columns)), places[row]]) for row in order]
    grays = [str(0.85 - 0.75 * share) for share in shares[by][order]]
    axes.add_collection(LineCollection(lines, colors=grays, linewidths=0.7))
    axes.set_xlim(-0.3, len(columns) - 0.7)
    axes.set_ylim(-0.02, 1.02)
    axes.axis("off")


_DRAW = {"distributions": _draw_histograms, "parallel": _draw_parallel}
