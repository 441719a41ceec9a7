"""Choose the next settings: points that fill the space, then neighbors of the front in shrinking steps.

The setting as written comes first, on all worlds, and shows which of them is the hardest. The first settings
are each structure with the numbers of the scenario, and with points of the Sobol sequence. All later settings
are neighbors of the front [Deb02], or of the best of another inverse.

Every setting is run on the hardest world, those that count by it on the next, and at last the front of these
on all the others: the worst of more runs is never better, so nothing else can count. That is successive
halving [Jamieson16]. A run ends once it exceeds a limit, or once another setting is better in both peak rate
and error.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from rmrc.study.sobol import sobol_point
from rmrc.tuning.front import Point, area, front
from rmrc.tuning.neighbors import neighbors
from rmrc.tuning.space import FEEDBACK, Setting, Space
from rmrc.tuning.trials import Outcome, Trials
from rmrc.tuning.verdict import ALIKE, Trial, Verdict, best, judge

# Points of a structure's cube to begin with, and settings of a round, enough for some cores.
_POINTS, _ROUND = 4, 12
# A setting that is better by less than this share does not count.
_NEW = 1e-2
# Errors above this multiple of the smallest one, and above that as written, are of no use.
_FAR = 3.0
# Neighbors are tried until so many rounds add less than this share to the area of the front.
_PATIENCE, _GROWTH = 12, 5e-3
# So many times more the front is completed, as far as there are runs.
_SETTLED = 3
# The area of a front goes this much beyond the largest rate and error, so that its ends count.
_BEYOND = 1.2
# A setting that adds less than this share to the area of the front is not run on all worlds.
_WORTH = 5e-4
# Shares of the largest feedback of which it is asked first whether a loop bears it.
_SHARES = (1.0, 0.94, 0.88, 0.8, 0.7, 0.5, 0.25)
# Inverses with some g(σ) σ above 1: less feedback may be less stable than more.
_ABOVE_1 = ("transpose", "jparse")
_STABLE = Outcome(0.0, 0.0, 0.0, 0.0, 1.0, -1.0, "")


class Search:
    """Tried settings in their order, which depends on the seed and not on the threads.

    Attributes:
        tried: All settings with a run on a world, the one as written first.
    """

    def __init__(self, space: Space, trials: Trials, margin: float, budget: int, seed: int) -> None:
        """Begin without settings.

        Args:
            space: The possible settings.
            trials: Runs settings.
            margin: Factor on its feedback that a setting must tolerate on the slowest loop; 1: none.
            budget: Number of runs.
            seed: Seed of the random numbers.
        """
        self._space, self._trials, self._margin = space, trials, margin
        self._budget, self._seed = budget, seed
        self.tried = list[Trial]()
        self._known = set[Setting]()

    @property
    def feasible(self) -> list[Trial]:
        """Settings that keep all limits on all worlds, within the restrictions of the search."""
        worlds = range(self._trials.worlds)
        return [trial for trial in self._sound if all(world in trial.outcomes for world in worlds)]

    def run(self, own: Setting, slower: float) -> Verdict | None:
        """Use the runs, as long as there is time, and return the verdict; None: interrupted too early.

        Args:
            own: The setting as written.
            slower: Times its duration that the others may take; where it does not complete its path, times
                the duration of the path.
        """
        if not self._begin(own, slower):
            return None
        starts = self._starts()
        for first in range(0, len(starts), _ROUND):
            self._try(starts[first : first + _ROUND])
        self._lower_feedback()
        random, areas = np.random.default_rng(self._seed), list[float]()
        while self._room > 0 and not self._trials.stop.is_set():
            line, reference = self._line(self._sound), self._reference()
            areas.append(area([trial.worst.point for trial in line], reference))
            if len(areas) > _PATIENCE and areas[-1] <= (1.0 + _GROWTH) * areas[-1 - _PATIENCE]:
                break
            self._try(neighbors(self._space, self.tried, self._parents(), reference, _ROUND, random))
        for attempt in range(1 + _SETTLED):  # on all worlds others may be better
            if attempt == 0 or self._trials.done < self._budget:
                self._complete(self._finalists())
        while True:
            verdict = judge(self.feasible, self.tried, self.tried[0])
            named, loops = [it for it in (verdict.recommended, verdict.second) if it], self._trials.loops
            jobs = [(trial, loop) for trial in named for loop in loops if loop not in trial.outcomes]
            if not jobs or not self._run(jobs):
                return verdict

    def _begin(self, own: Setting, slower: float) -> bool:
        """Run the setting as written on all worlds, which sets the time scale; return whether it was run."""
        trials = self._trials
        outcomes = trials.run([(own, world) for world in range(trials.worlds)])
        if outcomes is None:
            return False
        for world, outcome in enumerate(outcomes):
            time = outcome.time if outcome.completed == 1.0 else trials.planned[world]
            trials.longest[world] = slower * time
        for loop in trials.loops:
            trials.longest[loop] = trials.longest[0]
        first = max(range(trials.worlds), key=lambda world: outcomes[world].error)
        others = [world for world in range(trials.worlds) if world != first]
        self._order = [first, *sorted(others, key=lambda world: -outcomes[world].peak_rate)]
        self.tried.append(Trial(own, dict(enumerate(outcomes))))
        self._known.add(own._replace(is_written=False))
        return self._check_margin(self.tried)

    # Which settings count ---------------------------------------------------------------------

    @property
    def _sound(self) -> list[Trial]:
        """Settings that may be feasible, by their runs on the two hardest worlds at least."""
        least = min(2, self._trials.worlds)
        known = [trial for trial in self.tried if len(trial.outcomes) >= least and trial.keeps_limits]
        return [trial for trial in known if self._space.allows(trial.setting)]

    def _line(self, some: Sequence[Trial]) -> list[Trial]:
        """Return the front of some, as far as its errors are of use, by rising peak rate."""
        most = self._most(some)
        near = [trial for trial in some if trial.worst.error <= most]
        return [near[i] for i in front([trial.worst.point for trial in near])]

    def _most(self, some: Sequence[Trial]) -> float:
        """Return the largest error that is of use."""
        least = min((trial.worst.error for trial in some), default=math.inf)
        return max(_FAR * least, self.tried[0].worst.error)

    def _reference(self) -> tuple[float, float]:
        """Return the logarithms of the peak rate and the error beyond which nothing counts."""
        known = [self.tried[0], *self._sound]
        most = max(trial.worst.peak_rate for trial in known)
        return Point(_BEYOND * most, _BEYOND * self._most(known[1:]), 0.0).logs

    def _parents(self) -> list[Trial]:
        """Return the settings to refine: the front, and the best of each inverse."""
        possible = [trial for trial in self.tried if trial.setting.structure in self._space.structures]
        each = dict[tuple[str, str], Trial]()
        for trial in sorted(possible, key=_rank):
            each.setdefault(trial.setting.structure.inverse, trial)
        line = [trial for trial in self._line(self._sound) if trial in possible]
        return list(dict.fromkeys([*line, *each.values()]))

    def _finalists(self) -> list[Trial]:
        """Return the settings that add the most to the area of the front, and the best ones."""
        sound, reference = self._sound, self._reference()
        preferred = best(sound)
        inverse = preferred and preferred.setting.structure.inverse
        second = best(trial for trial in sound if trial.setting.structure.inverse != inverse)
        chosen = [trial for trial in (preferred, second) if trial]
        left = [trial for trial in self._line(sound) if trial not in chosen]
        while left:
            every = [[it.worst.point for it in (*chosen, trial)] for trial in left]
            areas = [area(points, reference) for points in every]
            i = int(np.argmax(areas))
            if areas[i] - area(every[i][:-1], reference) <= _WORTH * areas[i]:
                break
            chosen.append(left.pop(i))
        return chosen

    @property
    def _room(self) -> int:
        """Number of runs that are left, without those that the front needs."""
        worlds = self._trials.worlds
        owed = sum(max(0, worlds - len(trial.outcomes)) for trial in self._finalists())
        return self._budget - self._trials.done - owed

    # Runs -------------------------------------------------------------------------------------

    def _starts(self) -> list[Setting]:
        """Return each structure with the scenario's numbers, and with points that fill its cube."""
        space = self._space
        plain = [it for it in space.structures if not it.on_excess] or space.structures
        settings = [space.usual(structure) for structure in plain]
        for index in range(_POINTS):
            # policies matter less than the numbers of an inverse: all of them have one point
            some = [it for it in plain if index == 0 or it.at_singularity == plain[0].at_singularity]
            points = (sobol_point(index, len(structure.keys), self._seed) for structure in some)
            settings += map(space.at, some, points)
        return settings[: max(1, self._budget // 3)]

    def _try(self, settings: Iterable[Setting]) -> None:
        """Run new settings on the hardest world, and those that count on the next."""
        new = [Trial(setting) for setting in dict.fromkeys(settings) if setting not in self._known]
        worlds = self._order[:2]
        new = new[: max(0, self._room) // len(worlds)]
        for world in worlds:
            if not self._run([(trial, world) for trial in new], self._sound):
                return
            self.tried += [trial for trial in new if trial.setting not in self._known]
            self._known |= {trial.setting for trial in new}
            new = self._promising(new)[: max(0, self._room) // max(1, self._trials.worlds - 1)]

    def _promising(self, some: Sequence[Trial]) -> list[Trial]:
        """Return settings that may count beside the others; where none keeps the limits, the nearest."""
        able = [trial for trial in some if trial.keeps_limits]
        every = list(dict.fromkeys([*self._sound, *able]))
        if not every:
            return sorted(some, key=lambda trial: trial.worst.excess)[:2]
        preferred, chosen = best(every), self._line(every)
        return [trial for trial in able if trial in chosen or trial is preferred]

    def _run(self, jobs: Sequence[tuple[Trial, int]], known: Sequence[Trial] | None = None) -> bool:
        """Run settings on worlds, as far as they count beside known ones; return whether they were run."""
        points = [trial.worst.point for trial in self._line(known or [])]
        most = self._most(known or []) if points else math.inf
        least = min((point.error for point in points), default=0.0)

        def ends(so_far: Point) -> bool:
            rate, error = (1.0 + _NEW) * so_far.peak_rate, (1.0 + _NEW) * so_far.error
            is_beaten = any(point.peak_rate <= rate and point.error <= error for point in points)
            return so_far.error > most or (is_beaten and so_far.error > (1.0 + ALIKE) * least)

        outcomes = self._trials.run([(trial.setting, world) for trial, world in jobs], ends)
        for (trial, world), outcome in zip(jobs, outcomes or (), strict=False):
            trial.outcomes[world] = outcome
        return outcomes is not None

    def _complete(self, some: Sequence[Trial]) -> None:
        """Run settings on all worlds that are left, and with more feedback."""
        worlds = range(self._trials.worlds)
        self._run([(trial, world) for trial in some for world in worlds if world not in trial.outcomes])
        self._check_margin(some)

    # Margins ----------------------------------------------------------------------------------

    def _lower_feedback(self) -> None:
        """Lower the largest feedback to what the best setting so far tolerates with the margin."""
        preferred = best(self._sound)
        if self._margin == 1.0 or FEEDBACK in self._space.only or preferred is None:
            return
        low, high = self._space.limits[FEEDBACK]
        for share in _SHARES:
            setting = self._space.with_feedback(preferred.setting, share * high)
            if self._room < 2 or self._trials.bears([setting], self._margin) == [True]:
                self._space.limits[FEEDBACK] = low, share * high
                return

    def _check_margin(self, some: Sequence[Trial]) -> bool:
        """Try settings with more feedback, if requested; return whether it was done.

        Of each inverse, the largest feedback is tried first: less is then stable too.
        """
        missed = f"with {self._margin:g} times its feedback its loop is unstable on the slowest robot"
        asked = [it for it in some if it.keeps_limits and it.margin is None and it.setting.feedback > 0.0]
        left = sorted(asked, key=lambda trial: trial.setting.feedback) if self._margin > 1.0 else []
        while left:
            most = {trial.setting.structure.inverse: trial for trial in left}
            answers = self._trials.bears([trial.setting for trial in most.values()], self._margin)
            if None in answers:
                return False
            for (inverse, trial), is_stable in zip(most.items(), answers, strict=True):
                trial.margin = _STABLE if is_stable else _STABLE._replace(excess=1.0, missed=missed)
                implied = [it for it in left if it.setting.structure.inverse == inverse and is_stable]
                for other in implied if inverse[0] not in _ABOVE_1 else ():
                    other.margin = _STABLE
            left = [trial for trial in left if trial.margin is None]
        return True


def _rank(trial: Trial) -> tuple[float, bool, float]:
    """Return how good a setting is by its runs so far, the smallest for the best."""
    return max(trial.worst.excess, 0.0), trial.worst.ended, trial.worst.error
