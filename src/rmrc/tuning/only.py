"""`--only KEY=V1,V2,...`: restrictions of a search."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

from rmrc.support.errors import ScenarioError, did_you_mean
from rmrc.support.problems import Origin, Problem
from rmrc.tuning.space import NUMBERS, WORDS, Values

EXAMPLE = "control.inverse.method=damped,filtered"


class _RefusedError(Exception):
    """A text that restricts nothing: its name, and why."""


Only: TypeAlias = Sequence[str] | Mapping[str, Iterable[str | float]]
"""Values by key, or a text `KEY=V1,V2,...` for each key."""


def read_only(only: Only) -> tuple[dict[str, tuple[str, ...]], dict[str, Values]]:
    """Return the words and the numbers that keys are restricted to.

    Args:
        only: The values of some keys.

    Raises:
        ScenarioError: Lists their problems.
    """
    words, numbers, problems = dict[str, tuple[str, ...]](), dict[str, Values](), list[Problem]()
    for one in only.items() if isinstance(only, Mapping) else only:
        try:
            key, values = _split(one) if isinstance(one, str) else one
            if key not in (*WORDS, *NUMBERS):
                known = ", ".join((*WORDS, *NUMBERS))
                raise _RefusedError(key, f"is not a tunable key; choose from {known}")
            if key in words or key in numbers:
                raise _RefusedError(key, "is given twice")
            if key in WORDS:
                words[key] = tuple(_word(key, value) for value in dict.fromkeys(values))
            else:
                numbers[key] = tuple(_number(key, value) for value in dict.fromkeys(values))
        except _RefusedError as error:
            name, why = error.args
            problems.append(Problem((), why, Origin(f"--only {name}")))
    if problems:
        raise ScenarioError(problems)
    return words, numbers


def _split(text: str) -> tuple[str, Sequence[str]]:
    key, _, rest = (part.strip() for part in text.partition("="))
    values = [part.strip() for part in rest.split(",")]
    if not key or not all(values):
        raise _RefusedError(text, f"must be KEY=V1,V2,..., for example {EXAMPLE}")
    return key, values


def _word(key: str, value: str | float) -> str:
    if value not in WORDS[key]:
        near = did_you_mean(str(value), WORDS[key])
        raise _RefusedError(key, f"must be among {', '.join(WORDS[key])}, got {value}{near}")
    return str(value)


def _number(key: str, value: str | float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise _RefusedError(key, f"must be numbers, got {value}")
    return number
