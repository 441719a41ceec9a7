"""One scenario from file to files: run it, score it, leave a recording, the arrays and a scorecard."""

import json
import platform
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rmrc.errors import ScenarioError
from rmrc.files import written_whole
from rmrc.preparation import prepare
from rmrc.run import Run
from rmrc.scenario import Scenario
from rmrc.scorecard import Outcome, Scorecard, check, refused, scorecard
from rmrc.simulation import Simulation

# What decides the bits and the looks of a result.
LIBRARIES = ("rmrc", "mujoco", "numba", "numpy", "ruckig", "rerun-sdk")


@dataclass(frozen=True)
class Ended:
    """What a job left.

    Attributes:
        run: As far as it came.
        scorecard: Its figures.
        outcomes: Of the expectations.
        files: Written, the recording first.
        interrupted: Whether Ctrl-C ended it.
    """

    run: Run
    scorecard: Scorecard
    outcomes: tuple[Outcome, ...]
    files: tuple[Path, ...]
    interrupted: bool

    @property
    def status(self) -> str:
        """`complete`, `diverged` or `interrupted`."""
        if self.interrupted:
            return "interrupted"
        return "diverged" if self.run.divergence else "complete"


class Job:
    """A scenario that was checked and is ready to run."""

    def __init__(self, scenario: Scenario, folder: Path, record: bool = True) -> None:
        """Check all that can be checked before anything moves.

        Args:
            scenario: What to run.
            folder: Where its files go; made if it is missing.
            record: Whether to write a recording.

        Raises:
            ScenarioError: All that is wrong, a line each.
            OSError: The folder cannot be written.
        """
        self.scenario, self.folder, self._record = scenario, folder, record
        self._simulation: Simulation | None = None
        self.prepared = prepare(scenario)
        self._refuse_unknown_figures()
        folder.mkdir(parents=True, exist_ok=True)

    def _refuse_unknown_figures(self) -> None:
        joints, axes = self.prepared.arm.joints, self.scenario.task.axes
        problems = refused(self.scenario.expect, joints, axes)
        if problems:
            raise ScenarioError(
                [f"{self.scenario.locate(f'expect.{name}')}: {why}" for name, why in problems.items()]
            )

    @property
    def ticks(self) -> int:
        """How many control ticks it will take."""
        return len(self.prepared.reference.time)

    def compile(self) -> Simulation:
        """Load the compiled law, or compile it the first time, which takes seconds."""
        if self._simulation is None:
            self._simulation = Simulation([self.prepared])
        return self._simulation

    def run(self, on_ticks: Callable[[int], None] | None = None) -> Ended:
        """Run to the end, to divergence or to Ctrl-C, and write the files whichever it was.

        Args:
            on_ticks: Called with the number of ticks of each block that was finished.
        """
        simulation = self.compile()
        with ExitStack() as stack:
            recorder = None
            if self._record:
                from rmrc.output.recording import Recorder  # with rerun, a third of a second

                recorder = stack.enter_context(Recorder(self._file(".rrd"), self.prepared))

            def on_block(_: int, part: Run) -> None:
                if recorder is not None:
                    recorder.write(part)
                if on_ticks is not None:
                    on_ticks(len(part))

            stop = stack.enter_context(_interruptible())
            (run,) = simulation.run(on_block, stop)
            card = scorecard(run)
            outcomes = tuple(check(card, self.scenario.expect))
            ended = Ended(run, card, outcomes, tuple(self._files()), stop.is_set())
            run.save(self._file(".npz"))
            self._save_facts(ended)
            if recorder is not None:
                from rmrc.output.tables import markdown

                recorder.finish(markdown(card, outcomes))
        return ended

    def _file(self, suffix: str) -> Path:
        return self.folder / (self.scenario.name + suffix)

    def _files(self) -> list[Path]:
        return [
            self._file(suffix) for suffix in (".rrd", ".npz", ".json") if suffix != ".rrd" or self._record
        ]

    def _save_facts(self, ended: Ended) -> None:
        facts: dict[str, Any] = {
            "name": self.scenario.name,
            "status": ended.status,
            "divergence": ended.run.divergence and asdict(ended.run.divergence),
            "scorecard": ended.scorecard.nested(),
            "expect": [outcome.facts() for outcome in ended.outcomes],
            "scenario": self.scenario.model_dump(mode="json"),
            "versions": {"python": platform.python_version()} | {lib: version(lib) for lib in LIBRARIES},
        }
        with written_whole(self._file(".json")) as temporary:
            temporary.write_text(
                json.dumps(facts, indent=2, ensure_ascii=False, allow_nan=False) + "\n", "utf-8"
            )


@contextmanager
def _interruptible() -> Iterator[threading.Event]:
    """Yield an event that Ctrl-C sets; nothing is torn out of a block or of a file that is being written."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():  # Ctrl-C is not ours to handle
        yield stop
        return
    previous = signal.signal(signal.SIGINT, lambda *_: stop.set())
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, previous)
