"""The controls of the page: menus, switches and sliders, from the declarations of choices and sections."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, TypeAlias

import numpy as np

from rmrc.results.run import Run
from rmrc.scenario import schema_rows
from rmrc.scenario.choices import (
    INVERSES,
    LIMITS,
    OBJECTIVES,
    PARAMETERS,
    PLANTS,
    POLICIES,
    PRIORITIES,
    SCHEDULES,
    Parameter,
    Scales,
)
from rmrc.simulation.prepare import Prepared
from rmrc.tuning.space import scales

Value: TypeAlias = str | bool | float
Values: TypeAlias = Mapping[str, Value]
"""The changed values by dotted key; all other keys keep the values as written."""

MENUS = {f"control.{one.key}": one for one in (INVERSES, SCHEDULES, POLICIES, LIMITS, OBJECTIVES, PRIORITIES)}
METHOD, SCHEDULE, POLICY, EXCESS, OBJECTIVE, PRIORITY = MENUS
PLANT, FEEDBACK, RATE, DELAY, LAG = (
    "plant.kind", "control.feedback", "control.limits.rate", "plant.delay", "plant.lag",
)  # fmt: skip
FEEDFORWARD, STOPS = "control.feedforward", "control.limits.position"
SECONDARY = "secondary"
# Sections with a folder of their own on the page.
HEADED = [["control", "inverse"], ["control", "limits"], ["control", "nullspace"]]
# Steps of a slider, about one per pixel. Ends at 1, 2 or 5 times a power of ten then have round steps.
STEPS = 200
# End of a slider, as a multiple of the written value or of the default; end of a delay or a lag [s].
BEYOND, LATEST = 5.0, 0.05


@dataclass(frozen=True)
class Control:
    """A key that the page can change.

    Attributes:
        key: Dotted.
        meaning: Its meaning in the schema.
        unit: Its unit in the schema.
        written: Its value in the scenario; the effective value if the scenario omits it.
        options: The entries of a menu; (): no menu.
        low: The least value of a slider.
        high: The largest value of a slider.
        step: The distance between two values of a slider.
    """

    key: str
    meaning: str
    unit: str
    written: Value
    options: tuple[str, ...] = ()
    low: float = 0.0
    high: float = 0.0
    step: float = 0.0

    @property
    def section(self) -> str:
        """Its folder: `control.inverse` for a key of that section, `control` for most others."""
        steps = self.key.split(".")
        return ".".join(steps[:2]) if steps[:2] in HEADED else steps[0]

    @property
    def label(self) -> str:
        """Its key within the folder."""
        return self.key.removeprefix(f"{self.section}.")

    @property
    def hint(self) -> str:
        """Its meaning, with the unit."""
        return f"{self.meaning} [{self.unit}]" if self.unit else self.meaning

    def parsed(self, value: Value) -> Value:
        """Return a value of the page in the form of a file: numbers lose the tail of binary fractions."""
        return value if self.options or isinstance(value, bool) else float(f"{float(value):.9g}")


def controls(prepared: Prepared, run: Run) -> tuple[Control, ...]:
    """Return the controls of a scenario, in the order of the page.

    Args:
        prepared: The scenario as written.
        run: Its run, of one tick at least; gives the sizes of its numbers.
    """
    return tuple(_controls(prepared, run))


def _controls(prepared: Prepared, run: Run) -> Iterator[Control]:
    seen, scenario = scales(prepared, run), prepared.scenario
    told = {row.key: (row.meaning, row.unit) for row in schema_rows()}

    def slider(key: str, high: float, written: float, least: float | None = 0.0) -> Control:
        high, step = _ends(max(high, 1.25 * written))
        low = min(step, written) if least is None else least
        return Control(key, *told[key], written, (), low, high, step)

    def switch(key: str) -> Control:
        return Control(key, *told[key], attrgetter(key)(scenario))

    for key, menu in MENUS.items():
        yield Control(key, *told[key], attrgetter(key)(scenario), menu.names)
        for one in menu.parameters:
            name = f"control.{one.key}"
            value = attrgetter(name)(scenario)
            if one.kind == "number" and value is not None and _first(one) == key:
                yield slider(name, _highest(one, value, seen), value, one.bounds.ge)
        if key == POLICY:
            yield slider(FEEDBACK, BEYOND * scenario.control.feedback or 50.0, scenario.control.feedback)
            yield switch(FEEDFORWARD)
        if key == EXCESS:
            limit = _rate_limit(run)
            yield slider(RATE, 2.0 * limit, limit, None)
            yield switch(STOPS)
    yield Control(PLANT, *told[PLANT], scenario.plant.kind, PLANTS.names)
    for key, late in ((DELAY, scenario.plant.delay), (LAG, scenario.plant.lag)):
        if not isinstance(late, tuple):
            yield slider(key, LATEST, late)


def _first(parameter: Parameter) -> str:
    """Return the menu that shows a number which several choices read."""
    order = (SCHEDULE, METHOD, *MENUS)
    return next(key for key in order if parameter in MENUS[key].parameters)


def _highest(parameter: Parameter, written: float, seen: Scales) -> float:
    """Return the largest useful value, which is not far from the written one."""
    if parameter.bounds.lt == 1:
        return min(BEYOND * written, 0.5)
    far = BEYOND * (written or parameter.default or 1.0)
    return far if parameter.range is None else min(parameter.range(seen)[1], far)


def _rate_limit(run: Run) -> float:
    """Return the largest limit of a joint's rate; without one, twice the largest rate of the run."""
    limits = [limit for limit in run.rate_limit if math.isfinite(limit)]
    return max(limits) if limits else 2.0 * float(np.abs(run["qdot_cmd"]).max()) or 1.0


def _ends(high: float) -> tuple[float, float]:
    """Return the end of a slider, at 1, 2 or 5 times a power of ten, and the step that divides it.

    >>> _ends(0.83), _ends(0.999)
    ((1.0, 0.005), (1.0, 0.005))
    """
    power = 10.0 ** math.floor(math.log10(high))
    end = next(part * power for part in (1.0, 2.0, 5.0, 10.0) if part * power >= high * (1.0 - 1e-9))
    return float(f"{end:.3g}"), float(f"{end / STEPS:.3g}")


def read_of(written: Values, values: Values) -> frozenset[str]:
    """Return the keys that a setting reads: the others have no effect, and the page hides them.

    Args:
        written: The value of each key in the scenario.
        values: The changed keys, with their values.
    """
    now: dict[str, Any] = {**written, **values}
    method = INVERSES[now[METHOD]]
    chosen = [method, *([SCHEDULES[now[SCHEDULE]]] if method.is_scheduled else [])]
    chosen += [POLICIES[now[POLICY]], LIMITS[now[EXCESS]], OBJECTIVES[now[OBJECTIVE]]]
    is_second = now[OBJECTIVE] == SECONDARY
    chosen += [PRIORITIES[now[PRIORITY]]] if is_second else []
    read = {f"control.{parameter.key}" for one in chosen for parameter in one.parameters}
    unread = {f"control.{one.key}" for one in PARAMETERS} - read
    if not method.is_scheduled:
        unread.add(SCHEDULE)
    if not is_second:
        unread.add(PRIORITY)
    if now[EXCESS] == "none":
        unread.add(RATE)
    return frozenset(written) - unread
