"""One scenario from file to files: run it, score it, leave a recording, the arrays and a scorecard."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.leaving import Leaving, array_size, refuse_unwritable
from rmrc.results.run import Run
from rmrc.results.scorecard import Outcome, Scorecard, check, refuse_unknown, scorecard
from rmrc.scenario import Scenario
from rmrc.simulation.footprint import refuse_excess
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.interruption import interruptible


@dataclass(frozen=True)
class Ended:
    """What a job left.

    Attributes:
        run: As far as it came.
        scorecard: Its figures.
        outcomes: Of the expectations.
        files: Written, the recording first.
        interrupted: Whether Ctrl-C ended it.
        failures: Why other files could not be written, a line each.
    """

    run: Run
    scorecard: Scorecard
    outcomes: tuple[Outcome, ...]
    files: tuple[Path, ...]
    interrupted: bool
    failures: tuple[str, ...] = ()

    @property
    def status(self) -> str:
        """How the run ended."""
        return facts.status_of(self.run.divergence, self.run.is_complete, self.interrupted)


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
            OSError: The files cannot be written.
        """
        self.scenario, self.folder, self._record = scenario, folder, record
        self._simulation: Simulation | None = None
        self.prepared = prepare(scenario)
        refuse_unknown(scenario, self.prepared.arm.joints)
        refuse_excess([self.prepared], recorded=record)
        arm, reference = self.prepared.arm, self.prepared.reference
        size = array_size(reference.ticks, arm.n, min(arm.n, len(scenario.task.axes)))
        refuse_unwritable(self._files(), size, ", or shorten target.path")

    @property
    def ticks(self) -> int:
        """How many control ticks it will take."""
        return self.prepared.reference.ticks

    def compile(self) -> Simulation:
        """Load the compiled law, or compile it the first time, which takes seconds."""
        if self._simulation is None:
            self._simulation = Simulation([self.prepared])
        return self._simulation

    def run(self, on_ticks: Callable[[int], None] | None = None) -> Ended:
        """Run to the end, to divergence or to Ctrl-C, and write the files whichever it was.

        A recording that can no longer be written, as on a full disk, does not end the run.

        Args:
            on_ticks: Called with the number of ticks of each block that was finished.
        """
        simulation, leaving = self.compile(), Leaving()
        recorder, failed = None, False
        with interruptible() as stop, ExitStack() as stack:
            if self._record:
                with unlogged():
                    from rmrc.recording.single import Recorder  # with rerun, a third of a second

                recorder = stack.enter_context(Recorder(self._file(".rrd"), self.prepared))

            def on_block(_: int, part: Run) -> None:
                nonlocal failed
                if recorder is not None and not failed:
                    failed = not leaving.attempt(partial(recorder.write, part))
                if on_ticks is not None:
                    on_ticks(len(part))

            (run,) = simulation.run(on_block, stop)
            card = scorecard(run)
            outcomes = tuple(check(card, self.scenario.expect))
            part_path = recorder.part_path if recorder is not None and failed else None
            leaving.write(self._file(".npz"), partial(run.save, self._file(".npz")), part_path)
            status = facts.status_of(run.divergence, run.is_complete, stop.is_set())
            leaving.write(
                self._file(".json"), partial(self._save_facts, status, run, card, outcomes), part_path
            )
            if recorder is not None and not failed:
                from rmrc.show.tables import markdown

                leaving.write(self._file(".rrd"), partial(recorder.finish, markdown(card, outcomes)))
        files = tuple(path for path in self._files() if path in leaving.files)
        return Ended(run, card, outcomes, files, stop.is_set(), tuple(leaving.failures))

    def _file(self, suffix: str) -> Path:
        return self.folder / (self.scenario.name + suffix)

    def _files(self) -> list[Path]:
        return [
            self._file(suffix) for suffix in (".rrd", ".npz", ".json") if suffix != ".rrd" or self._record
        ]

    def _save_facts(self, status: str, run: Run, card: Scorecard, outcomes: tuple[Outcome, ...]) -> None:
        known = facts.run_facts(status, run, card, outcomes, self.scenario)
        facts.save(self._file(".json"), {"name": self.scenario.name, **known})
