"""The choices of the law by their codes, made from their declarations: a choice that is added is in every test."""

from enum import IntEnum
from functools import cache

from rmrc.scenario.choices import (
    CHOICES,
    INVERSES,
    LIMITS,
    OBJECTIVES,
    PARAMETERS,
    POLICIES,
    PRIORITIES,
    SCHEDULES,
)

FIELDS = [one.field for one in (*CHOICES, *PARAMETERS)]


@cache
def field(name):
    """Return the field of a world's record that is called so, or that of the only choice or parameter that ends so."""
    found = [one for one in FIELDS if one.endswith(f"_{name}")]
    assert len(found) < 2, f"{name} may be any of {', '.join(found)}"
    return found[0] if found and name not in FIELDS else name


def codes(name, choices):
    """Return an enumeration of choices, by their names in capitals."""
    return IntEnum(name, [(one.upper(), choices.code(one)) for one in choices.names])


Method, Schedule, Objective = (
    codes("Method", INVERSES),
    codes("Schedule", SCHEDULES),
    codes("Objective", OBJECTIVES),
)
Priority, OnExcess, AtSingularity = (
    codes("Priority", PRIORITIES),
    codes("OnExcess", LIMITS),
    codes("AtSingularity", POLICIES),
)
