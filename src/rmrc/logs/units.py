"""Units in the names of columns."""

import math
import re
from collections.abc import Mapping

SECONDS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6,
    "usec": 1e-6, "ns": 1e-9, "nsec": 1e-9, "nsecs": 1e-9, "nanosec": 1e-9, "nanoseconds": 1e-9,
}  # fmt: skip
# A step between the rows of a table without a column of time.
STEP = re.compile(rf"(\d+\.?\d*(?:e-?\d+)?)\s*({'|'.join(SECONDS)})")
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
ANGLES = {"rad": 1.0, "mrad": 1e-3} | dict.fromkeys(("deg", "degrees", "°"), math.pi / 180.0)


def rates(units: Mapping[str, float]) -> dict[str, float]:
    """Return the units of rates, as programs write them, of units of lengths or angles."""
    return {f"{unit}{per}": size for unit, size in units.items() for per in ("/s", "_s", "ps", "_per_s")}


JOINTS = ANGLES | LENGTHS
JOINT_RATES = rates(JOINTS) | JOINTS
SIZES = SECONDS | JOINT_RATES
"""The size of each unit in SI."""


def parts(name: str, units: Mapping[str, float]) -> tuple[str, str]:
    """Return a name in lowercase with _ between its words, without its unit, and the unit or "".

    Args:
        name: Name of a column.
        units: Units that the column may be in.

    >>> parts("Pose.X (mm)", LENGTHS), parts("q1_deg", JOINTS)
    (('pose_x', 'mm'), ('q1', 'deg'))
    """
    text, unit = name.strip().lower(), ""
    match = re.fullmatch(r"(.*?)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]", text)
    if match and match[2] in units:
        text, unit = match[1], match[2]
    text = re.sub(r"[^a-z0-9µ]+", "_", text).strip("_")
    for word in sorted(units, key=len, reverse=True):
        end = f"_{word.replace('/', '_')}"
        is_measured = word == "m" and "rad" in units  # q_m is a measured position, not one in meters
        if not unit and f"_{text}".endswith(end) and not is_measured:
            return f"_{text}".removesuffix(end).removeprefix("_"), word
    return text, unit
