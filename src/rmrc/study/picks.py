"""Full recordings of chosen rows: `--record worst:3`. The chosen runs are repeated, with the same bits."""

import heapq
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from rmrc import scenario
from rmrc.scenario import Check, Scenario
from rmrc.scenario.expect import PROFILE
from rmrc.study.dataset import Column, Dataset
from rmrc.support.errors import ScenarioError, did_you_mean

# The most frequent metric of interest, where a scenario has no expectations.
USUAL = "position_error.max"


def figures_of(expect: Iterable[str]) -> tuple[str, ...]:
    """Return the metrics of expectations: for a profile, the number of refused commands."""
    return tuple(f"{PROFILE}.refused" if name == PROFILE else name for name in expect)


class Choice(NamedTuple):
    """A choice of rows to record.

    Attributes:
        worst: Whether to record the worst rows, otherwise the best.
        most: Number of rows.
        figure: Name of the metric; "": that of the first expectation, or the largest position error.
    """

    worst: bool
    most: int
    figure: str

    @classmethod
    def read(cls, text: str) -> "Choice":
        """Return the choice written in a text: `worst:3`, `best:1` or `worst:3:joint_rate.peak`.

        Raises:
            ScenarioError: The text is invalid.
        """
        which, _, rest = text.partition(":")
        count, _, figure = rest.partition(":")
        if which not in ("worst", "best") or not count.isdecimal() or not 0 < int(count) <= 100:
            wanted = "must be worst:N or best:N, with N from 1 to 100, and optionally :METRIC"
            raise ScenarioError.about("--record", f"{wanted}, got {scenario.inline(text)}")
        return cls(which == "worst", int(count), figure)

    def settled(self, one: Scenario, columns: Sequence[Column]) -> "Choice":
        """Return the choice with its metric.

        Args:
            one: The scenario.
            columns: Columns of its rows.

        Raises:
            ScenarioError: No row has this metric.
        """
        figure = self.figure or next(iter(figures_of(one.expect)), USUAL)
        numbers = [c.name for c in columns if c.kind == "number"]
        if figure not in numbers:
            near = did_you_mean(figure, numbers) or "; choose one such as joint_rate.peak"
            raise ScenarioError.about("--record", f"no row has the metric {scenario.inline(figure)}{near}")
        return self._replace(figure=figure)


def chosen(dataset: Dataset, choice: Choice, expect: Mapping[str, Check | str]) -> list[int]:
    """Return the indices of the chosen rows, the most extreme first; the first of equal ones.

    Args:
        dataset: The rows; those without the metric are never chosen.
        choice: The choice, with its metric.
        expect: Expectation that defines the bad direction; without one, small values of `.min` and
            `completed` are bad, and large values of all others.
    """
    wanted = expect.get(choice.figure)
    bad = _badness(choice.figure, wanted if isinstance(wanted, Check) else None)
    sign = -1.0 if choice.worst else 1.0
    rows = (
        (sign * bad(value), index)
        for batch in dataset.batches(["index", choice.figure])
        for index, value in zip(batch["index"], batch[choice.figure], strict=True)
        if value is not None and not math.isnan(value)
    )
    return [index for _, index in heapq.nsmallest(choice.most, rows)]


def _badness(figure: str, wanted: Check | None) -> Callable[[float], float]:
    if wanted is not None and wanted.equals is not None:
        middle = wanted.equals
        return lambda value: abs(value - middle)
    if wanted is not None and (wanted.above is None) != (wanted.below is None):
        small = wanted.below is None
    else:
        small = figure.endswith(".min") or figure == "completed"
    return (lambda value: -value) if small else (lambda value: value)
