"""A run: its record, its metrics, and its file."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, create_model

import rmrc
from rmrc.results import notebook
from rmrc.results.columns import COLUMNS, Recorded
from rmrc.results.verdict import told
from rmrc.support.brief import brief, cut
from rmrc.support.errors import QuestionError
from rmrc.support.files import reading, written_whole

if TYPE_CHECKING:  # imports numba, which a run that is only read does not need
    from rmrc.results.scorecard import Scorecard

# Prefix of the columns of a baseline in the file of its run.
BASELINE = "baseline/"
# What reading another kind of file, or a damaged one, may raise.
# Facts of a run are smaller, in any unit.
LARGEST = 1e100


@brief
@dataclass(frozen=True, eq=False)
class Run(Recorded):
    """The run of one world: `run["qdot_cmd"]` is a column, `run.scorecard["tau.peak"].value` a metric.

    Attributes:
        baseline: The run of its scenario's baseline; None: it has none.
    """

    baseline: "Run | None" = None

    @cached_property
    def scorecard(self) -> "Scorecard":
        """The metrics of the run, up to its last tick."""
        from rmrc.results.scorecard import scorecard

        return scorecard(self)

    @property
    def verdict(self) -> str:
        """The result in one sentence."""
        other = self.baseline
        return told(self, self.scorecard, None if other is None else (other, other.scorecard))

    def plot(
        self,
        path: str | Path | None = None,
        panels: Sequence[str] = (),
        width: float = 7.16,
        font: float = 8.0,
    ) -> Any:
        """Draw it, and return matplotlib's figure, which a notebook shows; see `rmrc.plot`."""
        return rmrc.plot(self, path, panels, width, font)

    def to_pandas(self) -> Any:
        """Return the columns as a DataFrame over time, such as `qdot_cmd.elbow`.

        Raises:
            QuestionError: pandas is not installed.
        """
        return notebook.frame(self)

    def _repr_html_(self) -> str:
        """Return its metrics, for a notebook."""
        return self.scorecard._repr_html_()

    def save(self, path: Path) -> None:
        """Write all columns and the facts about them to an npz file, atomically."""
        beside = self.baseline.columns if self.baseline else {}
        columns = {**self.columns, **{f"{BASELINE}{name}": column for name, column in beside.items()}}
        _write(path, {**columns, "facts": np.array(json.dumps(self._facts()))})

    @classmethod
    def read(cls, path: Path) -> "Run":
        """Return the run in a file that `save` wrote.

        Raises:
            OSError: It cannot be opened.
            QuestionError: It is another kind of file, or damaged.
        """
        (run, *others) = read_runs(path).values()
        if others:
            raise QuestionError(f"{path}: holds {1 + len(others)} runs, not one; rmrc.read_runs reads them")
        return run

    def _facts(self) -> dict[str, Any]:
        """Return the facts except the columns, as strict JSON; infinite numbers are texts."""
        facts: dict[str, Any] = json.loads(
            _Facts.model_validate(self, from_attributes=True).model_dump_json()
        )
        facts["units"] = {name: column.unit for name, column in COLUMNS.items()}
        if self.baseline is not None:
            facts["baseline"] = self.baseline._facts()
        return facts

    @classmethod
    def _of(cls, facts: Mapping[str, Any], arrays: Mapping[str, NDArray[np.generic]]) -> "Run":
        """Return the run from the facts and columns of a file.

        Raises:
            KeyError: A column is missing.
            ValueError: The facts or columns are none that a run has saved.
        """
        baseline = None
        if "baseline" in facts:
            its = {name.removeprefix(BASELINE): arrays[name] for name in arrays if name.startswith(BASELINE)}
            baseline = cls._of(facts["baseline"], its)
        columns = {name: arrays[name] for name in COLUMNS}
        run = cls(**dict(_Facts.model_validate(facts)), columns=columns, baseline=baseline)
        _refuse_odd(run)
        return run


