"""Memory: how much a process may still take, and whether a need fits."""

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

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
    """Return the smallest remainder: of the machine's memory and of the limits of its cgroups.

    Args:
        root: Root of the file system with these data.
    """
    return min((_machine(root), *_cgroups(root)), key=lambda one: one.size)


def address_room(root: Path = Path("/")) -> Room:
    """Return the remainder of the addresses that `ulimit -v` allows, touched or not."""
    bound = "ulimit -v"
    if resource is None or (limit := resource.getrlimit(resource.RLIMIT_AS)[0]) == resource.RLIM_INFINITY:
        return Room(math.inf, bound)
    pages = _text(root / "proc/self/statm").split()
    used = int(pages[0]) * os.sysconf("SC_PAGE_SIZE") if pages else 0
    return Room(max(0, limit - used), bound)


def excess(held: float, reserved: float = 0.0) -> str | None:
    """Return by how much a need is too large, in words that follow "need", or None if it fits.

    Args:
        held: Memory that will be written [B].
        reserved: Memory that will only be reserved, which only `ulimit -v` counts [B].

    Example:
        >>> excess(1e6) is None
        True
    """
    for need, left in ((held, room()), (held + reserved, address_room())):
        if need > SHARE * left.size:
            return (
                f"{shown(need)} of memory, and {shown(SHARE * left.size)} may be taken: "
                f"{SHARE:.0%} of the memory that {left.bound} leaves"
            )
    return None


def shown(size: float) -> str:
    """Return a size in words.

    >>> shown(59_528_007_440), shown(2.5e6)
    ('59.5 GB', '2.5 MB')
    """
    return f"{size / 1e9:.3g} GB" if size >= 1e9 else f"{size / 1e6:.3g} MB"


def _machine(root: Path) -> Room:
    bound = "the machine"
    for line in _text(root / "proc/meminfo").splitlines():
        name, _, value = line.partition(":")
        if name == "MemAvailable":
            return Room(1024 * int(value.split()[0]), bound)
    try:
        return Room(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"), bound)
    except (AttributeError, ValueError, OSError):
        return Room(math.inf, bound)


def _cgroups(root: Path) -> Iterator[Room]:
    """Iterate over the remainders of the limits of the process's cgroups and of their parents."""
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, kinds, path = line.split(":", 2)
        if kinds == "":  # version 2
            base, names = root / "sys/fs/cgroup", ("memory.max", "memory.current", "inactive_file")
        elif "memory" in kinds.split(","):
            base = root / "sys/fs/cgroup/memory"
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        parts = [part for part in path.split("/") if part not in ("", "..")]
        # in a container, its own group is the root that it can see
        for count in range(len(parts) + 1):
            yield _cgroup(base.joinpath(*parts[:count]), *names)


def _cgroup(folder: Path, limit: str, usage: str, cache: str) -> Room:
    """Return the remainder in one group; cached files count as free."""
    bound = "the memory limit of its cgroup"
    most = _text(folder / limit).strip()
    # no limit is no file, "max", or in version 1 nearly 2^63
    if not (most.isdecimal() and len(most) < 19 and (used := _text(folder / usage).strip()).isdecimal()):
        return Room(math.inf, bound)
    known = dict(line.split(" ", 1) for line in _text(folder / "memory.stat").splitlines() if " " in line)
    return Room(max(0, int(most) - int(used) + int(known.get(cache, 0))), bound)


def _text(path: Path) -> str:
    """Return the contents of a file, "" if it does not exist."""
    try:
        return path.read_text("utf-8")
    except (OSError, ValueError):
        return ""
