"""Choose the next settings: points that fill the space, then neighbors of the front in shrinking steps.

The setting as written comes first, on all worlds, and shows which of them is the hardest. Every setting is
run on the hardest world; those that may count by it are run on the next, and only the front of these on all
the others: the worst of more runs is never better, so nothing else can count. That is successive halving
[Jamieson16]. A run ends once it exceeds a limit, or once another setting is better in both peak rate and
error.

The first settings are, of each inverse, the numbers of the scenario and points of the Sobol sequence. All
others are neighbors of the front [Deb02]: between two of its settings, most where the gap between them is
the largest, beyond its ends, or with another policy at a singularity.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from rmrc.scenario.choices import INVERSES
from rmrc.study.margins.margins import bears
from rmrc.study.study import Study
from rmrc.study.sobol import sobol_point
from rmrc.tuning.front import Point, area, front, gains
from rmrc.tuning.space import FEEDBACK, METHOD, SCHEDULE, Setting, Space, Structure
from rmrc.tuning.surrogate import predict
from rmrc.tuning.trials import Outcome, Trials
from rmrc.tuning.verdict import ALIKE, Trial, Verdict, best, judge

# Points of the Sobol sequence for each inverse, and the largest share of the runs for them.
POINTS, SHARE = 6, 0.3
# Settings of a round, so many that all of some cores are busy; the steps of its neighbors in the unit cube,
# whose sides are two or three decades, and the factor by which they shrink from round to round.
ROUND, FIRST_STEP, LAST_STEP, SHRINK = 12, 0.2, 0.01, 0.75
GUESSES, HOPE = 200, 0.5
# Share of a round for other policies, and for neighbors of the setting with the smallest error.
SWITCHED, LEAST = 0.25, 0.2
# A setting that is better by less than this share does not count.
NEW = 1e-2
# Errors above this multiple of the smallest one, and above that as written, are of no use.
FAR = 3.0
# A setting that adds less than this share to the area of the front is not run on all worlds.
WORTH = 2e-3
# Shares of the largest feedback that are tried for what a loop bears.
BORNE = (1.0, 0.94, 0.88, 0.8, 0.7, 0.5, 0.25)
# Outcomes of a setting that is stable with more feedback, and of one that is not.
STABLE = Outcome(0.0, 0.0, 0.0, 0.0, 1.0, -1.0, "")


class Search:
    """Tried settings in their order, which depends on the seed and not on the threads."""

    def __init__(
        self, study: Study, space: Space, trials: Trials, worlds: int, margin: float, budget: int, seed: int
    ) -> None:
        self._study, self._space, self._trials = study, space, trials
        self._worlds, self._margin, self._budget, self._seed = worlds, margin, budget, seed
        self.trials: dict[tuple[object, ...], Trial] = {}
        self._asked = dict[tuple[str, str], list[tuple[float, bool]]]()

    @property
    def feasible(self) -> list[Trial]:
        """Settings that keep all limits on all worlds, within the restrictions of the search."""
        return [trial for trial in self._sound if len(trial.outcomes) >= self._worlds]

    @property
    def _sound(self) -> list[Trial]:
        """Settings that may be feasible, by their runs on the two hardest worlds at least."""
        least = min(2, self._worlds)
        whole = [trial for trial in self.trials.values() if len(trial.outcomes) >= least]
        return [trial for trial in whole if trial.keeps_limits and self._space.allows(trial.setting)]

    @property
    def _room(self) -> int:
        """Number of runs that are left, without those that the front needs."""
        owed = sum(self._worlds - len(trial.outcomes) for trial in self._finalists() if len(trial.outcomes) < self._worlds)
        return self._budget - self._trials.done - owed

    def begin(self, own: Setting, slower: float) -> bool:
        """Run the setting as written, which sets the time scale of the others; return whether it was run.

        Args:
            own: As written.
            slower: Times its duration that the others may take; where it does not complete its path, times
                the duration of the path.
        """
        outcomes = self._trials.run([(own, world) for world in range(self._worlds)])
        if outcomes is None:
            return False
        self.own = Trial(own, dict(enumerate(outcomes)))
        self.trials[own[:2]] = self.own
        times = [it.time if it.completed == 1.0 else plan for it, plan in zip(outcomes, self._trials.planned, strict=False)]
        self._trials.longest = [slower * (times[world] if world < self._worlds else times[0]) for world in range(len(self._trials.planned))]
        self._order = sorted(range(self._worlds), key=lambda world: -outcomes[world].error)
        return self._check_margin([self.own])

    def run(self) -> Verdict:
        """Use the runs, as long as there is time, and return the verdict."""
        starts = self._starts()
        for first in range(0, len(starts), ROUND):
            self._try(starts[first : first + ROUND])
        self._lower_feedback()
        step, round_ = FIRST_STEP, 0
        while step > LAST_STEP and self._room > 0 and not self._trials.stop.is_set():
            self._try(self._neighbors(step, round_))
            step, round_ = step * SHRINK, round_ + 1
        while True:
            self._complete(self._finalists())
            verdict = judge(self.feasible, self.trials.values(), self.own)
            if self._trials.stop.is_set() or not self._confirm(verdict):
                return verdict

    # Proposals -------------------------------------------------------------------------------

    def _starts(self) -> list[Setting]:
        """Return each inverse with the scenario's numbers, and points that fill its cubes, one policy each."""
        inverses = dict[tuple[str, str], list[Structure]]()
        for structure in self._space.structures:
            inverses.setdefault(structure.inverse, []).append(structure)
        settings = [self._space.usual(structures[0]) for structures in inverses.values()]
        for index in range(POINTS):
            for i, structures in enumerate(inverses.values()):
                structure = structures[(index + i) % len(structures)]
                settings.append(self._space.at(structure, sobol_point(index, len(structure.keys), self._seed)))
        return settings[: max(len(inverses), int(SHARE * self._budget))]

    def _neighbors(self, step: float, round_: int) -> list[Setting]:
        """Return neighbors of the front that are expected to add the most to it."""
        random, line = np.random.default_rng((self._seed, round_)), self._line()
        if not line:
            near = sorted(self.trials.values(), key=lambda it: (it.worst.ended, it.worst.excess))[:4]
            return [self._beside(near[i % len(near)], step, random) for i in range(ROUND)]
        structures = {trial.setting.structure: None for trial in line}
        chosen = []
        for structure in structures:  # other policies
            others = [it for it in self._space.structures if it.inverse == structure.inverse]
            fresh = [it for it in others if all(key[0] != it for key in self.trials)]
            parents = [it for it in line if it.setting.structure.inverse == structure.inverse]
            parent = parents[random.integers(len(parents))].setting
            chosen += [self._space.usual(it, parent.by_key) for it in fresh[:1]]
        settings, figures = list[Setting](), list[np.ndarray]()
        every = {trial.setting.structure: None for trial in [*line, *sorted(self._sound, key=lambda it: it.worst.error)[:4]]}
        for structure in every:
            if structure not in self._space.structures:
                continue
            known = [it for it in self.trials.values() if it.setting.structure == structure and not (it.worst.ended and it.worst.excess > 0.0)]
            parents = [it for it in line if it.setting.structure == structure] or known
            if len(known) < 2:
                chosen.append(self._beside(parents[0], step, random))
                continue
            points = np.array([self._space.point(it.setting) for it in parents])
            first, second = random.integers(len(points), size=(2, GUESSES))
            share = np.where(random.random(GUESSES) < 0.5, 0.0, random.uniform(-0.5, 1.5, GUESSES))[:, None]
            off = step * random.uniform(0.1, 1.0, (GUESSES, 1)) * random.standard_normal((GUESSES, points.shape[1]))
            new = dict.fromkeys(self._space.at(structure, point) for point in points[first] + share * (points[second] - points[first]) + off)
            new = [it for it in new if it[:2] not in self.trials]
            if not new:
                continue
            at = np.array([self._space.point(it) for it in new])
            all_ = [it for it in self.trials.values() if it.setting.structure == structure]
            places = np.array([self._space.point(it.setting) for it in all_])
            nearest = np.linalg.norm(at[:, None] - places, axis=2).argmin(axis=1)
            keeps = np.array([it.worst.excess <= 0.0 for it in all_])[nearest]
            known_points = np.array([self._space.point(it.setting) for it in known])
            values = np.array([it.worst.point.logs for it in known])
            settings += [it for it, keep in zip(new, keeps, strict=True) if keep]
            figures += [*predict(known_points, values, at[keeps], HOPE)]
        figures = np.array(figures).reshape(-1, 2)
        reached = np.array([it.worst.point.logs for it in line])
        reference = self._reference()
        least = 2e-3 * area([it.worst.point for it in line], reference)
        # the least error
        picked = []
        low = reached[:, 1].min()
        for _ in range(2):
            if len(figures):
                i = int(figures[:, 1].argmin())
                if figures[i, 1] < low - NEW and i not in picked:
                    picked.append(i)
                    reached = np.vstack([reached, figures[i]])
        while len(figures) and len(picked) + len(chosen) < ROUND:
            gained = gains(reached, figures, reference)
            i = int(gained.argmax())
            if gained[i] <= least:
                break
            picked.append(i)
            reached = np.vstack([reached, figures[i]])
        return chosen + [settings[i] for i in dict.fromkeys(picked)]

    def _beside(self, trial: Trial, step: float, random: np.random.Generator) -> Setting:
        structure = trial.setting.structure
        if structure not in self._space.structures:
            return self._space.usual(self._space.structures[0])
        return self._space.at(structure, self._space.point(trial.setting) + step * random.standard_normal(len(structure.keys)))

    def _line(self) -> list[Trial]:
        """Return the useful part of the front, by rising peak rate."""
        sound = self._sound
        most = self._wanted(sound)
        near = [trial for trial in sound if trial.worst.error <= most]
        return [near[i] for i in front([trial.worst.point for trial in near])]

    def _wanted(self, sound: Sequence[Trial]) -> float:
        """Return the largest error that is of use."""
        least = min((trial.worst.error for trial in sound), default=math.inf)
        return max(FAR * least, self.own.worst.error)

    def _reference(self) -> tuple[float, float]:
        """Return the logarithms of the peak rate and the error beyond which nothing counts."""
        sound = self._sound
        rates = [trial.worst.peak_rate for trial in sound]
        return Point(max([self.own.worst.peak_rate, *rates]) * 1.01, self._wanted(sound) * 1.01, 0.0).logs

    # Runs ------------------------------------------------------------------------------------

    def _try(self, settings: Iterable[Setting]) -> None:
        """Run new settings on the hardest world, and those that count on the next."""
        new = [Trial(it) for it in dict.fromkeys(settings) if it[:2] not in self.trials]
        if self._room <= 0:
            return
        new = new[: max(1, self._room)]
        for world in self._order[:2]:
            if not self._run([(trial, world) for trial in new]):
                return
            new = self._promising(new)

    def _run(self, jobs: Sequence[tuple[Trial, int]], *, whole: bool = False) -> bool:
        """Run settings on worlds, and keep the outcomes; return whether they were run."""
        known = [trial.worst.point for trial in self._sound]
        known = [known[i] for i in front(known)]
        most = self._wanted(self._sound)
        least = min((point.error for point in known), default=0.0)

        def ends(_: Setting, so_far: Point) -> bool:
            rate, error = so_far.peak_rate * (1.0 + NEW), so_far.error * (1.0 + NEW)
            is_beaten = any(point.peak_rate <= rate and point.error <= error for point in known)
            return so_far.error > most or (is_beaten and so_far.error > (1.0 + ALIKE) * least)

        outcomes = self._trials.run([(trial.setting, world) for trial, world in jobs], None if whole else ends)
        for (trial, world), outcome in zip(jobs, outcomes or [], strict=bool(outcomes)):
            trial.outcomes[world] = outcome
            self.trials.setdefault(trial.setting[:2], trial)
        return outcomes is not None

    def _promising(self, some: Sequence[Trial]) -> list[Trial]:
        """Return settings that may count beside the others; where none keeps the limits, the nearest."""
        able = [trial for trial in some if trial.keeps_limits]
        known = self._sound
        if not able and not known:
            return sorted(some, key=lambda trial: trial.worst.excess)[:2]
        every = [*known, *(trial for trial in able if trial not in known)]
        chosen = [every[i] for i in front([trial.worst.point for trial in every])]
        preferred = best(every)
        return [trial for trial in able if trial in chosen or trial is preferred]

    def _finalists(self) -> list[Trial]:
        """Return the settings that count, by the area that they add to the front: greedily."""
        sound, line, reference = self._sound, self._line(), self._reference()
        preferred = best(sound)
        if preferred is None:
            return []
        second = best(it for it in sound if it.setting.structure.inverse != preferred.setting.structure.inverse)
        chosen = [trial for trial in (preferred, second) if trial]
        total = area([trial.worst.point for trial in line], reference)
        rest = [trial for trial in line if trial not in chosen]
        have = area([it.worst.point for it in chosen], reference)
        while rest:
            areas = [area([it.worst.point for it in (*chosen, trial)], reference) for trial in rest]
            i = int(np.argmax(areas))
            if areas[i] - have < WORTH * total:
                break
            have = areas[i]
            chosen.append(rest.pop(i))
        return chosen

    def _complete(self, some: Sequence[Trial]) -> None:
        """Run settings on the worlds that are left, and check their margin."""
        jobs = [(trial, world) for trial in some for world in range(self._worlds) if world not in trial.outcomes]
        if self._run(jobs, whole=True):
            self._check_margin([trial for trial in some if trial.keeps_limits])

    def _confirm(self, verdict: Verdict) -> bool:
        """Do the final checks of the named settings; return whether something was done."""
        named = [trial for trial in (verdict.recommended, verdict.second) if trial]
        loops = range(self._worlds, len(self._trials.planned))
        jobs = [(trial, loop) for trial in named for loop in loops if loop not in trial.outcomes]
        before = self._trials.done
        self._check_margin(named)
        self._run(jobs, whole=True)
        unfinished = any(len(trial.outcomes) < self._worlds for trial in self._finalists())
        return self._trials.done > before or unfinished

    # Margins ---------------------------------------------------------------------------------

    def _bears(self, settings: Sequence[Setting]) -> list[bool | None]:
        """Return whether settings tolerate the margin on the slowest loop."""
        loops = [(*it.changes, *self._trials._worlds[0].changes) for it in settings]
        answers = bears(self._study, loops, self._margin, threads=self._trials._threads, stop=self._trials.stop)
        self._trials.count(2 * len(settings))
        return answers

    def _lower_feedback(self) -> None:
        """Lower the largest feedback to what the best setting so far tolerates with the margin."""
        preferred = best(self._sound)
        if self._margin == 1.0 or FEEDBACK in self._space.only or preferred is None:
            return
        low, high = self._space.limits[FEEDBACK]
        for share in BORNE:
            if self._room < 2:
                return
            if self._bears([self._space.with_feedback(preferred.setting, share * high)]) == [True]:
                self._space.limits[FEEDBACK] = low, share * high
                return

    def _check_margin(self, some: Sequence[Trial]) -> bool:
        """Try settings with more feedback, if requested; return whether it was done.

        Of each inverse, the largest feedback is tried first: then less is stable too, unless some g(σ) σ is
        above 1.
        """
        if self._margin == 1.0:
            return True
        left = sorted((it for it in some if it.margin is None and it.setting.feedback > 0.0), key=lambda it: -it.setting.feedback)
        while left:
            batch = {it.setting.structure.inverse: it for it in reversed(left)}
            answers = self._bears([it.setting for it in batch.values()])
            if None in answers:
                return False
            for (inverse, trial), is_stable in zip(batch.items(), answers, strict=True):
                missed = f"with {self._margin:g} times its feedback its loop is unstable on the slowest robot"
                trial.margin = STABLE if is_stable else STABLE._replace(excess=1.0, missed=missed)
                if is_stable and inverse[0] not in ("transpose", "jparse"):
                    for other in left:
                        if other.setting.structure.inverse == inverse:
                            other.margin = STABLE
            left = [it for it in left if it.margin is None]
        return True
