"""Ctrl-C, SIGTERM and SIGHUP as an event, so that they interrupt no block and no write of a file.

The first of them stops the work and keeps the results. The second one ends the process of a command at once;
in another program's process its earlier handler runs. A signal that the process ignored from its start, as
with `nohup`, stays without effect.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

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
