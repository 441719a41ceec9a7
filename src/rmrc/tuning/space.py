"""What a search may change: the choices and numbers of a control law, their bounds, and `--only`."""

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.scenario import Change, Scenario, changes_of
from rmrc.scenario.choices import INVERSES, LIMITS, POLICIES, SCHEDULES, Parameter, Scales, Status
from rmrc.simulation.prepare import Prepared
from rmrc.support.errors import Origin, Problem, ScenarioError
from rmrc.tuning.robot import Only, lengths_of

METHOD, SCHEDULE, AT_SINGULARITY, ON_EXCESS = (
    f"control.{choices.key}" for choices in (INVERSES, SCHEDULES, POLICIES, LIMITS)
)
FEEDBACK = "control.feedback"
WORDS = (METHOD, SCHEDULE, AT_SINGULARITY, ON_EXCESS)


def _searched(parameters: Iterable[Parameter]) -> dict[str, Parameter]:
    """Return by their keys the parameters that a search changes."""
    return {f"control.{parameter.key}": parameter for parameter in parameters if parameter.range is not None}


_OF_INVERSES = _searched((*SCHEDULES.parameters, *INVERSES.parameters))
_SEARCHED = _OF_INVERSES | _searched(POLICIES.parameters)
NUMBERS = tuple(dict.fromkeys((*_OF_INVERSES, FEEDBACK, *_SEARCHED)))

Point: TypeAlias = NDArray[np.float64]


class Structure(NamedTuple):
    """The discrete choices of a setting.

    Attributes:
        method: `control.inverse.method`.
        schedule: `control.inverse.damping.schedule`; "" for the methods that have none.
        at_singularity: `control.at_singularity`.
        on_excess: `control.limits.on_excess`; "" for that of the scenario.
    """

    method: str
    schedule: str
    at_singularity: str
    on_excess: str = ""

    @property
    def inverse(self) -> tuple[str, str]:
        """The part that inverts."""
        return self.method, self.schedule

    @property
    def keys(self) -> tuple[str, ...]:
        """The numbers that it reads: those of the inverse, the feedback, those of the policy."""
        schedule = SCHEDULES[self.schedule].parameters if self.schedule else ()
        inverse = _searched((*INVERSES[self.method].parameters, *schedule))
        return (*inverse, FEEDBACK, *_searched(POLICIES[self.at_singularity].parameters))

    @property
    def words(self) -> dict[str, str]:
        """Key and value of each part that there is."""
        parts = dict(zip(WORDS, self, strict=True))
        return {key: value for key, value in parts.items() if value}


def all_structures(policies: Iterable[str]) -> Iterator[Structure]:
    """Iterate over all structures, those of the first policy first.

    Args:
        policies: Values of `control.at_singularity`.
    """
    for policy in policies:
        for method in INVERSES.options:
            for schedule in SCHEDULES.names if method.is_scheduled else ("",):
                yield Structure(method.name, schedule, policy)
    for schedule in SCHEDULES.names:
        yield Structure("damped", schedule, "damp", "optimal")


class Setting(NamedTuple):
    """A structure and its numbers.

    Attributes:
        structure: Its discrete choices.
        numbers: A value for each of the structure's keys.
        is_written: Whether it is the scenario's own, without changes.
    """

    structure: Structure
    numbers: tuple[float, ...]
    is_written: bool = False

    @property
    def by_key(self) -> dict[str, float]:
        """Its numbers, by key."""
        return dict(zip(self.structure.keys, self.numbers, strict=True))

    @property
    def feedback(self) -> float:
        """Its feedback [1/s]."""
        return self.by_key[FEEDBACK]

    @property
    def values(self) -> dict[str, str | float]:
        """Value of each key."""
        return {**self.structure.words, **self.by_key}

    @property
    def changes(self) -> tuple[Change, ...]:
        """Changes of the scenario that make it."""
        return () if self.is_written else changes_of(self.values)


