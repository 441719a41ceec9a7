"""Run one scenario: score it, and write a recording, the arrays and a scorecard."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.scorecard import Scorecard
from rmrc.scenario import Source
from rmrc.simulation.simulation import Watcher
from rmrc.study.batch import Batch, Recording, size_of
from rmrc.study.study import Ran, Study


@dataclass(frozen=True, eq=False)
class Scored(Ran):
    """Result of a scenario, with its baseline.

    Attributes:
        baseline: Result of the baseline, if there is one.
    """

    baseline: Ran | None

    @property
    def beside(self) -> Scorecard | None:
        """The metrics of its baseline."""
        return None if self.baseline is None else self.baseline.scorecard

    def facts(self) -> dict[str, Any]:
        """Return the facts about both, ready for strict JSON."""
        found = {"verdict": self.run.verdict, **super().facts()}
        if self.baseline is None:
            return found
        its = {name: fact for name, fact in self.baseline.facts().items() if name != "expect"}
        return found | {"baseline": {"changes": self.prepared.scenario.baseline, **its}}


def beside(results: Sequence[Ran]) -> tuple[Scored, ...]:
    """Return the result of a scenario, with that of its baseline if there is one."""
    one, baseline = (*results, None)[:2]
    assert one is not None
    run = one.run if baseline is None else replace(one.run, baseline=baseline.run)
    return (Scored(**vars(one) | {"run": run}, baseline=baseline),)


class Job(Batch[Scored]):
    """A validated scenario, ready to run."""

    kinds = (".rrd", ".npz", ".json")

    def __init__(self, source: Source, folder: Path, record: bool = True) -> None:
        """Check all that can be checked before anything moves.

        Args:
            source: The scenario, its file, or the name of a shipped one.
            folder: Folder for its files; created if missing.
            record: Whether to write a recording.

        Raises:
            ScenarioError: Lists all problems, one line each.
            OSError: The files cannot be written.
        """
        study = Study(source)
        worlds = study.prepare_beside()
        self.prepared = worlds[0]
        super().__init__(
            study, self.prepared.scenario.name, worlds, folder, record, sum(map(size_of, worlds))
        )

    def _recording(self) -> tuple[Recording, Watcher]:
        with unlogged():
            from rmrc.recording.single import Recorder  # imports rerun, a third of a second

        recorder = Recorder(self.file(".rrd"), *self.worlds)
        writers = recorder.write, recorder.write_baseline
        return recorder, lambda index, part: writers[index](part)

    def _scored(self, results: Sequence[Ran]) -> tuple[Scored, ...]:
        return beside(results)

    def _writers(self, results: Sequence[Scored]) -> Iterator[tuple[Sequence[str], Callable[..., None]]]:
        (one,) = results
        yield [".npz"], one.run.save
        yield [".json"], lambda path: facts.save(path, {"name": self.name, **one.facts()})

    def _markdown(self, results: Sequence[Scored]) -> str:
        from rmrc.show.tables import markdown

        (one,) = results
        return markdown(one.scorecard, one.outcomes, one.beside)
