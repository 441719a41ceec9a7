"""Threads that step worlds side by side and share one interpreter."""

import gc
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

# A thread that steps comes back to the interpreter thousands of times per second, for microseconds each: by
# itself it would wait for 5 ms for one that prepares runs.
_SWITCH = 5e-5

# Objects that somebody else has frozen, who wants them to stay so; Python itself freezes some hundred.
_FROZEN = 10_000


@contextmanager
def side_by_side(count: int) -> Iterator[ThreadPoolExecutor]:
    """Yield a pool of threads; in the end, wait for what they are at, and cancel what has not begun.

    Args:
        count: How many.
    """
    pool = ThreadPoolExecutor(count)
    _interpreter.enter()
    try:
        yield pool
    finally:
        try:
            pool.shutdown(cancel_futures=True)
        finally:  # a second Ctrl-C comes while we wait
            _interpreter.leave()


class _Interpreter:
    """Its settings, which all pools of a process share: the first changes them, the last puts them back."""

    def __init__(self) -> None:
        self._pools, self._before, self._freezes, self._lock = 0, 0.0, False, threading.Lock()

    def enter(self) -> None:
        with self._lock:
            self._pools += 1
            if self._pools == 1:
                self._before = sys.getswitchinterval()
                sys.setswitchinterval(_SWITCH)
                self._freezes = gc.get_freeze_count() < _FROZEN
                if self._freezes:  # what is loaded stays, and to look through it would stop all threads
                    gc.freeze()

    def leave(self) -> None:
        with self._lock:
            self._pools -= 1
            if self._pools == 0:
                if self._freezes:
                    gc.unfreeze()
                sys.setswitchinterval(self._before)


_interpreter = _Interpreter()
