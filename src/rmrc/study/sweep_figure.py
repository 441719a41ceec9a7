"""The pictures of a sweep: how figures are distributed, and how they go with what was varied."""

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rmrc.show.figures import plain
from rmrc.show.panels import paints
from rmrc.show.sheets import number

Array = NDArray[np.float64]
# Lines of the parallel coordinates at most, evenly chosen; more are a carpet.
LINES = 400
# Bins of a histogram; spread from which a scale is logarithmic.
BINS, WIDE = 20, 30.0


def _is_wide(values: Array) -> bool:
    """Say whether positive values are spread over decades, so that a logarithmic scale shows them."""
    return len(values) > 0 and bool((values > 0.0).all()) and bool(values.max() > WIDE * values.min())


def histograms(figures: Mapping[str, Array], units: Mapping[str, str]) -> Figure:
    """Return a histogram for each figure, with its median.

    Args:
        figures: Values of each, (runs,); NaN where a run has none.
        units: Of each.
    """
    columns = min(3, len(figures)) or 1
    lines = -(-len(figures) // columns) or 1
    with mpl.rc_context({"font.size": 9.0}):
        picture = Figure(figsize=(3.2 * columns, 2.2 * lines), layout="constrained")
        for i, (name, values) in enumerate(figures.items()):
            axes = picture.add_subplot(lines, columns, i + 1)
            seen = values[np.isfinite(values)]
            scaled = np.log10(seen) if _is_wide(seen) else seen
            low, high = scaled.min(), scaled.max()
            edges = np.linspace(low, high, BINS + 1) if high > low else np.array([low - 0.5, low + 0.5])
            axes.hist(seen, bins=(10.0**edges if _is_wide(seen) else edges).tolist(), color=paints(1)[0])
            axes.set_xscale("log" if _is_wide(seen) else "linear")
            axes.axvline(float(np.median(seen)), color="black", linewidth=1.0, linestyle=(0, (3, 2)))
            axes.set_xlabel(f"{plain(name)} [{units[name]}]")
            axes.set_ylabel("runs" if i % columns == 0 else "")
        picture.suptitle("dashed: the median", fontsize=9.0)
    return picture


def parallel(columns: Mapping[str, Array], units: Mapping[str, str], by: str) -> Figure:
    """Return a vertical axis for each column, and a line through them for each run that has all of them.

    Args:
        columns: Values of each, (runs,); NaN where a run has none.
        units: Of each.
        by: The column where lines are dark that are high.
    """
    rows = np.flatnonzero(np.all([np.isfinite(values) for values in columns.values()], axis=0))
    if len(rows) > LINES:
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, LINES).astype(int))]
    with mpl.rc_context({"font.size": 9.0}):
        picture = Figure(figsize=(max(6.0, 1.5 * len(columns)), 3.6), layout="constrained")
        axes = picture.add_subplot()
        shares = {}
        for i, (name, values) in enumerate(columns.items()):
            chosen = values[rows]
            scaled = np.log10(chosen) if _is_wide(chosen) else chosen
            low, high = (float(scaled.min()), float(scaled.max())) if len(rows) else (0.0, 0.0)
            shares[name] = (scaled - low) / (high - low) if high > low else np.full(len(rows), 0.5)
            axes.axvline(i, color="0.3", linewidth=0.8)
            for place, end, side in ((1.02, high, "bottom"), (-0.02, low, "top")):
                axes.text(i, place, number(10.0**end if _is_wide(chosen) else end), ha="center", va=side)
            unit = f" [{units[name]}]" if units[name] not in ("", "1") else ""
            told = plain(name.removeprefix("control.")) + unit
            axes.text(i, -0.14, told, ha="right", va="top", rotation=20)
        places, order = np.stack(list(shares.values()), axis=1), np.argsort(shares[by], kind="stable")
        lines = [np.column_stack([np.arange(len(columns)), places[row]]) for row in order]
        grays = [str(0.85 - 0.75 * share) for share in shares[by][order]]
        axes.add_collection(LineCollection(lines, colors=grays, linewidths=0.7))
        axes.set_xlim(-0.3, len(columns) - 0.7)
        axes.set_ylim(-0.02, 1.02)
        axes.axis("off")
    return picture
