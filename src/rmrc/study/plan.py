"""The plan of a sweep: its runs, each identified by its index alone.

    index = (cell · samples + sample) · repeats + repeat

A cell is one combination of the values that vary, the last key changing fastest. Every cell has the same
samples and the same seeds, so that cells differ by the varied keys and not by chance.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from rmrc.scenario import Change, Scenario, inline
from rmrc.scenario.sections import parse_key
from rmrc.study.sobol import sobol_point
from rmrc.support.problems import Key, Origin

SEEDS = "plant.seed", "arm.encoder.seed"
_PLANT_SEED, _ENCODER_SEED = map(parse_key, SEEDS)

_TOLD = 20

Value = object  # in YAML: a number, a text, a switch, null, or a list or a mapping of these


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

    vary: tuple[tuple[str, tuple[Value, ...]], ...] = ()
    draw: tuple[tuple[str, float, float], ...] = ()
    sampler: str = "random"
    samples: int = 1
    repeat: int = 1
    seed: int = 0
    plant_seed: int = 0
    origins: Mapping[str, Origin] = field(default_factory=dict, compare=False)

    def __len__(self) -> int:
        """Return the number of runs, which fits into 63 bits where `rmrc.study.sweep.Sweep` took the plan."""
        return self.count

    @property
    def count(self) -> int:
        """Number of runs, of any size."""
        return math.prod(len(values) for _, values in self.vary) * self.samples * self.repeat

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied and drawn keys, in the order of the columns."""
        return (*(key for key, _ in self.vary), *(key for key, _, _ in self.draw))

    def values(self, index: int) -> dict[str, Value]:
        """Return the value of each key in one run.

        Args:
            index: Index of the run, from 0 on.

        Example:
            >>> plan = Plan(vary=(("a", (1, 2)), ("b", ("x", "y", "z"))), repeat=2)
            >>> len(plan), plan.values(0), plan.values(11)
            (12, {'a': 1, 'b': 'x'}, {'a': 2, 'b': 'z'})
        """
        cell, rest = divmod(index, self.samples * self.repeat)
        chosen: dict[str, Value] = {}
        for key, values in reversed(self.vary):
            cell, i = divmod(cell, len(values))
            chosen[key] = values[i]
        drawn = self._drawn(rest // self.repeat)
        return {key: chosen[key] for key, _ in self.vary} | drawn

    def _drawn(self, sample: int) -> dict[str, Value]:
        if not self.draw:
            return {}
        point = _point(self.sampler, sample, len(self.draw), self.seed)
        # the rounding of a sum may reach the upper bound, and never exceeds it
        return {
            key: min(low + u * (high - low), high)
            for u, (key, low, high) in zip(point, self.draw, strict=True)
        }

    def run_seed(self, index: int) -> int:
        """Return the seed of one run's encoders: the same sample and repeat have the same in every cell."""
        return self.seed + index % (self.samples * self.repeat)

    @cached_property
    def _steps(self) -> list[tuple[str, Key, Origin | None]]:
        """The keys, their steps and origins, deeper keys later."""
        return sorted(
            ((key, parse_key(key), self.origins.get(key)) for key in self.keys), key=lambda one: len(one[1])
        )

    def changes(self, index: int) -> tuple[Change, ...]:
        """Return the changes that make one run of the scenario, deeper keys later."""
        values = self.values(index)
        varied = [Change(steps, values[key], origin) for key, steps, origin in self._steps]
        seed = self.run_seed(index)
        plant_seed = self.plant_seed + seed - self.seed
        return (*varied, Change(_PLANT_SEED, plant_seed), Change(_ENCODER_SEED, seed))

    def label(self, index: int) -> str:
        """Return one run in words: `run 17 (control.feedback=5, control.inverse.method=damped)`."""
        varied = ", ".join(f"{key}={_short(value)}" for key, value in self.values(index).items())
        return f"run {index} ({varied})" if varied else f"run {index}"

    @property
    def most_told(self) -> int:
        """Number of problems to report of a sweep."""
        return _TOLD

    def named(self, indices: Sequence[int], count: int) -> list[str]:
        """Return the words for the runs with a common problem: their number, and the first."""
        return [f"{count} runs, the first " * (count > 1) + self.label(indices[0])]


@lru_cache(2000)  # used before a run and after it, and by each cell
def _point(sampler: str, sample: int, count: int, seed: int) -> tuple[float, ...]:
    if sampler == "sobol":
        return tuple(sobol_point(sample, count, seed).tolist())
    return tuple(np.random.default_rng((seed, sample)).random(count).tolist())


def _short(value: Value) -> str:
    return f"{value:.6g}" if isinstance(value, float) else inline(value)


def plan_of(scenario: Scenario) -> Plan:
    """Return the plan of a scenario's `sweep` section.

    Without its own seed, the sweep uses those of the arm's encoders and of the plant.
    """
    sweep = scenario.sweep
    places = {key: f"sweep.vary.{key}" for key in sweep.vary} | {
        key: f"sweep.draw.{key}" for key in sweep.draw
    }
    return Plan(
        tuple(sweep.vary.items()),
        tuple((key, low, high) for key, (low, high) in sweep.draw.items()),
        sweep.sampler,
        sweep.samples if sweep.draw else 1,
        sweep.repeat,
        scenario.arm.encoder.seed if sweep.seed is None else sweep.seed,
        scenario.plant.seed if sweep.seed is None else sweep.seed,
        {key: Origin(scenario.locate(place), key=key) for key, place in places.items()},
    )
