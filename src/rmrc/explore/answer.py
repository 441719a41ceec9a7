"""The answer of a scenario to a setting: its view and its run, which equals that of `rmrc run` to the bit."""

import threading
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rmrc.explore.controls import Control, Values, controls
from rmrc.recording.scene import Frames, Scene
from rmrc.results.run import Run
from rmrc.scenario import Source, changes_of
from rmrc.simulation.prepare import Prepared
from rmrc.study.study import Study
from rmrc.support.errors import QuestionError, ScenarioError

# Instants of a run that are shown: 60 frames per second for five seconds.
INSTANTS = 300


@dataclass(frozen=True, eq=False)
class Answer:
    """The result of a setting.

    Attributes:
        values: The changed keys, with their values.
        prepared: The prepared scenario of the run.
        run: The run, with all ticks.
        like: An answer whose arm looks the same; None: there is none.
        instants: Largest number of instants that are shown.
    """

    values: Values
    prepared: Prepared
    run: Run
    like: "Answer | None" = None
    instants: int = INSTANTS

    @cached_property
    def scene(self) -> Scene:
        """The arm and the task; built at the first drawing, because the plots come first."""
        return Scene(self.prepared) if self.like is None else self.like.scene

    @cached_property
    def rows(self) -> NDArray[np.int64]:
        """The shown ticks, (F,)."""
        return np.unique(np.linspace(0, len(self.run) - 1, self.instants).round().astype(np.int64))

    @cached_property
    def frames(self) -> Frames:
        """The poses and marks at the shown ticks."""
        return self.scene.frames(self.run, self.rows)

    @property
    def end(self) -> float:
        """Time of the last tick [s]."""
        return float(self.run["time"][-1])

    def at(self, time: float) -> int:
        """Return the index of the last shown instant before a time [s]."""
        shown = self.run["time"][self.rows]
        return max(0, int(np.searchsorted(shown, time + 0.5 * self.run.period, side="right")) - 1)


class Explored:
    """A scenario that runs with many settings; for one thread at a time.

    Attributes:
        written: The answer to the scenario as written.
        controls: The keys that the page can change.
    """

    def __init__(self, source: Source) -> None:
        """Run the scenario once.

        Args:
            source: The scenario, its file, or the name of a shipped one.

        Raises:
            ScenarioError: The scenario is invalid; lists all faults.
            QuestionError: The run diverges before its first tick.
        """
        self._study = Study(source)
        written = self.answer({})
        if written is None:  # pragma: no cover - nothing stops it
            raise AssertionError
        self.written = written
        self.controls: tuple[Control, ...] = controls(self.written.prepared, self.written.run)

    def answer(self, values: Values, stop: threading.Event | None = None) -> Answer | None:
        """Return the answer to a setting, or None if the run was stopped.

        Args:
            values: The changed keys, with their values.
            stop: Ends the run once it is set.

        Raises:
            ScenarioError: The setting is invalid; lists all faults.
            QuestionError: The run diverges before its first tick.
        """
        prepared = self._study.prepare(changes_of(values))
        (ran,) = self._study.step([prepared], stop)
        if stop is not None and stop.is_set():
            return None
        if not len(ran.run):
            raise QuestionError(f"{ran.run.name} {ran.run.divergence}")
        return Answer(dict(values), ran.prepared, ran.run)

    def prepared(self, values: Values, period: float) -> Prepared:
        """Return the prepared scenario of a setting, with a control period.

        Args:
            values: The changed keys, with their values.
            period: The control period [s]; the scenario's own if that is longer, or if nothing else fits.

        Raises:
            ScenarioError: The setting is invalid; lists all faults.
        """
        changes = changes_of(values)
        if self.written.prepared.scenario.control.period < period:
            with suppress(ScenarioError):
                return self._study.prepare([*changes, *changes_of({"control.period": period})])
        return self._study.prepare(changes)