# The facts in the file of a run: all but its columns, checked by their types.
_Facts = create_model(  # type: ignore[call-overload]
    "_Facts",
    __config__=ConfigDict(ser_json_inf_nan="strings"),
    **{
        field.name: (get_type_hints(Recorded)[field.name], ... if field.default is MISSING else field.default)
        for field in fields(Recorded)
        if field.name != "columns"
    },
)


class Runs(dict[str, Run]):
    """Runs by label, as `compare` returns them; a notebook shows the metrics in which they differ."""

    def __repr__(self) -> str:
        """Return the labels."""
        labels = ", ".join(f"{label!r}: {len(run)} ticks" for label, run in self.items())
        return cut(f"Runs({{{labels}}})")

    def _repr_html_(self) -> str:
        """Return the metrics in which they differ, side by side."""
        return notebook.beside({label: run.scorecard for label, run in self.items()})

    def to_pandas(self) -> Any:
        """Return all metrics as a DataFrame, one row per run.

        Raises:
            QuestionError: pandas is not installed.
        """
        rows = {
            label: {name: figure.value for name, figure in run.scorecard.items()}
            for label, run in self.items()
        }
        return notebook.pandas().DataFrame.from_dict(rows, orient="index")


def save_runs(path: Path, runs: Mapping[str, Run]) -> None:
    """Write several runs to an npz file, atomically: `0/q` is column q of the first.

    Args:
        path: Path of the file.
        runs: By label.
    """
    arrays = {
        f"{i}/{name}": column for i, run in enumerate(runs.values()) for name, column in run.columns.items()
    }
    facts = [{"label": label, **run._facts()} for label, run in runs.items()]
    _write(path, {**arrays, "facts": np.array(json.dumps(facts))})


def read_runs(path: Path) -> Runs:
    """Return the runs in a file of `save` or `save_runs`, by label; the label of a single run is its name.

    Raises:
        OSError: It cannot be opened.
        QuestionError: It is another kind of file, or damaged.
    """
    with (
        reading(path, "the columns of a run"),
        path.open("rb") as opened,
        np.load(opened, allow_pickle=False) as file,
    ):
        facts = json.loads(str(file["facts"]))
        if isinstance(facts, dict):
            return Runs({facts["name"]: Run._of(facts, file)})
        columns = [{name: file[f"{i}/{name}"] for name in COLUMNS} for i in range(len(facts))]
        return Runs((part["label"], Run._of(part, columns[i])) for i, part in enumerate(facts))


def _write(path: Path, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def _refuse_odd(run: Run) -> None:
    """Refuse a run that none has saved: numbers beyond sense, facts and columns of another length or width.

    Raises:
        ValueError: It is such a run.
    """
    joints, axes = len(run.joints), len(run.screws)
    counts = (
        (run.is_slide, {joints}),
        (run.weights, {0, len(run.axes)}),
        (run.chatter_floor, {0, joints}),
        (run.torque_limit, {0, joints}),
        (run.rate_limit, {0, joints}),
        (run.shoulder, {3} if run.reach else {0}),
        (run.leaders, {axes}),
        (run.joint_scale, {joints} if axes else {0}),
        *((screw, {6}) for screw in run.screws),
    )
    numbers = (run.length, run.period, run.planned, run.wall_time, run.damping_below)
    if not all(abs(number) < LARGEST for number in numbers) or run.period <= 0.0 or run.planned < 1:
        raise ValueError
    if not all(len(values) in count for values, count in counts) or not {*run.leaders} <= {*range(joints)}:
        raise ValueError
    for name, column in run.columns.items():
        width = COLUMNS[name].width
        widths = {"": (), "n": (joints,)}.get(width, (int(width),) if width.isdigit() else column.shape[1:])
        if column.dtype.kind not in "fiub" or column.shape != (len(run), *widths):
            raise ValueError(name)