def own_setting(scenario: Scenario) -> Setting:
    """Return the setting of a scenario as it is written."""
    inverse = scenario.control.inverse
    schedule = inverse.damping.schedule if INVERSES[inverse.method].is_scheduled else ""
    structure = Structure(inverse.method, schedule, scenario.control.at_singularity)
    return Setting(structure, tuple(float(attrgetter(key)(scenario)) for key in structure.keys), True)


def scales(nominal: Prepared, run: Run) -> Scales:
    """Return the scales of numbers from a run.

    Args:
        nominal: The scenario of the run.
        run: The run.
    """
    task, reference = nominal.task, nominal.reference
    wanted: Point = task.turned(reference.twist, reference.pose)[:, task.rows] * task.row_scale
    sigma = _largest(run["sigma"]) or 1.0
    # Below speed/σ₁ no joint rates can follow. A bound above the limits, or far above the rates as written,
    # bounds nothing.
    slowest = float(np.linalg.norm(wanted, axis=1).max()) / sigma or 0.01
    allowed = float(np.linalg.norm(nominal.law.rate_limit / lengths_of(nominal)))
    reached = _largest(np.linalg.norm(run["qdot"] / lengths_of(nominal), axis=1))
    return Scales(
        sigma=sigma,
        manipulability=_largest(run["manipulability"]) or 1.0,
        start=_largest(run["sigma"][:1, nominal.task.rank - 1]) or sigma,
        slowest=slowest,
        fastest=max(2.0 * slowest, min(1.5 * reached, allowed)),
    )


def _largest(values: Point) -> float:
    """Return the largest finite value, 0 where there is none."""
    return float(values[np.isfinite(values)].max(initial=0.0))


