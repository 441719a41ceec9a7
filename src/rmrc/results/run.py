"""A run: what it recorded, its figures, and its file."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from rmrc.law.task import WORLD_VIEW, View
from rmrc.results.columns import ADDED, COLUMNS, Divergence, Recorded, completed
from rmrc.results.scorecard import Scorecard, scorecard
from rmrc.results.verdict import told
from rmrc.scenario.profile import Profile
from rmrc.support.errors import QuestionError
from rmrc.support.files import written_whole

# Begins the names of the columns of a baseline in the file of its run.
BASELINE = "baseline/"


@dataclass(frozen=True, eq=False)
class Run(Recorded):
    """What one world did: `run["qdot_cmd"]` is a column, `run.scorecard["tau.peak"].value` a figure.

    Attributes:
        baseline: What the baseline of its scenario did beside it; None: it has none.
    """

    baseline: "Run | None" = None

    @cached_property
    def scorecard(self) -> Scorecard:
        """The figures of the run, as far as it came."""
        return scorecard(self)

    @property
    def verdict(self) -> str:
        """What it comes to, in one sentence."""
        other = self.baseline
        return told(self, self.scorecard, None if other is None else (other, other.scorecard))

    def save(self, path: Path) -> None:
        """Write all columns and the facts about them to an npz file, whole or not at all."""
        beside = self.baseline.columns if self.baseline else {}
        columns = {**self.columns, **{f"{BASELINE}{name}": column for name, column in beside.items()}}
        _write(path, {**columns, "facts": np.array(json.dumps(self._facts()))})

    @classmethod
    def read(cls, path: Path) -> "Run":
        """Return the run in a file that `save` wrote.

        Raises:
            OSError: It cannot be opened.
            QuestionError: It is something else, or damaged.
        """
        (run, *others) = read_runs(path).values()
        if others:
            raise QuestionError(f"{path}: holds {1 + len(others)} runs, not one; rmrc.read_runs reads them")
        return run

    def _facts(self) -> dict[str, Any]:
        """Return what is known beside the columns, as strict JSON."""
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
        """Return the run of facts and columns of a file."""
        baseline = None
        if "baseline" in facts:
            its = {name.removeprefix(BASELINE): arrays[name] for name in arrays if name.startswith(BASELINE)}
            baseline = cls._of(facts["baseline"], its)
        columns = completed({name: arrays[name] for name in COLUMNS if name in arrays or name not in ADDED})
        for lacking in {"tau_gravity", "qdot_plain"} - columns.keys():
            columns[lacking] = np.full_like(columns["tau"], math.nan)
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
            _limits(facts, "rate_limit"), facts.get("damping_below", 0.0), baseline,
        )  # fmt: skip


def save_runs(path: Path, runs: Mapping[str, Run]) -> None:
    """Write several runs to an npz file, whole or not at all: `0/q` is column q of the first.

    Args:
        path: Of the file.
        runs: By label.
    """
    arrays = {
        f"{i}/{name}": column for i, run in enumerate(runs.values()) for name, column in run.columns.items()
    }
    facts = [{"label": label, **run._facts()} for label, run in runs.items()]
    _write(path, {**arrays, "facts": np.array(json.dumps(facts))})


def read_runs(path: Path) -> dict[str, Run]:
    """Return the runs in a file that `save` or `save_runs` wrote, by label; that of one alone is its name.

    Raises:
        OSError: It cannot be opened.
        QuestionError: It is something else, or damaged.
    """
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            facts = json.loads(str(file["facts"]))
            if isinstance(facts, dict):
                return {facts["name"]: Run._of(facts, file)}
            return {
                one["label"]: Run._of(
                    one, {name: file[f"{i}/{name}"] for name in COLUMNS if f"{i}/{name}" in file}
                )
                for i, one in enumerate(facts)
            }
    except (KeyError, ValueError, TypeError, EOFError, BadZipFile):
        raise QuestionError(f"{path}: does not hold the columns of a run, or is damaged") from None


def _write(path: Path, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def _finite(limits: tuple[float, ...]) -> list[float | None]:
    """Return limits as strict JSON has them: null for infinite."""
    return [limit if math.isfinite(limit) else None for limit in limits]


def _limits(facts: Mapping[str, Any], name: str) -> tuple[float, ...]:
    """Return limits of a file; those that it has from before they were kept are unknown."""
    return tuple(math.inf if limit is None else limit for limit in facts.get(name, ()))
