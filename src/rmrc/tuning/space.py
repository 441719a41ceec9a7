"""What can be chosen in a control law, and between which bounds."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.scenario import Change, Scenario, changes_of
from rmrc.scenario.choices import AtSingularity, Method, Schedule
from rmrc.simulation.prepare import Prepared

METHOD, SCHEDULE = "control.inverse.method", "control.inverse.damping.schedule"
AT_SINGULARITY, FEEDBACK = "control.at_singularity", "control.feedback"
_MAXIMUM, _BELOW = "control.inverse.damping.maximum", "control.inverse.damping.below"
_W_BELOW, _ERROR_GAIN = "control.inverse.damping.manipulability_below", "control.inverse.damping.error_gain"
_RATE_BOUND, _CUTOFF, _GAMMA = (f"control.inverse.{name}" for name in ("rate_bound", "cutoff", "gamma"))
_STOP = "control.stop.sigma"

WORDS: Mapping[str, tuple[str, ...]] = {
    key: tuple(one.name.lower() for one in kind)
    for key, kind in ((METHOD, Method), (SCHEDULE, Schedule), (AT_SINGULARITY, AtSingularity))
}
NUMBERS = (_MAXIMUM, _BELOW, _W_BELOW, _ERROR_GAIN, _RATE_BOUND, _CUTOFF, _GAMMA, FEEDBACK, _STOP)

# `gains` and `damping` of `rmrc.law.inverses` read these. The tolerance of `pseudoinverse` is left alone:
# `truncated` is the same with a threshold that is searched.
_OF_METHOD = {
    "filtered": (_MAXIMUM, _BELOW),
    "truncated": (_CUTOFF,),
    "selectively_damped": (_RATE_BOUND,),
    "jparse": (_GAMMA,),
}
_OF_SCHEDULE = {
    "constant": (_MAXIMUM,),
    "manipulability": (_MAXIMUM, _W_BELOW),
    "smallest_singular_value": (_MAXIMUM, _BELOW),
    "error": (_ERROR_GAIN,),
    "rate_bound": (_RATE_BOUND,),
}

Values = tuple[float, ...]


class Structure(NamedTuple):
    """What is not a number in a setting.

    Attributes:
        method: `control.inverse.method`.
        schedule: `control.inverse.damping.schedule`; "" for the methods that have none.
        at_singularity: `control.at_singularity`.
    """

    method: str
    schedule: str
    at_singularity: str

    @property
    def inverse(self) -> tuple[str, str]:
        """The part that inverts."""
        return self.method, self.schedule

    @property
    def keys(self) -> tuple[str, ...]:
        """The numbers that it reads."""
        own = _OF_SCHEDULE[self.schedule] if self.schedule else _OF_METHOD.get(self.method, ())
        return (*own, FEEDBACK, *((_STOP,) if self.at_singularity == "stop" else ()))

    @property
    def words(self) -> dict[str, str]:
        """Key and value of each part that there is."""
        parts = {METHOD: self.method, SCHEDULE: self.schedule, AT_SINGULARITY: self.at_singularity}
        return {key: value for key, value in parts.items() if value}

    @property
    def unread(self) -> tuple[str, ...]:
        """The keys of `WORDS` and `NUMBERS` that it does not read."""
        return tuple(key for key in (*WORDS, *NUMBERS) if key not in self.words and key not in self.keys)


def all_structures() -> Iterator[Structure]:
    """Iterate over all structures; what does the least beside inverting comes first."""
    for policy in WORDS[AT_SINGULARITY]:
        for method in WORDS[METHOD]:
            for schedule in WORDS[SCHEDULE] if method == "damped" else ("",):
                yield Structure(method, schedule, policy)


class Setting(NamedTuple):
    """A structure and its numbers.

    Attributes:
        structure: What is no number.
        numbers: A value for each of the structure's keys.
        is_written: Whether it is the scenario's own, which nothing overrides.
    """

    structure: Structure
    numbers: Values
    is_written: bool = False

    @property
    def values(self) -> dict[str, str | float]:
        """Value of each key."""
        return {**self.structure.words, **dict(zip(self.structure.keys, self.numbers, strict=True))}

    @property
    def changes(self) -> tuple[Change, ...]:
        """What makes it of the scenario."""
        return () if self.is_written else changes_of(self.values)


def own_setting(scenario: Scenario) -> Setting:
    """Return the setting of a scenario as it is written."""
    inverse = scenario.control.inverse
    schedule = inverse.damping.schedule if inverse.method == "damped" else ""
    structure = Structure(inverse.method, schedule, scenario.control.at_singularity)
    return Setting(structure, tuple(float(attrgetter(key)(scenario)) for key in structure.keys), True)


@dataclass(frozen=True)
class Seen:
    """What the scenario's own run tells about the scales of its numbers.

    Attributes:
        sigma: Largest singular value.
        manipulability: Largest w.
        speed: Largest norm of the scaled task velocity that is wanted.
        start: Smallest singular value at the start.
    """

    sigma: float
    manipulability: float
    speed: float
    start: float


def seen(nominal: Prepared, run: Run) -> Seen:
    """Return the scales of a run.

    Args:
        nominal: What was run.
        run: As far as it came.
    """
    wanted: NDArray[np.float64] = nominal.reference.twist[:, nominal.task.rows] * nominal.task.row_scale
    speed = float(np.linalg.norm(wanted, axis=1).max())
    sigma = _largest(run["sigma"])
    start = _largest(run["sigma"][:1, nominal.task.rank - 1])
    return Seen(sigma or 1.0, _largest(run["manipulability"]) or 1.0, speed, start or sigma or 1.0)


def _largest(values: NDArray[np.float64]) -> float:
    """Return the largest finite value, 0 where there is none."""
    return float(values[np.isfinite(values)].max(initial=0.0))


def bounds(nominal: Prepared, scales: Seen) -> dict[str, tuple[float, float]]:
    """Return the least and the largest value of each number that is worth trying.

    Args:
        nominal: The scenario.
        scales: Of its own run.
    """
    sigma, period = scales.sigma, nominal.scenario.control.period
    # λ = σ₁/2 takes a fifth of even the best direction's gain, as 1/(1 + λ²/σ²) says; σ₁/1000 lets rates grow
    # 500-fold.
    spectrum = (1e-3 * sigma, 0.5 * sigma)
    # Below speed/σ₁ no joint rates can follow; 300 times that bounds no drive's rates, and what the limits
    # allow is enough.
    slowest = scales.speed / sigma or 0.01
    length = np.where(nominal.arm.is_slide, nominal.task.length, 1.0)
    allowed = float(np.linalg.norm(nominal.law.rate_limit / length))
    fastest = max(2.0 * slowest, min(300.0 * slowest, allowed))
    return {
        _MAXIMUM: spectrum,
        # Damping that begins at σ₁ never ends.
        _BELOW: (5e-3 * sigma, sigma),
        _W_BELOW: (1e-3 * scales.manipulability, scales.manipulability),
        # λ = σ₁/10 at a task error from 1 mm to 1 (m over the length, or rad).
        _ERROR_GAIN: (0.1 * sigma, 100.0 * sigma),
        _RATE_BOUND: (slowest, fastest),
        _CUTOFF: spectrum,
        _GAMMA: (1e-3, 0.5),
        # An error that falls to 1/e in 5 periods is slow beside the servos, which take one or two; one that
        # takes more than 1 s is hardly fed back.
        FEEDBACK: (min(1.0, 0.02 / period), 0.2 / period),
        # An arm that is held where it starts, or soon after, does nothing wrong and nothing right.
        _STOP: (min(1e-3 * sigma, 0.1 * scales.start), 0.5 * scales.start),
    }  # fmt: skip


@dataclass(frozen=True)
class Space:
    """Settings as points of unit cubes, one for each structure; the numbers are on log scales.

    Attributes:
        structures: That can be chosen.
        limits: Bounds of each number.
        only: Values that a key is restricted to.
        own: The scenario's numbers, by key.
    """

    structures: tuple[Structure, ...]
    limits: Mapping[str, tuple[float, float]]
    only: Mapping[str, Values]
    own: Mapping[str, float]

    def at(self, structure: Structure, point: NDArray[np.float64]) -> Setting:
        """Return the setting at a point of a structure's cube, to 3 digits.

        Args:
            structure: Which cube.
            point: In [0, 1], one a key.
        """
        numbers = zip(structure.keys, point, strict=True)
        return Setting(structure, tuple(self._value(key, float(u)) for key, u in numbers))

    def _value(self, key: str, u: float) -> float:
        if key in self.only:
            values = self.only[key]
            return values[min(int(u * len(values)), len(values) - 1)]
        low, high = self.limits[key]
        return float(f"{low * (high / low) ** u:.3g}")

    def point(self, setting: Setting) -> NDArray[np.float64]:
        """Return where a setting lies in its cube; outside of the bounds, at the nearest."""
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
        """Say whether a setting keeps to what is restricted."""
        numbers = zip(setting.structure.keys, setting.numbers, strict=True)
        return setting.structure in self.structures and all(
            value in self.only.get(key, (value,)) for key, value in numbers
        )
