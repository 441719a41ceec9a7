"""Picture of margins: remaining response to a kick for each tried setting, and the stability limits."""

import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rmrc.show.figures import plain, save
from rmrc.study.margins.margins import Margin, Margins
from rmrc.study.margins.ringing import STILL_RINGS

# Smaller values are rounding; a divergence has no value; oscillating commands may hide the kick.
_LEAST, _ON, _MOST = 1e-3, 1.0, 1e2
_LABELS = {
    "gain": "times control.feedback as written [1]",
    "delay": "dead time added to that as written [ms]",
    "lag": "lag added to that as written [ms]",
}
_STABLE, _UNSTABLE = "#1f6fd6", "#c2372f"


def draw_margins(found: Margins, path: Path) -> None:
    """Draw the tried settings.

    Args:
        found: The margins.
        path: File to write atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`.
    """
    figure = Figure(figsize=(1.2 + 4.0 * len(found.all), 4.4), layout="constrained")
    panels = figure.subplots(1, len(found.all), sharey=True, squeeze=False)[0]
    for axes, one in zip(panels, found.all, strict=True):
        _draw(axes, one)
    panels[0].set_ylabel("remaining response to a kick [1]")
    handles = {
        label: line for axes in panels for line, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False)
    control = found.scenario.control
    figure.suptitle(
        f"{plain(found.scenario.name)}: stability margins, $K$ = {control.feedback:g}/s, $T$ = "
        f"{control.period:g} s"
    )
    save(figure, [path])


def _draw(axes: Axes, one: Margin) -> None:
    scale = 1.0 if one.name == "gain" else 1e3
    for is_unstable, marker, color, label in (
        (False, "o", _STABLE, "decays: stable"), (True, "X", _UNSTABLE, "keeps ringing: unstable"),
    ):  # fmt: skip
        chosen = [(scale * x, what) for x, what in one.tried if what.is_unstable == is_unstable]
        least = _ON if is_unstable else _LEAST
        shown = [min(max(what.left, least), _MOST) for _, what in chosen]
        axes.plot([x for x, _ in chosen], shown, linestyle="", marker=marker, color=color, label=label)
    if one.edge.is_found:
        axes.axvline(scale * one.value, color="black", linewidth=1.6, label="limit by simulation")
    for value, dashes, label in (
        (one.ideal, (6, 3), "limit of the ideal plant"), (one.rule, (1, 2), r"rule 1/(delay + $T$/2 + lag)"),
    ):  # fmt: skip
        if 0.0 < value < math.inf:
            axes.axvline(scale * value, color="0.35", linewidth=1.4, linestyle=(0, dashes), label=label)
    axes.axhline(STILL_RINGS, color="0.6", linewidth=0.8)
    axes.set_yscale("log")
    axes.set_ylim(0.5 * _LEAST, 2.0 * _MOST)
    if one.name == "gain":
        axes.set_xscale("log")
    axes.set_xlabel(_LABELS[one.name])
    axes.grid(which="major", color="0.9", linewidth=0.8)
