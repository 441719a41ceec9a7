"""A short repr of any object, which fits on a screen."""

import dataclasses
from collections.abc import Mapping, Sequence, Set
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

# Most characters of a value within another, and of the whole, which is 24 lines of 80.
VALUE, WHOLE = 120, 1900
# Number of members of a collection that are shown.
MEMBERS = 6


def brief(cls: type[T]) -> type[T]:
    """Give a dataclass a repr that fits on a screen: arrays by their shapes, nested objects by their names.

    >>> import numpy as np
    >>> @brief
    ... @dataclasses.dataclass
    ... class Path:
    ...     name: str
    ...     points: np.ndarray
    >>> Path("line", np.zeros((500, 3)))
    Path(name='line', points=array of (500, 3))
    """
    cls.__repr__ = told  # type: ignore[method-assign]
    return cls


def told(one: Any) -> str:
    """Return the name of an object's class and its fields, each short."""
    names = [field.name for field in dataclasses.fields(one) if field.repr and field.name[0] != "_"]
    inner = ", ".join(f"{name}={_short(getattr(one, name))}" for name in names)
    return cut(f"{type(one).__name__}({inner})", WHOLE)


def _short(value: object) -> str:
    """Return a value in few characters."""
    if isinstance(value, np.ndarray):
        return repr(value.tolist()) if value.size <= MEMBERS else f"array of {value.shape}"
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}(…)"
    if isinstance(value, Mapping):
        shown = [f"{key!r}: {_short(value[key])}" for key in list(value)[:MEMBERS]]
        return cut(f"{{{_members(shown, len(value))}}}", VALUE)
    if isinstance(value, Sequence | Set) and not isinstance(value, str | bytes):
        shown = [_short(member) for member in list(value)[:MEMBERS]]
        return cut(f"({_members(shown, len(value))})", VALUE)
    return cut(repr(value), VALUE)


def _members(shown: Sequence[str], count: int) -> str:
    more = [f"… {count} in all"] if count > len(shown) else []
    return ", ".join([*shown, *more])


def cut(text: str, most: int = WHOLE) -> str:
    """Return a text on one line; if it is longer than a screen, without its middle."""
    text = " ".join(text.split())
    return text if len(text) <= most else f"{text[: most - 2]}…{text[-1]}"
