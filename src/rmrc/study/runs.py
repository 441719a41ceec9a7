"""The runs of a sweep: each is planned and prepared from its index alone, run, and becomes a row.

    index = (cell · samples + sample) · repeats + repeat

A cell is one combination of the values that vary, the last key changing fastest. Every cell has the same
samples and the same seeds, so that cells differ by the varied keys and not by chance.
"""

import json
import math
import re
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import files as files_of_model
from rmrc.results.columns import Divergence
from rmrc.results.expectations import check
from rmrc.results.run import versions
from rmrc.results.scorecard import Figure, Scorecard
from rmrc.scenario import Change, Draft, Scenario, changes_of, inline, schema_rows
from rmrc.scenario.sections import parse_key
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.dataset import Column, as_number
from rmrc.study.study import Study, ending
from rmrc.support.errors import Origin, ScenarioError

# Quasi-random numbers -----------------------------------------------------------------------------
#
# The Sobol sequence: points that fill a unit cube more evenly than random points, by index.

# Number of binary digits: nobody runs more than 2**32 samples.
_BITS = 32

# A primitive polynomial over {0, 1} as a binary number, and the first direction numbers, of each dimension
# [JoeKuo08, new-joe-kuo-6.21201]. The first dimension is van der Corput's sequence.
_DIRECTIONS = (
    (1, (1,) * _BITS), (3, (1,)), (7, (1, 3)), (11, (1, 3, 1)), (13, (1, 1, 1)), (19, (1, 1, 3, 3)),
    (25, (1, 3, 5, 13)), (37, (1, 1, 5, 5, 17)), (41, (1, 1, 5, 5, 5)), (47, (1, 1, 7, 11, 19)),
    (55, (1, 1, 5, 1, 1)), (59, (1, 1, 1, 3, 11)), (61, (1, 3, 5, 5, 31)), (67, (1, 3, 3, 9, 7, 49)),
    (91, (1, 1, 1, 15, 21, 21)), (97, (1, 3, 1, 13, 27, 49)), (103, (1, 1, 1, 15, 7, 5)),
    (109, (1, 3, 1, 15, 13, 25)), (115, (1, 1, 5, 5, 19, 61)), (131, (1, 3, 7, 11, 23, 15, 103)),
)  # fmt: skip


def _direction_numbers(polynomial: int, first: Sequence[int]) -> list[int]:
    """Return v_k = m_k / 2ᵏ of a dimension as binary fractions.

    m_k = 2 a₁ m_{k-1} ⊕ … ⊕ 2ˢ m_{k-s} ⊕ m_{k-s}, with the coefficients a of the polynomial [JoeKuo08].
    """
    degree, m = len(first), list(first)
    for k in range(degree, _BITS):
        m.append(m[k - degree])
        for i in range(1, degree + 1):
            m[k] ^= (m[k - i] << i) * (polynomial >> (degree - i) & 1)
    return [number << (_BITS - 1 - k) for k, number in enumerate(m)]


_V = np.array([_direction_numbers(*dimension) for dimension in _DIRECTIONS], np.uint32)  # (20, 32)


def sobol_point(index: int, dimensions: int, seed: int | None = None) -> NDArray[np.float64]:
    """Return one point of the Sobol sequence in the unit cube.

    x = ⊕ v_j over the digits j of Gray's code i ⊕ ⌊i/2⌋ that are 1 [JoeKuo08]. A seed shifts all points by
    one random point, digit by digit, which keeps every box as evenly filled and the origin out.

    Args:
        index: From 0 on, below 2³².
        dimensions: 1 to 20.
        seed: Seed of the digital shift; None: no shift.

    Returns:
        A point in [0, 1), (dimensions,).

    Example:
        >>> [sobol_point(i, 2).tolist() for i in range(4)]
        [[0.0, 0.0], [0.5, 0.5], [0.75, 0.25], [0.25, 0.75]]
    """
    gray = index ^ (index >> 1)
    digits = [j for j in range(_BITS) if gray >> j & 1]
    point = np.bitwise_xor.reduce(_V[:dimensions, digits], axis=1)
    if seed is not None:
        point ^= np.random.default_rng(seed).integers(2**_BITS, size=len(_V), dtype=np.uint32)[:dimensions]
    return np.asarray(point * 2.0**-_BITS)


# The runs of a sweep ------------------------------------------------------------------------------

# Weeks of one core, at some milliseconds each; and the largest number in a 64-bit column.
_MOST_RUNS, _MOST_SEED = 10**7, 2**63 - 1


