"""A short repr of any object, which fits on a screen."""

import dataclasses
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

# Most characters of a value within another, and of the whole, which is 24 lines of 80.
VALUE, WHOLE = 120, 1900


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

    def shown(self: Any) -> str:
        names = [field.name for field in dataclasses.fields(self) if field.repr and field.name[0] != "_"]
        inner = ", ".join(f"{name}={_short(getattr(self, name))}" for name in names)
        return cut(f"{type(self).__name__}({inner})", WHOLE)

    cls.__repr__ = shown  # type: ignore[method-assign]
    return cls


def _short(value: object) -> str:
    """Return a value in few characters."""
    if isinstance(value, np.ndarray) and value.size > 6:
        return f"array of {value.shape}"
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}(…)"
    return cut(repr(value), VALUE)


def cut(text: str, most: int = WHOLE) -> str:
    """Return a text on one line; if it is longer than a screen, without its middle."""
    text = " ".join(text.split())
    return text if len(text) <= most else f"{text[: most - 2]}…{text[-1]}"
