"""The tunable keys of a control law, and their bounds."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.scenario import Change, Scenario, changes_of
from rmrc.scenario.choices import INVERSES, LIMITS, POLICIES, SCHEDULES, Choice, Parameter, Scales, Status
from rmrc.simulation.prepare import Prepared
from rmrc.textbook.stability import edge_gain
from rmrc.tuning.robot import Robot

METHOD, SCHEDULE, AT_SINGULARITY, ON_EXCESS = (
    f"control.{one.key}" for one in (INVERSES, SCHEDULES, POLICIES, LIMITS)
)
FEEDBACK = "control.feedback"

WORDS: Mapping[str, tuple[str, ...]] = {
    METHOD: INVERSES.names, SCHEDULE: SCHEDULES.names, AT_SINGULARITY: POLICIES.names,
    ON_EXCESS: LIMITS.names,
}  # fmt: skip


def _searched(parameters: Iterable[Parameter]) -> dict[str, Parameter]:
    """Return by their keys the parameters that a search changes."""
    return {f"control.{one.key}": one for one in parameters if one.range is not None}


_SEARCHED = _searched((*SCHEDULES.parameters, *INVERSES.parameters, *POLICIES.parameters))
_OF_INVERSES = tuple(_searched((*SCHEDULES.parameters, *INVERSES.parameters)))
NUMBERS = (*_OF_INVERSES, FEEDBACK, *(key for key in _SEARCHED if key not in _OF_INVERSES))

Values = tuple[float, ...]


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
        """The numbers that it reads."""
        return _keys(self)

    @property
    def words(self) -> dict[str, str]:
        """Key and value of each part that there is."""
        parts = dict(zip((METHOD, SCHEDULE, AT_SINGULARITY, ON_EXCESS), self, strict=True))
        return {key: value for key, value in parts.items() if value}

    @property
    def unread(self) -> tuple[str, ...]:
        """The keys of `WORDS` and `NUMBERS` that it does not read; rates are limited whatever it is."""
        read = (*self.words, *self.keys, ON_EXCESS)
        return tuple(key for key in (*WORDS, *NUMBERS) if key not in read)


@cache  # a search asks for those of each setting again and again
def _keys(structure: Structure) -> tuple[str, ...]:
    """Return the numbers that a structure reads."""
    inverse: list[Choice] = [
        INVERSES[structure.method],
        *([SCHEDULES[structure.schedule]] if structure.schedule else ()),
    ]
    read = _searched(parameter for one in inverse for parameter in one.parameters)
    return tuple(dict.fromkeys((*read, FEEDBACK, *_searched(POLICIES[structure.at_singularity].parameters))))


TRIED = tuple(one.name for one in POLICIES.options if one.is_tried)


def all_structures(policies: Iterable[str] = TRIED) -> Iterator[Structure]:
    """Iterate over all structures, the simplest policies first.

    Args:
        policies: At a singularity, in the order of their declaration.
    """
    for policy in policies:
        for method in WORDS[METHOD]:
            for schedule in WORDS[SCHEDULE] if INVERSES[method].is_scheduled else ("",):
                yield Structure(method, schedule, policy)
    for schedule in WORDS[SCHEDULE]:
        yield Structure("damped", schedule, "damp", "optimal")


def meets_limits(run: Run) -> bool:
    """Return whether a limit acts in a run: only then the treatment of excessive rates matters."""
    limits = Status.RATE_LIMITED | Status.ACCELERATION_LIMITED | Status.POSITION_LIMITED
    return bool(np.any(run["status"].astype(np.int64) & int(limits)))


class Setting(NamedTuple):
    """A structure and its numbers.

    Attributes:
        structure: Its discrete choices.
        numbers: A value for each of the structure's keys.
        is_written: Whether it is the scenario's own, without changes.
    """

    structure: Structure
    numbers: Values
    is_written: bool = False

    @property
    def feedback(self) -> float:
        """Its feedback [1/s]."""
        return self.numbers[self.structure.keys.index(FEEDBACK)]

    @property
    def values(self) -> dict[str, str | float]:
        """Value of each key."""
        return {**self.structure.words, **dict(zip(self.structure.keys, self.numbers, strict=True))}

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
        run: The run so far.
    """
    task, reference = nominal.task, nominal.reference
    wanted: NDArray[np.float64] = task.turned(reference.twist, reference.pose)[:, task.rows] * task.row_scale
    sigma = _largest(run["sigma"]) or 1.0
    # Below speed/σ₁ no joint rates can follow; 300 times that bounds no actuator's rates, and the limits are
    # sufficient.
    slowest = float(np.linalg.norm(wanted, axis=1).max()) / sigma or 0.01
    lengths = np.where(nominal.arm.is_slide, nominal.task.length, 1.0)
    allowed = float(np.linalg.norm(nominal.law.rate_limit / lengths))
    return Scales(
        sigma=sigma,
        manipulability=_largest(run["manipulability"]) or 1.0,
        start=_largest(run["sigma"][:1, nominal.task.rank - 1]) or sigma,
        slowest=slowest,
        fastest=max(2.0 * slowest, min(300.0 * slowest, allowed)),
    )


