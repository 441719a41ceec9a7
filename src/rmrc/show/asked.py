"""The size that a user asks for a picture: how wide it is, and how large its letters are."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple


class Asked(NamedTuple):
    """What is asked of pictures.

    Attributes:
        width: Width of the picture [in]; None: its own.
        font: Size of the letters [pt]; None: its own.
    """

    width: float | None = None
    font: float | None = None


ASKED: ContextVar[Asked] = ContextVar("ASKED", default=Asked())  # noqa: B039 (frozen)


@contextmanager
def sized(width: float | None, font: float | None) -> Iterator[None]:
    """Have pictures that are drawn meanwhile so wide, with letters of such a size.

    Args:
        width: In inches; None: as wide as each is by itself.
        font: In points; None: as large as they are by themselves.
    """
    token = ASKED.set(Asked(width, font))
    try:
        yield
    finally:
        ASKED.reset(token)
