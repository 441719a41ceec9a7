"""Trials: settings that run on worlds, measured against the limits, and the Pareto front of them."""

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.results.columns import Divergence
from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard
from rmrc.scenario import Change, Variant, changes_of
from rmrc.scenario.choices import POLICIES
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.margins import bears
from rmrc.study.study import Study
from rmrc.support.spatial import AXES
from rmrc.tuning.robot import lengths_of
from rmrc.tuning.space import Setting


class Point(NamedTuple):
    """Objectives of a setting: less is better.

    Attributes:
        peak_rate: [rad/s].
        error: [m].
        time: [s]; counts only between settings that are equal in both.
    """

    peak_rate: float
    error: float
    time: float


def dominates(a: Point, b: Point) -> bool:
    """Return whether a is better than b in one and worse in none; of equals, the shorter is better.

    Example:
        >>> dominates(Point(1.0, 2.0, 9.0), Point(1.0, 3.0, 5.0)), dominates(Point(1, 2, 9), Point(2, 1, 9))
        (True, False)
    """
    if a[:2] == b[:2]:
        return a.time < b.time
    return a.peak_rate <= b.peak_rate and a.error <= b.error


def front(points: Sequence[Point]) -> list[int]:
    """Return the indices of the nondominated points, by rising peak rate; equal points are all included.

    Example:
        >>> front([Point(1, 5, 0), Point(2, 2, 0), Point(3, 3, 0), Point(4, 1, 0)])
        [0, 1, 3]
    """
    chosen = list[int]()
    for i in sorted(range(len(points)), key=lambda i: (points[i], i)):
        # of those before it, the last has the smallest error
        if not chosen or not dominates(points[chosen[-1]], points[i]):
            chosen.append(i)
    return chosen


# Relative excess of a measured peak over a limit that is allowed: the law keeps commands within it, and
# servos overshoot.
TOLERANCE = 0.01
# Changes of a commanded acceleration's sign per second: a path with corners and limits has some, and a loop
# that rings 15 and more.
CHATTER = 5.0
# Share of the time in which actuators may be at their limit, for starting.
SATURATED = 0.01

OnRuns = Callable[[int], None]


class Outcome(NamedTuple):
    """The result of a run.

    Attributes:
        error: The larger of position_error.max and task.length · orientation_error.max [m].
        peak_rate: The largest of the joints' peak rates, of those that slide over task.length [rad/s].
        time: duration [s].
        completed: Share of the path.
        excess: Largest relative excess over a limit; not positive: all limits are kept.
        missed: The limit with the largest excess, in words.
        ended: Whether it was ended because it could no longer count: all values are those until then.
        condition: Largest κ.
        end: Errors at the end: position_error.end, and task.length · orientation_error.end [m].
    """

    error: float
    peak_rate: float
    time: float
    completed: float
    excess: float
    missed: str
    ended: bool = False
    condition: float = 0.0
    end: tuple[float, float] = (0.0, 0.0)

    @property
    def point(self) -> Point:
        """The objectives on a Pareto front."""
        return Point(self.peak_rate, self.error, self.time)


def worst(outcomes: Sequence[Outcome]) -> Outcome:
    """Return the worst of each of several runs."""
    largest = ("error", "peak_rate", "time", "ended", "condition")
    values = {name: max(getattr(outcome, name) for outcome in outcomes) for name in largest}
    completed = min(outcome.completed for outcome in outcomes)
    return max(outcomes, key=lambda outcome: outcome.excess)._replace(completed=completed, **values)


