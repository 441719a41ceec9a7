"""Runs made by hand, of an arm that stands still but for the columns that a test gives."""

import numpy as np

from rmrc.results.columns import COLUMNS
from rmrc.results.run import Run


def make_run(ticks, joints=("shoulder", "elbow"), axes=("x", "y"), period=0.001, **given):
    """Return a run that stands still, but for the columns and fields that are given."""
    n = len(joints)
    width = {"n": n, "k": min(n, len(axes)), "nq": n, "6": 6, "7": 7}
    columns = {
        name: np.zeros((ticks, width[column.width]) if column.width else ticks)
        for name, column in COLUMNS.items()
    }
    columns["time"] = columns["path_time"] = np.arange(ticks) * period
    columns["status"] = np.zeros(ticks, np.int64)
    columns |= {name: np.asarray(values) for name, values in given.items() if name in COLUMNS}
    fields = {
        "name": "case",
        "is_slide": (False,) * n,
        "length": 1.0,
        "planned": ticks or 1,
        "wall_time": 0.5,
    }
    fields |= {name: value for name, value in given.items() if name not in COLUMNS}
    return Run(joints=tuple(joints), axes=axes, period=period, columns=columns, **fields)


def random_columns(rng, ticks, n, k):
    """Return columns of random numbers, the times and the status left out."""
    width = {"n": n, "k": k, "nq": n, "6": 6, "7": 7}
    return {
        name: rng.normal(size=(ticks, width[column.width]) if column.width else ticks)
        for name, column in COLUMNS.items()
        if name not in ("time", "path_time", "status")
    }
