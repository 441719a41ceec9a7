"""The rows of a sweep, ready to show: the ends of its runs, and the extremes of the main metrics."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.show.sheets import Sheet, number
from rmrc.study.dataset import Contents, Left, read_left
from rmrc.support.errors import QuestionError
from rmrc.support.files import reading

Array = NDArray[np.float64]


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
        rows, about = left or read_left(path)
        with reading(path, "of a sweep"):
            contents = Contents.read(about)
            units = {column.name: column.unit for column in contents.columns}
            keys = list(units)[1 : list(units).index("seed")]
            varied = [key for key in keys if len(set(map(str, rows[key]))) > 1]
            figures = {name: np.array(rows[name], float) for name in contents.metrics}
        if not rows["index"]:
            raise QuestionError(f"{path}: has no rows to show")
        figures = {name: values for name, values in figures.items() if np.isfinite(values).any()}
        return cls(path.name.removesuffix(".parquet").removesuffix(".sweep"), rows, units, varied, figures)

    def extremes(self) -> dict[str, tuple[int, int]]:
        """Return the rows with the smallest and largest value of each metric, the first of equal ones."""
        return {
            name: (int(np.nanargmin(values)), int(np.nanargmax(values)))
            for name, values in self.figures.items()
        }

    def sheets(self) -> list[Sheet]:
        """Return the tables of the summary."""
        rows, met = self.rows, [value for value in self.rows["met"] if value is not None]
        counts = [(status, str(count)) for status, count in sorted(Counter(rows["status"]).items())]
        counts += [("all expectations met", str(sum(met)))] if met else []
        extremes = [
            (f"{name} [{self.units[name]}]", *(text for i in ends for text in self._end(name, i)))
            for name, ends in self.extremes().items()
        ]
        return [
            Sheet(f"{self.name}: {len(rows['index'])} runs", ("", ""), counts),
            Sheet("", ("metric", "least", "run", "most", "run"), extremes),
        ]

    def _end(self, name: str, i: int) -> tuple[str, str]:
        return number(float(self.figures[name][i])), str(self.rows["index"][i])
