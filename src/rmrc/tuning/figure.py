"""The plot of a search: error against peak rate, with the Pareto front and the recommendations."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rmrc.show.figures import MARKERS, entitle, explain, lettering, plain, sheet
from rmrc.show.palette import BLACK, distinct, mix
from rmrc.tuning.space import METHOD

# Settings with a name: drawn large, and distinguished without colors.
_NAMED = {"recommended": ("*", 15.0), "second best": ("D", 13.0), "as written": ("X", 13.0)}
# Sizes of the markers of the first method and of the last: far from a singularity methods are equal, and
# nested rings show how many there are.
LARGEST, SMALLEST = 11.0, 4.0
# The picture shows errors up to this multiple of the largest one with a name.
_ROOM = 4.0

_Row = Mapping[str, Any]


def front_figure(answer: Mapping[str, Any], rows: Iterable[_Row]) -> Figure:
    """Return the picture of the results.

    Args:
        answer: As `rmrc.tuning.answer.answer_of` returns it, with a recommended setting.
        rows: All settings, as in the file of settings; the feasible ones are drawn.
    """
    points = [row for row in rows if row["feasible"]]
    marks = [
        (name, row) for row in answer["named"] for name in [row["role"].partition(",")[0]] if name in _NAMED
    ]
    with lettering():
        figure = sheet(9.0, 5.4)
        axes = figure.add_subplot(yscale="log")
        methods = sorted({row[METHOD] for row in points})
        for i, (color, method) in enumerate(zip(distinct(len(methods)), methods, strict=True)):
            size = LARGEST - (LARGEST - SMALLEST) * i / max(1, len(methods) - 1)
            axes.plot(
                *_steps([row for row in points if row[METHOD] == method]), linestyle="",
                marker=MARKERS[i % len(MARKERS)], markersize=size, markerfacecolor="none",
                color=f"#{mix(color, BLACK, 0.15) >> 8:06x}", markeredgewidth=1.0, label=plain(method),
            )  # fmt: skip
        axes.step(
            *_steps(answer["front"]), where="post", color="black", linewidth=1.3, label="front", zorder=3
        )
        for i, (name, row) in enumerate(marks):  # the first on top
            shape, size = _NAMED[name]
            axes.plot(
                row["peak_rate"], row["error"], linestyle="", marker=shape, markersize=size, color="white",
                markeredgecolor="black", markeredgewidth=1.4, zorder=9 - i,
                label=f"{row['role']}: {plain(row['words'])}",
            )  # fmt: skip
        _frame(axes, [*points, *(row for _, row in marks)], [row for _, row in marks], answer["limits"])
        entitle(figure, f"{plain(answer['name'])}: settings within all limits")
        explain(figure, loc="outside right upper")
    return figure


def _steps(rows: Sequence[_Row]) -> tuple[list[float], list[float]]:
    """Return peak rates and errors."""
    return [row["peak_rate"] for row in rows], [row["error"] for row in rows]


def _frame(axes: Axes, points: Sequence[_Row], marks: Sequence[_Row], limits: Sequence[float]) -> None:
    """Set ranges around the relevant results, draw limits within them, and label the axes."""
    top = _ROOM * max(row["error"] for row in marks)
    if top > 0.0:
        axes.set_ylim(0.7 * min(row["error"] for row in points if row["error"] > 0.0), top)
    else:  # a log scale has no 0: an arm that holds still in an ideal plant has no error
        axes.set_yscale("linear")
    within = [row["peak_rate"] for row in points if row["error"] <= top]
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
