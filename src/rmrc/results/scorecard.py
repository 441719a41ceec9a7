"""The scorecard: a run in metrics.

A metric has one flat name with dots, such as `joint_rate.peak` or `joint_rate.shoulder.peak`. The set of
metrics depends on the joints and the task axes alone, never on the events of the run: a metric that a run is
too short to determine is NaN, or "" for a name. Equal ticks give equal metrics; only `wall_time` and `speed`
differ from one execution to the next.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rmrc.results import notebook
from rmrc.results.columns import Recorded
from rmrc.results.metrics import metrics
from rmrc.support.brief import brief


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
        """Return a metric by its flat name."""
        return self.figures[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.figures)

    def __len__(self) -> int:
        """Return the number of metrics."""
        return len(self.figures)

    def to_pandas(self) -> Any:
        """Return the metrics as a DataFrame, one row each, with value, unit and meaning.

        Raises:
            QuestionError: pandas is not installed.
        """
        return notebook.pandas().DataFrame.from_dict(
            {name: figure._asdict() for name, figure in self.items()}, orient="index"
        )

    def _repr_html_(self) -> str:
        """Return the defined metrics, for a notebook."""
        return notebook.figures(self.name, self)

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


def scorecard(run: Recorded) -> Scorecard:
    """Return the metrics of a run of any length, even 0."""
    with np.errstate(all="ignore"):  # of infinite values, differences are NaN
        named = {name: Figure(value, unit, meaning) for name, value, unit, meaning in metrics(run)}
    return Scorecard(run.name, run.joints, named)


def json_value(value: float | str) -> float | str | None:
    """Return a value for strict JSON, as in `Scorecard.nested`."""
    if isinstance(value, str):
        return value or None
    if math.isnan(value):
        return None
    return str(value) if math.isinf(value) else value
