"""Who works on the pieces of a sweep: threads of this process here, or a cluster in `rmrc.study.dask`."""

import threading
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from typing import Any, Literal, Protocol

from rmrc.study.shards import Shards
from rmrc.support.threads import side_by_side

# A method of `Shards`: indices, what it shares with other pieces, an event that ends it -> what came out.
Work = Literal["check", "run"]

# How often one looks up from waiting, in seconds.
_LOOK = 0.2


class Crew(Protocol):
    """Who works on pieces; each that is under way has a future, of threads or of Dask."""

    @property
    def room(self) -> int:
        """How many pieces may be under way now, so that nobody waits."""

    def shared(self, value: object) -> object:
        """Return what to give to `submit` for a value that many pieces share."""

    def submit(
        self, work: Work, pieces: Sequence[range], shared: object, stop: threading.Event
    ) -> Iterable[Any]:
        """Have pieces done, and return the future of each.

        Args:
            work: What.
            pieces: Indices of the runs of each.
            shared: As `shared` returned it.
            stop: Once it is set, nobody waits for the results.
        """

    def ended(self, running: Mapping[Any, range]) -> Iterator[tuple[Any, Any]]:
        """Wait a moment; iterate over the futures of some that ended by then, and what came out of each.

        Where nothing came out of one, raise why, after those of which something did.

        Args:
            running: The pieces that are under way, by their futures.
        """


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

    def submit(
        self, work: Work, pieces: Sequence[range], shared: object, stop: threading.Event
    ) -> list[Future[Any]]:
        """Have pieces done by the next threads that are free."""
        return [self._pool.submit(getattr(self._shards, work), piece, shared, stop) for piece in pieces]

    def ended(self, running: Mapping[Future[Any], range]) -> Iterator[tuple[Future[Any], Any]]:
        """Wait until a piece has ended, but not for long."""
        ended = wait(running, _LOOK, FIRST_COMPLETED).done
        for future in sorted(ended, key=lambda one: one.exception() is not None):
            yield future, future.result()


@contextmanager
def threads(count: int, shards: Shards) -> Iterator[Crew]:
    """Yield so many threads; in the end, wait for what they are at.

    Args:
        count: How many.
        shards: What does the work.
    """
    with side_by_side(count) as pool:
        yield Threads(pool, count, shards)


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
    running: dict[Any, range] = {}
    shared = crew.shared(shared)
    try:
        while True:
            stopped = stop.is_set()
            new = [] if stopped else list(islice(pieces, max(0, crew.room - len(running))))
            if new:
                running.update(zip(crew.submit(work, new, shared, stop), new, strict=True))
            if not running:
                return
            for future, found in crew.ended(running):
                piece = running.pop(future)
                if found is not None:
                    yield piece, found
            if stopped:
                return
    finally:
        if running:
            stop.set()
