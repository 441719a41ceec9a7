"""Run settings on worlds, and measure the results against the limits."""

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
from rmrc.study.study import Study
from rmrc.support.spatial import AXES
from rmrc.tuning.front import Point
from rmrc.tuning.space import Setting

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
        roughness: The largest of the joints' rms commanded accelerations [rad/s² or m/s²].
        completed: Share of the path.
        excess: Largest relative excess over a limit; not positive: all limits are kept.
        missed: The limit with the largest excess, in words.
        ended: Whether it was ended because it could no longer count: all values are those until then.
        condition: Largest κ.
    """

    error: float
    peak_rate: float
    time: float
    roughness: float
    completed: float
    excess: float
    missed: str
    ended: bool = False
    condition: float = 0.0

    @property
    def point(self) -> Point:
        """The objectives on a Pareto front."""
        return Point(self.peak_rate, self.error, self.time)


def worst(outcomes: Sequence[Outcome]) -> Outcome:
    """Return the worst of each of several runs."""
    figures = zip(*(outcome[:4] for outcome in outcomes), strict=True)
    error, peak_rate, time, roughness = (max(values) for values in figures)
    tightest = max(outcomes, key=lambda outcome: outcome.excess)
    completed = min(outcome.completed for outcome in outcomes)
    ended = any(outcome.ended for outcome in outcomes)
    condition = max(outcome.condition for outcome in outcomes)
    return Outcome(
        error, peak_rate, time, roughness, completed, tightest.excess, tightest.missed, ended, condition
    )


@dataclass(frozen=True)
class Limits:
    """The limits of a run.

    Attributes:
        joints: Names.
        units: `rad` or `m`.
        scale: 1, or task.length of a joint that slides.
        length: task.length [m].
        rate: Largest rate of each joint; infinite for none.
        acceleration: Largest acceleration of each.
        jerk: Largest commanded jerk of each; compared with that of the joint with the largest.
    """

    joints: tuple[str, ...]
    units: tuple[str, ...]
    scale: NDArray[np.float64]
    length: float
    rate: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    jerk: NDArray[np.float64]

    @classmethod
    def of(cls, prepared: Prepared) -> "Limits":
        """Return the limits of a scenario, the model's own where it has none."""
        arm, length, law = prepared.arm, prepared.task.length, prepared.law
        scale = np.where(arm.is_slide, length, 1.0)
        jerk = np.full(arm.n, prepared.scenario.control.limits.jerk or math.inf)
        limits = law.rate_limit, law.acceleration_limit, jerk
        return cls(arm.joints, tuple(arm.units), scale, length, *limits)

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
        time, completed = figure("duration"), figure("completed")
        excesses = [(-1.0, ""), *self._peaks(card), *_smooth(card, time)]
        excesses.append((time / longest - 1.0 - 1e-9, f"it takes {time:.4g} s, and {longest:.4g} is allowed"))
        if completed != 1.0 and not ended:
            over = 1.0 / completed - 1.0 if completed > 0.0 else math.inf
            excesses.append((over, f"{completed:.0%} of the path is completed in {time:.4g} s"))
        if divergence is not None:
            excesses.append((math.inf, f"it {divergence}"))
        excess, missed = max(excesses, key=lambda pair: pair[0])
        rate, rough = float((rates / self.scale).max()), figure("joint_acceleration_cmd.rms")
        return Outcome(
            error, rate, time, rough, completed, excess, missed, ended, figure("condition.max")
        )

    def _peaks(self, card: Scorecard) -> Iterator[tuple[float, str]]:
        """Yield the relative excess over the limits of the joints, and in words."""
        for what, name, limits, per in (
            ("rate", "joint_rate", self.rate, "/s"),
            ("acceleration", "joint_acceleration", self.acceleration, "/s²"),
        ):
            for joint, limit, unit in zip(self.joints, limits, self.units, strict=True):
                if limit < math.inf:
                    yield _over(what, joint, float(card[f"{name}.{joint}.peak"].value), limit, f"{unit}{per}")
        joint = str(card["joint_jerk_cmd.peak_joint"].value)
        if joint and np.isfinite(self.jerk).any():
            j, jerk = self.joints.index(joint), float(card["joint_jerk_cmd.peak"].value)
            yield _over("commanded jerk", joint, jerk, self.jerk[j], f"{self.units[j]}/s³")

    def progress(self, run: Run) -> tuple[Point, bool]:
        """Return the objectives of a run so far, and whether it exceeded the limit of a joint already."""
        used = np.isin(np.array(AXES), run.axes)
        off = run["pose_error"] * used
        error = max(_longest(off[:, :3]), self.length * _longest(off[:, 3:]))
        rates = np.abs(run["qdot"]).max(axis=0)
        accelerations = np.abs(np.diff(run["qdot"], axis=0)).max(axis=0) / run.period
        most = 1.0 + TOLERANCE
        is_over = (rates > most * self.rate).any() or (accelerations > most * self.acceleration).any()
        return Point(float((rates / self.scale).max()), error, len(run) * run.period), bool(is_over)


