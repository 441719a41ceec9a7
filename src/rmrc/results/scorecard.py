"""The scorecard: a run in metrics.

A metric has one flat name with dots, such as `joint_rate.peak` or `joint_rate.shoulder.peak`. Equal ticks
give equal metrics; only `wall_time` and `speed` differ from one execution to the next.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rmrc.results.columns import Recorded
from rmrc.results.metrics import metrics
from rmrc.support.errors import did_you_mean
from rmrc.support.text import brief

# Other words at the end of a metric.
_WORDS = {"max": "peak", "maximum": "max", "peak": "max", "mean": "rms", "final": "end", "last": "end"}


class Figure(NamedTuple):
    """One metric.

    Attributes:
        value: A number (NaN: undefined for this run), or the name of a joint.
        unit: SI, `1` for a plain number, "" for a name.
        meaning: A short description.
    """

    value: float | str
    unit: str
    meaning: str


@brief
@dataclass(frozen=True, eq=False)
class Scorecard(Mapping[str, Figure]):
    """The metrics of one run by name, in the order of display.

    Attributes:
        name: Name of the scenario.
        joints: Names of the joints in the names of metrics.
        figures: By flat name.
    """

    name: str
    joints: tuple[str, ...]
    figures: Mapping[str, Figure]

    def __getitem__(self, name: str) -> Figure:
        """Return a metric by its flat name.

        Raises:
            KeyError: There is none; it names the nearest.
        """
        if name not in self.figures:
            raise KeyError(f'no metric "{name}"{nearest(name, self.figures)}')
        return self.figures[name]

    def __contains__(self, name: object) -> bool:
        """Return whether there is such a metric."""
        return name in self.figures

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.figures)

    def __len__(self) -> int:
        """Return the number of metrics."""
        return len(self.figures)

    def nested(self) -> dict[str, object]:
        """Return the values as dicts within dicts, ready for strict JSON.

        A name is split at its dots, except where the part before a dot is a metric itself (a joint
        may be called `peak`). JSON has neither NaN nor infinity: an undefined number or name
        becomes None, an infinite number the text "inf" or "-inf", which `float` reads.
        """
        tree: dict[str, object] = {}
        for name, figure in self.figures.items():
            branch, start, parts = tree, 0, name.split(".")
            for end in range(1, len(parts)):
                if ".".join(parts[:end]) not in self.figures:
                    key, start = ".".join(parts[start:end]), end
                    branch = branch.setdefault(key, {})  # type: ignore[assignment]
            branch[".".join(parts[start:])] = json_value(figure.value)
        return tree


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the metric that a name is likely to mean, as the end of a message, or how metrics begin."""
    group, _, last = name.rpartition(".")
    known, word = list(names), f"{group}.{_WORDS.get(last, last)}"
    groups = ", ".join(dict.fromkeys(each.partition(".")[0] for each in known))
    if word in known:
        return f'; did you mean "{word}"?'
    return did_you_mean(name, known) or f"; metrics begin with {groups}"


def scorecard(run: Recorded) -> Scorecard:
    """Return the metrics of a run of any length, even 0."""
    with np.errstate(all="ignore"):  # of infinite values, differences are NaN
        named = {name: Figure(value, unit, meaning) for name, value, unit, meaning in metrics(run)}
    return Scorecard(run.name, run.joints, named)


def json_value(value: float | str) -> float | str | None:
    """Return a value for strict JSON, as in `Scorecard.nested`."""
    if isinstance(value, str):
        return value or None
    return None if math.isnan(value) else str(value) if math.isinf(value) else value
