"""A run: its columns, the facts about it, its metrics, and its files."""

import json
import os
import platform
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from rmrc.results.columns import COLUMNS, Recorded, no_ticks
from rmrc.results.scorecard import Scorecard, scorecard, verdict
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.files import reading, write_text, written_whole
from rmrc.support.text import brief, cut

# Prefix of the columns of a baseline in the file of its run.
BASELINE = "baseline/"


@brief
@dataclass(frozen=True, eq=False)
class Run(Recorded):
    """The run of one world: `run["qdot_cmd"]` is a column, `run.scorecard["tau.peak"].value` a metric.

    Attributes:
        name: Name of the scenario.
        joints: Names, n of them.
        is_slide: Which joints slide, (n,).
        axes: Task axes that count.
        length: Characteristic length L of the task [m].
        period: Control period [s].
        columns: All columns by name, time first: (T,) or (T, width).
        planned: Ticks of the path; a run has fewer if it was cut short, and more if it was slowed.
        divergence: Where it diverged, or None.
        wall_time: Seconds that the stepping of this world took.
        rate_limit: Rate limit of each joint [rad/s or m/s], infinite without one; none: not known.
        torque_limit: Torque limit of each joint [N·m or N], infinite without one; none: no joint has one.
        baseline: The run of its scenario's baseline; None: it has none.
    """

    baseline: "Run | None" = None

    @cached_property
    def scorecard(self) -> Scorecard:
        """The metrics of the run, up to its last tick."""
        return scorecard(self)

    @property
    def verdict(self) -> str:
        """The result in one sentence."""
        return verdict(self, self.scorecard, self.baseline)

    def plot(self, *arguments: Any, **options: Any) -> Any:
        """Draw it, and return matplotlib's figure, which a notebook shows; arguments as of `rmrc.plot`."""
        return import_module("rmrc").plot(self, *arguments, **options)

    # Its file -------------------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all columns and the facts about them to an npz file, atomically."""
        facts, arrays = self._facts(), dict(self.columns)
        if self.baseline is not None:
            facts["baseline"] = self.baseline._facts()
            arrays |= {f"{BASELINE}{name}": column for name, column in self.baseline.columns.items()}
        _write(Path(path), arrays, facts)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> "Run":
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
        """Return the facts as strict JSON; infinite numbers are texts."""
        facts: dict[str, Any] = json.loads(_RUN.dump_json(self, exclude={"columns", "baseline"}))
        return facts | {"units": {name: column.unit for name, column in COLUMNS.items()}}


_RUN = TypeAdapter(Run)


class Runs(dict[str, Run]):
    """Runs by label, as `compare` returns them."""

    def __repr__(self) -> str:
        """Return the labels."""
        labels = ", ".join(f"{label!r}: {len(run)} ticks" for label, run in self.items())
        return cut(f"Runs({{{labels}}})")

    def __missing__(self, label: str) -> Run:
        """Name the run whose label is nearest."""
        raise KeyError(f'no run "{label}"{did_you_mean(label, self) or f"; there are {list(self)}"}')


def save_runs(path: Path, runs: Mapping[str, Run]) -> None:
    """Write several runs to an npz file, atomically: `0/q` is column q of the first.

    Args:
        path: Path of the file.
        runs: By label.
    """
    arrays = dict[str, NDArray[np.generic]]()
    for i, run in enumerate(runs.values()):
        arrays |= {f"{i}/{name}": column for name, column in run.columns.items()}
    _write(path, arrays, [{"label": label, **run._facts()} for label, run in runs.items()])


def read_runs(path: str | os.PathLike[str]) -> Runs:
    """Return the runs in a file of `save` or `save_runs`, by label; the label of a single run is its name.

    Raises:
        OSError: It cannot be opened.
        QuestionError: It is another kind of file, or damaged.
    """
    path = Path(path)
    with reading(path, "the columns of a run"), path.open("rb") as opened, np.load(opened) as file:
        facts = json.loads(str(file["facts"]))
        if isinstance(facts, dict):
            return Runs({facts["name"]: _read(facts, file)})
        return Runs((part["label"], _read(part, file, f"{i}/")) for i, part in enumerate(facts))


def _read(facts: Mapping[str, Any], file: Mapping[str, Any], prefix: str = "") -> Run:
    """Return the run from the facts and arrays of a file.

    Raises:
        KeyError: A column is missing.
        ValueError: The facts or columns are none that a run has saved.
    """
    columns = {name: file[f"{prefix}{name}"] for name in COLUMNS}
    baseline = _read(facts["baseline"], file, BASELINE) if "baseline" in facts else None
    run = _RUN.validate_python({**facts, "columns": columns, "baseline": baseline})
    shapes = no_ticks(len(run.joints), columns["sigma"].shape[-1], columns["qpos"].shape[-1])
    for name, column in columns.items():
        if column.shape != (len(run), *shapes[name].shape[1:]) or column.dtype.kind not in "fi":
            raise ValueError(f"column {name}")
    return run


def _write(path: Path, arrays: Mapping[str, NDArray[np.generic]], facts: Any) -> None:
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays, facts=np.array(json.dumps(facts)))  # type: ignore[arg-type]


# The libraries that determine the bits and the appearance of a result.
LIBRARIES = ("rmrc", "mujoco", "numba", "numpy", "ruckig", "rerun-sdk")


@cache
def versions() -> dict[str, str]:
    """Return the versions of the software that determines the bits of a result."""
    versions = {"python": platform.python_version()}
    for library in LIBRARIES:
        with suppress(metadata.PackageNotFoundError):  # a worker of a sweep needs no rerun
            versions[library] = metadata.version(library)
    return versions


def save_facts(path: Path, facts: Mapping[str, Any]) -> None:
    """Write facts atomically.

    Args:
        path: Path of the file; its folder is created if missing.
        facts: Strict JSON.
    """
    text = json.dumps(facts, indent=2, ensure_ascii=False, allow_nan=False)
    write_text(path, f"{text}\n")
