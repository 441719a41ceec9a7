"""Threads that step worlds side by side and share one interpreter."""

import gc
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

# A thread that steps comes back to the interpreter thousands of times a second, for microseconds each: by
# itself it would wait for 5 ms for one that prepares runs.
_SWITCH = 5e-5


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
        self._pools, self._before, self._lock = 0, 0.0, threading.Lock()

    def enter(self) -> None:
        with self._lock:
            self._pools += 1
            if self._pools == 1:
                self._before = sys.getswitchinterval()
                sys.setswitchinterval(_SWITCH)
                gc.freeze()  # what is loaded stays, and to look through it for garbage would stop all threads

    def leave(self) -> None:
        with self._lock:
            self._pools -= 1
            if self._pools == 0:
                gc.unfreeze()
                sys.setswitchinterval(self._before)


_interpreter = _Interpreter()
