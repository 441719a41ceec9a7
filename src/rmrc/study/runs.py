"""The runs of a sweep in one process: each is prepared from its index, run, and becomes a row."""

import json
import re
import threading
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from rmrc.arm import files as files_of_model
from rmrc.results import facts
from rmrc.results.columns import Divergence
from rmrc.results.expectations import check
from rmrc.results.scorecard import Figure, Scorecard
from rmrc.scenario import Draft, Scenario, schema_rows
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.dataset import Column, as_number
from rmrc.study.plan import Plan
from rmrc.study.study import Study, ending

# Metrics that differ from one execution to the next, which rows must not.
NOT_KEPT = frozenset({"wall_time", "speed"})

Rows: TypeAlias = list[dict[str, Any]]


class Parcel(NamedTuple):
    """All inputs of the runs of a sweep, for machines without its files.

    Attributes:
        draft: Draft of the scenario.
        plan: The runs.
        files: Contents of the models, what these include, recorded motions and profiles.
        folders: Folders of packages.
    """

    draft: Draft
    plan: Plan
    files: Mapping[Path, bytes]
    folders: Sequence[Path]

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
    folders = [path for path in named if path.is_dir()]
    for folder in folders:
        if folder not in packages.values():
            needed.update(path for path in folder.rglob("*") if path.is_file())
    return Parcel(draft, plan, {path: path.read_bytes() for path in sorted(needed)}, folders)


class Runs:
    """The runs of a sweep in this process, which its threads share."""

    def __init__(self, parcel: Parcel, root: Path | None = None) -> None:
        """Read the scenario.

        Args:
            parcel: The inputs.
            root: Folder below which the files are; None: they are where they were.
        """
        self._plan, self._study = parcel.plan, Study(parcel.draft.moved(root) if root else parcel.draft)
        self._lock = threading.Lock()
        self._versions = json.dumps({k: v for k, v in facts.versions().items() if k != "rerun-sdk"})

    def prepare(self, index: int) -> Prepared:
        """Return a validated run.

        Raises:
            ScenarioError: Lists its problems.
        """
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
            worlds = [self.prepare(index) for index in indices]
        simulation = Simulation(worlds, keep_columns=False)
        simulation.step(None, stop)
        ends = zip(indices, worlds, simulation.scorecards(), simulation.divergences(), strict=True)
        rows = [self._row(*end) for end in ends]
        return [row for row in rows if row["status"] != "unfinished" or not stop.is_set()]

    def _row(self, index: int, world: Prepared, card: Scorecard, end: Divergence | None) -> dict[str, Any]:
        outcomes = check(card, world.scenario.expect)
        return {
            "index": index,
            **self._plan.values(index),
            "seed": self._plan.run_seed(index),
            "status": ending(card, end),
            "divergence": end and str(end),
            "met": all(outcome.ok for outcome in outcomes) if outcomes else None,
            # an undefined name is null
            **{name: None if figure.value == "" else figure.value for name, figure in _figures(card)},
            "versions": self._versions,
        }


def _figures(card: Scorecard) -> list[tuple[str, Figure]]:
    return [(name, figure) for name, figure in card.items() if name not in NOT_KEPT]


def columns_of(plan: Plan, worlds: Iterable[Prepared]) -> list[Column]:
    """Return the columns of a sweep.

    Args:
        plan: Its runs.
        worlds: One run of each kind; metrics depend only on the joints and axes.
    """
    known, keys = {row.key: row for row in schema_rows()}, list[Column]()
    for key in plan.keys:
        general = re.sub(r"\[\d+\]", "[]", key)
        row = known.get(general) or known.get(general.removesuffix("[]"))
        about = (row.unit, row.meaning) if row else ("", "a key of the scenario")
        keys.append(Column(key, _kind(plan.vary.get(key, (0.0,))), *about))
    units, figures = dict[str, dict[str, None]](), dict[str, Figure]()
    for world in worlds:
        (blank,) = Simulation([world], keep_columns=False).scorecards()
        for name, figure in _figures(blank):
            figures.setdefault(name, figure)
            units.setdefault(name, {}).update(dict.fromkeys(figure.unit.split(" or ")))
    return [
        Column("index", "count", "1", "number of the run in the sweep, from 0"),
        *keys,
        Column("seed", "count", "1", "arm.encoder.seed of the run; plant.seed counts in step"),
        Column("status", "text", "", "end of the run: complete, unfinished (time limit reached) or diverged"),
        Column("divergence", "text", "", "time and cause of divergence; null if none"),
        Column("met", "switch", "", "whether all expectations were met; null without expectations"),
        *(
            Column(name, "text" if figure.value == "" else "number", " or ".join(units[name]), figure.meaning)
            for name, figure in figures.items()
        ),
        Column("versions", "text", "", "of everything that determines the bits, as JSON"),
    ]


def _kind(values: Sequence[object]) -> str:
    """Return the type of a column with these values, some possibly missing."""
    known = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in known):
        return "switch"
    return "number" if all(as_number(value) is not None for value in known) else "text"
