"""Full recordings of chosen rows: `--record worst:3`. Those runs are run again, with the same bits."""

import heapq
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from rmrc import scenario
from rmrc.scenario import Check, Scenario
from rmrc.scenario.sections import PROFILE
from rmrc.study.dataset import Column, Dataset
from rmrc.support.errors import ScenarioError, did_you_mean

# What is asked for most, where a scenario expects nothing.
USUAL = "position_error.max"


def figures_of(expect: Iterable[str]) -> tuple[str, ...]:
    """Return the figures that expectations are about: of a profile, how many commands it refuses."""
    return tuple(f"{PROFILE}.refused" if name == PROFILE else name for name in expect)


class Choice(NamedTuple):
    """Which rows are recorded.

    Attributes:
        worst: Whether those with the worst figure, else with the best.
        most: How many.
        figure: Its name; "": that of the first expectation, or the largest position error.
    """

    worst: bool
    most: int
    figure: str

    @classmethod
    def read(cls, text: str) -> "Choice":
        """Return the choice in a text: `worst:3`, `best:1` or `worst:3:joint_rate.peak`.

        Raises:
            ScenarioError: The text is none.
        """
        which, _, rest = text.partition(":")
        count, _, figure = rest.partition(":")
        if which not in ("worst", "best") or not count.isdecimal() or not 0 < int(count) <= 100:
            wanted = "must be worst:N or best:N, with N from 1 to 100, and optionally :METRIC"
            raise ScenarioError.about("--record", f"{wanted}, got {scenario.inline(text)}")
        return cls(which == "worst", int(count), figure)

    def settled(self, one: Scenario, columns: Sequence[Column]) -> "Choice":
        """Return the choice with its figure.

        Args:
            one: The scenario.
            columns: Of its rows.

        Raises:
            ScenarioError: No row has such a number.
        """
        figure = self.figure or next(iter(figures_of(one.expect)), USUAL)
        numbers = [c.name for c in columns if c.kind == "number"]
        if figure not in numbers:
            near = did_you_mean(figure, numbers) or "; take one such as joint_rate.peak"
            raise ScenarioError.about("--record", f"no row has a number {scenario.inline(figure)}{near}")
        return self._replace(figure=figure)


def chosen(dataset: Dataset, choice: Choice, expect: Mapping[str, Check | str]) -> list[int]:
    """Return the indices of the chosen rows, the most extreme first; of equal ones, the first.

    Args:
        dataset: The rows; those without the figure are never chosen.
        choice: With its figure.
        expect: Says what is bad: to be above, below or far off; else `.min` and `completed` are bad where
            they are small, and everything else where it is large.
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
