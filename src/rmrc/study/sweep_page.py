"""The page of a sweep: how its runs ended, how figures are distributed, and which runs have the extremes."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pyarrow.parquet as pq
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rmrc.show.figures import plain
from rmrc.show.page import Page
from rmrc.show.panels import paints
from rmrc.show.run_page import versions
from rmrc.show.sheets import Sheet, number
from rmrc.study.dataset import Contents
from rmrc.study.summary import MAIN
from rmrc.support.errors import QuestionError

Array = NDArray[np.float64]
# Lines of the parallel coordinates at most, evenly chosen; more are a carpet.
LINES = 400
# Bins of a histogram; values of a key that are listed; spread from which a scale is logarithmic.
BINS, SHOWN, WIDE = 20, 6, 30.0

_Rows = Mapping[str, list[Any]]


def page(path: Path) -> Page:
    """Return the page of a sweep.

    Args:
        path: The `.parquet` that `sweep` left.

    Raises:
        OSError: It cannot be read.
        QuestionError: It is something else, or has no row.
    """
    table = pq.read_table(path)
    try:
        contents = Contents.read((table.schema.metadata or {})[b"rmrc"])
    except (KeyError, ValueError, TypeError):
        raise QuestionError(f"{path}: does not hold the rows of a sweep") from None
    if not table.num_rows:
        raise QuestionError(f"{path}: has no row, so there is nothing to report")
    rows = table.to_pydict()
    units = {column.name: column.unit for column in contents.columns}
    names = list(units)
    keys = [name for name in names[1 : names.index("status")] if name != "seed"]
    varied = [name for name in keys if len(set(map(str, rows[name]))) > 1]
    figures = {name: _numbers(rows[name]) for name in MAIN if name in rows}
    figures = {name: values for name, values in figures.items() if np.isfinite(values).any()}
    name = path.name.removesuffix(".parquet").removesuffix(".sweep")
    made = Page(f"{name}: {table.num_rows} runs", _verdict(rows, figures, units))
    made.section("How the runs ended")
    made.table(_endings(rows))
    made.section("What was varied")
    made.table(_varied(rows, varied, units))
    made.section("How the figures are distributed")
    made.figure(_histograms(figures, units), "How many runs have which value")
    made.section("Extremes", "`rmrc sweep` with --record worst:1:FIGURE or best:1:FIGURE records such a run.")
    made.table(_extremes(rows, varied, figures, units))
    numeric = [one for one in varied if np.isfinite(_numbers(rows[one])).sum() > 1]
    if numeric and figures:
        first = next(iter(figures))
        made.section("From what was varied to the figures", f"One line per run, dark where {first} is large.")
        columns = {one: _numbers(rows[one]) for one in numeric} | figures
        made.figure(_parallel(columns, units, first), "Parallel coordinates: one line per run")
    made.section("Made with", "Equal versions give equal bits on one machine.")
    made.table(versions(json.loads(rows["versions"][0])))
    return made


def _numbers(values: Sequence[Any]) -> Array:
    """Return numbers; NaN for what is none."""
    return np.array([float(v) if isinstance(v, int | float) else np.nan for v in values])


def _verdict(rows: _Rows, figures: Mapping[str, Array], units: Mapping[str, str]) -> str:
    """Return how many runs completed the path, and how far the first figure spreads, in a sentence."""
    count = len(rows["status"])
    complete = sum(one == "complete" for one in rows["status"])
    known = [one for one in rows["met"] if one is not None]
    met = f", {sum(known)} met what is expected" if known else ""
    spread = ""
    if figures:
        name, values = next(iter(figures.items()))
        low, high = np.nanmin(values), np.nanmax(values)
        spread = f"; {name} is between {number(low)} and {number(high)} {units[name]}"
    return f"{complete} of {count} runs completed the path{met}{spread}."


def _endings(rows: _Rows) -> Sheet:
    counts = [(one, str(rows["status"].count(one))) for one in sorted(set(rows["status"]))]
    known = [one for one in rows["met"] if one is not None]
    counts += [("all expectations met", f"{sum(known)} of {len(known)}")] if known else []
    return Sheet("", ("", "runs"), counts)


def _varied(rows: _Rows, varied: Sequence[str], units: Mapping[str, str]) -> Sheet:
    told = []
    for name in varied:
        values, unit = rows[name], units[name] if units[name] not in ("", "1") else ""
        different = list(dict.fromkeys(values))
        words = ", ".join(map(str, different[:SHOWN])) + (" and more" if len(different) > SHOWN else "")
        if len(different) > SHOWN and all(isinstance(one, int | float) for one in different):
            words = f"{len(different)} values from {number(min(different))} to {number(max(different))}"
        told.append((name, f"{words} {unit}".strip()))
    return Sheet("", ("key", "values"), told, frozenset({0, 1}))


def _extremes(
    rows: _Rows, varied: Sequence[str], figures: Mapping[str, Array], units: Mapping[str, str]
) -> Sheet:
    """Return which runs have the least and the largest of each figure, with what was varied there."""
    told = []
    for name, values in figures.items():
        unit = units[name] if units[name] != "1" else ""
        for word, i in (("least", int(np.nanargmin(values))), ("largest", int(np.nanargmax(values)))):
            setting = ", ".join(f"{key.removeprefix('control.')} {_brief(rows[key][i])}" for key in varied)
            value = f"{number(float(values[i]))} {unit}".strip()
            told.append((name, word, value, str(rows["index"][i]), setting))
    return Sheet("", ("figure", "", "value", "run", "where"), told, frozenset({0, 1, 4}))


def _brief(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _is_wide(values: Array) -> bool:
    """Say whether positive values are spread over decades, so that a logarithmic scale shows them."""
    return len(values) > 0 and bool((values > 0.0).all()) and bool(values.max() > WIDE * values.min())


def _histograms(figures: Mapping[str, Array], units: Mapping[str, str]) -> Figure:
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


def _parallel(columns: Mapping[str, Array], units: Mapping[str, str], by: str) -> Figure:
    """Return a vertical axis for each column, and a line through them for each run that has all of them."""
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
