"""Choose the next settings: a coarse grid over damping and feedback, then neighbors of the best in all sizes.

The setting as written comes first, on all worlds, and shows which of them is the hardest. Every other setting
is run on the hardest world. Whichever looks best so far is run on the others, until the best has been run on
all: the worst of more runs is never better, so nothing else can be best. A run ends once it exceeds a limit,
or once another setting is better in both peak rate and error. That is successive halving [Jamieson16].
"""

import math
from collections.abc import Sequence

import numpy as np

from rmrc.tuning.space import Setting, Space
from rmrc.tuning.trials import Outcome, Point, Trials, front
from rmrc.tuning.verdict import ALIKE, HAIR, LESS, Trial, Verdict, best, judge

# Dampings and feedbacks of a grid, the finest first, and its middle feedback, relative to that as written.
_GRIDS, _MIDDLE = ((7, 5), (7, 3), (5, 3), (3, 3), (3, 2), (2, 2), (2, 1), (1, 1)), 1.5
# Settings of a round, enough for some cores; the shortest and the longest step in the unit cube, whose sides
# are two or three decades.
_ROUND, _STEPS = 12, (0.003, 0.5)
# A setting that is better by less than this share does not count.
_NEW = 1e-2
# Errors above this multiple of the smallest one, and above that as written, are of no use.
_FAR = 3.0
# Neighbors are tried until so many rounds lower the least error by less than this share.
_PATIENCE, _GAIN = 16, 5e-3
# Settings on the front are at least this far apart in peak rate, relatively.
_APART = 0.05
# Inverses with some g(σ) σ above 1: less feedback may be less stable than more.
_ABOVE_1 = ("transpose", "jparse")
_STABLE = Outcome(0.0, 0.0, 0.0, 1.0, -1.0, "")


