"""The size of pictures that a user requests: their width, and their font size."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple


class Asked(NamedTuple):
    """The requested size of pictures.

    Attributes:
        width: Width of the picture [in]; None: its own.
        font: Font size [pt]; None: its own.
    """

    width: float | None = None
    font: float | None = None


ASKED: ContextVar[Asked] = ContextVar("ASKED", default=Asked())  # noqa: B039 (frozen)


@contextmanager
def sized(width: float | None, font: float | None) -> Iterator[None]:
    """Draw pictures meanwhile with this width and font size.

    Args:
        width: Width [in]; None: the own width of each picture.
        font: Font size [pt]; None: the own sizes of each picture.
    """
    token = ASKED.set(Asked(width, font))
    try:
        yield
    finally:
        ASKED.reset(token)
