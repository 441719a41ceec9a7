"""Threads that step worlds side by side and share one interpreter."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager


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
