"""Settings on copies -> what they come to: prepared, stepped in batches on all cores, measured."""

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Divergence
from rmrc.results.scorecard import Scorecard
from rmrc.scenario import Change, Variant, changes_of
from rmrc.simulation.prepare import Prepared
from rmrc.study.executors import threads
from rmrc.study.study import Listed, OnRuns, Result, Study
from rmrc.tuning.front import Point
from rmrc.tuning.space import Setting

# How far above a limit a measured peak may be: the law keeps commands within it, and servos overshoot.
TOLERANCE = 0.01

# A batch is a second of one core at most, so that Ctrl-C and the progress bar need not wait.
_TICKS = 200_000
# Of the jobs that are run together, each thread has so many batches, so that none waits long for another.
_PARTS = 4


class Outcome(NamedTuple):
    """What a run came to.

    Attributes:
        error: The larger of position_error.max and task.length · orientation_error.max [m].
        peak_rate: The largest of the joints' peak rates, of those that slide over task.length [rad/s].
        time: duration [s].
        completed: Share of the path.
        excess: Share by which what is allowed is exceeded most; not positive: it is kept.
        missed: What that is, in words.
    """

    error: float
    peak_rate: float
    time: float
    completed: float
    excess: float
    missed: str

    @property
    def point(self) -> Point:
        """What counts on a front."""
        return Point(self.peak_rate, self.error, self.time)


def worst(outcomes: Sequence[Outcome]) -> Outcome:
    """Return the worst of each of several runs."""
    error, peak_rate, time = (max(values) for values in zip(*(one[:3] for one in outcomes), strict=True))
    tightest = max(outcomes, key=lambda one: one.excess)
    completed = min(one.completed for one in outcomes)
    return Outcome(error, peak_rate, time, completed, tightest.excess, tightest.missed)


@dataclass(frozen=True)
class Limits:
    """What is allowed.

    Attributes:
        joints: Names.
        units: `rad` or `m`.
        scale: 1, or task.length of a joint that slides.
        length: task.length [m].
        rate: Largest rate of each joint; infinite for none.
        acceleration: Largest acceleration of each.
    """

    joints: tuple[str, ...]
    units: tuple[str, ...]
    scale: NDArray[np.float64]
    length: float
    rate: NDArray[np.float64]
    acceleration: NDArray[np.float64]

    @classmethod
    def of(cls, prepared: Prepared) -> "Limits":
        """Return the limits of a scenario, the model's own where it has none."""
        arm, length, law = prepared.arm, prepared.task.length, prepared.law
        scale = np.where(arm.is_slide, length, 1.0)
        return cls(arm.joints, tuple(arm.units), scale, length, law.rate_limit, law.acceleration_limit)

    def measure(self, card: Scorecard, divergence: Divergence | None, longest: float) -> Outcome:
        """Return what a run came to.

        Args:
            card: Its figures.
            divergence: Where it diverged.
            longest: Time that it may take [s].
        """

        def figure(name: str) -> float:
            return float(card[name].value) if name in card else 0.0

        error = max(figure("position_error.max"), self.length * figure("orientation_error.max"))
        rates = np.array([figure(f"joint_rate.{joint}.peak") for joint in self.joints])
        found = [(-1.0, "")]
        for what, limits, unit in (("rate", self.rate, "/s"), ("acceleration", self.acceleration, "/s²")):
            for joint, limit, own in zip(self.joints, limits, self.units, strict=True):
                peak = figure(f"joint_{what}.{joint}.peak")
                over = peak / float(limit * (1.0 + TOLERANCE)) - 1.0
                found.append(
                    (over, f"the {what} of {joint} is {peak:.4g} {own}{unit}, and {limit:.4g} is allowed")
                )
        time, completed = figure("duration"), figure("completed")
        found.append((time / longest - 1.0 - 1e-9, f"it takes {time:.4g} s, and {longest:.4g} is allowed"))
        if completed != 1.0:
            over = 1.0 / completed - 1.0 if completed > 0.0 else math.inf
            found.append((over, f"{completed:.0%} of the path is done in {time:.4g} s"))
        if divergence is not None:
            found.append((math.inf, f"it {divergence}"))
        excess, missed = max(found, key=lambda pair: pair[0])
        return Outcome(error, float((rates / self.scale).max()), time, completed, excess, missed)


