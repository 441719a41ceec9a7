"""Memory: how much a process may still take, and whether a need fits."""

import math
import re
from pathlib import Path
from typing import NamedTuple

# A check lets a run take this share of the remaining memory: the rest is for errors of the estimate.
SHARE = 0.8


class Room(NamedTuple):
    """The remainder of a memory limit.

    Attributes:
        size: Its size [B]; infinite if it is unknown.
        bound: The limit, in words.
    """

    size: float
    bound: str


def room(root: Path = Path("/")) -> Room:
    """Return what the machine has left, or its container, if that is less.

    Args:
        root: Root of the file system with these data.
    """
    group = root / "sys/fs/cgroup"
    most = _number(group / "memory.max", r"(\d+)", math.inf)
    cached = _number(group / "memory.stat", r"inactive_file (\d+)", 0.0)
    container = most - _number(group / "memory.current", r"(\d+)", 0.0) + cached
    machine = 1024 * _number(root / "proc/meminfo", r"MemAvailable:\s+(\d+)", math.inf)
    return min(Room(machine, "the machine"), Room(max(0.0, container), "the container"))


def _number(path: Path, pattern: str, other: float) -> float:
    """Return a number in a file, or another one without it, as where a group has no limit."""
    try:
        match = re.search(pattern, path.read_text("utf-8"))
    except (OSError, ValueError):
        return other
    return float(match[1]) if match else other


def excess(need: float) -> str | None:
    """Return by how much a need [B] is too large, in words that follow "need", or None if it fits.

    Example:
        >>> excess(1e6) is None
        True
    """
    left = room()
    if need <= SHARE * left.size:
        return None
    return (
        f"{shown(need)} of memory, and {shown(SHARE * left.size)} may be taken: "
        f"{SHARE:.0%} of the memory that {left.bound} leaves"
    )


def shown(size: float) -> str:
    """Return a size in words.

    >>> shown(59_528_007_440), shown(2.5e6)
    ('59.5 GB', '2.5 MB')
    """
    return f"{size / 1e9:.3g} GB" if size >= 1e9 else f"{size / 1e6:.3g} MB"
