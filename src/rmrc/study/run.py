"""One scenario from file to files: run it, score it, leave a recording, the arrays and a scorecard."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.leaving import array_size
from rmrc.results.run import Run
from rmrc.results.scorecard import Outcome, Scorecard, check, scorecard
from rmrc.scenario import Scenario
from rmrc.study.batch import Batch, OnTicks, Recording
from rmrc.study.study import Study


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


class Job(Batch):
    """A scenario that was checked and is ready to run."""

    kinds = (".rrd", ".npz", ".json")

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
        self.scenario, self.prepared = scenario, Study(scenario).prepare()
        n, ticks = self.prepared.arm.n, self.prepared.reference.ticks
        size = array_size(ticks, n, min(n, len(scenario.task.axes)))
        super().__init__(scenario.name, [self.prepared], folder, record, size)

    def _recording(self) -> tuple[Recording, Callable[[int, Run], None]]:
        with unlogged():
            from rmrc.recording.single import Recorder  # with rerun, a third of a second

        recorder = Recorder(self.file(".rrd"), self.prepared)
        return recorder, lambda _, part: recorder.write(part)

    def run(self, on_ticks: OnTicks | None = None) -> Ended:
        """Run to the end, to divergence or to Ctrl-C, and write the files whichever it was.

        Args:
            on_ticks: Called with the number of ticks of each block that was finished.
        """
        from rmrc.show.tables import markdown

        with self._ran(on_ticks) as ran:
            (run,) = ran.runs
            card = scorecard(run)
            outcomes = tuple(check(card, self.scenario.expect))
            ran.write(".npz", run.save)
            status = facts.status_of(run.divergence, run.is_complete, ran.interrupted)
            known = facts.run_facts(status, run, card, outcomes, self.scenario, self.prepared.arm.notes)
            ran.write(".json", lambda path: facts.save(path, {"name": self.name, **known}))
            ran.finish(lambda: markdown(card, outcomes))
        return Ended(run, card, outcomes, ran.files, ran.interrupted, ran.failures)
