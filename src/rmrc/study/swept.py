"""The rows of a sweep, ready to show: the ends of its runs, and the extremes of the main metrics."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.show.sheets import Sheet, number
from rmrc.study.dataset import Table, about_of, read_table
from rmrc.support.files import reading


@dataclass(frozen=True, eq=False)
class Swept:
    """The rows of a sweep, at least one, by rising index from 0 on.

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
    figures: Mapping[str, NDArray[np.float64]]

    @classmethod
    def of(cls, path: Path, table: Table | None = None) -> "Swept":
        """Return the contents of a file.

        Args:
            path: The `.parquet` that `sweep` left.
            table: Its contents, if already read.

        Raises:
            OSError: It cannot be opened.
            QuestionError: It is another kind of file.
        """
        table = read_table(path) if table is None else table
        rows, names = table.to_pydict(), table.column_names
        with reading(path, "of a sweep"):
            units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
            varied = [key for key in names[1 : names.index("seed")] if len(set(map(str, rows[key]))) > 1]
            metrics = json.loads(about_of(table.schema))["metrics"]
            figures = {name: np.array(rows[name], float) for name in metrics}
        figures = {name: values for name, values in figures.items() if np.isfinite(values).any()}
        return cls(path.name.removesuffix(".parquet").removesuffix(".sweep"), rows, units, varied, figures)

    def extremes(self) -> dict[str, tuple[int, int]]:
        """Return the runs with the smallest and largest value of each metric, the first of equal ones."""
        return {key: (int(np.nanargmin(v)), int(np.nanargmax(v))) for key, v in self.figures.items()}

    def sheets(self) -> list[Sheet]:
        """Return the tables of the summary."""
        ends, met = self.rows["status"], [value for value in self.rows["met"] if value is not None]
        counts = [(status, str(count)) for status, count in sorted(Counter(ends).items())]
        counts += [("all expectations met", str(sum(met)))] if met else []
        extremes = []
        for name, runs in self.extremes().items():
            cells = [text for i in runs for text in (number(float(self.figures[name][i])), str(i))]
            extremes.append((f"{name} [{self.units[name]}]", *cells))
        return [
            Sheet(f"{self.name}: {len(ends)} runs", ("", ""), counts),
            Sheet("", ("metric", "least", "run", "most", "run"), extremes),
        ]
