"""Rows of a sweep: the varied keys, every metric of the scorecard, and the end of the run."""

import re
from collections.abc import Iterable, Sequence

from rmrc.results.scorecard import Figure
from rmrc.scenario import schema_rows
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.dataset import Column, as_number
from rmrc.study.plan import Plan, Value

# Metrics that differ from one execution to the next, which rows must not.
NOT_KEPT = frozenset({"wall_time", "speed"})


def columns_of(plan: Plan, worlds: Iterable[Prepared]) -> list[Column]:
    """Return the columns of a sweep.

    Args:
        plan: Its runs.
        worlds: One run of each kind; metrics depend only on the joints and axes.
    """
    known = {row.key: row for row in schema_rows()}
    columns = [Column("index", "count", "1", "number of the run in the sweep, from 0")]
    for key in plan.keys:
        general = re.sub(r"\[\d+\]", "[]", key)
        row = known.get(general) or known.get(general.removesuffix("[]"))
        about = (row.unit, row.meaning) if row else ("", "a key of the scenario")
        columns.append(Column(key, _kind(plan.vary.get(key, (0.0,))), *about))
    return [
        *columns,
        Column("seed", "count", "1", "arm.encoder.seed of the run; plant.seed counts in step"),
        Column("status", "text", "", "end of the run: complete, unfinished (time limit reached) or diverged"),
        Column("divergence", "text", "", "time and cause of divergence; null if none"),
        Column("met", "switch", "", "whether all expectations were met; null without expectations"),
        *_figures(worlds),
        Column("scenario", "text", "", "hash of the scenario and its files, without name and expectations"),
        Column("versions", "text", "", "of everything that determines the bits, as JSON"),
    ]


def _figures(worlds: Iterable[Prepared]) -> list[Column]:
    """Return the metrics of all runs."""
    units, figures = dict[str, dict[str, None]](), dict[str, Figure]()
    for world in worlds:
        (blank,) = Simulation([world], keep_columns=False).scorecards()
        for name, figure in blank.items():
            figures.setdefault(name, figure)
            units.setdefault(name, {}).update(dict.fromkeys(figure.unit.split(" or ")))
    return [
        Column(name, "text" if figure.value == "" else "number", " or ".join(units[name]), figure.meaning)
        for name, figure in figures.items()
        if name not in NOT_KEPT
    ]


def _kind(values: Sequence[Value]) -> str:
    """Return the type of a column with these values, some possibly missing."""
    known = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in known):
        return "switch"
    return "number" if all(as_number(value) is not None for value in known) else "text"
