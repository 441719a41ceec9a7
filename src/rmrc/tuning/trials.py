"""Run settings on perturbed scenarios, in batches on all cores, and measure the results."""

import math
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard
from rmrc.scenario import Change, Variant, changes_of
from rmrc.scenario.choices import POLICIES
from rmrc.simulation.prepare import Prepared
from rmrc.study.executors import threads
from rmrc.study.margins.margins import bears
from rmrc.study.study import Listed, OnRuns, Result, Study
from rmrc.support.spatial import AXES
from rmrc.tuning.bar import ALIKE, Bar
from rmrc.tuning.front import Point
from rmrc.tuning.space import Setting

# Relative excess of a measured peak over a limit that is allowed: the law keeps commands within it, and
# servos overshoot.
TOLERANCE = 0.01

# Changes of a commanded acceleration's sign per second, as `rmrc.results.events` counts them: a path with
# corners and limits has some, and a loop that rings 15 and more.
CHATTER = 5.0
# Share of the time in which actuators may be at their limit, for starting.
SATURATED = 0.01

# A batch takes at most a second of one core, so that Ctrl-C and the progress bar need not wait.
_TICKS = 200_000
# Number of batches per thread for jobs that are run together, so that none waits long for another, if there
# are enough jobs: a tick of a few worlds costs more per world.
_PARTS, _WIDE = 2, 16


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


# The outcome of a setting that is stable with more feedback.
STABLE = Outcome(0.0, 0.0, 0.0, 0.0, 1.0, -1.0, "")


def worst(outcomes: Sequence[Outcome]) -> Outcome:
    """Return the worst of each of several runs."""
    figures = zip(*(one[:4] for one in outcomes), strict=True)
    error, peak_rate, time, roughness = (max(values) for values in figures)
    tightest = max(outcomes, key=lambda one: one.excess)
    completed = min(one.completed for one in outcomes)
    ended, condition = any(one.ended for one in outcomes), max(one.condition for one in outcomes)
    excess, missed = tightest.excess, tightest.missed
    return Outcome(error, peak_rate, time, roughness, completed, excess, missed, ended, condition)


def scaled(one: Outcome, by: Outcome, to: Outcome) -> Outcome:
    """Return the expected outcome of a setting on all scenarios, if it keeps the limits there.

    Args:
        one: Its outcome on a model.
        by: That of a neighbor on the model.
        to: That of the neighbor on all scenarios.
    """
    figures = (a * (c / b if b else 1.0) for a, b, c in zip(one[:4], by[:4], to[:4], strict=True))
    error, peak_rate, time, roughness = figures
    return Outcome(error, peak_rate, time, roughness, to.completed, -1.0, "", condition=to.condition)


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

    def measure(self, result: Result, longest: float) -> Outcome:
        """Return the outcome of a run.

        Args:
            result: Its result.
            longest: Largest allowed duration [s].
        """
        card = result.scorecard

        def figure(name: str) -> float:
            return float(card[name].value) if name in card else 0.0

        rates = np.array([figure(f"joint_rate.{joint}.peak") for joint in self.joints])
        error = max(figure("position_error.max"), self.length * figure("orientation_error.max"))
        time, completed = figure("duration"), figure("completed")
        found = [(-1.0, ""), *self._peaks(card), *_smooth(card, time)]
        found.append((time / longest - 1.0 - 1e-9, f"it takes {time:.4g} s, and {longest:.4g} is allowed"))
        if completed != 1.0 and not result.ended:
            over = 1.0 / completed - 1.0 if completed > 0.0 else math.inf
            found.append((over, f"{completed:.0%} of the path is completed in {time:.4g} s"))
        if result.divergence is not None:
            found.append((math.inf, f"it {result.divergence}"))
        excess, missed = max(found, key=lambda pair: pair[0])
        rate, rough = float((rates / self.scale).max()), figure("joint_acceleration_cmd.rms")
        condition = figure("condition.max")
        return Outcome(error, rate, time, rough, completed, excess, missed, result.ended, condition)

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

    def is_exceeded(self, run: Run) -> bool:
        """Return whether a run has exceeded the limit of a joint already."""
        qdot, most = run["qdot"], 1.0 + TOLERANCE
        rate = np.abs(qdot).max(axis=0)
        acceleration = np.abs(np.diff(qdot, axis=0)).max(axis=0) / run.period
        return bool(((rate > most * self.rate) | (acceleration > most * self.acceleration)).any())

    def point(self, run: Run) -> tuple[float, float]:
        """Return the peak rate and the error of a run so far, as `measure` has them."""
        rate = (np.abs(run["qdot"]).max(axis=0) / self.scale).max()
        position, orientation = (
            np.linalg.norm(run["pose_error"][:, [i for i in some if AXES[i] in run.axes]], axis=1).max()
            for some in (range(3), range(3, 6))
        )
        return float(rate), float(np.maximum(position, self.length * orientation))