@dataclass(frozen=True)
class Plan:
    """The runs of a sweep.

    Attributes:
        vary: Keys and their values; their combinations are the cells.
        draw: Drawn keys, with their bounds.
        sampler: `random` or `sobol`.
        samples: Samples of each cell.
        repeat: Runs per sample.
        seed: Seed of the samples, and of the first run's encoders.
        plant_seed: Seed of the first run's plant.
        origins: Origins of the values or bounds of each key, for messages.
    """

    vary: Mapping[str, tuple[object, ...]] = field(default_factory=dict)
    draw: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    sampler: str = "random"
    samples: int = 1
    repeat: int = 1
    seed: int = 0
    plant_seed: int = 0
    origins: Mapping[str, Origin] = field(default_factory=dict, compare=False)

    def __len__(self) -> int:
        """Return the number of runs."""
        return math.prod(map(len, self.vary.values())) * self.samples * self.repeat

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied and drawn keys, in the order of the columns."""
        return (*self.vary, *self.draw)

    def values(self, index: int) -> dict[str, object]:
        """Return the value of each key in one run.

        Args:
            index: Index of the run, from 0 on.

        Example:
            >>> plan = Plan(vary={"a": (1, 2), "b": ("x", "y", "z")}, repeat=2)
            >>> len(plan), plan.values(0), plan.values(11)
            (12, {'a': 1, 'b': 'x'}, {'a': 2, 'b': 'z'})
        """
        cell, sample = divmod(index // self.repeat, self.samples)
        values: dict[str, object] = dict.fromkeys(self.vary)
        for key, choices in reversed([*self.vary.items()]):
            cell, i = divmod(cell, len(choices))
            values[key] = choices[i]
        if self.sampler == "sobol":
            point = sobol_point(sample, len(self.draw), self.seed)
        else:
            point = np.random.default_rng((self.seed, sample)).random(len(self.draw))
        for u, (key, (low, high)) in zip(point.tolist(), self.draw.items(), strict=True):
            values[key] = min(low + u * (high - low), high)  # the rounding of a sum never exceeds the bound
        return values

    def run_seed(self, index: int) -> int:
        """Return the seed of one run's encoders: the same sample and repeat have the same in every cell."""
        return self.seed + index % (self.samples * self.repeat)

    def changes(self, index: int) -> tuple[Change, ...]:
        """Return the changes that make one run of the scenario, deeper keys later."""
        values, seed = self.values(index).items(), self.run_seed(index)
        varied = (Change(parse_key(key), value, self.origins.get(key)) for key, value in values)
        seeds = {"plant.seed": self.plant_seed + seed - self.seed, "arm.encoder.seed": seed}
        return (*sorted(varied, key=lambda change: len(change.key)), *changes_of(seeds))

    def label(self, index: int) -> str:
        """Return one run in words: `run 17 (control.feedback=5, control.inverse.method=damped)`."""
        varied = ", ".join(f"{key}={inline(value)}" for key, value in self.values(index).items())
        return f"run {index} ({varied})" if varied else f"run {index}"


def plan_of(scenario: Scenario) -> Plan:
    """Return the plan of a scenario's `sweep` section.

    Without its own seed, the sweep uses those of the arm's encoders and of the plant.

    Raises:
        ScenarioError: It has one run or too many, or seeds that fit no column.
    """
    sweep = scenario.sweep
    places = {key: f"sweep.vary.{key}" for key in sweep.vary} | {k: f"sweep.draw.{k}" for k in sweep.draw}
    origins = {key: Origin(scenario.locate(place), key=key) for key, place in places.items()}
    first_seeds = scenario.arm.encoder.seed, scenario.plant.seed
    seed, plant_seed = (first if sweep.seed is None else sweep.seed for first in first_seeds)
    samples = sweep.samples if sweep.draw else 1
    plan = Plan(sweep.vary, sweep.draw, sweep.sampler, samples, sweep.repeat, seed, plant_seed, origins)
    runs = math.prod(map(len, sweep.vary.values())) * samples * sweep.repeat
    last = _MOST_SEED + 1 - samples * sweep.repeat
    for is_wrong, text in (
        (runs > _MOST_RUNS, f"{_MOST_RUNS} runs or fewer, got {runs}; lower sweep.samples or .repeat"),
        (runs < 2, f"2 runs or more, got {runs}; use --vary control.inverse.method=damped,pseudoinverse"),
        (max(seed, plant_seed) > last, f"seeds up to {last}, got {seed}; lower sweep.seed"),
    ):
        if is_wrong:
            raise ScenarioError([scenario.problem("sweep", f"must have {text}")])
    return plan


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
        self._versions = json.dumps({k: v for k, v in versions().items() if k != "rerun-sdk"})

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
