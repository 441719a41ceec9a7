"""What a scenario answers to a setting: its run, to the bit that of `rmrc run`, and what is seen of it."""

import threading
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rmrc.explore.controls import Control, Values, controls
from rmrc.recording.scene import Frames, Scene
from rmrc.results.run import Run
from rmrc.scenario import Source, changes_of
from rmrc.simulation.prepare import Prepared
from rmrc.study.study import Ran, Study
from rmrc.support.errors import QuestionError

# Instants of a run that are shown: a film of 60 frames a second for five seconds.
INSTANTS = 300


@dataclass(frozen=True, eq=False)
class Answer:
    """What came of a setting.

    Attributes:
        values: What differs from the scenario as it is written.
        ran: The run with its figures.
    """

    values: Values
    ran: Ran

    @cached_property
    def scene(self) -> Scene:
        """The arm and the task; made when it is drawn, as the plots come first."""
        return Scene(self.prepared)

    @cached_property
    def rows(self) -> NDArray[np.int64]:
        """Ticks that are shown, (F,)."""
        return np.unique(np.linspace(0, len(self.run) - 1, INSTANTS).round().astype(np.int64))

    @cached_property
    def frames(self) -> Frames:
        """What is seen at these."""
        return self.scene.frames(self.run, self.rows)

    @property
    def run(self) -> Run:
        """All its ticks."""
        return self.ran.run

    @property
    def prepared(self) -> Prepared:
        """What was run."""
        return self.ran.prepared

    @property
    def end(self) -> float:
        """Time of its last tick [s]."""
        return float(self.run["time"][-1])

    def at(self, time: float) -> int:
        """Return which of the shown instants is nearest before a time [s]."""
        shown = self.run["time"][self.rows]
        return max(0, int(np.searchsorted(shown, time + 0.5 * self.run.period, side="right")) - 1)


class Explored:
    """A scenario that is asked again and again; for one thread at a time.

    Attributes:
        written: What it answers as it is written.
        controls: What can be changed.
    """

    def __init__(self, source: Source) -> None:
        """Run it once.

        Args:
            source: The scenario, its file, or the name of a shipped one.

        Raises:
            ScenarioError: All that is wrong with it.
            QuestionError: It diverges before its first tick.
        """
        self._study = Study(source)
        written = self.answer({})
        if written is None:  # pragma: no cover - nobody stops it
            raise AssertionError
        self.written = written
        self.controls: tuple[Control, ...] = controls(self.written.prepared, self.written.run)

    def answer(self, values: Values, stop: threading.Event | None = None) -> Answer | None:
        """Return what comes of a setting, or None if it was stopped.

        Args:
            values: What differs from the scenario as it is written.
            stop: Once it is set, the run ends.

        Raises:
            ScenarioError: All that is wrong with the setting.
            QuestionError: It diverges before its first tick.
        """
        prepared = self._study.prepare(changes_of(values))
        (ran,) = self._study.step([prepared], stop)
        if stop is not None and stop.is_set():
            return None
        if not len(ran.run):
            raise QuestionError(f"{ran.run.name} {ran.run.divergence}")
        return Answer(dict(values), ran)
