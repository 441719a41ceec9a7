"""Who works on the pieces of a sweep: threads of this process here, or a cluster in `rmrc.sweep.cluster`."""

import sys
import threading
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import Any, Literal, Protocol

from rmrc.sweep.shards import Shards

# A method of `Shards`: indices, what it shares with other pieces, an event that ends it -> what came out.
Work = Literal["check", "run"]

# A thread that steps comes back to the interpreter thousands of times a second, for microseconds each: by
# itself it would wait for 5 ms for one that prepares runs.
_SWITCH = 5e-5

# How often one looks up from waiting, in seconds.
_LOOK = 0.2


class Piece(Protocol):
    """A piece that is under way: a future of threads, or of Dask."""

    def add_done_callback(self, told: Callable[[Any], object], /) -> object:
        """Have it told when it ends."""

    def result(self) -> Any:
        """Return what came out of it."""


class Crew(Protocol):
    """Who works on pieces."""

    @property
    def room(self) -> int:
        """How many pieces may be under way now, so that nobody waits."""

    def shared(self, value: object) -> object:
        """Return what to give to `submit` for a value that many pieces share."""

    def submit(self, work: Work, indices: range, shared: object, stop: threading.Event) -> Piece:
        """Have a piece done.

        Args:
            work: What.
            indices: Of the runs.
            shared: As `shared` returned it.
            stop: Once it is set, nobody waits for the result.
        """

    def result(self, future: Piece, indices: range) -> Any:
        """Return what came out of a piece that ended, or raise why nothing did."""


class Threads:
    """Threads of this process: each runs its own batch."""

    def __init__(self, pool: ThreadPoolExecutor, count: int, shards: Shards) -> None:
        """Keep what they work with.

        Args:
            pool: Of the threads.
            count: How many there are.
            shards: What does the work.
        """
        self._pool, self._shards = pool, shards
        self.room = count + 1  # so that none waits while a part is written

    def shared(self, value: object) -> object:
        """Return the value."""
        return value

    def submit(self, work: Work, indices: range, shared: object, stop: threading.Event) -> Piece:
        """Have a piece done by the next thread that is free."""
        return self._pool.submit(getattr(self._shards, work), indices, shared, stop)

    def result(self, future: Piece, indices: range) -> Any:  # noqa: ARG002
        """Return what came out of a piece that ended."""
        return future.result()


@contextmanager
def threads(count: int, shards: Shards) -> Iterator[Crew]:
    """Yield so many threads; in the end, wait for what they are at.

    Args:
        count: How many.
        shards: What does the work.
    """
    pool, before = ThreadPoolExecutor(count), sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH)
    try:
        yield Threads(pool, count, shards)
    finally:
        try:
            pool.shutdown(cancel_futures=True)
        finally:  # a second Ctrl-C comes while we wait
            sys.setswitchinterval(before)


def done(
    crew: Crew, work: Work, pieces: Iterator[range], shared: object, stop: threading.Event
) -> Generator[tuple[range, Any], None, None]:
    """Iterate over pieces and what came out of them, as they end; no more are begun than have room.

    Args:
        crew: Who does it.
        work: What is done.
        pieces: Indices of runs, asked for as there is room.
        shared: What the pieces share.
        stop: Once it is set, what has ended is all; set here when whoever iterates does not go on.
    """
    ended: SimpleQueue[Piece] = SimpleQueue()
    running: dict[Piece, range] = {}
    shared = crew.shared(shared)
    try:
        while True:
            while not stop.is_set() and len(running) < crew.room:
                piece = next(pieces, None)
                if piece is None:
                    break
                future = crew.submit(work, piece, shared, stop)
                running[future] = piece
                future.add_done_callback(ended.put)
            if not running:
                return
            try:
                future = ended.get(timeout=0.0 if stop.is_set() else _LOOK)
            except Empty:
                if stop.is_set():
                    return
                continue
            piece = running.pop(future)
            found = crew.result(future, piece)
            if found is not None:
                yield piece, found
    finally:
        if running:
            stop.set()
