"""The controls of the page: keys of a scenario, their values, and what each value does to the law.

The page knows no key. Python prepares the scenario with each value of a control, and keeps what differs in
the record of the world: its words, and its methods. Keys that act together form a group, which has one
such difference for each combination of their values. Values that the scenario or its arm cannot have are
left out.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.export.image import begun
from rmrc.export.objects import name_of
from rmrc.scenario import schema_rows
from rmrc.scenario.choices import (
    INVERSES,
    LIMITS,
    OBJECTIVES,
    PARAMETERS,
    POLICIES,
    PRIORITIES,
    SCHEDULES,
    SLOW_LONGEST,
    STOP_CONDITION,
)
from rmrc.simulation.prepare import Cache, Prepared, prepare
from rmrc.simulation.reference import Spline
from rmrc.support.errors import ScenarioError

# A key, and values to try.
Trial: TypeAlias = tuple[str, Iterable[Any]]

MENUS = INVERSES, SCHEDULES, POLICIES, OBJECTIVES, PRIORITIES
# Numbers that matter to few, or decide how long a run may last.
LEFT_OUT = {SLOW_LONGEST, STOP_CONDITION, *(each for each in PARAMETERS if "push" in each.key)}
# Preferred numbers within a decade, for numbers that act alone, and for pairs.
FINE, COARSE = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 7.5, 8.0), (1.0, 2.0, 5.0)
# Delays and lags [ms].
TIMES = (*range(11), *range(12, 31, 2), *range(35, 101, 5))
SPEED, SPEEDS = "target.speed", (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0)
# Powers of the speed in the limits of a path.
POWERS = {"velocity": 1, "acceleration": 2, "jerk": 3}


class Control(NamedTuple):
    """A control of the page.

    Attributes:
        key: Key of the scenario, dotted.
        values: As a scenario has them; that of the scenario is among them.
        start: Number of the value of the scenario.
        unit: Unit of numbers; "" for none.
        meaning: What it is.
        reads: Keys of menus, each with those of its names for which the law reads the key; none: always.
    """

    key: str
    values: Sequence[Any]
    start: int
    unit: str = ""
    meaning: str = ""
    reads: Sequence[tuple[str, Sequence[str]]] = ()


class Controls:
    """The controls of a scenario.

    Attributes:
        controls: The controls, in the order of the page.
        groups: Controls that act together, by their numbers, and their effects: by the numbers of their
            values, with commas between them, the difference from the scenario as it is.
        paths: Each speed along the path, the limits that give it, and the scenario with them.
    """

    def __init__(self, prepared: Prepared, wanted: Mapping[str, Any]) -> None:
        """Try all values.

        Args:
            prepared: The scenario as the page runs it, with all numbers that its arm gives.
            wanted: Values that the controls must have, by their keys.
        """
        self._prepared, self._cache, self._wanted = prepared, Cache(prepared.arm), wanted
        self._tried = cache(self._try)
        self._rows, base = {row.key: row for row in schema_rows()}, written(prepared)
        self.controls, self.groups = list[Control](), list[tuple[list[int], dict[str, Any]]]()
        for trials in _trials(prepared):
            group = [control for trial in trials if len((control := self._control(*trial)).values) > 1]
            first = len(self.controls)
            self.controls += group
            self.groups.append(([*range(first, len(self.controls))], self._effects(base, group)))
        self.paths = list(self._paths())
        speeds = [speed for speed, _, _ in self.paths]
        if len(speeds) > 1:
            meaning = "speed along the path: scales target.limits"
            self.controls.append(Control(SPEED, speeds, speeds.index(1.0), "×", meaning))

    def _paths(self) -> Iterator[tuple[float, dict[str, float], Prepared]]:
        has_rate = any(isinstance(piece, Spline) for piece in self._prepared.reference.pieces)
        limits = self._prepared.scenario.target.limits
        for speed in (1.0,) if has_rate else SPEEDS:  # a recorded motion has its own
            changes = {
                f"target.limits.{name}": getattr(limits, name) * speed ** POWERS[name.rpartition("_")[2]]
                for name in type(limits).model_fields
                if speed != 1.0
            }
            if (faster := self._tried(*changes.items())) is not None:
                yield speed, changes, faster

    def _try(self, *changes: tuple[str, Any]) -> Prepared | None:
        """Return the scenario with other values, or None if it cannot have them."""
        if not changes:
            return self._prepared
        try:
            return prepare(self._prepared.scenario.set(dict(changes)), self._cache)
        except ScenarioError:
            return None

    def _control(self, key: str, values: Iterable[Any]) -> Control:
        """Return the control of a key, with those values that it can have."""
        value, row, wanted = attrgetter(key)(self._prepared.scenario), self._rows[key], self._wanted.get(key)
        able = [each for each in dict.fromkeys((*values, wanted)) if each not in (value, None)]
        able = [each for each in able if self._tried((key, each)) is not None]
        if isinstance(value, str):
            able = [each for each in values if each in (*able, value)]
        else:  # a number; None, or numbers of all joints, come first
            able = sorted([*able, value]) if isinstance(value, float) else [value, *able]
        turns, _, slides = row.unit.partition(" or ")
        is_slide = self._prepared.arm.is_slide
        unit = (
            row.unit if is_slide.any() != is_slide.all() else slides if slides and is_slide.all() else turns
        )
        unit = "" if unit == "1" or unit.startswith("as ") else unit
        return Control(key, able, able.index(value), unit, row.meaning, _reads(key))

    def _effects(self, base: "Written", group: Sequence[Control]) -> dict[str, Any]:
        """Return the effect of each combination of values of a group."""
        effects = {}
        for numbers in itertools.product(*(range(len(control.values)) for control in group)):
            chosen = zip(group, numbers, strict=True)
            changes = [(each.key, each.values[number]) for each, number in chosen if number != each.start]
            if (changed := self._tried(*changes)) is not None:
                effects[",".join(map(str, numbers))] = difference(base, written(changed))
        return effects


class Written(NamedTuple):
    """What a scenario writes into the record of a world: its words, and the names of its methods."""

    words: NDArray[np.uint64]
    methods: Mapping[str, str]


def written(prepared: Prepared) -> Written:
    """Return what the law and the hardware of a scenario write."""
    records, methods = begun(prepared)
    return Written(records.view(np.uint64), {field: name_of(each) for field, each in methods.items()})


def difference(base: Written, other: Written) -> dict[str, Any]:
    """Return what makes another of a base: words by their bits, in hexadecimal, and methods; "" for none."""
    words: dict[str, list[int]] = {}
    for index in np.flatnonzero(base.words != other.words).tolist():
        words.setdefault(f"{other.words[index]:x}", []).append(index)
    methods = {**dict.fromkeys(base.methods, ""), **other.methods}
    changed = {field: name for field, name in methods.items() if name != base.methods.get(field, "")}
    return {"words": words, "methods": changed}


def _trials(prepared: Prepared) -> Iterator[list[Trial]]:
    """Yield groups of keys with values to try."""
    control, limits = prepared.scenario.control, prepared.scenario.control.limits
    for menus in ((INVERSES, SCHEDULES), (POLICIES,), (OBJECTIVES, PRIORITIES)):
        yield [(f"control.{menu.key}", menu.names) for menu in menus]
        for each in PARAMETERS:
            is_read = any(each in menu.parameters for menu in menus)
            if is_read and not each.is_each and each not in LEFT_OUT:
                yield [(f"control.{each.key}", numbers(attrgetter(each.key)(control)))]
        if INVERSES in menus:
            yield [("control.feedback", (0.0, *numbers(control.feedback)))]
    yield [(f"control.{LIMITS.key}", LIMITS.names)]
    fastest = prepared.law.rate_limit[np.isfinite(prepared.law.rate_limit)]
    yield [("control.limits.rate", numbers(limits.rate, float(fastest.min(initial=math.tau))))]
    yield [
        ("control.limits.acceleration", numbers(limits.acceleration, 10.0, COARSE)),
        ("control.limits.jerk", numbers(limits.jerk, 100.0, COARSE)),
    ]
    for name in ("delay", "lag"):
        yield [(f"plant.{name}", [float(f"{time}e-3") for time in TIMES])]


def numbers(value: Any, usual: float = 1.0, steps: Sequence[float] = FINE) -> list[float]:
    """Return preferred numbers, a decade up and down from a value, or from a usual one if it is no number.

    >>> numbers(3.0, steps=COARSE)
    [0.5, 1.0, 2.0, 5.0, 10.0, 20.0]
    """
    middle = value if isinstance(value, float) and value > 0.0 else usual
    decade = math.floor(math.log10(middle))
    grid = [float(f"{step}e{power}") for power in range(decade - 1, decade + 2) for step in steps]
    return [each for each in grid if 0.1 <= each / middle <= 10.0]


def _reads(key: str) -> list[tuple[str, list[str]]]:
    """Return menus with names for which the law reads a key, of a parameter or of another menu."""
    key = key.removeprefix("control.")
    readers = [
        (menu.key, [each.name for each in menu.options if key in [read.key for read in each.parameters]])
        for menu in MENUS
    ]
    if key == SCHEDULES.key:
        readers = [(INVERSES.key, [each.name for each in INVERSES.options if each.is_scheduled])]
    if key == PRIORITIES.key:
        readers = [(OBJECTIVES.key, ["secondary"])]
    return [(f"control.{menu}", names) for menu, names in readers if names]
