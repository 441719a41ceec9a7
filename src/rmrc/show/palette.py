"""Colors, 0xRRGGBBAA, one for each thing, and the size of pictures: their width, and their font size.

They suit a dark and a light background, and all color vision. Each has a contrast of at least 3 against
white and against the viewer's dark background. Any two that share a panel differ by a ΔE of at least 20 (CIE
1976), also for deuteranopes and protanopes; those of the first six joints by 35, and by 23 for these. Joints
have no green, magenta, bright red or turquoise: these are for σ_min, λ, serious statuses, and active ones.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from rmrc.scenario.choices import Status

# Colors of joints, in the order of the chain, and of variants.
HUES = (
    0x2F7FE8FF, 0xE06C00FF, 0x692DFFFF, 0x98945CFF, 0xA04458FF, 0x7A5890FF, 0x5898D8FF, 0xA84000FF,
)  # fmt: skip
BLACK, WHITE = 0x000000FF, 0xFFFFFFFF
# Limits and bounds; the smallest singular value; λ; the tip and its error.
GRAY, GREEN, MAGENTA, GOLD = 0x949494FF, 0x1E9650FF, 0xB4289BFF, 0xB08A00FF
# The error across the path, if it is drawn apart from the error along the path.
INDIGO = 0x5566FFFF
# Statuses: serious, active, and none. The last is also for rotation errors and second tasks.
RED, TEAL, SLATE = 0xFF2D2DFF, 0x00809CFF, 0x606060FF
GRAVE = Status.SINGULAR | Status.STOPPED | Status.STUCK | Status.CONTACT


def of_status(status: int) -> int:
    """Return the color of a status, 0xRRGGBBAA: serious, active, or none."""
    return RED if status & GRAVE else TEAL if status else SLATE


def css(color: int) -> str:
    """Return a color as matplotlib and a page take it."""
    return f"#{color >> 8:06x}"


def paints(count: int) -> list[str]:
    """Return the same colors as `distinct`, as matplotlib takes them."""
    return [css(color) for color in distinct(count)]


def hue(joint: int) -> int:
    """Return the color of a joint, 0xRRGGBBAA, by its number in the chain."""
    return HUES[joint % len(HUES)]


def distinct(count: int) -> list[int]:
    """Return this many colors: the hues, then darker ones, then paler ones, and so on.

    >>> [f"{color:08x}" for color in distinct(9)][::8]
    ['2f7fe8ff', '1c4c8bff']
    """
    rounds = (
        (BLACK, 0.0), (BLACK, 0.4), (WHITE, 0.45), (BLACK, 0.6), (WHITE, 0.65), (BLACK, 0.2), (WHITE, 0.25),
    )  # fmt: skip
    return [mix(HUES[i % len(HUES)], *rounds[i // len(HUES) % len(rounds)]) for i in range(count)]


def mix(first: int, second: int, part: float) -> int:
    """Return the color at this part of the way from the first to the second, 0xRRGGBBAA."""
    channels = [((first >> s) & 255, (second >> s) & 255, s) for s in (24, 16, 8, 0)]
    return sum(round(a + (b - a) * part) << s for a, b, s in channels)


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
