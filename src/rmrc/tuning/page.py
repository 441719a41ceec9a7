"""`rmrc.report`: the report page of a verb's output, and that of a search with the picture of its front."""

import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from matplotlib.figure import Figure

from rmrc.show.figures import MARKERS, entitle, explain, lettering, plain, sheet
from rmrc.show.page import Page, Section, code, items, page_of_run, picture, table
from rmrc.show.palette import paints
from rmrc.study.dataset import Table, about_of, read_table
from rmrc.study.pictures import sweep_page
from rmrc.study.sweep import Swept
from rmrc.support.files import reading
from rmrc.tuning.answer import Row, front, named, numbers, sheets, words
from rmrc.tuning.space import METHOD

# Markers of the roles, which are distinguished without colors.
_SHAPES = "*DXPs"


def page(path: Path) -> Page:
    """Return the page of a run, a comparison, a sweep or a search.

    Args:
        path: The `.npz` of `run` or `compare`, or the `.parquet` of `sweep` or `tune`.

    Raises:
        OSError: It cannot be read.
        QuestionError: It is another kind of file, or damaged.
    """
    with reading(path, "an output of run, compare, sweep or tune"):
        if path.suffix != ".parquet":
            return page_of_run(path)
        rows = read_table(path)
        return _of_search(rows) if "on_front" in rows.column_names else sweep_page(Swept.of(path, rows))


def report(result: str | PathLike[str], path: str | PathLike[str] | None = None) -> Path:
    """Write one self-contained HTML page of a verb's output: verdict, metrics, plots, blocks to copy.

    Args:
        result: `NAME.npz` of `run` or `compare`, with its `.json`, `NAME.sweep.parquet` or
            `NAME.tune.parquet`.
        path: The page; None: the path of the result with the suffix `.html`.

    Returns:
        The page.

    Raises:
        OSError: A file cannot be read or written.
        QuestionError: The result is another kind of file, or damaged.
    """
    written = Path(result).with_suffix(".html") if path is None else Path(path)
    page(Path(result)).write(written)
    return written


def _of_search(trials: Table) -> Page:
    about, rows = json.loads(about_of(trials.schema)), trials.to_pylist()
    verdict, best = "No tried setting keeps the limits.", next(iter(named(rows)), None)
    sections = [Section("Trials", [*map(table, sheets(about, rows)), items(about["lines"])], is_wide=True)]
    if best:
        result = f"{1e3 * best['error']:.3g} mm at a peak rate of {best['peak_rate']:.3g} rad/s"
        verdict = f"Recommended: {words(best)} ({numbers(best)}), with an error of {result}."
        drawn = picture(
            front_figure(about["name"], rows), "Settings that keep the limits, and the Pareto front"
        )
        sections[:0] = [
            Section("To paste: the recommended control section", [code(about["block"], "Copy the block")]),
            Section("Error against peak rate", [drawn]),
        ]
    return Page(f"Tuning of {about['name']}", verdict, sections)


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
        axes = figure.add_subplot(xlabel="largest joint rate [rad/s]", ylabel="largest error [m]")
        # a log scale has no 0: an arm that holds still in an ideal plant has no error
        axes.set_yscale("log" if all(row["error"] > 0.0 for row in feasible) else "linear")
        for i, (color, method) in enumerate(zip(paints(len(methods)), methods, strict=True)):
            points = _columns([row for row in feasible if row[METHOD] == method])
            (rings,) = axes.plot(*points, MARKERS[i % len(MARKERS)], color=color, label=plain(method))
            rings.set_markersize(11.0 - i)  # methods are often equal: nested rings show how many there are
            rings.set_markerfacecolor("none")
        axes.step(*_columns(front(rows)), where="post", color="black", label="front", zorder=3)
        for shape, row in zip(_SHAPES, named(rows), strict=False):
            label = f"{row['role']}: {plain(words(row))}"
            axes.plot(*_columns([row]), shape, ms=13.0, color="white", mec="black", label=label)
        axes.grid(color="0.88")
        entitle(figure, f"{plain(name)}: settings within all limits")
        explain(figure, loc="outside right upper")
    return figure


def _columns(rows: Sequence[Row]) -> tuple[list[float], list[float]]:
    """Return peak rates and errors."""
    return [row["peak_rate"] for row in rows], [row["error"] for row in rows]