class Search:
    """Tried settings in their order, which depends on the seed and not on the threads.

    Attributes:
        tried: All settings with a run on a world, the one as written first.
    """

    def __init__(
        self, space: Space, trials: Trials, margin: float, enough: float, budget: int, seed: int
    ) -> None:
        """Begin without settings.

        Args:
            space: The possible settings.
            trials: Runs settings.
            margin: Factor on its feedback that a setting must tolerate on the slowest loop; 1: none.
            enough: Feedback beyond which more is no better [1/s].
            budget: Number of runs.
            seed: Seed of the random numbers.
        """
        self._space, self._trials, self._margin, self._enough = space, trials, margin, enough
        self._budget, self._random = budget, np.random.default_rng(seed)
        self.tried = list[Trial]()

    @property
    def feasible(self) -> list[Trial]:
        """Settings that keep all limits on all worlds, within the restrictions of the search."""
        return [trial for trial in self._sound if not self._missing(trial)]

    def run(self, written: Setting, slower: float) -> Verdict | None:
        """Use the runs, as long as there is time, and return the verdict; None: interrupted too early.

        Args:
            written: The setting as written.
            slower: Times its duration that the others may take; where it does not complete its path, times
                the duration of the path.
        """
        if not self._begin(written, slower):
            return None
        grid = self._grid()
        for first in range(0, len(grid), _ROUND):
            self._try(grid[first : first + _ROUND])
        errors = list[float]()
        while self._room > 0 and not self._trials.stop.is_set():
            each = (min((it.worst.error for it in few), default=1e9) for few in (self._sound, self._nearer))
            errors.append(math.prod(each))
            if len(errors) > _PATIENCE and errors[-1] > (1.0 - _GAIN) * errors[-1 - _PATIENCE]:
                break
            self._try(self._neighbors())
        self._settle(None)
        if preferred := self._best(self._sound):
            self._settle(preferred.setting.structure.inverse)
        for trial in self._line(self._sound, _APART):
            while self._advance(trial):
                pass
        return self._verdict()

    def _begin(self, written: Setting, slower: float) -> bool:
        """Run the setting as written on all worlds, which sets the time scale; return whether it was run."""
        trials = self._trials
        outcomes = trials.run([(written, world) for world in range(trials.worlds)])
        if outcomes is None:
            return False
        for world, outcome in enumerate(outcomes):
            time = outcome.time if outcome.completed == 1.0 else trials.planned[world]
            trials.longest[world] = slower * time
        for loop in trials.loops:
            trials.longest[loop] = trials.longest[0]
        hardest = max(range(trials.worlds), key=lambda world: outcomes[world].error)
        self._order = list(dict.fromkeys((hardest, *range(trials.worlds))))
        self.tried.append(Trial(written, dict(enumerate(outcomes))))
        return self._missing(self.tried[0]) != [-1] or self._check_margin(self.tried[0])

    def _verdict(self) -> Verdict | None:
        """Return the verdict, once the settings that it names were run on the loops between as well."""
        while True:
            verdict = judge(self.feasible, self.tried, self.tried[0], self._enough)
            worlds = {trial: self._trials.loops for trial in (verdict.recommended, verdict.second) if trial}
            worlds |= {verdict.close: range(self._trials.worlds)} if verdict.close else {}
            jobs = [(trial, it) for trial, some in worlds.items() for it in some if it not in trial.outcomes]
            if not jobs or not self._run(jobs):
                return verdict

    # Settings ---------------------------------------------------------------------------------

    @property
    def _sound(self) -> list[Trial]:
        """Settings that keep the limits in their runs so far."""
        return [it for it in self.tried if it.keeps_limits and self._space.allows(it.setting)]

    def _best(self, some: Sequence[Trial]) -> Trial | None:
        return best(some, self.tried[0], self._enough)

    @property
    def _nearer(self) -> list[Trial]:
        """Settings that keep the limits, and end nearer to the target than as written, by rising error."""
        nearer = [trial for trial in self._sound if trial.ends_nearer(self.tried[0])]
        return sorted(nearer, key=lambda trial: trial.worst.error)

    def _line(self, some: Sequence[Trial], apart: float = 0.0) -> list[Trial]:
        """Return the front of some, as far as its errors are of use, by falling peak rate."""
        most = self._most(some)
        near, line = [trial for trial in some if trial.worst.error <= most], list[Trial]()
        for i in reversed(front([trial.worst.point for trial in near])):
            if not line or near[i].worst.peak_rate <= (1.0 - apart) * line[-1].worst.peak_rate:
                line.append(near[i])
        return line

    def _most(self, some: Sequence[Trial]) -> float:
        """Return the largest error that is of use."""
        least = min((trial.worst.error for trial in some), default=math.inf)
        return max(_FAR * least, self.tried[0].worst.error)

    @property
    def _room(self) -> int:
        """Number of runs that are left, without those that the best and the front need."""
        worlds = self._trials.worlds
        kept_back = worlds - 1 + max(0, self._budget - 2 * worlds) // 6
        return self._budget - self._trials.done - kept_back

    def _grid(self) -> list[Setting]:
        """Return a grid over damping and feedback for each inverse, with at most a third of the runs."""
        space, most = self._space, max(1, self._budget // 3)
        plain = [it for it in space.structures if not it.on_excess] or list(space.structures)
        plain = [it for it in plain if it.at_singularity == plain[0].at_singularity]
        middle = _MIDDLE * self.tried[0].setting.feedback
        for size in _GRIDS:
            grid = [setting for structure in plain for setting in space.grid(structure, *size, middle)]
            if len(grid) <= most:
                break
        return [grid[i] for i in self._random.permutation(len(grid))][:most]

    def _neighbors(self) -> list[Setting]:
        """Return settings beside the best, that which ends nearer, other inverses, and the front."""
        some = sorted(self.tried, key=_rank)
        each = {trial.setting.structure.inverse: trial for trial in reversed(some)}
        others, line = sorted(each.values(), key=_rank), self._line(self._sound)
        preferred = self._best(self._sound) or some[0]
        front = [line[i] for i in self._random.permutation(len(line))]
        nearer = {trial.setting.structure.inverse: trial for trial in reversed(self._nearer)}
        between = [self._between(trial) for trial in sorted(nearer.values(), key=_rank)[: _ROUND // 3]]
        parents = [*[preferred] * 4, *others[:2], *front[:2]]
        shortest, longest = _STEPS
        steps = shortest * (longest / shortest) ** self._random.random(len(parents))
        pairs = zip(parents, steps, strict=True)
        return between + [self._space.beside(it.setting, step, self._random) for it, step in pairs]

    def _between(self, trial: Trial) -> Setting:
        """Return a setting between one that ends nearer and another of its inverse with less error so far."""
        least = self.tried[0].setting.feedback
        others = [
            other.setting
            for other in self.tried
            if other.setting.structure.inverse == trial.setting.structure.inverse
            and other.setting.feedback >= least and other.worst.error <= trial.worst.error
        ]  # fmt: skip
        other = others[self._random.integers(len(others))]
        return self._space.between(trial.setting, other, self._random)

    # Runs -------------------------------------------------------------------------------------

    def _try(self, settings: Sequence[Setting]) -> None:
        """Run new settings on the hardest world, and the best so far on all."""
        known = {trial.setting._replace(is_written=False) for trial in self.tried}
        new = [Trial(it) for it in dict.fromkeys(settings) if it not in known and self._space.allows(it)]
        new = new[: max(0, self._room)]
        if self._run([(trial, self._order[0]) for trial in new]):
            self.tried += new
        self._settle(None)

    def _settle(self, inverse: tuple[str, str] | None) -> None:
        """Run the best on all worlds, and what is then the best, as far as the runs go.

        Args:
            inverse: Which is left out.
        """
        while True:
            some = [trial for trial in self._sound if trial.setting.structure.inverse != inverse]
            trial = self._best(some)
            if trial is None or not self._advance(trial):
                return

    def _missing(self, trial: Trial) -> list[int]:
        """Return the worlds on which a setting was not run; [-1]: only its margin is unknown."""
        missing = [world for world in self._order if world not in trial.outcomes]
        is_checked = trial.margin is not None or self._margin == 1.0 or trial.setting.feedback == 0.0
        return missing if missing or is_checked else [-1]

    def _advance(self, trial: Trial) -> bool:
        """Run a setting where it was not run yet, at the nominal world first; return whether it was run."""
        missing = self._missing(trial)
        if not missing or not trial.keeps_limits or self._trials.done + len(missing) > self._budget:
            return False
        if missing == [-1]:
            return self._check_margin(trial)
        return self._run([(trial, it) for it in (missing[:1] if 0 in missing else missing)])

    def _run(self, jobs: Sequence[tuple[Trial, int]]) -> bool:
        """Run settings on worlds, as far as they count beside known ones; return whether they were run."""
        feasible, written = self.feasible, self.tried[0].setting.feedback
        points = [(trial.worst.point, trial.setting.feedback) for trial in feasible]
        most = self._most(feasible) if points else math.inf
        least = min((point.error for point, _ in points), default=math.inf)

        def ends(setting: Setting, so_far: Point, excess: float) -> bool:
            if excess > (HAIR if so_far.error <= LESS * least else 0.0):
                return True
            rate, error = (1.0 + _NEW) * so_far.peak_rate, (1.0 + _NEW) * so_far.error
            # what has more feedback, and more than as written, may end nearer
            is_beaten = any(
                point.peak_rate <= rate
                and point.error <= error
                and setting.feedback <= max(feedback, written)
                for point, feedback in points
            )
            return so_far.error > most or (is_beaten and so_far.error > (1.0 + ALIKE) * least)

        outcomes = self._trials.run([(trial.setting, world) for trial, world in jobs], ends)
        for (trial, world), outcome in zip(jobs, outcomes or (), strict=False):
            trial.outcomes[world] = outcome
        return outcomes is not None

    def _check_margin(self, trial: Trial) -> bool:
        """Try a setting with more feedback, unless more is stable with its inverse; return whether it was."""
        inverse, feedback = trial.setting.structure.inverse, trial.setting.feedback
        implied = any(
            other.margin == _STABLE and other.setting.structure.inverse == inverse
            and other.setting.feedback >= feedback and inverse[0] not in _ABOVE_1
            for other in self.tried
        )  # fmt: skip
        (is_stable,) = [True] if implied else self._trials.bears([trial.setting], self._margin)
        if is_stable is None:
            return False
        missed = f"with {self._margin:g} times its feedback its loop is unstable on the slowest robot"
        trial.margin = _STABLE if is_stable else _STABLE._replace(excess=1.0, missed=missed)
        return True


def _rank(trial: Trial) -> tuple[bool, float]:
    """Return how good a setting is by its runs so far, the smallest for the best."""
    outcome = trial.worst
    return outcome.ended, outcome.error * (1.0 + max(outcome.excess, 0.0))
