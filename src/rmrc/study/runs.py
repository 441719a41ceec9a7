"""The runs of a sweep in one process: checked before the first one starts, then run, each to a row."""

import hashlib
import json
import secrets
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from functools import cached_property
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple, TypeAlias

from rmrc.arm import files as files_of_model
from rmrc.results import facts
from rmrc.scenario import Draft, Scenario
from rmrc.simulation.prepare import Prepared
from rmrc.study.plan import Plan
from rmrc.study.rows import NOT_KEPT
from rmrc.study.study import Result, Study

# Variants that are kept from their check until their run: 60 MB. Small sweeps are then prepared once.
_MOST_KEPT = 2000
# Seconds between two looks at what may end the wait for rows.
_LOOK = 0.2
# The sections of a scenario on which no run depends.
_UNUSED = {"name", "expect", "look", "baseline", "sweep", "tune"}

Rows: TypeAlias = list[dict[str, Any]]


class Parcel(NamedTuple):
    """All inputs of the runs of a sweep, for machines without its files.

    Attributes:
        name: A name that no other parcel has.
        draft: Draft of the scenario.
        plan: The runs.
        files: Contents of the models, what these include, recorded motions and profiles.
        folders: Folders of packages.
    """

    name: str
    draft: Draft
    plan: Plan
    files: Mapping[Path, bytes]
    folders: Sequence[Path]

    @property
    def digest(self) -> str:
        """Hash of the names and the contents of the files."""
        digest = hashlib.sha256()
        for path, data in self.files.items():
            digest.update(f"{path.name} {len(data)} ".encode() + data)
        return digest.hexdigest()[:16]

    def unpack(self, root: Path) -> None:
        """Write the files below a folder, which is absolute."""
        for folder in (*self.folders, *(path.parent for path in self.files)):
            (root / folder.relative_to(folder.anchor)).mkdir(parents=True, exist_ok=True)
        for path, data in self.files.items():
            (root / path.relative_to(path.anchor)).write_bytes(data)


def pack(scenario: Scenario, plan: Plan) -> Parcel:
    """Return the parcel of a sweep; files that are missing are left out.

    Raises:
        OSError: A file cannot be read.
    """
    draft, packages = scenario.draft, dict(scenario.arm.packages)
    named = draft.files()
    needed = {file for path in named if path.is_file() for file in files_of_model(path, packages)}
    for folder in (path for path in named if path.is_dir() and path not in packages.values()):
        needed.update(path for path in folder.rglob("*") if path.is_file())
    folders = [path for path in named if path.is_dir()]
    return Parcel(
        secrets.token_hex(8), draft, plan, {path: path.read_bytes() for path in sorted(needed)}, folders
    )


class Runs:
    """The runs of a sweep in this process, which its threads share."""

    def __init__(self, parcel: Parcel, root: Path | None = None) -> None:
        """Read the scenario.

        Args:
            parcel: The inputs.
            root: Folder below which the files are; None: they are where they were.
        """
        self._plan, self._study = parcel.plan, Study(parcel.draft.moved(root) if root else parcel.draft)
        self._kept, self._lock, self._digest = dict[int, Prepared](), threading.Lock(), parcel.digest
        folders = {f"{path.parent}" for path in parcel.draft.files()}
        self._places = [*sorted(folders, key=len, reverse=True), *([f"{root}"] if root else [])]

    def check(self, index: int) -> Prepared:
        """Return a validated run, and keep it if there is room.

        Raises:
            ScenarioError: Lists its problems.
        """
        world = self._prepare(index)
        if len(self._kept) < _MOST_KEPT and not world.scenario.arm.stretch:  # stretched arms are large
            self._kept[index] = world
        return world

    def _prepare(self, index: int) -> Prepared:
        return self._study.prepare(self._plan.changes(index))

    def rows(self, indices: Sequence[int], stop: threading.Event) -> Rows:
        """Return the rows of some runs, made one after another on this thread; after a stop, of the finished.

        Args:
            indices: The runs.
            stop: Event that ends the work.
        """
        if stop.is_set():
            return []
        with self._lock:  # preparation holds the interpreter's lock, and shares arms
            worlds = [
                self._kept.pop(index) if index in self._kept else self._prepare(index) for index in indices
            ]
        results = self._study.watch(worlds, None, stop)
        ended = (pair for pair in zip(indices, results, strict=True) if pair[1].status != "interrupted")
        return [self._row(index, result) for index, result in ended]

    def _row(self, index: int, result: Result) -> dict[str, Any]:
        figures = {name: figure.value for name, figure in result.scorecard.figures.items()}
        return {
            "index": index,
            **self._plan.values(index),
            "seed": self._plan.run_seed(index),
            "status": result.status,
            "divergence": result.divergence and str(result.divergence),
            "met": all(outcome.ok for outcome in result.outcomes) if result.outcomes else None,
            # an undefined name is null
            **{
                name: None if value == "" else value
                for name, value in figures.items()
                if name not in NOT_KEPT
            },
            "scenario": self._hash(result.prepared.scenario),
            "versions": self._versions,
        }

    @cached_property
    def _versions(self) -> str:
        return json.dumps({name: text for name, text in facts.versions().items() if name != "rerun-sdk"})

    def _hash(self, scenario: Scenario) -> str:
        """Return a hash of the inputs of a run that does not depend on the places of its files."""
        text = scenario.model_dump_json(exclude=_UNUSED)
        for place in self._places:
            text = text.replace(place, "")
        return hashlib.sha256(f"{self._digest} {text}".encode()).hexdigest()[:16]


def finished(futures: Sequence["Future[Rows]"], is_over: Callable[[], bool]) -> Iterator[Rows]:
    """Iterate over results as they come; raises the error of a failed one.

    Args:
        futures: Of all.
        is_over: Called now and then; ends the iteration.
    """
    done, remaining = SimpleQueue["Future[Rows]"](), len(futures)
    for future in futures:
        future.add_done_callback(done.put)
    while remaining and not is_over():
        try:
            future = done.get(timeout=_LOOK)
        except Empty:
            continue
        remaining -= 1
        yield future.result()
