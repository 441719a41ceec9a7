"""A run: its record, its metrics, and its file."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

import rmrc
from rmrc.law.task import WORLD_VIEW, View
from rmrc.results import notebook
from rmrc.results.columns import ADDED, COLUMNS, Divergence, Recorded, completed
from rmrc.results.verdict import told
from rmrc.scenario.profile import Profile
from rmrc.support.brief import brief, cut
from rmrc.support.errors import QuestionError
from rmrc.support.files import written_whole

if TYPE_CHECKING:  # imports numba, which a run that is only read does not need
    from rmrc.results.scorecard import Scorecard

# Prefix of the columns of a baseline in the file of its run.
BASELINE = "baseline/"
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
        """Return the facts except the columns, as strict JSON."""
        facts = {
            "name": self.name,
            "joints": self.joints,
            "is_slide": self.is_slide,
            "axes": self.axes,
            "length": self.length,
            "period": self.period,
            "planned": self.planned,
            "divergence": self.divergence and vars(self.divergence),
            "wall_time": self.wall_time,
            "weights": self.weights,
            "touching": self.touching,
            "resting": self.resting,
            "torque_limit": _finite(self.torque_limit),
            "rate_limit": _finite(self.rate_limit),
            "damping_below": self.damping_below,
            "shoulder": self.shoulder,
            "reach": self.reach,
            "screws": self.screws,
            "leaders": self.leaders,
            "joint_scale": self.joint_scale,
            "chatter_floor": self.chatter_floor,
            "units": {name: column.unit for name, column in COLUMNS.items()},
        }
        if self.view.frame != "world":
            facts["view"] = self.view
        if self.baseline is not None:
            facts["baseline"] = self.baseline._facts()
        if self.profile is not None:
            facts["profile"] = self.profile.model_dump(mode="json")
        return facts

    @classmethod
    def _of(cls, facts: Mapping[str, Any], arrays: Mapping[str, NDArray[np.generic]]) -> "Run":
        """Return the run from the facts and columns of a file."""
        baseline = None
        if "baseline" in facts:
            its = {name.removeprefix(BASELINE): arrays[name] for name in arrays if name.startswith(BASELINE)}
            baseline = cls._of(facts["baseline"], its)
        columns = completed({name: arrays[name] for name in COLUMNS if name in arrays or name not in ADDED})
        for lacking in {"tau_gravity", "qdot_plain"} - columns.keys():
            columns[lacking] = np.full_like(columns["tau"], math.nan)
        _refuse_odd(facts, columns)
        divergence = facts["divergence"] and Divergence(**facts["divergence"])
        frame, base, free = facts.get("view", WORLD_VIEW)
        view = View(frame, tuple(base), free)
        profile = Profile.model_validate(facts["profile"]) if "profile" in facts else None
        return cls(
            facts["name"], tuple(facts["joints"]), tuple(facts["is_slide"]), tuple(facts["axes"]),
            facts["length"], facts["period"], columns, facts["planned"], divergence,
            facts["wall_time"], tuple(facts.get("weights", ())), _limits(facts, "torque_limit"), view,
            tuple(facts.get("touching", ())), tuple(map(tuple, facts.get("resting", ()))),
            tuple(facts.get("chatter_floor", ())), profile,
            _limits(facts, "rate_limit"), facts.get("damping_below", 0.0), tuple(facts.get("shoulder", ())),
            facts.get("reach", 0.0), tuple(map(tuple, facts.get("screws", ()))),
            tuple(facts.get("leaders", ())), tuple(facts.get("joint_scale", ())), baseline,
        )  # fmt: skip


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
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            facts = json.loads(str(file["facts"]))
            if isinstance(facts, dict):
                return Runs({facts["name"]: Run._of(facts, file)})
            return Runs(
                (
                    one["label"],
                    Run._of(one, {name: file[f"{i}/{name}"] for name in COLUMNS if f"{i}/{name}" in file}),
                )
                for i, one in enumerate(facts)
            )
    except (KeyError, ValueError, TypeError, AttributeError, EOFError, BadZipFile, OSError) as error:
        if isinstance(error, OSError) and error.filename is not None:  # it is missing; else it is damaged
            raise
        raise QuestionError(f"{path}: does not hold the columns of a run, or is damaged") from None


def _write(path: Path, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def _refuse_odd(facts: Mapping[str, Any], columns: Mapping[str, NDArray[np.generic]]) -> None:
    """Refuse facts that no run has saved: texts for numbers, columns of another length or width.

    Raises:
        ValueError: There is such a fact.
        TypeError: A fact has another type.
    """
    joints, ticks = len(facts["joints"]), len(columns["time"])
    numbers = [facts[name] for name in ("length", "period", "planned", "wall_time")]
    several = [facts.get(name, ()) for name in ("weights", "torque_limit", "rate_limit", "chatter_floor")]
    screws, leaders, scale = (facts.get(name, ()) for name in ("screws", "leaders", "joint_scale"))
    numbers += [
        facts.get("damping_below", 0.0),
        facts.get("reach", 0.0),
        *facts.get("shoulder", ()),
        *(one for some in (*several, *screws, scale) for one in some if one is not None),
    ]
    words = [facts["name"], *facts["joints"], *facts["axes"], *facts.get("touching", ())]
    if not all(isinstance(one, int | float) for one in numbers) or not all(isinstance(w, str) for w in words):
        raise TypeError
    if not all(abs(one) < LARGEST for one in numbers[:5]):
        raise ValueError
    if len(facts.get("shoulder", ())) != (3 if facts.get("reach") else 0):
        raise ValueError
    if len(facts["is_slide"]) != joints or not all(len(one) in (0, joints) for one in several[1:3]):
        raise ValueError
    if len(screws) != len(leaders) or not all(len(one) == 6 for one in screws):
        raise ValueError
    if len(scale) != (joints if screws else 0) or not all(one in range(joints) for one in leaders):
        raise ValueError
    for name, column in columns.items():
        kind = COLUMNS[name].width
        width = {"": (), "n": (joints,)}.get(kind, (int(kind),) if kind.isdigit() else column.shape[1:])
        if column.dtype.kind not in "fiub" or column.shape != (ticks, *width):
            raise ValueError(name)


def _finite(limits: tuple[float, ...]) -> list[float | None]:
    """Return limits for strict JSON: null for infinite."""
    return [limit if math.isfinite(limit) else None for limit in limits]


def _limits(facts: Mapping[str, Any], name: str) -> tuple[float, ...]:
    """Return limits of a file; limits that an older file lacks are unknown."""
    return tuple(math.inf if limit is None else limit for limit in facts.get(name, ()))
