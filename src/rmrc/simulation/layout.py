"""Where the columns of a run stand in the record of its world, and in a row of the run."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.law.record import world_type
from rmrc.results.columns import COLUMNS

# Groups of a world's record that hold columns, beside `tick`.
_ELSEWHERE = {"sigma": "first", "gain": "first", "damping": "first"}
_WORD = 8


class Layout(NamedTuple):
    """The columns of a row.

    Attributes:
        sources: Index of each number among the words of the record, (width,).
        places: First number of each column, and how many; 0 for a scalar.
    """

    sources: NDArray[np.int64]
    places: dict[str, tuple[int, int]]

    def columns(self, rows: NDArray[np.int64]) -> dict[str, NDArray[np.generic]]:
        """Return views of rows, (T, width), by the names of their columns."""
        numbers = rows.view(np.float64)
        columns: dict[str, NDArray[np.generic]] = {}
        for name, (first, count) in self.places.items():
            table = rows if name == "status" else numbers
            columns[name] = table[:, first : first + count] if count else table[:, first]
        return columns


@cache
def layout(capacity: int, n: int, k: int) -> Layout:
    """Return the layout of an arm of n joints with k singular values, in records of a capacity."""
    world = world_type(capacity)
    sizes = {"n": n, "k": k, "": 0}
    sources, places = list[int](), {}
    for name, column in COLUMNS.items():
        if column.width == "nq":
            continue
        group = _ELSEWHERE.get(name, "tick")
        fields = world[group].fields
        assert world.fields is not None
        assert fields is not None
        first = (world.fields[group][1] + fields[name][1]) // _WORD
        count = sizes.get(column.width, 0) or int(column.width if column.width.isdigit() else 0)
        places[name] = len(sources), count
        sources += range(first, first + max(1, count))
    return Layout(np.array(sources, np.int64), places)
