"""Some runs of a plan -> their rows: prepared, stepped as one batch on one thread, scored."""

import hashlib
import json
import threading
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from rmrc.arm import Arm
from rmrc.plants.batches import Batches
from rmrc.results import facts
from rmrc.results.columns import Divergence
from rmrc.results.scorecard import Scorecard, check
from rmrc.scenario import Change, Scenario
from rmrc.scenario.keys import split
from rmrc.simulation.footprint import Footprint, footprint
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.columns import typed
from rmrc.study.dataset import Column, as_parquet
from rmrc.study.plan import SEED, Plan
from rmrc.study.study import Study
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Problem

# Runs that are kept from their check until they are run: 30 MB. Small sweeps are then prepared once.
_KEPT = 1000

# What a run depends on, of its scenario.
_SECTIONS = sorted(Scenario.model_fields.keys() - {"name", "expect", "sweep"})
_SORTED = json.JSONEncoder(sort_keys=True)


class Checked(NamedTuple):
    """What is known of some runs before they start.

    Attributes:
        runs: How many they are.
        problems: The first run that has it and how many have it, by what is wrong.
        kinds: The first run of those that have the same figures, by what decides these.
        ticks: Of the references of all.
        longest: Of the longest of them.
        world: What a world takes of memory, at most.
    """

    runs: int
    problems: dict[Problem, tuple[int, int]]
    kinds: dict[object, int]
    ticks: int
    longest: int
    world: Footprint = Footprint(0, 0)


class Shards:
    """What runs batches of a plan; threads may share it.

    The law runs without the interpreter's lock. Preparation does not, and asks arms that are shared, so that
    one thread prepares at a time.
    """

    def __init__(self, base: Scenario, plan: Plan) -> None:
        """Keep what all runs share.

        Args:
            base: The scenario.
            plan: What the runs are.
        """
        self._study, self._plan = Study(base.draft), plan
        self._versions = json.dumps(facts.versions())
        self._prints: WeakKeyDictionary[Arm, str] = WeakKeyDictionary()
        self._lock = threading.Lock()
        self._checked: dict[int, Prepared] = {}
        self._batches = Batches()
        vary = {split(key)[0] for key in (*plan.keys, SEED)}
        self._same = {name: _as_json(base, name) for name in _SECTIONS if name not in vary}

    def prepare(self, index: int, *more: Change) -> Prepared:
        """Return one run, checked whole.

        Args:
            index: Of the run.
            more: Changes on top.

        Raises:
            ScenarioError: All that is wrong with it.
        """
        return self._study.prepare((*self._plan.changes(index), *more))

    def check(self, indices: range, _: object, stop: threading.Event) -> Checked | None:
        """Return what is known of some runs before they start, or None if that was interrupted.

        Args:
            indices: Of the runs.
            stop: Once it is set, this ends.
        """
        problems: dict[Problem, tuple[int, int]] = {}
        kinds: dict[object, int] = {}
        ticks = longest = 0
        world = Footprint(0, 0)
        with self._lock:
            for index in indices:
                if stop.is_set():
                    return None
                try:
                    one = self.prepare(index)
                except ScenarioError as error:
                    for problem in error.problems:
                        first, count = problems.get(problem, (index, 0))
                        problems[problem] = first, count + 1
                    continue
                kinds.setdefault(
                    (one.arm.joints, tuple(one.arm.is_slide.tolist()), one.scenario.task.axes), index
                )
                if len(self._checked) < _KEPT and not one.scenario.arm.stretch:  # stretched arms are large
                    self._checked[index] = one
                ticks += one.reference.ticks
                longest = max(longest, one.reference.ticks)
                world = world.or_more(footprint([one], keep_columns=False))
        return Checked(len(indices), problems, kinds, ticks, longest, world)

    def run(self, indices: range, columns: Sequence[Column], stop: threading.Event) -> bytes | None:
        """Return the rows of some runs as Parquet, or None if they were interrupted.

        Args:
            indices: Of the runs.
            columns: Of a row.
            stop: Once it is set, the runs end.
        """
        rows = self.rows(indices, stop)
        own = [column for column in columns if column.name in self._plan.keys]  # others have their type
        return as_parquet(columns, [typed(row, own) for row in rows]) if rows else None

    def rows(self, indices: range, stop: threading.Event) -> list[dict[str, Any]]:
        """Return the rows of some runs, none if they were interrupted.

        Args:
            indices: Of the runs.
            stop: Once it is set, the runs end.
        """
        with self._lock:
            prepared = [
                self._checked.pop(index) if index in self._checked else self.prepare(index)
                for index in indices
                if not stop.is_set()
            ]
            if stop.is_set():
                return []
            simulation = Simulation(prepared, keep_columns=False, batches=self._batches)
        ended = _ended(simulation, stop)
        if stop.is_set():
            return []
        return [self._row(*each) for each in zip(indices, prepared, ended, strict=True)]

    def _row(
        self, index: int, prepared: Prepared, ended: tuple[Scorecard, Divergence | None]
    ) -> dict[str, Any]:
        card, divergence = ended
        expect = prepared.scenario.expect
        values = {name: figure.value for name, figure in card.figures.items()}
        met = all(outcome.ok for outcome in check(card, expect)) if expect else None
        return {
            "index": index,
            **self._plan.values(index),
            "seed": self._plan.run_seed(index),
            "status": _status(card, divergence),
            "divergence": divergence and str(divergence),
            "met": met,
            # an undefined name is none
            **{name: None if value == "" else value for name, value in values.items()},
            "scenario": digest(prepared.scenario, self.fingerprint(prepared.arm), self._same),
            "versions": self._versions,
        }

    def fingerprint(self, arm: Arm) -> str:
        """Return what tells one compiled model from another, wherever its files lie."""
        if arm not in self._prints:
            found = hashlib.sha256()
            for name, data in _numbers(arm.model):
                found.update(f"{name} {len(data)} ".encode() + data)
            self._prints[arm] = found.hexdigest()
        return self._prints[arm]