@dataclass(frozen=True)
class Limits:
    """The limits of a run.

    Attributes:
        joints: Names.
        scale: 1, or task.length of a joint that slides.
        length: task.length [m].
        rate: Largest rate of each joint; infinite for none.
        acceleration: Largest acceleration of each.
        jerk: Largest commanded jerk of each; compared with that of the joint with the largest.
    """

    joints: tuple[str, ...]
    scale: NDArray[np.float64]
    length: float
    rate: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    jerk: NDArray[np.float64]

    @classmethod
    def of(cls, prepared: Prepared) -> "Limits":
        """Return the limits of a scenario, the model's own where it has none."""
        arm, law = prepared.arm, prepared.law
        jerk = np.broadcast_to(prepared.scenario.control.limits.jerk or math.inf, arm.n)
        limits = law.rate_limit, law.acceleration_limit, jerk
        return cls(arm.joints, lengths_of(prepared), prepared.task.length, *limits)

    def measure(
        self, card: Scorecard, longest: float, divergence: Divergence | None = None, *, ended: bool = False
    ) -> Outcome:
        """Return the outcome of a run.

        Args:
            card: Its metrics.
            longest: Largest allowed duration [s].
            divergence: Where it diverged, or None.
            ended: Whether it was ended early.
        """

        def figure(name: str) -> float:
            return float(card[name].value) if name in card else 0.0

        rates = np.array([figure(f"joint_rate.{joint}.peak") for joint in self.joints])
        error = max(figure("position_error.max"), self.length * figure("orientation_error.max"))
        time, completed, refused = figure("duration"), figure("completed"), figure("profile.refused")
        excesses = [(-1.0, ""), *self._peaks(card), _over(card, "chatter", CHATTER)]
        if time > 0.0:
            excesses.append(_over(card, "torque_limited.time", SATURATED * time))
        if refused > 0.0:
            excesses.append((refused, f"the profile refuses {refused:g} commands"))
        over, words = _over(card, "duration", longest)
        excesses.append((over - 1e-9, words))
        if completed != 1.0 and not ended:
            over = 1.0 / completed - 1.0 if completed > 0.0 else math.inf
            excesses.append((over, f"{completed:.0%} of the path is completed in {time:.4g} s"))
        if divergence is not None:
            excesses.append((math.inf, f"it {divergence}"))
        excess, missed = max(excesses, key=lambda pair: pair[0])
        rate, condition = float((rates / self.scale).max()), figure("condition.max")
        position, angle = ends(card)
        end = position, self.length * angle
        return Outcome(error, rate, time, completed, excess, missed, ended, condition, end)

    def _peaks(self, card: Scorecard) -> Iterator[tuple[float, str]]:
        """Yield the relative excess over the limits of the joints, and in words."""
        most = str(card["joint_jerk_cmd.peak_joint"].value)
        for i, joint in enumerate(self.joints):
            limits = {"joint_rate": self.rate[i], "joint_acceleration": self.acceleration[i]}
            for name, limit in limits.items():
                if limit < math.inf:
                    yield _over(card, f"{name}.{joint}.peak", limit, 1.0 + TOLERANCE)
            if joint == most and self.jerk[i] < math.inf:
                yield _over(card, "joint_jerk_cmd.peak", self.jerk[i], 1.0 + TOLERANCE)

    def progress(self, run: Run) -> tuple[Point, float]:
        """Return the objectives of a run so far, and its relative excess over the limits of the joints."""
        off = run["pose_error"] * np.isin(AXES, run.axes)
        position, angle = (float(np.linalg.norm(it, axis=1).max()) for it in (off[:, :3], off[:, 3:]))
        error = max(position, self.length * angle)
        rates = np.abs(run["qdot"]).max(axis=0)
        accelerations = np.abs(np.diff(run["qdot"], axis=0)).max(axis=0) / run.period
        over = np.maximum(rates / self.rate, accelerations / self.acceleration)
        point = Point(float((rates / self.scale).max()), error, len(run) * run.period)
        return point, float(over.max()) / (1.0 + TOLERANCE) - 1.0


def ends(card: Scorecard) -> tuple[float, float]:
    """Return the error at the end of a run: a length and an angle [m, rad], 0 for what is no task."""
    names = "position_error.end", "orientation_error.end"
    position, angle = (float(card[name].value) if name in card else 0.0 for name in names)
    return position, angle


