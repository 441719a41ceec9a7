"""The plan of a sweep: its runs, each identified by its index alone.

    index = (cell · samples + sample) · repeats + repeat

A cell is one combination of the values that vary, the last key changing fastest. Every cell has the same
samples and the same seeds, so that cells differ by the varied keys and not by chance.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rmrc.scenario import Change, Scenario, changes_of, inline
from rmrc.scenario.sections import parse_key
from rmrc.study.sobol import sobol_point
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Origin

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
