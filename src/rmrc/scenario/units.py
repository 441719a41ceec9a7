"""Numbers with units, as texts."""

import math
import re

from rmrc.scenario.wording import inline

_DEGREE = math.radians(1.0)

# Factor to the unit of scenarios, and that unit.
UNITS: dict[str, tuple[float, str]] = {
    "mm": (1e-3, "m"), "cm": (1e-2, "m"), "m": (1.0, "m"), "ms": (1e-3, "s"), "s": (1.0, "s"),
    "rad": (1.0, "rad"), "deg": (_DEGREE, "rad"), "degrees": (_DEGREE, "rad"), "°": (_DEGREE, "rad"),
    "mm/s": (1e-3, "m/s"), "m/s": (1.0, "m/s"), "rad/s": (1.0, "rad/s"), "deg/s": (_DEGREE, "rad/s"),
    "Hz": (1.0, "1/s"), "g": (1e-3, "kg"), "kg": (1.0, "kg"), "N": (1.0, "N"), "%": (1e-2, "1"),
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
    value, own = _read(text)
    if own not in (unit, "") or not math.isfinite(value):
        raise ValueError(f"is not a number in {unit}" if unit != "1" else "is not a number")
    return value, own != ""


def instead(text: str, unit: str) -> str:
    """Return the correct spelling for a text that is not a number, as the end of a message; "" if unknown.

    Args:
        text: As it stands in the file.
        unit: Unit of the key, such as `m/s` or `rad or m`.

    >>> instead("250 mm/s", "m/s")
    '; write 0.25, in m/s'
    >>> instead("90 deg/s", "m/s")
    '; it is 1.570796 rad/s, and the key is in m/s'
    >>> instead("1e-3", "s")  # which YAML reads as a text
    '; write 0.001'
    """
    value, own = _read(text)
    wanted = unit.split(" or ")
    if not math.isfinite(value):
        return ""
    if own == "rad" and "rad" in wanted:
        return f"; write {_short(math.degrees(value))} deg"
    if own == "1/s" and "s" in wanted and value > 0.0:
        return f"; write {_short(1.0 / value)}, the period in s"
    if own == "" or own in wanted:
        return f"; write {_short(value)}{own and f', in {own}'}"
    return f"; it is {_short(value)} {own}, and the key is {f'in {unit}' if unit else 'a plain number'}"


def _read(text: str) -> tuple[float, str]:
    """Return the value of a text and its unit, "" for none; not a number if it is no quantity."""
    match = re.fullmatch(rf"\s*({DECIMAL})(?:\s*/\s*({DECIMAL}))?\s*([^\s\d.]\S*)?\s*", text)
    factor, unit = UNITS.get(match[3], (math.nan, "")) if match and match[3] else (1.0, "")
    over = float(match[2] or 1.0) if match else 0.0
    return (factor * float(match[1]) / over, unit) if match and over else (math.nan, "")


def _short(value: float) -> str:
    """Return a number as YAML reads it back, to seven digits."""
    return inline(float(f"{value:.7g}")).removesuffix(".0")
