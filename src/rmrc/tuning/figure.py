"""The plot of a search: error against peak rate, with the Pareto front and the recommendations."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from rmrc.show.figures import MARKERS, entitle, explain, lettering, plain, sheet
from rmrc.show.palette import BLACK, distinct, mix
from rmrc.tuning.answer import Row, front, named, words
from rmrc.tuning.space import METHOD

# Markers of the roles, which are distinguished without colors.
_SHAPES = "*DXP"
# Sizes of the markers of the first method and of the last: far from a singularity methods are equal, and
# nested rings show how many there are.
_LARGEST, _SMALLEST = 11.0, 4.0


def front_figure(name: str, rows: Sequence[Row]) -> Figure:
    """Return the picture of the settings that keep the limits.

    Args:
        name: Name of the scenario.
        rows: All settings, as `rmrc.tuning.answer.rows_of` returns them, one of them recommended.
    """
    feasible = [row for row in rows if row["feasible"]]
    methods = sorted({row[METHOD] for row in feasible})
    with lettering():
        figure = sheet(9.0, 5.4)
        axes = figure.add_subplot(
            xlabel="largest rate of a joint [rad/s]", ylabel="largest tracking error [m]"
        )
        # a log scale has no 0: an arm that holds still in an ideal plant has no error
        axes.set_yscale("log" if all(row["error"] > 0.0 for row in feasible) else "linear")
        for i, (color, method) in enumerate(zip(distinct(len(methods)), methods, strict=True)):
            axes.plot(
                *_columns([row for row in feasible if row[METHOD] == method]),
                linestyle="",
                marker=MARKERS[i % len(MARKERS)],
                markersize=_LARGEST - (_LARGEST - _SMALLEST) * i / len(methods),
                markerfacecolor="none",
                color=f"#{mix(color, BLACK, 0.15) >> 8:06x}",
                label=plain(method),
            )
        axes.step(*_columns(front(rows)), where="post", color="black", label="front", zorder=3)
        for shape, row in zip(_SHAPES, named(rows), strict=False):
            label = f"{row['role']}: {plain(words(row))}"
            axes.plot(
                *_columns([row]), shape, markersize=13.0, color="white", markeredgecolor="black", label=label
            )
        axes.grid(color="0.88")
        entitle(figure, f"{plain(name)}: settings within all limits")
        explain(figure, loc="outside right upper")
    return figure


def _columns(rows: Sequence[Row]) -> tuple[list[float], list[float]]:
    """Return peak rates and errors."""
    return [row["peak_rate"] for row in rows], [row["error"] for row in rows]
