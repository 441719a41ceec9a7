"""Arguments by keyword that a function does not have: the nearest, or the key of a scenario that is meant."""

import re
from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any, ParamSpec, TypeVar

from rmrc.scenario.messages import ALIASES, below, fields
from rmrc.scenario.sections import Sections
from rmrc.support.errors import did_you_mean

P = ParamSpec("P")
R = TypeVar("R")


def hinted(*more: Callable[..., Any]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator: the function's TypeError about an unknown keyword names what to write instead.

    Args:
        more: Functions that get the keywords which are left over.
    """

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def called(*args: P.args, **named: P.kwargs) -> R:
            try:
                return function(*args, **named)
            except TypeError as error:
                match = re.search(r"unexpected keyword argument '(\w+)'", str(error))
                if match is None or match[1] not in named:
                    raise
                known = [name for each in (function, *more) for name in signature(each).parameters]
                text = _instead(match[1], named[match[1]], known)
            name = function.__qualname__.removesuffix(".__init__")
            raise TypeError(f'{name} has no argument "{match[1]}"{text}')

        return called

    return decorated


def _instead(name: str, value: object, known: list[str]) -> str:
    """Return what to write instead of an argument, as the end of a message."""
    section = next(iter(below(name, fields(Sections))), None)
    if section is None:
        return did_you_mean(name, known) or f"; its arguments are {', '.join(known)}"
    key = f"{section}.{name}"
    value = ALIASES.get(value, value) if isinstance(value, str) else value
    if "control" in known and key.startswith("control."):
        head, *inner = key.split(".")
        for step in reversed(inner):
            value = {step: value}
        return f"; write {head}={value}"
    return f"; write scenario=rmrc.load(...).set({ {key: value} })"
