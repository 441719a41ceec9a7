"""The report page of a sweep: ends of its runs, distributions of metrics, and runs with extremes."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.show.page import Page
from rmrc.show.run_page import versions
from rmrc.show.sheets import Sheet, number
from rmrc.study.dataset import Left
from rmrc.study.sweep_figure import histograms, parallel
from rmrc.study.swept import Array, Swept

# Number of listed values of a key; for more, only the ends are given.
SHOWN = 6

# Column of the run in the table of extremes.
_RUN = 3

_Rows = Mapping[str, list[Any]]


def page(path: Path, left: Left) -> Page:
    """Return the page of a sweep.

    Args:
        path: The `.parquet` file of `sweep`.
        left: Its contents.

    Raises:
        QuestionError: It is another kind of file, or has no rows.
    """
    swept = Swept.of(path, left)
    rows, units, varied, figures = swept.rows, swept.units, swept.varied, swept.figures
    made = Page(f"{swept.name}: {len(rows['index'])} runs", _verdict(rows, figures, units))
    made.section("End of the runs")
    made.table(_endings(rows))
    made.section("Varied keys")
    made.table(_varied(rows, varied, units))
    made.section("Distributions of the metrics")
    made.figure(histograms(swept), "Number of runs by value")
    note = "rmrc sweep --record worst:1:METRIC or best:1:METRIC records such a run. Its number is a link."
    made.section("Extremes", note)
    made.table(_extremes(rows, varied, figures, units), {_RUN: _recordings(path, swept)})
    if swept.coordinates:
        first = next(iter(figures))
        made.section("From the varied keys to the metrics", f"One line per run, dark where {first} is large.")
        made.figure(parallel(swept), "Parallel coordinates: one line per run")
    made.section("Made with", "The same versions give the same bits on one machine.")
    made.table(versions(json.loads(rows["versions"][0])))
    return made


def _verdict(rows: _Rows, figures: Mapping[str, Array], units: Mapping[str, str]) -> str:
    """Return a sentence with the number of complete runs, and the range of the first metric."""
    count = len(rows["status"])
    complete = sum(one == "complete" for one in rows["status"])
    known = [one for one in rows["met"] if one is not None]
    met = f", {sum(known)} met all expectations" if known else ""
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
    """Return the runs with the smallest and largest value of each metric, with their varied keys."""
    told = []
    for name, values in figures.items():
        unit = units[name] if units[name] != "1" else ""
        for word, i in (("least", int(np.nanargmin(values))), ("largest", int(np.nanargmax(values)))):
            setting = ", ".join(f"{key.removeprefix('control.')} {_brief(rows[key][i])}" for key in varied)
            value = f"{number(float(values[i]))} {unit}".strip()
            told.append((name, word, value, str(rows["index"][i]), setting))
    return Sheet("", ("metric", "", "value", "run", "where"), told, frozenset({0, 1, 4}))


def _recordings(path: Path, swept: Swept) -> dict[str, Path]:
    """Return the recordings next to the rows, by the number of their run."""
    files = {str(i): path.with_name(f"{swept.name}-{i}.rrd") for i in swept.rows["index"]}
    return {run: file.resolve() for run, file in files.items() if file.exists()}


def _brief(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
