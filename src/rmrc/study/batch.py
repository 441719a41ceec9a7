"""Run a few scenarios in this process, record them, and write files at the end."""

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
    """A recording that grows during the run; a context manager."""

    part_path: Path

    def __enter__(self) -> Self:
        """Return the recording."""

    def __exit__(self, *_: Any) -> None:
        """Close it."""

    def finish(self, markdown: str) -> None:
        """Add the metrics, and complete the recording."""


@dataclass(frozen=True)
class Left(Generic[R]):
    """The output of a batch.

    Attributes:
        results: Results of each scenario, as far as it came.
        files: Written files, the recording first.
        interrupted: Whether Ctrl-C ended the batch.
        failures: Reasons why other files could not be written, one line each.
    """

    results: tuple[R, ...]
    files: tuple[Path, ...]
    interrupted: bool
    failures: tuple[str, ...] = ()

    def raise_any(self) -> None:
        """Raise the errors that a verb prints on stderr.

        Raises:
            KeyboardInterrupt: Ctrl-C ended the batch.
            OutputError: Files could not be written.
        """
        if self.interrupted:
            raise KeyboardInterrupt
        if self.failures:
            raise OutputError("; ".join(self.failures))


def size_of(one: Prepared) -> int:
    """Return the memory for the columns of a scenario [B]."""
    n = one.arm.n
    return array_size(one.reference.ticks, n, min(n, len(one.task.rows)), len(one.qpos))


class Batch(ABC, Generic[R]):
    """Validated scenarios, ready to run.

    Attributes:
        name: Name of the batch.
        worlds: The scenarios.
        folder: Where the files go.
    """

    # The files, the recording first, and the ends of their names after that of the batch.
    kinds: ClassVar[tuple[str, ...]]
    suffix: ClassVar[str] = ""

    def __init__(
        self, study: Study, name: str, worlds: Sequence[Prepared], folder: Path, record: bool, size: int = 0
    ) -> None:
        """Refuse scenarios that do not fit into memory, and files that cannot be written.

        Args:
            study: Study that prepared the scenarios.
            name: Name of the batch.
            worlds: The scenarios.
            folder: Folder for the files; created if missing.
            record: Whether to write a recording.
            size: Lower bound of the total file size [B].

        Raises:
            ScenarioError: The scenarios do not fit into memory.
            OSError: The files cannot be written.
        """
        refuse_excess(worlds, recorded=record)
        self._study, self.name, self.worlds, self.folder, self._record = study, name, worlds, folder, record
        refuse_unwritable(self.files, size, ", or shorten target.path")

    @property
    def files(self) -> list[Path]:
        """Return the output of the batch."""
        return [self.file(kind) for kind in self.kinds if kind != ".rrd" or self._record]

    def file(self, kind: str) -> Path:
        """Return one of the files."""
        return self.folder / f"{self.name}{self.suffix}{kind}"

    @property
    def ticks(self) -> int:
        """Total number of control ticks of the scenarios."""
        return sum(one.reference.ticks for one in self.worlds)

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        self._study.compile(self.worlds)

    def run(self, on_ticks: OnTicks | None = None) -> Left[R]:
        """Run to the end, to divergence or to Ctrl-C, and write the files in each case.

        A failing recording, as on a full disk, does not end the run; it is deleted if the other files need
        the space.

        Args:
            on_ticks: Called after each block with its number of ticks.
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
                        part_path.unlink(missing_ok=True)  # so that the arrays have its room

                watchers.insert(0, record)
            results = self._scored(self._study.step(self.worlds, stop, watchers))
            for kinds, write in self._writers(results):
                leaving.write([self.file(kind) for kind in kinds], write)
            if recording is not None and not spare:
                markdown = self._markdown(results)
                leaving.write([self.file(".rrd")], lambda _: recording.finish(markdown))
            files = tuple(path for path in self.files if path in leaving.files)
            return Left(results, files, stop.is_set(), tuple(leaving.failures))

    @abstractmethod
    def _recording(self) -> tuple[Recording, Watcher]:
        """Return a new recording, and the function that writes a block of ticks to it."""

    @abstractmethod
    def _scored(self, results: Sequence[Ran]) -> tuple[R, ...]:
        """Return the output for the results of the worlds."""

    @abstractmethod
    def _writers(self, results: Sequence[R]) -> Iterator[tuple[Sequence[str], Callable[..., None]]]:
        """Yield groups of other files, each with the function that writes them."""

    @abstractmethod
    def _markdown(self, results: Sequence[R]) -> str:
        """Return the metrics that a recording shows."""
