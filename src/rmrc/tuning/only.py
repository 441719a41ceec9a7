"""`--only KEY=V1,V2,...`: what a search is restricted to."""

import math
from collections.abc import Sequence

from rmrc.support.errors import ScenarioError, did_you_mean
from rmrc.support.problems import Origin, Problem
from rmrc.tuning.space import NUMBERS, WORDS, Values

EXAMPLE = "control.inverse.method=damped,filtered"


class _RefusedError(Exception):
    """A text that restricts nothing: its name, and why."""


def read_only(texts: Sequence[str]) -> tuple[dict[str, tuple[str, ...]], dict[str, Values]]:
    """Return the words and the numbers that keys are restricted to.

    Args:
        texts: `KEY=V1,V2,...`, one a key.

    Raises:
        ScenarioError: All that is wrong with them.
    """
    words, numbers, problems = dict[str, tuple[str, ...]](), dict[str, Values](), list[Problem]()
    for text in texts:
        key, _, rest = (part.strip() for part in text.partition("="))
        values = tuple(dict.fromkeys(part.strip() for part in rest.split(",")))
        try:
            if not key or not all(values):
                raise _RefusedError(text, f"must be KEY=V1,V2,..., for example {EXAMPLE}")
            if key not in (*WORDS, *NUMBERS):
                known = ", ".join((*WORDS, *NUMBERS))
                raise _RefusedError(key, f"is nothing that is chosen; take one of {known}")
            if key in words or key in numbers:
                raise _RefusedError(key, "is given twice")
            if key in WORDS:
                words[key] = tuple(_word(key, value) for value in values)
            else:
                numbers[key] = tuple(_number(key, value) for value in values)
        except _RefusedError as error:
            name, why = error.args
            problems.append(Problem((), why, Origin(f"--only {name}")))
    if problems:
        raise ScenarioError(problems)
    return words, numbers


def _word(key: str, value: str) -> str:
    if value not in WORDS[key]:
        raise _RefusedError(
            key, f"must be of {', '.join(WORDS[key])}, got {value}{did_you_mean(value, WORDS[key])}"
        )
    return value


def _number(key: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise _RefusedError(key, f"must be numbers, got {value}")
    return number