def _over(what: str, joint: str, peak: float, limit: float, unit: str) -> tuple[float, str]:
    """Return the relative excess over a limit, and in words."""
    said = f"the {what} of {joint} is {peak:.4g} {unit}, and {limit:.4g} is allowed"
    return peak / (limit * (1.0 + TOLERANCE)) - 1.0, said


def _smooth(card: Scorecard, time: float) -> Iterator[tuple[float, str]]:
    """Yield the relative excess over chatter, torque and profile limits, and in words."""
    chatter, saturated = float(card["chatter"].value), float(card["torque_limited.time"].value)
    refused, most = float(card["profile.refused"].value), SATURATED * time
    if chatter > 0.0:
        said = (
            f"the acceleration of {card['chatter_joint'].value} changes its sign {chatter:.4g} times per "
            "second"
        )
        yield chatter / CHATTER - 1.0, f"{said}, and {CHATTER:g} is allowed"
    if saturated > 0.0:
        said = (
            f"the actuator of {card['torque_limited.first_joint'].value} is at its limit for "
            f"{saturated:.4g} s"
        )
        yield saturated / most - 1.0, f"{said}, and {most:.4g} is allowed"
    if refused > 0.0:
        said = f"the profile refuses {refused:g} commands"
        yield refused, f"{said}, the first for the {card['profile.first_condition'].value}"


@dataclass(frozen=True)
class Ending:
    """Ends runs that can no longer count.

    Attributes:
        bar: Stopping rule.
        limits: The limits; a run that exceeds them does not count if another setting keeps them.
        rivals: Least known error of each run's inverse.
    """

    bar: Bar
    limits: Limits
    rivals: NDArray[np.float64]

    def __call__(self, index: int, run: Run) -> bool:
        """Return whether a run ends here."""
        if self.limits.is_exceeded(run):
            return True
        rate, error = np.array([self.limits.point(run)]).T
        return bool(self.bar.beats(rate, error, self.rivals[[index]], 1.0 + ALIKE)[0])


@dataclass
class _Outcomes:
    """The outcomes of a study's runs.

    Attributes:
        pieces: Pieces of the runs.
        limits: The limits of a run.
        longest: Largest allowed duration of each [s].
        on_runs: Called with the number of finished runs of each piece.
        found: By index; None for an interrupted run.
    """

    pieces: Sequence[range]
    limits: Limits
    longest: Sequence[float]
    on_runs: OnRuns
    found: list[Outcome | None]

    def reduce(self, results: Sequence[Result]) -> list[Outcome]:
        return [self.limits.measure(one, self.longest[one.index]) for one in results]

    def missing(self) -> Sequence[range]:
        return self.pieces

    def keep(self, piece: range, payload: list[Outcome]) -> None:
        self.found[piece.start : piece.stop] = payload
        self.on_runs(len(piece))


