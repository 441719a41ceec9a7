"""What verbs leave, made by hand and then spoiled: columns of a run with its figures, rows of a sweep."""

import io
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from rmrc.results.columns import COLUMNS

TICKS = 4
WIDTHS = {"n": 2, "k": 2, "nq": 2}
FACTS = {
    "name": "left", "joints": ["a", "b"], "is_slide": [False, False], "axes": ["x", "y"], "length": 1.0,
    "period": 0.01, "planned": TICKS, "divergence": None, "wall_time": 0.1, "weights": [1.0, 1.0], "touching": [],
    "resting": [], "torque_limit": ["Infinity", 1.0], "rate_limit": ["Infinity", 3.0], "damping_below": 0.1,
    "chatter_floor": [1e-3, 1e-3],
}  # fmt: skip
ODD = (None, "", "x\x1b[31m", [], {}, [[]], -1, 0, 1e308, True, ["a"], [1, "b", None], float("nan"))
ROWS = {"index": [0, 1], "control.feedback": [5.0, 10.0], "status": ["complete", "diverged"], "met": [True, None],
        "joint_rate.peak": [1.0, None], "versions": ["{}", "{}"]}  # fmt: skip


def run(chance):
    """Return the bytes of a `.npz`: sound, of odd facts or columns, or damaged."""
    columns = {}
    for name, column in COLUMNS.items():
        width = WIDTHS.get(column.width) or (int(column.width) if column.width else 0)
        columns[name] = np.full((TICKS, width) if width else TICKS, 0.5)
    columns["time"] = 0.01 * np.arange(TICKS)
    sound, facts = dict(columns), dict(FACTS)
    for _ in range(chance.under(3)):
        if chance.odds(0.5):
            facts[chance.pick(tuple(facts))] = chance.pick(ODD)
        else:
            name = chance.pick(tuple(columns))
            one = sound[name]
            columns[name] = chance.pick(
                (one * np.nan, one * 1e30, one[:2], one[:0], one.astype("<U3"), one.T)
            )
    facts.pop(chance.pick(tuple(facts)) if chance.odds(0.1) else "", None)
    stream = io.BytesIO()
    np.savez(stream, **columns, facts=np.array(json.dumps(facts)))
    return chance.scratch(stream.getvalue()) if chance.odds(0.2) else stream.getvalue()


def figures(chance):
    """Return the bytes of a `.json` beside it, which is none of a run that is whole."""
    facts = {"name": "left", "scorecard": {}, "expect": [], "assumed": [], "divergence": None, "versions": {}}
    facts[chance.pick(tuple(facts))] = chance.pick(ODD)
    return json.dumps(facts).encode() if chance.odds(0.9) else chance.noise(40)


def rows(chance):
    """Return the bytes of a `.parquet`: its rows with odd values, told of by nothing or by something else."""
    table = {name: list(values) for name, values in ROWS.items()}
    if chance.odds(0.3):
        del table[chance.pick(tuple(table))]
    columns = [{"name": name, "type": "number", "unit": "1", "meaning": ""} for name in ROWS]
    about = chance.pick(({}, {"columns": columns}, {"columns": 1}, {"plan": {}, "columns": columns}, []))
    metadata = {b"rmrc": json.dumps(about).encode()} if chance.odds(0.8) else {}
    stream = io.BytesIO()
    pq.write_table(pa.table(table).replace_schema_metadata(metadata), stream)
    return chance.scratch(stream.getvalue()) if chance.odds(0.2) else stream.getvalue()
