"""A few scenarios, run as one batch in this process: recorded while they run, and files in the end."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, ClassVar, Protocol

from rmrc.results.leaving import Leaving, refuse_unwritable
from rmrc.results.run import Run
from rmrc.simulation.footprint import refuse_excess
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.support.interruption import interruptible

OnTicks = Callable[[int], None]


class Recording(Protocol):
    """A recording that grows while scenarios run; a context manager."""

    part_path: Path

    def __enter__(self) -> Any:
        """Return the recording."""

    def __exit__(self, *_: Any) -> None:
        """Close it."""

    def finish(self, scorecard_markdown: str) -> None:
        """Add the figures, and make it whole."""


class Batch(ABC):
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
        self, name: str, worlds: Sequence[Prepared], folder: Path, record: bool, size: int = 0
    ) -> None:
        """Refuse what does not fit into memory, and files that cannot be written.

        Args:
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
        self.name, self.worlds, self.folder, self._record = name, worlds, folder, record
        self._simulation: Simulation | None = None
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

    def compile(self) -> Simulation:
        """Load the compiled law, or compile it the first time, which takes seconds."""
        if self._simulation is None:
            self._simulation = Simulation(self.worlds)
        return self._simulation

    @abstractmethod
    def _recording(self) -> tuple[Recording, Callable[[int, Run], None]]:
        """Return a new recording, and what writes a block of ticks of a scenario to it."""

    @contextmanager
    def _ran(self, on_ticks: OnTicks | None) -> Iterator["Ran"]:
        """Run all of it, to the end, to divergence or to Ctrl-C, and yield what came of it, to be written.

        A recording that can no longer be written, as on a full disk, does not end the run.

        Args:
            on_ticks: Called with the number of ticks of each block that was finished.
        """
        simulation = self.compile()
        with interruptible() as stop, ExitStack() as stack:
            ran = Ran(self, stop)
            if self._record:
                recording, show = self._recording()
                ran.recording = stack.enter_context(recording)

            def on_block(index: int, part: Run) -> None:
                if ran.is_recorded:
                    ran.is_broken = not ran.leaving.attempt(lambda: show(index, part))
                if on_ticks is not None:
                    on_ticks(len(part))

            ran.runs = simulation.run(on_block, stop)
            yield ran


class Ran:
    """What came of a batch, and what it leaves.

    Attributes:
        runs: As far as they came.
        recording: That grew meanwhile, if there is one.
        is_broken: Whether it could not be written to its end.
        leaving: Writes the files.
    """

    def __init__(self, batch: Batch, stop: threading.Event) -> None:
        """Begin with nothing."""
        self._batch, self._stop = batch, stop
        self.runs = list[Run]()
        self.recording: Recording | None = None
        self.is_broken, self.leaving = False, Leaving()

    @property
    def is_recorded(self) -> bool:
        """Whether there is a recording that can be written."""
        return self.recording is not None and not self.is_broken

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C came."""
        return self._stop.is_set()

    @property
    def files(self) -> tuple[Path, ...]:
        """What was written, the recording first."""
        return tuple(path for path in self._batch.files if path in self.leaving.files)

    @property
    def failures(self) -> tuple[str, ...]:
        """Why other files could not be written, a line each."""
        return tuple(self.leaving.failures)

    def write(self, kind: str, write: Callable[[Path], None]) -> None:
        """Write one of the files; a broken recording is given up if that makes room."""
        path, recording = self._batch.file(kind), self.recording
        spare = recording.part_path if recording is not None and self.is_broken else None
        self.leaving.write(path, lambda: write(path), spare)

    def finish(self, markdown: Callable[[], str]) -> None:
        """Add the figures to the recording, which is whole then.

        Args:
            markdown: Returns them.
        """
        recording = self.recording
        if recording is not None and not self.is_broken:
            text = markdown()
            self.leaving.write(self._batch.file(".rrd"), lambda: recording.finish(text))
