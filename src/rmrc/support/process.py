"""The process: the signals that end it, its memory, and its threads.

Ctrl-C, SIGTERM and SIGHUP are an event, so that they interrupt no block and no write of a file. The first of
them stops the work and keeps the results. The second one ends the process of a command at once; in another
program's process its earlier handler runs. A signal that the process ignored from its start, as with
`nohup`, stays without effect.

A check tells whether a need of memory fits into what is left. Threads step worlds side by side and share one
interpreter.
"""

import math
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NamedTuple, NoReturn

# The signals that the system has: Windows has no SIGHUP.
_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_SHOW_CURSOR = b"\x1b[?25h"

_Handler = Callable[[int, FrameType | None], None]
_came: list[int] = []  # the signals that came since `stops_like_ctrl_c` began


def signal_that_came() -> int | None:
    """Return the number of the first signal that stopped this process's work, None without one."""
    return _came[0] if _came else None


@contextmanager
def stops_like_ctrl_c() -> Iterator[None]:
    """Have SIGTERM and SIGHUP act as Ctrl-C does: raise KeyboardInterrupt, or set an `interruptible` event.

    For a process that ends when it is stopped. It has no effect outside of the main thread.
    """
    _came.clear()

    def interrupt(number: int, frame: FrameType | None) -> None:
        if _is_importing(frame):  # libraries turn it into other errors, and there is nothing to keep
            _end(number)
        _next_one_ends(number)
        raise KeyboardInterrupt

    def unraisable(lost: "sys.UnraisableHookArgs") -> None:
        if _came and isinstance(lost.exc_value, KeyboardInterrupt):
            _end(_came[0])  # a callback caught it, and nothing else would notice it
        before(lost)

    before = sys.unraisablehook
    sys.unraisablehook = unraisable
    try:
        with _handled(interrupt, lambda _: True):
            yield
    finally:
        sys.unraisablehook = before


@contextmanager
def interruptible() -> Iterator[threading.Event]:
    """Yield an event set by Ctrl-C and by the signals that `stops_like_ctrl_c` treats alike."""
    stop = threading.Event()
    before = {number: signal.getsignal(number) for number in _SIGNALS}

    def end(number: int, _: FrameType | None) -> None:
        stop.set()
        if getattr(before[number], "is_ours", False):
            _next_one_ends(number)
        else:  # in a notebook
            signal.signal(number, before[number])

    def is_like_ctrl_c(number: int) -> bool:
        return number == signal.SIGINT or getattr(signal.getsignal(number), "is_ours", False)

    with _handled(end, is_like_ctrl_c):
        yield stop


@contextmanager
def _handled(handler: _Handler, is_chosen: Callable[[int], bool]) -> Iterator[None]:
    """Handle the chosen signals, except those that are ignored."""
    if threading.current_thread() is not threading.main_thread():  # another thread may not set handlers
        yield
        return
    handler.is_ours = True  # type: ignore[attr-defined]
    chosen = [n for n in _SIGNALS if signal.getsignal(n) != signal.SIG_IGN and is_chosen(n)]
    before = {number: signal.signal(number, handler) for number in chosen}
    try:
        yield
    finally:
        for number, previous in before.items():
            # a signal that `_next_one_ends` left to the system stays so while the outer handler is active
            is_left = signal.getsignal(number) == signal.SIG_DFL and getattr(previous, "is_ours", False)
            signal.signal(number, signal.SIG_DFL if is_left else previous)


def _next_one_ends(number: int) -> None:
    """Leave the next signal to the system, which ends the process even while Python does not react."""
    _came.append(number)
    for one in _SIGNALS:
        if getattr(signal.getsignal(one), "is_ours", False):
            signal.signal(one, signal.SIG_DFL)
    if sys.stderr is not None and sys.stderr.isatty():  # where a progress bar may have hidden it
        os.write(sys.stderr.fileno(), _SHOW_CURSOR)


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _end(number: int) -> NoReturn:
    """End the process at once, with the exit code of a signal."""
    os.write(2, b"rmrc: interrupted\n")
    os._exit(128 + number)


# The end of the process ---------------------------------------------------------------------------
#
# Whether this process ends with its job, as that of the command line does: it need not search its memory.

ends_with_job = False


# Memory, and threads ------------------------------------------------------------------------------

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


@contextmanager
def side_by_side(count: int) -> Iterator[ThreadPoolExecutor]:
    """Yield a pool of threads; at the end, wait for running work, and cancel the rest.

    Args:
        count: Number of threads.
    """
    pool = ThreadPoolExecutor(count)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def work_in_shares(work: Callable[[slice], None], count: int, size: int, threads: int | None = None) -> None:
    """Let threads work on many items, some at a time.

    Args:
        work: Does the items of a slice, and lets other threads run meanwhile.
        count: Number of items.
        size: Items of a slice.
        threads: None: one per core.
    """
    parts = [slice(begin, begin + size) for begin in range(0, count, size)]
    if len(parts) == 1:  # starting a thread would take longer
        work(parts[0])
        return
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        list(pool.map(work, parts))
