"""Numbers with units or as fractions, and their spelling in a scenario."""

import math
import re

# Factor to the unit of scenarios, and that unit.
UNITS: dict[str, tuple[float, str]] = {
    "mm": (1e-3, "m"), "cm": (1e-2, "m"), "m": (1.0, "m"), "km": (1e3, "m"),
    "um": (1e-6, "m"), "in": (0.0254, "m"),
    "us": (1e-6, "s"), "ms": (1e-3, "s"), "s": (1.0, "s"), "sec": (1.0, "s"), "min": (60.0, "s"),
    "rad": (1.0, "rad"), "radian": (1.0, "rad"), "radians": (1.0, "rad"), "mrad": (1e-3, "rad"),
    "deg": (math.radians(1), "rad"), "degree": (math.radians(1), "rad"), "degrees": (math.radians(1), "rad"),
    "°": (math.radians(1), "rad"), "rev": (math.tau, "rad"),
    "turn": (math.tau, "rad"), "turns": (math.tau, "rad"),
    "mm/s": (1e-3, "m/s"), "cm/s": (1e-2, "m/s"), "m/s": (1.0, "m/s"), "km/h": (1 / 3.6, "m/s"),
    "rad/s": (1.0, "rad/s"), "deg/s": (math.radians(1), "rad/s"), "°/s": (math.radians(1), "rad/s"),
    "rpm": (math.tau / 60.0, "rad/s"), "mm/s²": (1e-3, "m/s²"), "m/s²": (1.0, "m/s²"), "g": (1e-3, "kg"),
    "rad/s²": (1.0, "rad/s²"), "deg/s²": (math.radians(1), "rad/s²"), "°/s²": (math.radians(1), "rad/s²"),
    "mm/s³": (1e-3, "m/s³"), "m/s³": (1.0, "m/s³"), "rad/s³": (1.0, "rad/s³"),
    "deg/s³": (math.radians(1), "rad/s³"),
    "kg": (1.0, "kg"), "hz": (1.0, "1/s"), "khz": (1e3, "1/s"), "1/s": (1.0, "1/s"), "n": (1.0, "N"),
    "kn": (1e3, "N"), "nm": (1.0, "N·m"), "n·m": (1.0, "N·m"), "n*m": (1.0, "N·m"), "%": (1e-2, "1"),
}  # fmt: skip

# Each digit matches in one way only; otherwise a long invalid text would take time quadratic in its length.
UNSIGNED = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_NUMBER = rf"[-+]?{UNSIGNED}"


def instead(text: str, unit: str) -> str:
    """Return the correct spelling for a text that is not a number, as the end of a message; "" if unknown.

    Args:
        text: As it stands in the file.
        unit: Unit of the key, such as `m/s` or `rad or m`.

    >>> instead("250 mm/s", "m/s")
    ': write 0.25, in m/s; only an angle may have a unit, deg or rad'
    >>> instead("90 deg/s", "m/s")
    ': it is 1.570796 rad/s, and the key is in m/s'
    >>> instead("7 ms", "s")  # a period takes Hz
    ': write 0.007, in s'
    >>> instead("pi/2", "rad")
    ': write 90 deg'
    """
    known = _quantity(text)
    if known is None:
        return ""
    value, of = known
    wanted = unit.split(" or ")
    if of == "rad" and "rad" in wanted:
        return f": write {_short(math.degrees(value))} deg"
    if of == "1/s" and "s" in wanted and value > 0.0:
        return f": write {_short(1.0 / value)}, the period in s"
    if of == "" or of in wanted:
        where = f", in {of}" if of not in ("", "1") else ""
        where += "; only an angle may have a unit, deg or rad" if where and of != "s" else ""
        return f": write {_short(value)}{where}"
    return f": it is {_short(value)} {of}, and the key is {f'in {unit}' if unit else 'a plain number'}"


def quantity(text: str, unit: str) -> tuple[float, bool]:
    """Return the value of a text in a unit, and whether the text has one itself.

    Raises:
        ValueError: It is no number with that unit, or one that converts to it, or with none.

    >>> quantity("6 ms", "s"), quantity("0.5", "rad")
    ((0.006, True), (0.5, False))
    """
    if re.fullmatch(rf"\s*{_NUMBER}\s*", text) and math.isfinite(float(text)):
        return float(text), False
    known = _quantity(text)
    if known is None or known[1] not in (unit, ""):
        raise ValueError(f"is not a number in {unit}" if unit != "1" else "is not a number")
    return known[0], known[1] != ""


def _quantity(text: str) -> tuple[float, str] | None:
    """Return the value of a text and its unit, "" for none."""
    text = " ".join(text.split())
    if match := re.fullmatch(rf"({_NUMBER}) ?(\S+)", text):
        unit = match[2].lower().replace("^", "").replace("**", "")
        unit = re.sub(r"(?<=s)2$", "²", re.sub(r"(?<=s)3$", "³", unit))
        if unit in UNITS:
            factor, of = UNITS[unit]
            return _finite(float(match[1]) * factor, of)
    if match := re.fullmatch(rf"({_NUMBER})? ?\*? ?([-+])?(?:pi|π)(?: ?/ ?({_NUMBER}))?", text):
        over = float(match[3] or 1.0)
        sign = -1.0 if match[2] == "-" else 1.0
        return _finite(sign * float(match[1] or 1.0) * math.pi / over, "rad") if over else None
    if match := re.fullmatch(rf"({_NUMBER}) ?/ ?({_NUMBER})", text):
        return _finite(float(match[1]) / float(match[2]), "") if float(match[2]) else None
    if re.fullmatch(r"[-+]?[0-9]+,[0-9]+", text):  # with a decimal comma
        return _finite(float(text.replace(",", ".")), "")
    return None


def _finite(value: float, unit: str) -> tuple[float, str] | None:
    return (value, unit) if math.isfinite(value) else None


def _short(value: float) -> str:
    """Return a number as YAML reads it back, to seven digits."""
    text = f"{value:.7g}"
    digits, exponent, power = text.partition("e")
    return f"{digits if '.' in digits else digits + '.0'}e{power}" if exponent else text
