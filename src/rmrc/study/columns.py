"""The columns of a row: the keys that vary, every figure of the scorecard, and how the run ended."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

from rmrc.results.scorecard import Figure
from rmrc.scenario import angle, inline, schema_rows
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.dataset import Column
from rmrc.study.plan import Plan, Value

# They differ from one execution to the next, and rows do not.
NOT_KEPT = frozenset({"wall_time", "speed"})


def own_columns(plan: Plan) -> list[Column]:
    """Return the columns before the figures: index, keys, seed, and how the run ended."""
    known = {row.key: row for row in schema_rows()}
    columns = [Column("index", "count", "1", "number of the run in the sweep, from 0 on")]
    for key in plan.keys:
        general = re.sub(r"\[\d+\]", "[]", key)
        row = known.get(general) or known.get(general.removesuffix("[]"))
        kind = _kind(dict(plan.vary).get(key, (0.0,)))
        about = (row.unit, row.meaning) if row else ("", "a key of the scenario")
        columns.append(Column(key, kind, *about))
    return [
        *columns,
        Column("seed", "count", "1", "arm.encoder.seed of the run"),
        Column("status", "text", "", "how the run ended: complete, unfinished (its time was up) or diverged"),
        Column("divergence", "text", "", "where it diverged and why; null if it did not"),
        Column("met", "switch", "", "whether all that is expected was met; null if nothing is expected"),
    ]


def last_columns() -> list[Column]:
    """Return the columns behind the figures: what a row was made of."""
    return [
        Column("scenario", "text", "", "hash of the scenario and its model, without name and expectations"),
        Column("versions", "text", "", "of what decides the bits, as JSON"),
    ]


def figure_columns(runs: Iterable[Prepared]) -> list[Column]:
    """Return the figures of all runs; which there are depends on joints and axes alone, so on few of them."""
    units: dict[str, dict[str, None]] = {}
    figures: dict[str, Figure] = {}
    for one in runs:
        (blank,) = Simulation([one], keep_columns=False).scorecards()
        for name, figure in blank.items():
            figures.setdefault(name, figure)
            units.setdefault(name, {}).update(dict.fromkeys(figure.unit.split(" or ")))
    return [
        Column(name, "text" if figure.value == "" else "number", " or ".join(units[name]), figure.meaning)
        for name, figure in figures.items()
        if name not in NOT_KEPT
    ]


def _kind(values: Sequence[Value]) -> str:
    """Return the type of a column that holds these values and perhaps nothing."""
    given = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in given):
        return "switch"
    if all(_number(value) is not None for value in given):
        return "number"
    return "text"


def _number(value: Value) -> float | None:
    """Return a number, or an angle in radians; None for what is neither."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    try:
        return angle(value) if isinstance(value, str) else None
    except ValueError:
        return None


def typed(row: dict[str, Any], columns: Sequence[Column]) -> dict[str, Any]:
    """Return a row with its values as the columns have them: angles as numbers, lists as YAML."""
    result = dict(row)
    for name, kind, _, _ in columns:
        value = result.get(name)
        if kind == "number" and name in result and value is not None:
            result[name] = _number(value)
        elif kind == "text" and value is not None and not isinstance(value, str):
            result[name] = inline(value)
    return result
