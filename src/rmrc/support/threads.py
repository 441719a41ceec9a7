"""Threads that step worlds side by side and share one interpreter."""

import gc
import os
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

# A thread that steps worlds returns to the interpreter thousands of times per second, for microseconds each.
# By default it would wait 5 ms for a thread that prepares runs.
_SWITCH = 5e-5

# More frozen objects than Python's own few hundred mean that another library froze them and relies on it.
_FROZEN = 10_000


@contextmanager
def side_by_side(count: int) -> Iterator[ThreadPoolExecutor]:
    """Yield a pool of threads; at the end, wait for running work, and cancel the rest.

    Args:
        count: Number of threads.
    """
    pool = ThreadPoolExecutor(count)
    _interpreter.enter()
    try:
        yield pool
    finally:
        try:
            pool.shutdown(cancel_futures=True)
        finally:  # a second Ctrl-C during the wait
            _interpreter.leave()


class _Interpreter:
    """Interpreter settings that all pools of a process share: the first sets, the last restores them."""

    def __init__(self) -> None:
        self._pools, self._before, self._freezes, self._lock = 0, 0.0, False, threading.Lock()

    def enter(self) -> None:
        with self._lock:
            self._pools += 1
            if self._pools == 1:
                self._before = sys.getswitchinterval()
                sys.setswitchinterval(_SWITCH)
                self._freezes = gc.get_freeze_count() < _FROZEN
                if self._freezes:  # loaded objects stay, and searching them would stop all threads
                    gc.freeze()

    def leave(self) -> None:
        with self._lock:
            self._pools -= 1
            if self._pools == 0:
                if self._freezes:
                    gc.unfreeze()
                sys.setswitchinterval(self._before)


_interpreter = _Interpreter()


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
