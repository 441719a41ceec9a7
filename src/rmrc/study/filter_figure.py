"""Picture of the filters g(σ) of several inverses in one plot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rmrc.show.figures import DASHES, MARKERS, entitle, explain, is_narrow, lettering, plain, save, sheet
from rmrc.show.palette import BLACK, distinct, mix
from rmrc.study.filters import FilterFactor

# Height of the legend per variant [in].
LEGEND_LINE = 0.36


def filter_factors(name: str, curves: Sequence[tuple[str, FilterFactor]], paths: Sequence[Path]) -> None:
    """Draw g(σ) of each variant, with the smallest σ of its run marked on it.

    Args:
        name: Name of the scenario.
        curves: Label and curve of each variant, one or more.
        paths: Files to write atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`.
    """
    with lettering():
        save(_filter_factors(name, curves), paths)


def _filter_factors(name: str, curves: Sequence[tuple[str, FilterFactor]]) -> Figure:
    figure = sheet(9.0, max(4.8, 1.0 + LEGEND_LINE * len(curves)))
    axes = figure.add_subplot(xscale="log", yscale="log")
    both = np.concatenate([curve.sigma for _, curve in curves])
    ends = np.array([both.min(), both.max()])
    for i, (color, (label, curve)) in enumerate(zip(distinct(len(curves)), curves, strict=True)):
        paint = f"#{mix(color, BLACK, 0.15) >> 8:06x}"  # the colors are for dark screens
        # Curves that coincide, as all do far from singularities, are nested: the first is the widest.
        outside = 1.0 - i / max(1, len(curves) - 1)
        at = max(curve.sigma_min, curve.sigma[0])
        where = int(np.searchsorted(curve.sigma, at))
        sigma = np.insert(curve.sigma, where, at)
        gain = np.insert(curve.gain, where, curve.gain_min if at == curve.sigma_min else curve.gain[0])
        axes.plot(
            sigma, gain, color=paint, linewidth=1.6 + 3.0 * outside, linestyle=(0, DASHES[i % len(DASHES)]),
            marker=MARKERS[i % len(MARKERS)], markevery=[where], markersize=8.0 + 5.0 * outside,
            markeredgecolor="black", label=f"{plain(label)}\n    $\\sigma_{{\\min}}$ = {curve.sigma_min:.3g}",
        )  # fmt: skip
        # The rug: the same σ at the bottom, where the curve has no place for a gain of 0.
        axes.plot(
            at, 0.0, "|", color=paint, markersize=10.0 + 10.0 * outside, markeredgewidth=2.0,
            transform=axes.get_xaxis_transform(), clip_on=False,
        )  # fmt: skip
    axes.plot(ends, 1.0 / ends, ":", color="black", linewidth=0.9, label=r"$1/\sigma$, exact")
    _frame(axes, curves)
    entitle(figure, f"{plain(name)}: the inverses as filters")
    explain(figure, loc="outside right upper", handlelength=4.5)
    return figure


def _frame(axes: Axes, curves: Sequence[tuple[str, FilterFactor]]) -> None:
    """Set the ranges, with a gain of 0 below the lower edge, and label the axes."""
    positive = np.concatenate([curve.gain[curve.gain > 0.0] for _, curve in curves])
    sigma = np.concatenate([curve.sigma for _, curve in curves])
    axes.set_xlim(0.9 * sigma.min(), sigma.max())
    if len(positive):
        axes.set_ylim(0.5 * positive.min(), 2.0 * positive.max())
    axes.set_yscale("log", nonpositive="clip")
    more = "" if is_narrow() else "\nmarks: smallest value of each run, at the edge if outside"
    axes.set_xlabel(rf"$\sigma$ of the direction that is lost first [1]{more}")
    gain = r"$g(\sigma)$"
    told = f"gain {gain} [1]" if is_narrow() else f"{gain}, joint rate per unit task velocity [1]"
    axes.set_ylabel(told)
    axes.grid(which="major", color="0.85", linewidth=0.8)