def bounds(nominal: Prepared, run: Run, edge: float) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest value of each number to try.

    Args:
        nominal: The scenario.
        run: Its own run.
        edge: The largest feedback that its loop may tolerate with its margin [1/s].
    """
    # An error that falls to 1/e in 5 periods is slow beside the servos, which take one or two. With more than
    # 1 s there is hardly any feedback.
    largest = min(0.2 / nominal.scenario.control.period, edge)
    seen = scales(nominal, run)
    ranges = {key: parameter.range(seen) for key, parameter in _SEARCHED.items() if parameter.range}
    return {FEEDBACK: (min(1.0, 0.1 * largest), largest), **ranges}


def meets_limits(run: Run) -> bool:
    """Return whether a limit acts in a run: only then the treatment of excessive rates matters."""
    limits = Status.RATE_LIMITED | Status.ACCELERATION_LIMITED | Status.POSITION_LIMITED
    return bool(np.any(run["status"].astype(np.int64) & int(limits)))


def rounded(value: float) -> float:
    """Return a number rounded to the digits that are tried and printed."""
    return float(f"{value:.3g}")


@dataclass(frozen=True)
class Space:
    """Settings as points of unit cubes, one for each structure; the numbers are on log scales.

    Attributes:
        structures: The possible structures.
        limits: Bounds of each number.
        only: Values to which a key is restricted.
    """

    structures: tuple[Structure, ...]
    limits: dict[str, tuple[float, float]]
    only: Mapping[str, tuple[Any, ...]]

    def at(self, structure: Structure, point: Point) -> Setting:
        """Return the setting at a point of a structure's cube, to 3 digits.

        Args:
            structure: Its structure.
            point: One number per key; outside of [0, 1] it is the nearest within.
        """
        numbers = zip(structure.keys, np.clip(point, 0.0, 1.0).tolist(), strict=True)
        return Setting(structure, tuple(self._value(key, share) for key, share in numbers))

    def _value(self, key: str, share: float) -> float:
        if key in self.only:
            values = self.only[key]
            return float(values[min(int(share * len(values)), len(values) - 1)])
        low, high = self.limits[key]
        return rounded(low * (high / low) ** share)

    def point(self, setting: Setting) -> Point:
        """Return the position of a setting in its cube; outside of the bounds, at the nearest."""
        return np.array([self._share(key, value) for key, value in setting.by_key.items()])

    def _share(self, key: str, value: float) -> float:
        if key in self.only:
            values = self.only[key]
            return (values.index(value) + 0.5) / len(values) if value in values else 0.5
        low, high = self.limits[key]
        return min(max(math.log(value / low) / math.log(high / low), 0.0), 1.0) if value > 0.0 else 0.0

    def grid(self, structure: Structure, dampings: int, feedbacks: int, middle: float) -> list[Setting]:
        """Return a structure's settings on a grid over its feedback and all its other numbers together.

        Args:
            structure: Its structure.
            dampings: Number of values of the other numbers.
            feedbacks: Number of feedbacks.
            middle: The middle feedback [1/s].
        """
        low, high = self.limits[FEEDBACK]
        share = math.log(min(max(middle, low), high) / low) / math.log(high / low)
        rows, columns = ((np.arange(count) + 0.5) / count for count in (dampings, feedbacks))
        pairs = [
            (row, gain) for row in rows for gain in np.interp(columns, (0.0, 0.5, 1.0), (0.0, share, 1.0))
        ]
        is_gain = np.array([key == FEEDBACK for key in structure.keys])
        return list(dict.fromkeys(self.at(structure, np.where(is_gain, gain, row)) for row, gain in pairs))

    def beside(self, setting: Setting, step: float, random: np.random.Generator) -> Setting:
        """Return a neighbor of a setting; half of them differ in one number, or in the policy, alone.

        Args:
            setting: The setting.
            step: Typical distance in the cube.
            random: Random numbers.
        """
        structure, shares = (
            setting.structure,
            dict(zip(setting.structure.keys, self.point(setting), strict=True)),
        )
        alone = random.integers(-len(shares), len(shares) + 1)  # negative: all of them
        if alone == len(shares) or structure not in self.structures:
            alike = [it for it in self.structures if it.inverse == structure.inverse] or self.structures
            structure = alike[random.integers(len(alike))]
        point = np.array([shares.get(key, random.random()) for key in structure.keys])
        moved = np.full(len(point), True) if alone < 0 else np.arange(len(point)) == alone
        return self.at(structure, point + step * random.standard_normal(len(point)) * moved)

    def between(self, setting: Setting, other: Setting, random: np.random.Generator) -> Setting:
        """Return a setting between two with the same inverse, with any policy."""
        ends = [dict(zip(it.structure.keys, self.point(it), strict=True)) for it in (setting, other)]
        alike = [it for it in self.structures if it.inverse == setting.structure.inverse]
        structure, share = alike[random.integers(len(alike))], random.random()
        pairs = [[end.get(key, 0.5) for end in ends] for key in structure.keys]
        return self.at(structure, np.array([(1.0 - share) * a + share * b for a, b in pairs]))

    def allows(self, setting: Setting) -> bool:
        """Return whether a setting keeps to the restrictions."""
        numbers = setting.by_key.items()
        is_within = all(value in self.only.get(key, (value,)) for key, value in numbers)
        return setting.structure in self.structures and is_within


def read_only(only: Only) -> dict[str, tuple[Any, ...]]:
    """Return the values that keys are restricted to, which may be no values of their keys.

    Args:
        only: The values of some keys.

    Raises:
        ScenarioError: Lists the texts and keys that restrict nothing.
    """
    restricted, problems, keys = dict[str, tuple[Any, ...]](), list[Problem](), (*WORDS, *NUMBERS)
    for key, values in only.items() if isinstance(only, Mapping) else map(_split, only):
        wrong = f"must be KEY=V1,V2,..., for example {METHOD}=damped,filtered" if "" in values else ""
        wrong = wrong if key in keys else f"is not a tunable key; choose from {', '.join(keys)}"
        if wrong:
            problems.append(Problem((), wrong, Origin(f"--only {key}")))
        restricted[key] = (*restricted.get(key, ()), *values)
    if problems:
        raise ScenarioError(problems)
    return restricted


def _split(text: str) -> tuple[str, list[Any]]:
    key, _, values = text.partition("=")
    each: list[Any] = [value.strip() for value in values.split(",")]
    if key.strip() in NUMBERS:
        with suppress(ValueError):  # preparing the scenario names what is no number
            each = [float(value) for value in each]
    return key.strip(), each