@dataclass
class _Outcomes:
    """What runs of a study come to.

    Attributes:
        pieces: Of the runs.
        limits: What is allowed.
        longest: Time that each may take [s].
        on_runs: Called with the number of runs of each piece that was done.
        found: By index; None for a run that was interrupted.
    """

    pieces: Sequence[range]
    limits: Limits
    longest: Sequence[float]
    on_runs: OnRuns
    found: list[Outcome | None]

    def reduce(self, results: Sequence[Result]) -> list[Outcome]:
        return [
            self.limits.measure(one.scorecard, one.divergence, self.longest[one.index]) for one in results
        ]

    def missing(self) -> Sequence[range]:
        return self.pieces

    def keep(self, piece: range, payload: list[Outcome]) -> None:
        self.found[piece.start : piece.stop] = payload
        self.on_runs(len(piece))


class Trials:
    """What runs settings on copies; what comes out depends on neither the threads nor the batches."""

    def __init__(
        self,
        study: Study,
        copies: Sequence[Variant],
        threads: int,
        stop: threading.Event,
        on_runs: OnRuns | None,
    ) -> None:
        """Keep what all trials share; `planned` has the times of the copies' paths [s].

        Args:
            study: Of the scenario.
            copies: The scenario itself first; all can be prepared.
            threads: How many batches are run at a time.
            stop: Once it is set, the runs end.
            on_runs: Called with the number of runs of each batch that was done.
        """
        self._study, self._copies, self._threads, self._stop = study, copies, threads, stop
        self._on_runs = on_runs
        nominal = study.prepare()
        self.limits, self._control = Limits.of(nominal), nominal.scenario.control
        references = [study.prepare(copy.changes).reference for copy in copies]
        self.planned = [one.period * one.ticks for one in references]
        self._longest = [math.inf] * len(copies)
        self._ticks = nominal.reference.ticks
        self.done = 0

    @property
    def is_stopped(self) -> bool:
        """Whether the runs were ended from outside."""
        return self._stop.is_set()

    def allow(self, times: Sequence[float]) -> None:
        """Say how long a run of each copy may take from now on [s]."""
        self._longest = list(times)

    def run(self, jobs: Sequence[tuple[Setting, int]]) -> list[Outcome | None]:
        """Return what settings come to on copies, None for those that were interrupted.

        Args:
            jobs: Setting, and index of the copy.
        """
        most = max(1, _TICKS // self._ticks)
        size = max(1, min(most, -(-len(jobs) // (_PARTS * self._threads))))
        pieces = [range(first, min(first + size, len(jobs))) for first in range(0, len(jobs), size)]
        longest = [self._longest[copy] for _, copy in jobs]
        into = _Outcomes(pieces, self.limits, longest, self._count, [None] * len(jobs))
        variants = Listed([Variant("", self._changes(*job)) for job in jobs])
        with threads(self._threads, self._study) as crew:
            self._study.run(variants, crew, into, self._stop)
        return into.found

    def _count(self, runs: int) -> None:
        self.done += runs
        if self._on_runs is not None:
            self._on_runs(runs)

    def _changes(self, setting: Setting, copy: int) -> tuple[Change, ...]:
        """Return what makes a run; a slow one ends when it has taken longer than allowed."""
        changes = (*setting.changes, *self._copies[copy].changes)
        if setting.structure.at_singularity != "slow" or self._longest[copy] == math.inf:
            return changes
        share = self._longest[copy] / self.planned[copy]
        longest = min(max(share, 1.0), self._control.slow.longest)
        return (*changes, *changes_of({"control.slow.longest": longest}))
