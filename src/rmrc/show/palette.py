"""Colors, 0xRRGGBBAA, for a dark and a light background; neighbors differ in hue and brightness."""

HUES = (
    0x3D8BFDFF, 0xFF9F1CFF, 0x2EC27EFF, 0xE5484DFF, 0xB07CFFFF, 0x17C3CEFF, 0xE668B3FF, 0xA3A948FF,
)  # fmt: skip
BLACK, WHITE = 0x000000FF, 0xFFFFFFFF


def distinct(count: int) -> list[int]:
    """Return as many colors: the hues, then the same darker, then paler, and so on.

    >>> [f"{color:08x}" for color in distinct(9)][::8]
    ['3d8bfdff', '255398ff']
    """
    rounds = (
        (BLACK, 0.0),
        (BLACK, 0.4),
        (WHITE, 0.45),
        (BLACK, 0.6),
        (WHITE, 0.65),
        (BLACK, 0.2),
        (WHITE, 0.25),
    )
    return [mix(HUES[i % len(HUES)], *rounds[i // len(HUES) % len(rounds)]) for i in range(count)]


def mix(first: int, second: int, part: float) -> int:
    """Return the color that has gone so far from the first to the second, 0xRRGGBBAA."""
    channels = [((first >> s) & 255, (second >> s) & 255, s) for s in (24, 16, 8, 0)]
    return sum(round(a + (b - a) * part) << s for a, b, s in channels)
