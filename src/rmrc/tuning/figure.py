"""The plot of a search: error against peak rate, with the Pareto front and the recommendations."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rmrc.show.figures import MARKERS, entitle, explain, lettering, plain, save, sheet
from rmrc.show.palette import BLACK, distinct, mix
from rmrc.tuning.tables import Row

# Settings with a name: drawn large, and distinguished without colors.
_NAMED = {"recommended": ("*", 15.0), "second best": ("D", 13.0), "as written": ("X", 13.0)}
# Sizes of the markers of the first method and of the last.
LARGEST, SMALLEST = 11.0, 4.0
# The picture shows errors up to this multiple of the largest one with a name.
_ROOM = 4.0


def draw_front(
    name: str,
    points: Sequence[Row],
    front: Sequence[Row],
    marks: Sequence[Row],
    limits: Sequence[float],
    path: Path,
) -> None:
    """Write `front_figure` to a file, atomically; the suffix says how: `.png`, `.svg` or `.pdf`."""
    save(front_figure(name, points, front, marks, limits), [path])


def front_figure(
    name: str, points: Sequence[Row], front: Sequence[Row], marks: Sequence[Row], limits: Sequence[float]
) -> Figure:
    """Return the picture of the results.

    Args:
        name: Name of the scenario.
        points: Each feasible setting, in words its method.
        front: Nondominated settings, by rising peak rate.
        marks: Settings with a name, the most important first.
        limits: Rate limits of the joints [rad/s].
    """
    with lettering():
        return _front(name, points, front, marks, limits)


def _front(
    name: str, points: Sequence[Row], front: Sequence[Row], marks: Sequence[Row], limits: Sequence[float]
) -> Figure:
    figure = sheet(9.0, 5.4)
    axes = figure.add_subplot(yscale="log")
    methods = sorted({one.words for one in points})
    for i, (color, method) in enumerate(zip(distinct(len(methods)), methods, strict=True)):
        # Far from a singularity methods are equal: nested rings show how many there are.
        size = LARGEST - (LARGEST - SMALLEST) * i / max(1, len(methods) - 1)
        axes.plot(
            *_steps([one for one in points if one.words == method]), linestyle="",
            marker=MARKERS[i % len(MARKERS)], markersize=size, markerfacecolor="none",
            color=f"#{mix(color, BLACK, 0.15) >> 8:06x}", markeredgewidth=1.0, label=plain(method),
        )  # fmt: skip
    axes.step(*_steps(front), where="post", color="black", linewidth=1.3, label="front", zorder=3)
    for i, mark in enumerate(marks):  # the first on top
        shape, size = _NAMED[mark.name]
        axes.plot(
            mark.peak_rate, mark.error, linestyle="", marker=shape, markersize=size, color="white",
            markeredgecolor="black", markeredgewidth=1.4, zorder=9 - i,
            label=f"{mark.name}: {plain(mark.words)}",
        )  # fmt: skip
    _frame(axes, points, marks, limits)
    entitle(figure, f"{plain(name)}: settings within all limits")
    explain(figure, loc="outside right upper")
    return figure


def _steps(rows: Sequence[Row]) -> tuple[list[float], list[float]]:
    """Return peak rates and errors."""
    return [one.peak_rate for one in rows], [one.error for one in rows]


def _frame(axes: Axes, points: Sequence[Row], marks: Sequence[Row], limits: Sequence[float]) -> None:
    """Set ranges around the relevant results, draw limits within them, and label the axes."""
    # a log scale has no 0: an arm that holds still in an ideal plant has no error
    errors = [one.error for one in (*points, *marks) if one.error > 0.0]
    top = _ROOM * max(mark.error for mark in marks)
    if top > 0.0:
        axes.set_ylim(0.7 * min(errors), top)
    else:
        axes.set_yscale("linear")
    within = [one.peak_rate for one in (*points, *marks) if one.error <= top]
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
