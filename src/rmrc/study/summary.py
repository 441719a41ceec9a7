"""Summary of a sweep: the ends of its runs, and the extremes of the main metrics."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rmrc.study.dataset import Column, Dataset

MAIN = (
    "joint_rate.peak", "joint_acceleration.peak", "position_error.max", "position_error.end",
    "orientation_error.max", "orientation_error.end", "sigma.min",
)  # fmt: skip


@dataclass
class Extremes:
    """The smallest and largest value of a metric, and their runs, the first of equal ones.

    Attributes:
        column: The metric.
        least: Smallest value and its run; NaN and -1 where no run has one.
        most: Largest value and its run.
    """

    column: Column
    least: tuple[float, int] = (math.nan, -1)
    most: tuple[float, int] = (math.nan, -1)

    def add(self, value: float | None, index: int) -> None:
        """Add a row."""
        if value is None or math.isnan(value):
            return
        if self.least[1] < 0 or (value, index) < self.least:
            self.least = value, index
        if self.most[1] < 0 or (-value, index) < (-self.most[0], self.most[1]):
            self.most = value, index


@dataclass(frozen=True)
class Summary:
    """A summary of rows.

    Attributes:
        statuses: Number of runs by their end.
        met: Number of runs that met all expectations, or None without expectations.
        extremes: Extremes of the main metrics.
    """

    statuses: Mapping[str, int]
    met: int | None
    extremes: Sequence[Extremes]


def summarize(dataset: Dataset, columns: Sequence[Column], more: Sequence[str] = ()) -> Summary:
    """Return a summary of the existing rows, read some thousands at a time.

    Args:
        dataset: The rows.
        columns: Their columns.
        more: Metrics in addition to the main ones.
    """
    known = {column.name: column for column in columns}
    names = [name for name in dict.fromkeys((*MAIN, *more)) if name in known]
    extremes = {name: Extremes(known[name]) for name in names}
    statuses, met = Counter[str](), Counter[bool | None]()
    for batch in dataset.batches(["index", "status", "met", *names]):
        statuses.update(batch["status"])
        met.update(batch["met"])
        for name, extreme in extremes.items():
            for index, value in zip(batch["index"], batch[name], strict=True):
                extreme.add(value, index)
    return Summary(statuses, met[True] if met[True] or met[False] else None, list(extremes.values()))