def _largest(values: NDArray[np.float64]) -> float:
    """Return the largest finite value, 0 where there is none."""
    return float(values[np.isfinite(values)].max(initial=0.0))


def bounds(nominal: Prepared, run: Run, robot: Robot, margin: float) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest value of each number to try.

    Args:
        nominal: The scenario.
        run: Its own run so far.
        robot: Robot whose loop must tolerate the feedback.
        margin: Factor on the feedback.
    """
    seen, period = scales(nominal, run), nominal.scenario.control.period
    # An error that falls to 1/e in 5 periods is slow beside the servos, which take one or two. With more than
    # 1 s there is hardly any feedback. Beyond the stability limit of its loop, an ideal plant is unstable.
    edge = edge_gain(period, *robot.slowest(nominal.scenario)) / margin
    largest = min(0.2 / period, edge)
    limits = {FEEDBACK: (min(1.0, 0.1 * largest), largest)}
    return limits | {key: one.range(seen) for key, one in _SEARCHED.items() if one.range is not None}


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
        own: The scenario's numbers, by key.
    """

    structures: tuple[Structure, ...]
    limits: Mapping[str, tuple[float, float]]
    only: Mapping[str, Values]
    own: Mapping[str, float]

    def at(self, structure: Structure, point: NDArray[np.float64]) -> Setting:
        """Return the setting at a point of a structure's cube, to 3 digits.

        Args:
            structure: Its structure.
            point: In [0, 1], one per key.
        """
        numbers = zip(structure.keys, point, strict=True)
        return Setting(structure, tuple(self._value(key, float(u)) for key, u in numbers))

    def _value(self, key: str, u: float) -> float:
        if key in self.only:
            values = self.only[key]
            return values[min(int(u * len(values)), len(values) - 1)]
        low, high = self.limits[key]
        return rounded(low * (high / low) ** u)

    def point(self, setting: Setting) -> NDArray[np.float64]:
        """Return the position of a setting in its cube; outside of the bounds, at the nearest."""
        return np.array(
            [self._share(*pair) for pair in zip(setting.structure.keys, setting.numbers, strict=True)]
        )

    def _share(self, key: str, value: float) -> float:
        if key in self.only:
            values = self.only[key]
            return (values.index(value) + 0.5) / len(values) if value in values else 0.5
        low, high = self.limits[key]
        return min(max(math.log(value / low) / math.log(high / low), 0.0), 1.0) if value > 0.0 else 0.0

    def usual(self, structure: Structure) -> Setting:
        """Return a structure with the scenario's own numbers, which are the defaults where it has none."""
        numbers = [
            self.own[key] if self.own[key] in self.only.get(key, (self.own[key],)) else self.only[key][0]
            for key in structure.keys
        ]
        return Setting(structure, tuple(numbers))

    def allows(self, setting: Setting) -> bool:
        """Return whether a setting keeps to the restrictions."""
        if setting.structure not in self.structures:
            return False
        numbers = dict(zip(setting.structure.keys, setting.numbers, strict=True)) if self.only else {}
        return all(value in self.only.get(key, (value,)) for key, value in numbers.items())