class Trials:
    """Runs settings on scenarios; the results depend on neither the threads nor the batches."""

    def __init__(
        self,
        study: Study,
        scenarios: Sequence[Variant],
        threads: int,
        stop: threading.Event,
        on_runs: OnRuns | None,
        margin: float = 1.0,
        model: Variant | None = None,
        loops: Sequence[Variant] = (),
    ) -> None:
        """Keep the common data of all trials.

        `planned` has the durations of the scenarios' paths [s]. For the model, `tick` is its period [s], and
        `weight` the cost of its runs.

        Args:
            study: Study of the scenario.
            scenarios: The scenario itself first; all can be prepared.
            threads: Number of batches that are run at a time.
            stop: Event that ends the runs.
            on_runs: Called with the number of finished runs of each batch.
            margin: Factor on its feedback that a setting must tolerate on the scenario itself; 1: none.
            model: A cheap scenario similar to the hardest scenario; None: there is none.
            loops: The scenario itself on loops beside the slowest.
        """
        self._study, self._threads, self._stop, self._on_runs = study, threads, stop, on_runs
        self.loops = tuple(loops)
        self.scenarios, self.margin, self.model = len(scenarios), margin, len(scenarios) if model else None
        self._scenarios = scenarios = (*scenarios, *([model] if model else ()))
        nominal = study.prepare()
        self.limits, self._control = Limits.of(nominal), nominal.scenario.control
        references = [study.prepare(case.changes).reference for case in self._scenarios]
        self.planned = [one.period * one.ticks for one in references]
        self.tick = references[-1].period
        self.weight = min(1.0, references[-1].ticks / nominal.reference.ticks) if model else 1.0
        self._of_model: Study | None = None
        self._longest = [math.inf] * len(self._scenarios)
        self._ticks = nominal.reference.ticks
        self.done, self._spent = 0, 0.0

    @property
    def is_stopped(self) -> bool:
        """Whether the runs were ended from outside."""
        return self._stop.is_set()

    def aim(self, case: int) -> None:
        """Give the model the start and the target of a scenario."""
        if self.model is None:
            return
        model, there = self._scenarios[self.model], self._scenarios[case].changes
        placed = [one for one in there if ".".join(map(str, one.key)) in ("arm.start", "target.offset")]
        changes = (*model.changes, *placed)
        self._of_model = self._study.of(changes)  # so that common parts are checked once
        reference = self._of_model.prepare().reference
        self._scenarios = (*self._scenarios[:-1], model._replace(changes=changes))
        self.planned[self.model] = reference.period * reference.ticks

    def allow(self, times: Sequence[float]) -> None:
        """Set the largest duration of each scenario's runs from now on [s]."""
        self._longest = list(times)

    def run(
        self, jobs: Sequence[tuple[Setting, int]], bar: Bar | None = None, rivals: Sequence[float] = ()
    ) -> list[Outcome | None]:
        """Return the outcomes of settings on scenarios, None for interrupted ones.

        Args:
            jobs: Setting, and index of the scenario.
            bar: Ends runs that cannot count; None: all run to their end.
            rivals: Least known error of each job's inverse.
        """
        longest = [self._longest[case] for _, case in jobs]
        is_model = all(case == self.model for _, case in jobs)
        study = self._of_model if is_model and self._of_model else self._study
        changes = [self._changes(*job, study) for job in jobs]
        ending = Ending(bar, self.limits, np.array(rivals)) if bar else None
        return self._step(study, changes, longest, self._count_model if is_model else self._count, ending)

    def between(self, settings: Sequence[Setting]) -> list[Outcome | None]:
        """Return the worst of settings on the loops beside the slowest; None for interrupted ones."""
        jobs = [(one, loop) for one in settings for loop in self.loops]
        changes = [(*self._changes(one, 0, self._study), *loop.changes) for one, loop in jobs]
        found = self._step(self._study, changes, [self._longest[0]] * len(jobs), self._count)
        each = [found[i : i + len(self.loops)] for i in range(0, len(jobs), len(self.loops))]
        return [None if None in some else worst([one for one in some if one]) for some in each]

    def _step(
        self,
        study: Study,
        changes: Sequence[tuple[Change, ...]],
        longest: Sequence[float],
        on_runs: OnRuns,
        ending: Ending | None = None,
    ) -> list[Outcome | None]:
        """Return the outcomes of a study's runs, None for interrupted ones."""
        most = max(1, _TICKS // self._ticks)
        parts = self._threads * (_PARTS if len(changes) >= _WIDE * _PARTS * self._threads else 1)
        size = max(1, min(most, -(-len(changes) // parts)))
        pieces = [range(first, min(first + size, len(changes))) for first in range(0, len(changes), size)]
        into = _Outcomes(pieces, self.limits, longest, on_runs, [None] * len(changes))
        variants = Listed([Variant("", one) for one in changes])
        with threads(self._threads, study) as crew:
            study.run(variants, crew, into, self._stop, ending)
        return into.found

    def bear(self, settings: Sequence[Setting]) -> list[Outcome | None]:
        """Return the excess of settings with the margin on their feedback; None for interrupted ones."""
        fed_back = [one for one in dict.fromkeys(settings) if one.feedback > 0.0]  # others have no loop
        changes = [(*one.changes, *self._scenarios[0].changes) for one in fed_back]  # the slowest loop
        known = bears(self._study, changes, self.margin, threads=self._threads, stop=self._stop)
        self._count(2 * len(fed_back))
        missed = f"with {self.margin:g} times its feedback its loop is unstable on the slowest robot"
        outcomes = {None: None, True: STABLE, False: STABLE._replace(excess=1.0, missed=missed)}
        found = dict(zip(fed_back, known, strict=True))
        return [outcomes[found.get(one, True)] for one in settings]

    def _count(self, runs: int) -> None:
        self.done += runs
        self._tell(runs)

    def _count_model(self, runs: int) -> None:
        self._tell(self.weight * runs)

    def _tell(self, runs: float) -> None:
        told, self._spent = int(self._spent), self._spent + runs
        if self._on_runs is not None:
            self._on_runs(int(self._spent) - told)

    def _changes(self, setting: Setting, case: int, study: Study) -> tuple[Change, ...]:
        """Return the changes for a run of a study, which ends when it has taken longer than allowed."""
        changes = (*setting.changes, *(() if study is self._of_model else self._scenarios[case].changes))
        if not POLICIES[setting.structure.at_singularity].slows or self._longest[case] == math.inf:
            return changes
        share = self._longest[case] / self.planned[case]
        longest = min(max(share, 1.0), self._control.slow.longest)
        return (*changes, *changes_of({"control.slow.longest": longest}))
