"""A few scenarios, run as one batch in this process: recorded while they run, and files in the end."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar

from rmrc.results.leaving import Leaving, OutputError, array_size, refuse_unwritable
from rmrc.results.run import Run
from rmrc.simulation.footprint import refuse_excess
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Watcher
from rmrc.study.study import Ran, Study
from rmrc.support.interruption import interruptible

OnTicks = Callable[[int], None]
R = TypeVar("R")


class Recording(Protocol):
    """A recording that grows while scenarios run; a context manager."""

    part_path: Path

    def __enter__(self) -> Self:
        """Return the recording."""

    def __exit__(self, *_: Any) -> None:
        """Close it."""

    def finish(self, markdown: str) -> None:
        """Add the figures, and make it whole."""


@dataclass(frozen=True)
class Left(Generic[R]):
    """What a batch left.

    Attributes:
        results: Of each scenario, as far as it came.
        files: Written, the recording first.
        interrupted: Whether Ctrl-C ended it.
        failures: Why other files could not be written, a line each.
    """

    results: tuple[R, ...]
    files: tuple[Path, ...]
    interrupted: bool
    failures: tuple[str, ...] = ()

    def raise_any(self) -> None:
        """Raise what a verb says on stderr.

        Raises:
            KeyboardInterrupt: There was one.
            OutputError: Files could not be written.
        """
        if self.interrupted:
            raise KeyboardInterrupt
        if self.failures:
            raise OutputError("; ".join(self.failures))


def size_of(one: Prepared) -> int:
    """Return what the columns of a scenario take [B]."""
    n = one.arm.n
    return array_size(one.reference.ticks, n, min(n, len(one.task.rows)), len(one.qpos))


class Batch(ABC, Generic[R]):
    """Scenarios that were checked and are ready to run.

    Attributes:
        name: Of what is run.
        worlds: The scenarios.
        folder: Where the files go.
    """

    # The files, the recording first, and what their names have behind that of the batch.
    kinds: ClassVar[tuple[str, ...]]
    suffix: ClassVar[str] = ""

    def __init__(
        self, study: Study, name: str, worlds: Sequence[Prepared], folder: Path, record: bool, size: int = 0
    ) -> None:
        """Refuse what does not fit into memory, and files that cannot be written.

        Args:
            study: That prepared the scenarios.
            name: Of what is run.
            worlds: The scenarios.
            folder: Where the files go; made if it is missing.
            record: Whether to write a recording.
            size: What the files take together, at least [B].

        Raises:
            ScenarioError: The scenarios do not fit into memory.
            OSError: The files cannot be written.
        """
        refuse_excess(worlds, recorded=record)
        self._study, self.name, self.worlds, self.folder, self._record = study, name, worlds, folder, record
        refuse_unwritable(self.files, size, ", or shorten target.path")

    @property
    def files(self) -> list[Path]:
        """What is left in the end."""
        return [self.file(kind) for kind in self.kinds if kind != ".rrd" or self._record]

    def file(self, kind: str) -> Path:
        """Return one of the files."""
        return self.folder / f"{self.name}{self.suffix}{kind}"

    @property
    def ticks(self) -> int:
        """How many control ticks the scenarios take together."""
        return sum(one.reference.ticks for one in self.worlds)

    def compile(self) -> None:
        """Load the compiled law, or compile it the first time, which takes seconds."""
        self._study.compile(self.worlds)

    def run(self, on_ticks: OnTicks | None = None) -> Left[R]:
        """Run all of it, to the end, to divergence or to Ctrl-C, and write the files whichever it was.

        A recording that can no longer be written, as on a full disk, does not end the run, and is given up
        where that makes room for the other files.

        Args:
            on_ticks: Called with the number of ticks of each block that was finished.
        """
        leaving, spare = Leaving(), list[Path]()
        watchers: list[Watcher] = [lambda _, part: on_ticks(len(part))] if on_ticks else []
        with interruptible() as stop, ExitStack() as stack:
            recording: Recording | None = None
            if self._record:
                recording, show = self._recording()
                part_path = stack.enter_context(recording).part_path

                def record(index: int, part: Run) -> None:
                    if not (spare or leaving.attempt(partial(show, index, part))):
                        spare.append(part_path)

                watchers.insert(0, record)
            results = self._scored(self._study.step(self.worlds, stop, watchers))
            for kinds, write in self._writers(results):
                leaving.write([self.file(kind) for kind in kinds], write, *spare)
            if recording is not None and not spare:
                markdown = self._markdown(results)
                leaving.write([self.file(".rrd")], lambda _: recording.finish(markdown))
            files = tuple(path for path in self.files if path in leaving.files)
            return Left(results, files, stop.is_set(), tuple(leaving.failures))

    @abstractmethod
    def _recording(self) -> tuple[Recording, Watcher]:
        """Return a new recording, and what writes a block of ticks to it."""

    @abstractmethod
    def _scored(self, results: Sequence[Ran]) -> tuple[R, ...]:
        """Return what is left of the results of the worlds."""

    @abstractmethod
    def _writers(self, results: Sequence[R]) -> Iterator[tuple[Sequence[str], Callable[..., None]]]:
        """Yield which other files are written together, and what takes their paths and does it."""

    @abstractmethod
    def _markdown(self, results: Sequence[R]) -> str:
        """Return the figures that a recording shows."""
