"""The output of a sweep, ready to show: its rows, the varied keys, and the main metrics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.study.dataset import Contents, Left, read_left
from rmrc.study.summary import MAIN
from rmrc.support.errors import QuestionError

Array = NDArray[np.float64]

# A parallel coordinate of words has room for so many.
MOST_WORDS = 12


@dataclass(frozen=True, eq=False)
class Swept:
    """The rows of a sweep, at least one.

    Attributes:
        name: Name of the sweep.
        rows: All columns, by name.
        units: Units of each.
        varied: Keys with several values.
        figures: The main metrics of any run, (runs,) each; NaN where a run has none.
    """

    name: str
    rows: Mapping[str, list[Any]]
    units: Mapping[str, str]
    varied: Sequence[str]
    figures: Mapping[str, Array]

    @classmethod
    def of(cls, path: Path, left: Left | None = None) -> "Swept":
        """Return the contents of a file.

        Args:
            path: The `.parquet` that `sweep` left.
            left: Its contents, if already read.

        Raises:
            OSError: It cannot be opened.
            QuestionError: It is another kind of file, or has no rows.
        """
        left = left or read_left(path)
        rows = left.rows
        if "on_front" in rows:
            raise QuestionError(f"{path}: holds the settings of a search, not the rows of a sweep")
        try:
            contents = Contents.read(left.about)
        except (KeyError, ValueError, TypeError):
            raise QuestionError(f"{path}: does not hold the rows of a sweep") from None
        if not rows["index"]:
            raise QuestionError(f"{path}: has no rows to show")
        units = {column.name: column.unit for column in contents.columns}
        names = list(units)
        keys = [name for name in names[1 : names.index("status")] if name != "seed"]
        varied = [name for name in keys if len(set(map(str, rows[name]))) > 1]
        figures = {name: numbers(rows[name]) for name in MAIN if name in rows}
        figures = {name: values for name, values in figures.items() if np.isfinite(values).any()}
        name = path.name.removesuffix(".parquet").removesuffix(".sweep")
        return cls(name, rows, units, varied, figures)

    @property
    def coordinates(self) -> dict[str, Array]:
        """The varied keys, words by their number among `words`, and the metrics; empty if either is."""
        codes = {name: {one: i for i, one in enumerate(self.words(name))} for name in self.varied}
        values = {name: numbers([codes[name].get(v, v) for v in self.rows[name]]) for name in self.varied}
        known = {name: one for name, one in values.items() if np.isfinite(one).sum() > 1}
        return known | dict(self.figures) if known and self.figures else {}

    def words(self, name: str) -> list[str]:
        """Return the different values of a column of words, of which there are a few."""
        found = list(dict.fromkeys(v for v in self.rows[name] if isinstance(v, str)))
        return found if len(found) <= MOST_WORDS else []


def numbers(values: Sequence[Any]) -> Array:
    """Return numbers; NaN for other values."""
    return np.array([float(v) if isinstance(v, int | float) else np.nan for v in values])
