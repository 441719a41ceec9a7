"""Threads that step worlds side by side and share one interpreter."""

import gc
import sys
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
    pool, before = ThreadPoolExecutor(count), sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH)
    gc.freeze()  # what is loaded stays, and to look through it for garbage would stop all threads
    try:
        yield pool
    finally:
        try:
            pool.shutdown(cancel_futures=True)
        finally:  # a second Ctrl-C comes while we wait
            gc.unfreeze()
            sys.setswitchinterval(before)
