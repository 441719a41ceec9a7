"""Numbers with units, as texts."""

import math
import re

# Factor to the unit of scenarios, and that unit.
_UNITS = {
    "s": (1.0, "s"), "ms": (1e-3, "s"), "rad": (1.0, "rad"), "deg": (math.radians(1.0), "rad"),
    "%": (1e-2, "1"),
}  # fmt: skip

# Each digit matches in one way only; otherwise a long invalid text would take time quadratic in its length.
UNSIGNED = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
DECIMAL = rf"[-+]?{UNSIGNED}"


def quantity(text: str, unit: str) -> tuple[float, bool]:
    """Return the value of a text in a unit, and whether the text has one itself.

    Raises:
        ValueError: It is no number with that unit, or one that converts to it, or with none.

    >>> quantity("6 ms", "s"), quantity("0.5", "rad")
    ((0.006, True), (0.5, False))
    """
    match = re.fullmatch(rf"\s*({DECIMAL})\s*([a-z%]*)\s*", text)
    factor, own = _UNITS.get(match[2], (1.0, match[2] or unit)) if match else (1.0, "")
    value = float(match[1]) * factor if match else math.nan
    if match is None or own != unit or not math.isfinite(value):
        raise ValueError(f"is not a number in {unit}" if unit != "1" else "is not a number")
    return value, bool(match[2])