def _numbers(model: Any) -> Iterator[tuple[str, bytes]]:
    """Iterate over all that a compiled model holds, but for the paths of its files and how long these are."""
    for name in dir(model):
        hidden = name.startswith("_") or "path" in name or name == "nbuffer"
        value = None if hidden else getattr(model, name)
        if isinstance(value, np.ndarray):
            yield name, value.tobytes()
        elif isinstance(value, int | float | bytes):
            yield name, repr(value).encode()
        elif type(value).__module__.startswith("mujoco."):  # options, statistics, looks
            yield from ((f"{name}.{inner}", data) for inner, data in _numbers(value))


def _ended(simulation: Simulation, stop: threading.Event) -> list[tuple[Scorecard, Divergence | None]]:
    """Return the figures of each world, and where it diverged."""
    simulation.step(stop=stop)
    simulation.release()
    return list(zip(simulation.scorecards(), simulation.divergences(), strict=True))


def _status(card: Scorecard, divergence: Divergence | None) -> str:
    if divergence:
        return "diverged"
    return "complete" if card["completed"].value == 1.0 else "unfinished"


def digest(one: Scenario, model: str, same: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return a hash of what a run depends on: of its scenario but for name, expectations and sweep.

    Args:
        one: The scenario.
        model: Stands for the model's file, which may lie anywhere.
        same: Sections as JSON that are known to be these.
    """
    texts = {name: same[name] if name in same else _as_json(one, name, model) for name in _SECTIONS}
    text = ", ".join(f'"{name}": {section}' for name, section in texts.items())
    return hashlib.sha256(f"{{{text}}}".encode()).hexdigest()[:16]


def _as_json(one: Scenario, name: str, model: str = "") -> str:
    """Return a section of a scenario as JSON, with something for the model's file."""
    data: dict[str, Any] = getattr(one, name).model_dump(mode="json")
    return _SORTED.encode(data | {"model": model} if name == "arm" else data)
