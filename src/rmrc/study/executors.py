"""Workers for the pieces of a study: threads of this process, or a cluster by `rmrc.study.dask`."""

import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from typing import Any, Protocol, TypeAlias, TypeVar

from rmrc.support.threads import side_by_side

P = TypeVar("P")

# Work on a piece of a study, which an event can end; None: no result.
Work: TypeAlias = Callable[[Any, range, threading.Event], P | None]

# Interval between checks while waiting [s].
_LOOK = 0.2


class Crew(Protocol):
    """Workers for the pieces of one study; each piece in progress has a future, of threads or of Dask."""

    @property
    def room(self) -> int:
        """Number of pieces in progress at which no worker idles."""

    def shared(self, work: Work[Any]) -> object:
        """Return the argument of `submit` for a function that is applied to many pieces."""

    def submit(self, work: object, pieces: Sequence[range], stop: threading.Event) -> Iterable[Any]:
        """Submit pieces, and return the future of each.

        Args:
            work: The result of `shared`.
            pieces: Indices of the variants of each.
            stop: Event that cancels waiting for the results.
        """

    def ended(self, running: Mapping[Any, range]) -> Iterator[tuple[Any, Any]]:
        """Wait briefly; iterate over the finished futures and their results.

        Raise the error of a failed one, after yielding the successful ones.

        Args:
            running: The pieces in progress, by their futures.
        """


class Threads:
    """Threads of this process: each runs its own batch."""

    def __init__(self, pool: ThreadPoolExecutor, count: int, study: object) -> None:
        """Store the pool and the study.

        Args:
            pool: Pool of the threads.
            count: Number of threads.
            study: The study.
        """
        self._pool, self._study = pool, study
        self.room = count + 1  # so that none waits while a part is written

    def shared(self, work: Work[Any]) -> object:
        """Return the work."""
        return work

    def submit(self, work: Any, pieces: Sequence[range], stop: threading.Event) -> list[Future[Any]]:
        """Submit pieces to the next free threads."""
        return [self._pool.submit(work, self._study, piece, stop) for piece in pieces]

    def ended(self, running: Mapping[Future[Any], range]) -> Iterator[tuple[Future[Any], Any]]:
        """Wait for a piece to finish, with a short timeout."""
        ended = wait(running, _LOOK, FIRST_COMPLETED).done
        for future in sorted(ended, key=lambda one: one.exception() is not None):
            yield future, future.result()


@contextmanager
def threads(count: int, study: object) -> Iterator[Crew]:
    """Yield a pool of threads; at the end, wait for their work.

    Args:
        count: Number of threads.
        study: The study.
    """
    with side_by_side(count) as pool:
        yield Threads(pool, count, study)


def done(
    crew: Crew, work: Work[P], pieces: Iterator[range], stop: threading.Event
) -> Generator[tuple[range, P], None, None]:
    """Iterate over pieces and their results as they finish; start only as many as there is room for.

    Args:
        crew: The workers.
        work: The function to apply.
        pieces: Indices of variants, taken as there is room.
        stop: Event that ends the iteration; set here if the caller stops iterating.
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
