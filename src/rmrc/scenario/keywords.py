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


def hinted(function: Callable[P, R], more: Callable[..., Any] | None = None) -> Callable[P, R]:
    """Return a function whose TypeError about an unknown keyword says what to write instead.

    Args:
        function: The function.
        more: Function that gets the keywords that it does not name itself.
    """

    @wraps(function)
    def called(*args: P.args, **named: P.kwargs) -> R:
        try:
            return function(*args, **named)
        except TypeError as error:
            match = re.search(r"unexpected keyword argument '(\w+)'", str(error))
            if match is None or match[1] not in named:
                raise
        known = [name for each in (function, more or function) for name in signature(each).parameters]
        name, text = (
            function.__qualname__.removesuffix(".__init__"),
            _instead(match[1], named[match[1]], known),
        )
        raise TypeError(f'{name} has no argument "{match[1]}"{text}')

    return called


def _instead(name: str, value: object, known: list[str]) -> str:
    """Return what to write instead of an argument, as the end of a message."""
    section = next(iter(below(name, fields(Sections))), None)
    if section is None:
        return did_you_mean(name, known) or f"; its arguments are {', '.join(known)}"
    value = ALIASES.get(value, value) if isinstance(value, str) else value
    if "control" not in known or not f"{section}.".startswith("control."):
        return f"; write scenario=rmrc.load(...).set({ {f'{section}.{name}': value} })"
    for step in (name, *reversed(section.split(".")[1:])):
        value = {step: value}
    return f"; write control={value}"
