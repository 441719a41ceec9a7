"""One scenario from file to files: run it, score it, leave a recording, the arrays and a scorecard."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from rmrc import facts
from rmrc.interruption import interruptible
from rmrc.preparation import prepare
from rmrc.run import Run
from rmrc.scenario import Scenario
from rmrc.scorecard import Outcome, Scorecard, check, refuse_unknown, scorecard
from rmrc.simulation import Simulation


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
        """How the run ended."""
        return facts.status_of(self.run, self.interrupted)


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
        refuse_unknown(scenario, self.prepared.arm.joints)
        folder.mkdir(parents=True, exist_ok=True)

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

            stop = stack.enter_context(interruptible())
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
        known = facts.run_facts(ended.status, ended.run, ended.scorecard, ended.outcomes, self.scenario)
        facts.save(self._file(".json"), {"name": self.scenario.name, **known})
