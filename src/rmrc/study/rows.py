"""Rows of a sweep: the varied keys, every metric of the scorecard, and the end of the run."""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from rmrc.arm import Arm
from rmrc.results import facts
from rmrc.results.scorecard import Figure
from rmrc.scenario import Scenario, angle, inline, schema_rows
from rmrc.scenario.keys import split
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.dataset import Column, as_parquet
from rmrc.study.plan import SEEDS, Plan, Value
from rmrc.study.study import Result

# The sections of a scenario on which a run depends.
_UNUSED = {"name", "expect", "look", "baseline", "sweep", "tune"}
_SECTIONS = sorted(Scenario.model_fields.keys() - _UNUSED)
_SORTED = json.JSONEncoder(sort_keys=True)

_prints: WeakKeyDictionary[Arm, str] = WeakKeyDictionary()

# Metrics that differ from one execution to the next, which rows must not.
NOT_KEPT = frozenset({"wall_time", "speed"})


def own_columns(plan: Plan) -> list[Column]:
    """Return the columns before the metrics: index, keys, seed, and the end of the run."""
    known = {row.key: row for row in schema_rows()}
    columns = [Column("index", "count", "1", "number of the run in the sweep, from 0")]
    for key in plan.keys:
        general = re.sub(r"\[\d+\]", "[]", key)
        row = known.get(general) or known.get(general.removesuffix("[]"))
        kind = _kind(dict(plan.vary).get(key, (0.0,)))
        about = (row.unit, row.meaning) if row else ("", "a key of the scenario")
        columns.append(Column(key, kind, *about))
    return [
        *columns,
        Column("seed", "count", "1", "arm.encoder.seed of the run; plant.seed counts in step"),
        Column("status", "text", "", "end of the run: complete, unfinished (time limit reached) or diverged"),
        Column("divergence", "text", "", "time and cause of divergence; null if none"),
        Column("met", "switch", "", "whether all expectations were met; null without expectations"),
    ]


def last_columns() -> list[Column]:
    """Return the columns after the metrics: the inputs of a row."""
    return [
        Column("scenario", "text", "", "hash of the scenario and its model, without name and expectations"),
        Column("versions", "text", "", "of everything that determines the bits, as JSON"),
    ]


def figure_columns(runs: Iterable[Prepared]) -> list[Column]:
    """Return the metrics of all runs; they depend only on joints and axes, so a few runs suffice."""
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
    """Return the type of a column with these values, some possibly missing."""
    given = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in given):
        return "switch"
    if all(_number(value) is not None for value in given):
        return "number"
    return "text"


def _number(value: Value) -> float | None:
    """Return a number, or an angle in radians; None for any other value."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    try:
        return angle(value) if isinstance(value, str) else None
    except ValueError:
        return None


class AsRows:
    """Make the rows of some results, as the Parquet file of a part."""

    def __init__(self, plan: Plan, base: Scenario, columns: Sequence[Column]) -> None:
        """Store the data common to all rows.

        Args:
            plan: Plan of the sweep.
            base: Its scenario.
            columns: Columns of a row.
        """
        self._plan, self._columns, self._versions = plan, columns, json.dumps(facts.versions())
        self._own = [column for column in columns if column.name in plan.keys]  # the others have fixed types
        # numbers of `task` and `control` may come from the arm of each run
        vary = {"task", "control", *(split(key)[0] for key in (*plan.keys, *SEEDS))}
        self._same = {name: _as_json(base, name) for name in _SECTIONS if name not in vary}

    def __call__(self, results: Sequence[Result]) -> bytes:
        """Return the rows of some results."""
        return as_parquet(self._columns, [typed(self.row(one), self._own) for one in results])

    def row(self, one: Result) -> dict[str, Any]:
        """Return the row of a result, with the values of its keys as given."""
        values = {name: figure.value for name, figure in one.scorecard.figures.items()}
        met = all(outcome.ok for outcome in one.outcomes) if one.outcomes else None
        return {
            "index": one.index,
            **self._plan.values(one.index),
            "seed": self._plan.run_seed(one.index),
            "status": one.status,
            "divergence": one.divergence and str(one.divergence),
            "met": met,
            # an undefined name is null
            **{name: None if value == "" else value for name, value in values.items()},
            "scenario": digest(one.prepared.scenario, fingerprint(one.prepared.arm), self._same),
            "versions": self._versions,
        }


def fingerprint(arm: Arm) -> str:
    """Return a digest of a compiled model, independent of the location of its files."""
    if arm not in _prints:
        found = hashlib.sha256()
        for name, data in _numbers(arm.model):
            found.update(f"{name} {len(data)} ".encode() + data)
        _prints[arm] = found.hexdigest()
    return _prints[arm]


def _numbers(model: Any) -> Iterator[tuple[str, bytes]]:
    """Iterate over the contents of a compiled model, without the paths of its files and their lengths."""
    for name in dir(model):
        hidden = name.startswith("_") or "path" in name or name == "nbuffer"
        value = None if hidden else getattr(model, name)
        if isinstance(value, np.ndarray):
            yield name, value.tobytes()
        elif isinstance(value, int | float | bytes):
            yield name, repr(value).encode()
        elif type(value).__module__.startswith("mujoco."):  # options, statistics, visual settings
            yield from ((f"{name}.{inner}", data) for inner, data in _numbers(value))


def digest(one: Scenario, model: str, same: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return a hash of a run's inputs: its scenario without name, expectations and sweep.

    Args:
        one: The scenario.
        model: Replacement for the path of the model's file.
        same: Known JSON of sections.
    """
    texts = {name: same[name] if name in same else _as_json(one, name, model) for name in _SECTIONS}
    text = ", ".join(f'"{name}": {section}' for name, section in texts.items())
    return hashlib.sha256(f"{{{text}}}".encode()).hexdigest()[:16]


def _as_json(one: Scenario, name: str, model: str = "") -> str:
    """Return a section of a scenario as JSON, with a replacement for the model's file."""
    data: dict[str, Any] = getattr(one, name).model_dump(mode="json")
    return _SORTED.encode(data | {"model": model} if name == "arm" else data)


def typed(row: dict[str, Any], columns: Sequence[Column]) -> dict[str, Any]:
    """Return a row with values converted for the columns: angles to numbers, lists to YAML."""
    result = dict(row)
    for name, kind, _, _ in columns:
        value = result.get(name)
        if kind == "number" and name in result and value is not None:
            result[name] = _number(value)
        elif kind == "text" and value is not None and not isinstance(value, str):
            result[name] = inline(value)
    return result