def _longest(vectors: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(vectors, axis=1).max())


def _over(what: str, joint: str, peak: float, limit: float, unit: str) -> tuple[float, str]:
    """Return the relative excess over a limit, and in words."""
    words = f"the {what} of {joint} is {peak:.4g} {unit}, and {limit:.4g} is allowed"
    return peak / (limit * (1.0 + TOLERANCE)) - 1.0, words


def _smooth(card: Scorecard, time: float) -> Iterator[tuple[float, str]]:
    """Yield the relative excess over chatter, torque and profile limits, and in words."""
    chatter, saturated = float(card["chatter"].value), float(card["torque_limited.time"].value)
    refused, most = float(card["profile.refused"].value), SATURATED * time
    if chatter > 0.0:
        joint = card["chatter_joint"].value
        words = f"the acceleration of {joint} changes its sign {chatter:.4g} times per second"
        yield chatter / CHATTER - 1.0, f"{words}, and {CHATTER:g} is allowed"
    if saturated > 0.0:
        words = f"the actuator of {card['torque_limited.first_joint'].value} is at its limit for"
        yield saturated / most - 1.0, f"{words} {saturated:.4g} s, and {most:.4g} is allowed"
    if refused > 0.0:
        words = f"the profile refuses {refused:g} commands"
        yield refused, f"{words}, the first for the {card['profile.first_condition'].value}"


class Trials:
    """Runs settings on worlds; the results do not depend on the threads.

    Attributes:
        limits: The limits of a run.
        done: Number of runs so far.
    """

    def __init__(
        self, study: Study, worlds: Sequence[Variant], threads: int, stop: threading.Event, on_runs: OnRuns
    ) -> None:
        """Keep the common data of all trials.

        Args:
            study: Study of the scenario.
            worlds: All worlds, the scenario itself first.
            threads: Number of threads, one world each.
            stop: Event that ends the runs.
            on_runs: Called with the number of finished runs.
        """
        self._study, self._worlds, self._threads = study, worlds, threads
        self.stop, self.on_runs, self.done = stop, on_runs, 0
        nominal = study.prepare()
        self.limits, self._slowest = Limits.of(nominal), nominal.scenario.control.slow.longest
        references = [study.prepare(world.changes).reference for world in worlds]
        self.planned = [path.period * path.ticks for path in references]
        self.longest = [math.inf] * len(worlds)

    def run(
        self,
        jobs: Sequence[tuple[Setting, int]],
        ends: Callable[[Setting, Point], bool] | None = None,
    ) -> list[Outcome] | None:
        """Return the outcomes of settings on worlds; None if interrupted.

        Args:
            jobs: Setting, and index of the world.
            ends: Whether a setting with these objectives so far can no longer count; None: all run to the
                end.
        """
        if not jobs:
            return []

        def rule(index: int, run: Run) -> bool:
            point, is_over = self.limits.progress(run)
            return is_over or (ends is not None and ends(jobs[index][0], point))

        worlds = [self._study.prepare(self._changes(*job)) for job in jobs]
        simulation = Simulation(worlds, self._threads, keep_columns=False)
        simulation.step(stop=self.stop, rule=rule if ends else None)
        if self.stop.is_set():
            return None
        self.count(len(jobs))
        results = zip(jobs, simulation.scorecards(), simulation.divergences(), simulation.ended(), strict=True)
        return [
            self.limits.measure(card, self.longest[world], end, ended=ended)
            for (_, world), card, end, ended in results
        ]

    def count(self, runs: int) -> None:
        """Count runs that are done."""
        self.done += runs
        self.on_runs(runs)

    def _changes(self, setting: Setting, world: int) -> tuple[Change, ...]:
        """Return the changes for a run, which ends when it has taken longer than allowed."""
        changes = (*setting.changes, *self._worlds[world].changes)
        if not POLICIES[setting.structure.at_singularity].slows or self.longest[world] == math.inf:
            return changes
        share = max(self.longest[world] / self.planned[world], 1.0)
        return (*changes, *changes_of({"control.slow.longest": min(share, self._slowest)}))
