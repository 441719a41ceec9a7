"""Who works on the pieces of a study: threads of this process here, or a cluster in `rmrc.study.dask`."""

import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from typing import Any, Protocol, TypeAlias, TypeVar

from rmrc.support.threads import side_by_side

P = TypeVar("P")

# What is done with a piece of a study, until an event ends it; None: nothing came of it.
Work: TypeAlias = Callable[[Any, range, threading.Event], P | None]

# How often one looks up from waiting, in seconds.
_LOOK = 0.2


class Crew(Protocol):
    """Who works on the pieces of one study; each that is under way has a future, of threads or of Dask."""

    @property
    def room(self) -> int:
        """How many pieces may be under way now, so that nobody waits."""

    def shared(self, work: Work[Any]) -> object:
        """Return what to give to `submit` for a work that is done with many pieces."""

    def submit(self, work: object, pieces: Sequence[range], stop: threading.Event) -> Iterable[Any]:
        """Have pieces done, and return the future of each.

        Args:
            work: As `shared` returned it.
            pieces: Indices of the variants of each.
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

    def __init__(self, pool: ThreadPoolExecutor, count: int, study: object) -> None:
        """Keep what they work with.

        Args:
            pool: Of the threads.
            count: How many there are.
            study: What they work on.
        """
        self._pool, self._study = pool, study
        self.room = count + 1  # so that none waits while a part is written

    def shared(self, work: Work[Any]) -> object:
        """Return the work."""
        return work

    def submit(self, work: Any, pieces: Sequence[range], stop: threading.Event) -> list[Future[Any]]:
        """Have pieces done by the next threads that are free."""
        return [self._pool.submit(work, self._study, piece, stop) for piece in pieces]

    def ended(self, running: Mapping[Future[Any], range]) -> Iterator[tuple[Future[Any], Any]]:
        """Wait until a piece has ended, but not for long."""
        ended = wait(running, _LOOK, FIRST_COMPLETED).done
        for future in sorted(ended, key=lambda one: one.exception() is not None):
            yield future, future.result()


@contextmanager
def threads(count: int, study: object) -> Iterator[Crew]:
    """Yield so many threads; in the end, wait for what they are at.

    Args:
        count: How many.
        study: What they work on.
    """
    with side_by_side(count) as pool:
        yield Threads(pool, count, study)


def done(
    crew: Crew, work: Work[P], pieces: Iterator[range], stop: threading.Event
) -> Generator[tuple[range, P], None, None]:
    """Iterate over pieces and what came out of them, as they end; no more are begun than have room.

    Args:
        crew: Who does it.
        work: What is done.
        pieces: Indices of variants, asked for as there is room.
        stop: Once it is set, what has ended is all; set here when whoever iterates does not go on.
    """
    running: dict[Any, range] = {}
    shared = crew.shared(work)
    try:
        while True:
            stopped = stop.is_set()
            new = [] if stopped else list(islice(pieces, max(0, crew.room - len(running))))
            if new:
                running.update(zip(crew.submit(shared, new, stop), new, strict=True))
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
