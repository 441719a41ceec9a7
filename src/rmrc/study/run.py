"""One scenario from file to files: run it, score it, leave a recording, the arrays and a scorecard."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.leaving import array_size
from rmrc.scenario import Source
from rmrc.simulation.simulation import Watcher
from rmrc.study.batch import Batch, Recording
from rmrc.study.study import Ran, Study


class Job(Batch[Ran]):
    """A scenario that was checked and is ready to run."""

    kinds = (".rrd", ".npz", ".json")

    def __init__(self, source: Source, folder: Path, record: bool = True) -> None:
        """Check all that can be checked before anything moves.

        Args:
            source: The scenario, its file, or the name of a shipped one.
            folder: Where its files go; made if it is missing.
            record: Whether to write a recording.

        Raises:
            ScenarioError: All that is wrong, a line each.
            OSError: The files cannot be written.
        """
        study = Study(source)
        self.prepared = study.prepare()
        scenario, n, ticks = self.prepared.scenario, self.prepared.arm.n, self.prepared.reference.ticks
        size = array_size(ticks, n, min(n, len(scenario.task.axes)), len(self.prepared.qpos))
        super().__init__(study, scenario.name, [self.prepared], folder, record, size)

    def _recording(self) -> tuple[Recording, Watcher]:
        with unlogged():
            from rmrc.recording.single import Recorder  # with rerun, a third of a second

        recorder = Recorder(self.file(".rrd"), self.prepared)
        return recorder, lambda _, part: recorder.write(part)

    def _scored(self, result: Ran) -> Ran:
        return result

    def _writers(self, results: Sequence[Ran]) -> Iterator[tuple[Sequence[str], Callable[..., None]]]:
        (one,) = results
        yield [".npz"], one.run.save
        yield [".json"], lambda path: facts.save(path, {"name": self.name, **one.facts()})

    def _markdown(self, results: Sequence[Ran]) -> str:
        from rmrc.show.tables import markdown

        (one,) = results
        return markdown(one.scorecard, one.outcomes)