def _over(card: Scorecard, name: str, limit: float, factor: float = 1.0) -> tuple[float, str]:
    """Return the relative excess of a metric over a limit times a factor, and in words."""
    figure = card[name]
    words = f"{name} is {figure.value:.4g} {figure.unit}, and {limit:.4g} is allowed"
    return float(figure.value) / (limit * factor) - 1.0, words


class Trials:
    """Runs settings on worlds; the results do not depend on the threads.

    Attributes:
        worlds: Number of worlds, 0 for the scenario itself.
        loops: Numbers of further worlds, the scenario itself on other loops.
        planned: Duration of the path of each world [s].
        longest: Largest allowed duration of each [s].
        limits: The limits of a run.
        stop: Event that ends the runs.
        done: Number of runs so far.
    """

    def __init__(
        self,
        study: Study,
        worlds: Sequence[Variant],
        loops: Sequence[Variant],
        threads: int,
        stop: threading.Event,
        on_runs: OnRuns,
    ) -> None:
        """Keep the common data of all trials.

        Args:
            study: Study of the scenario.
            worlds: The scenario itself, and perturbed scenarios.
            loops: The scenario itself on other loops.
            threads: Number of threads, one world each.
            stop: Event that ends the runs.
            on_runs: Called with the number of finished runs.
        """
        self._study, self._threads, self.stop, self._on_runs, self.done = study, threads, stop, on_runs, 0
        self._changes = [variant.changes for variant in (*worlds, *loops)]
        self.worlds = len(worlds)
        self.loops = range(len(worlds), len(worlds) + len(loops))
        nominal = study.prepare()
        self.limits, self._slowest = Limits.of(nominal), nominal.scenario.control.slow.longest
        references = [study.prepare(changes).reference for changes in self._changes]
        self.planned = [path.period * path.ticks for path in references]
        self.longest = [math.inf] * len(references)

    def run(
        self, jobs: Sequence[tuple[Setting, int]], ends: Callable[[Setting, Point, float], bool] | None = None
    ) -> list[Outcome] | None:
        """Return the outcomes of settings on worlds; None if interrupted.

        Args:
            jobs: Setting, and number of the world.
            ends: Whether a run of a setting with these objectives and this excess so far can no longer count;
                None: all run to the end.
        """

        def rule(index: int, run: Run) -> bool:
            return ends is not None and ends(jobs[index][0], *self.limits.progress(run))

        if not jobs:
            return []
        prepared = [self._study.prepare(self._all_changes(*job)) for job in jobs]
        simulation = Simulation(prepared, self._threads, keep_columns=False)
        simulation.step(stop=self.stop, rule=rule if ends else None)
        if self.stop.is_set():
            return None
        self._count(len(jobs))
        results = zip(
            jobs, simulation.scorecards(), simulation.divergences(), simulation.ended(), strict=True
        )
        return [
            self.limits.measure(card, self.longest[world], end, ended=ended)
            for (_, world), card, end, ended in results
        ]

    def bears(self, settings: Sequence[Setting], margin: float) -> list[bool | None]:
        """Return whether loops tolerate a factor on their feedback, on the slowest; None if interrupted."""
        loops = [(*setting.changes, *self._changes[0]) for setting in settings]
        answers = bears(self._study, loops, margin, threads=self._threads, stop=self.stop)
        self._count(2 * len(settings))
        return answers

    def _count(self, runs: int) -> None:
        self.done += runs
        self._on_runs(runs)

    def _all_changes(self, setting: Setting, world: int) -> tuple[Change, ...]:
        """Return the changes for a run, which ends when it has taken longer than allowed."""
        changes = (*setting.changes, *self._changes[world])
        if not POLICIES[setting.structure.at_singularity].slows or self.longest[world] == math.inf:
            return changes
        share = max(self.longest[world] / self.planned[world], 1.0)
        return (*changes, *changes_of({"control.slow.longest": min(share, self._slowest)}))
