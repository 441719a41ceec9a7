"""The picture of a search: error against peak rate, with the front and what is recommended."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rmrc.show.figures import MARKERS, plain, save
from rmrc.show.palette import BLACK, distinct, mix

# What has a name: drawn large, and told apart without colors.
_NAMED = {"recommended": ("*", 15.0), "second best": ("D", 13.0), "as written": ("X", 13.0)}
# The picture shows errors down from so many times the largest that has a name.
_ROOM = 4.0


class Mark(NamedTuple):
    """A setting that has a name.

    Attributes:
        name: `recommended`, `second best` or `as written`.
        words: Its method.
        peak_rate: [rad/s].
        error: [m].
    """

    name: str
    words: str
    peak_rate: float
    error: float


def draw_front(
    name: str,
    points: Sequence[tuple[str, float, float]],
    front: Sequence[tuple[float, float]],
    marks: Sequence[Mark],
    limits: Sequence[float],
    path: Path,
) -> None:
    """Draw what was found.

    Args:
        name: Of the scenario.
        points: Method, peak rate [rad/s] and error [m] of each feasible setting.
        front: Peak rate and error of those that none dominates, by rising peak rate.
        marks: What has a name, the most important first.
        limits: Rate limits of the joints [rad/s].
        path: File to write, whole or not at all; the suffix says how: `.png`, `.svg` or `.pdf`.
    """
    figure = Figure(figsize=(9.0, 5.4), layout="constrained")
    axes = figure.add_subplot(yscale="log")
    methods = sorted({method for method, _, _ in points})
    for i, (color, method) in enumerate(zip(distinct(len(methods)), methods, strict=True)):
        own = [(rate, error) for which, rate, error in points if which == method]
        axes.plot(
            *zip(*own, strict=True), linestyle="",
            marker=MARKERS[i % len(MARKERS)], markersize=4.5, alpha=0.55,
            color=f"#{mix(color, BLACK, 0.15) >> 8:06x}", markeredgewidth=0.0, label=plain(method),
        )  # fmt: skip
    axes.step(*zip(*front, strict=True), where="post", color="black", linewidth=1.3, label="front", zorder=3)
    for i, mark in enumerate(marks):  # the first on top
        shape, size = _NAMED[mark.name]
        axes.plot(
            mark.peak_rate, mark.error, linestyle="", marker=shape, markersize=size, color="white",
            markeredgecolor="black", markeredgewidth=1.4, zorder=9 - i,
            label=f"{mark.name}: {plain(mark.words)}",
        )  # fmt: skip
    _frame(axes, points, marks, limits)
    axes.set_title(f"{plain(name)}: settings that keep the limits on every copy")
    figure.legend(loc="outside right upper", frameon=False)
    save(figure, [path])


def _frame(
    axes: Axes, points: Sequence[tuple[str, float, float]], marks: Sequence[Mark], limits: Sequence[float]
) -> None:
    """Set ranges around what matters, draw limits that are within them, and name the axes."""
    # a log scale has no 0: an arm that holds still in an ideal plant has no error
    errors = [error for error in (*(e for _, _, e in points), *(m.error for m in marks)) if error > 0.0]
    top = _ROOM * max(mark.error for mark in marks)
    if top > 0.0:
        axes.set_ylim(0.7 * min(errors), top)
    else:
        axes.set_yscale("linear")
    within = [rate for _, rate, error in points if error <= top] + [mark.peak_rate for mark in marks]
    margin = 0.06 * (max(within) - min(within)) or 0.1 * max(within) or 1.0
    drawn = [limit for limit in limits if limit <= 1.5 * max(within)]
    axes.set_xlim(min(within) - margin, max(*within, *drawn) + margin)
    for i, limit in enumerate(drawn):
        label = None if i else "rate limit of a joint"
        axes.axvline(limit, color="0.35", linestyle=(0, (6, 3)), linewidth=1.2, label=label)
    axes.set_xlabel("largest rate of a joint [rad/s]")
    axes.set_ylabel("largest tracking error [m]")
    axes.grid(which="major", color="0.88", linewidth=0.8)
    axes.grid(which="minor", axis="y", color="0.93", linewidth=0.5)
