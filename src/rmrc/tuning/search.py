"""Choose the next settings: tried on a cheap model, on the hardest perturbed scenario, then on all.

The setting as written comes first, on all scenarios, and shows which of them is the hardest. All structures
are examined on the model, and neighbors of the best of them; the best there go on to the scenarios. From then
on a Gaussian process of each structure predicts the results of its neighbors from its runs there, and the
search runs the neighbors with the largest predicted gain of the front. Neighbors of a structure with few runs
are tried on the model first: their results there, and the results of their parents on both, predict their
results on the scenarios. Without a cheap model, the scenarios are used instead.

A run on the hardest scenario ends once it can no longer count: see `rmrc.tuning.bar`. The other settings are
run on the next scenario, and tried with more feedback. Only settings that count in the end are run on all the
others: the worst of more runs is never better, so nothing else can count. If the robot is a range, a
recommended setting is then run on more loops, evenly from the fastest to the slowest, and is left out if it
breaks a limit there: arms that rest at a singularity on almost equal loops may leave it on two branches.
Nondominated sorting is that of NSGA-II [Deb02]; giving no more runs to bad settings is the idea of successive
halving [Jamieson16]; running first the settings that add the most to the dominated area is that of
[Emmerich06].
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import count

import numpy as np
from numpy.typing import NDArray

from rmrc.study.sobol import sobol_point
from rmrc.tuning.bar import NEW, Bar
from rmrc.tuning.bearing import NEAR, Bearing, with_feedback
from rmrc.tuning.front import front
from rmrc.tuning.space import FEEDBACK, Setting, Space, Structure
from rmrc.tuning.surrogate import Surrogate, gains
from rmrc.tuning.trials import STABLE, Outcome, Trials, scaled
from rmrc.tuning.tried import Tried, best, best_of_each, is_same
from rmrc.tuning.verdict import Verdict, judge

# Shares of the runs for a look at all structures, and for the neighbors of the best of them on a model.
_LOOK, _NEARER = 0.25, 0.2
# Of the remaining runs, the share for the hardest scenario at once.
_CONFIRM = 0.25
# Settings that are tried at a time: enough for a batch on each of some cores, and few enough for their
# results to end later ones. Then on the model, before at most this many are run on the scenarios.
_ROUND, _NEXT_ROUND, _CHOSEN = 64, 32, 12
# Of a front on the model, so many go on to the scenarios.
_FRONT = 32
# Number of predicted neighbors of a structure; they count as better than expected by this many standard
# deviations. Those that add less than this share to the area of the front are not run.
_GUESSES, _HOPE, _GAIN = 200, 0.5, 2e-3
# Number of further neighbors that may have the least error of all, and of neighbors that are tried for a
# structure with too few runs for a prediction.
_LEAST_ERROR, _CHILDREN = 2, 4
# A setting that adds less than this share of its area to the front is not run on all of them. The area goes
# this far beyond the largest rate and error of the front, so that its ends count.
_WORTH, _BEYOND = 1e-3, 0.01
# Smaller rates and errors count as this one.
_NOTHING = 1e-12
# Settings are compared on so many scenarios, the hardest. Those that count in the end run on the others.
_HARDEST = 2
# The best setting so far is run on all scenarios once its error is below this share of the previous best.
_BETTER = 0.9
# Steps in the unit cube, whose sides are two or three decades: the first, the first of settings already
# refined on a model, the last, and the factors by which they shrink after a round with a new result, and
# after one without.
_FIRST_STEP, _NEXT_STEP, _LAST_STEP, _SHRINK = 0.25, 0.15, 0.003, (0.7, 0.5)
# Other inverses than the best whose own best is refined as well, so that the comparison with it is fair.
_RIVALS = 4
# Where nothing keeps the limits, so many of a round that are nearest to it are run on the other scenarios.
_NEAREST = 2
# Shares of the largest feedback of which it is asked first whether a loop tolerates it, within what share of
# the runs that are left.
_PROBED, _PROBES = (1.0, 0.94, 0.88, 0.8), 0.1


_Array = NDArray[np.float64]


class Search:
    """Tried settings in their order, which depends on the seed and not on the threads."""

    def __init__(self, space: Space, trials: Trials, budget: int, seed: int) -> None:
        """Keep the data of a search.

        Args:
            space: The possible settings.
            trials: Runs settings.
            budget: Number of runs.
            seed: Seed of the random numbers.
        """
        self._space, self._trials, self._seed = space, trials, seed
        self._left = self._budget = float(budget)
        self._tried: dict[Setting, Tried] = {}
        self._seen: dict[Setting, Tried] = {}
        self._bearing = Bearing()

    @property
    def tried(self) -> list[Tried]:
        """All settings that have a run on a scenario."""
        return list(self._tried.values())

    @property
    def edge(self) -> float:
        """The feedback with which loops are about to be unstable [1/s]; 0: it is not known."""
        return self._bearing.expected * self._trials.margin

    @property
    def looks(self) -> int:
        """Number of settings that were examined on a model."""
        return len(self._seen)

    @property
    def feasible(self) -> list[Tried]:
        """Settings that keep all limits on all scenarios, within the restrictions of the search."""
        return [one for one in self._sound if self._is_whole(one)]

    @property
    def _sound(self) -> list[Tried]:
        """Those that may be feasible, by their runs on the hardest scenarios at least."""
        return [one for one in self._known() if one.keeps_limits and self._space.allows(one.setting)]

    def begin(self, own: Setting, slower: float) -> bool:
        """Run the scenario's own setting, which sets the time scale of the others; return whether it was run.

        Args:
            own: As written.
            slower: Times its duration that the others may take; where it does not complete its path, times
                the duration of the path.
        """
        trials, done = self._trials, list[Outcome]()
        for _ in range(1 if trials.model is None else 2):  # the model last, once the hardest is known
            scenarios = range(len(done), len(trials.planned) if done else trials.scenarios)
            outcomes = trials.run([(own, case) for case in scenarios])
            self._left -= len(scenarios)
            done += [one for one in outcomes if one is not None]
            if len(done) < scenarios.stop:
                return False
            trials.aim(max(range(trials.scenarios), key=lambda case: done[case].error))
        trials.allow(
            [
                slower * (one.time if one.completed == 1.0 else plan)
                for one, plan in zip(done, trials.planned, strict=True)
            ]
        )
        self._own = self._tried[own] = Tried(own, dict(enumerate(done[: trials.scenarios])))
        if trials.model is not None:
            self._seen[own] = Tried(own, {trials.model: done[trials.model]})
        return self._bear([self._own])

    def run(self) -> None:
        """Use the runs, as long as there is time and new settings remain."""
        model = self._trials.model
        for settings in self._looks():
            if model is None:
                self._round(settings)
            else:
                self._see(settings, self._able_on_model())
        if model is not None:
            self._refine_model()
            self._confirm()
        self._refine()

    def _known(self) -> list[Tried]:
        """Return settings run to the end on the hardest scenarios, and with more feedback if requested."""
        return [
            one
            for one in self._tried.values()
            if len(one.outcomes) >= min(_HARDEST, self._trials.scenarios) and not one.worst.ended
            and (one.bears is not None or self._trials.margin == 1.0 or one.worst.excess > 0.0)
        ]  # fmt: skip

    def _is_whole(self, one: Tried) -> bool:
        """Return whether a setting was run on all scenarios."""
        return len(one.outcomes) == self._trials.scenarios

    def _able_on_model(self) -> list[Tried]:
        """Return possible settings that keep limits on the model, by rising error."""
        return self._able(one for one in self._seen.values() if self._space.allows(one.setting))

    def _able(self, some: Iterable[Tried]) -> list[Tried]:
        """Return those that keep limits, by rising error."""
        return sorted((one for one in some if one.keeps_limits), key=lambda one: one.worst.error)

    @property
    def _room(self) -> int:
        """Number of remaining runs of scenarios, without those already needed."""
        return max(0, int(self._left) - self._owed)

    @property
    def _owed(self) -> int:
        """How many runs `_settle` would make now."""
        return max(0, self._trials.scenarios - _HARDEST) * len(self._unsettled())

    # Stages ---------------------------------------------------------------------------------

    def _looks(self) -> Iterator[list[Setting]]:
        """Yield each structure with the scenario's numbers, and points that fill its cube, as rounds."""
        structures, until = (
            self._space.structures,
            self._left - int(_LOOK * self._budget) * self._trials.weight,
        )
        settings = [self._space.usual(one) for one in structures]
        for index in count():
            settings += [
                self._space.at(one, sobol_point(index, len(one.keys), self._seed)) for one in structures
            ]
            if len(settings) >= _ROUND:
                before = self._left
                yield settings[: max(0, round((before - until) / self._trials.weight))]
                settings = []
                if self._left <= max(until, 0.0) or self._left == before or self._trials.is_stopped:
                    return  # where nothing is new, the space is finite

    def _refine_model(self) -> None:
        """Try neighbors on the model, before the runs on the scenarios."""
        until = self._left - int(_NEARER * self._budget) * self._trials.weight
        for step, round_ in self._steps(_FIRST_STEP, until, self._able_on_model):
            able = self._able_on_model()
            if not able:
                return
            children = self._children(self._parents(able), step, (self._seed, 1, round_), _ROUND)
            self._see((child for child, _ in children), able, until)

    def _confirm(self) -> None:
        """Try on the scenarios the best settings of the model: its front, and the best of some inverses."""
        able = [one for one in self._able_on_model() if not one.setting.is_written]
        bar, preferred = self._bar(able), best(able)
        if bar is None or preferred is None:
            return
        on_front = [able[i] for i in front([one.worst.point for one in able])]
        near = [one for one in on_front if one.worst.error <= bar.wanted]
        first = [preferred, *best_of_each(able), *_spread(near, min(_FRONT, len(near)))]
        self._probe(preferred.setting)
        some = [self._bearing.within(one.setting, self._space) for one in first]
        if self._trials.margin > 1.0 and not self._bearing.probed:  # stability limits are found on the way
            shares = _PROBED * len(some)
            some = [
                with_feedback(one, by * one.feedback, self._space)
                for one, by in zip(some, shares, strict=False)
            ]
        self._round(list(dict.fromkeys(some))[: max(1, int(_CONFIRM * self._left))])

    def _refine(self) -> None:
        """Try neighbors of the front and of the best of some inverses, in steps that shrink."""
        model = self._trials.model
        first, number = (_FIRST_STEP, _ROUND) if model is None else (_NEXT_STEP, _NEXT_ROUND)
        for step, round_ in self._steps(first, 0.0, self._known):
            if not self._room:
                return
            learned, unknown = self._learned(step, (self._seed, 2, round_))
            some, count = (unknown, _CHILDREN * len(unknown)) if learned else (self._worth_refining(), number)
            children = self._children(some, step, (self._seed, round_), count) if some else []
            tried = [child for child, _ in children] if model is None else self._expected(children)
            self._round([*learned, *(tried[:_CHILDREN] if learned else tried)])
            self._settle_best()

    def _steps(
        self, step: float, until: float, known: Callable[[], list[Tried]]
    ) -> Iterator[tuple[float, int]]:
        """Yield steps and their numbers until so many runs are left; they shrink faster if nothing is new."""
        for round_ in count():
            if self._left <= max(until, 0.0) or step < _LAST_STEP or self._trials.is_stopped:
                return
            before = len(known())
            yield step, round_
            step *= _SHRINK[len(known()) == before]

    # Proposals ------------------------------------------------------------------------------

    def _children(
        self, parents: Sequence[Tried], step: float, seed: tuple[int, ...], number: int
    ) -> list[tuple[Setting, Tried]]:
        """Return neighbors, each with its parent."""
        random, children = np.random.default_rng(seed), list[tuple[Setting, Tried]]()
        for child in range(number):
            parent = parents[child % len(parents)]
            point = self._space.point(parent.setting)
            point = np.clip(point + step * random.standard_normal(len(point)), 0.0, 1.0)
            setting = self._space.at(parent.setting.structure, point)
            children.append((self._bearing.within(setting, self._space), parent))
        return children

    def _expected(self, children: Sequence[tuple[Setting, Tried]]) -> list[Setting]:
        """Return which neighbors are expected to count, by their and their parents' results on the model."""
        if not self._sound:
            return [child for child, _ in children]
        self._see([setting for child, parent in children for setting in (child, parent.setting)])
        expected = list[Tried]()
        for child, parent in dict(children).items():
            seen, before = self._seen.get(child), self._seen.get(parent.setting)
            if seen is None or before is None or seen.worst.excess > max(0.0, before.worst.excess):
                continue
            expected.append(Tried(child, {0: scaled(seen.worst, before.worst, parent.worst)}))
        counts = self._promising([one for one in expected if one.setting not in self._tried])
        return [one.setting for one in _spread(counts, min(_CHOSEN, len(counts)))]

    def _learned(self, step: float, seed: tuple[int, ...]) -> tuple[list[Setting], list[Tried]]:
        """Return neighbors that may count by the runs on scenarios, and parents with too few such runs."""
        sound, random = self._sound, np.random.default_rng(seed)
        if not sound:
            return [], []
        by_error = sorted(sound, key=lambda one: one.worst.error)
        on_front = [by_error[i] for i in front([one.worst.point for one in by_error])]
        parents: dict[Structure, list[Tried]] = {}
        for one in (*_unlike(best_of_each(by_error)), *on_front):
            if one.setting.structure in self._space.structures:
                parents.setdefault(one.setting.structure, []).append(one)
        settings, figures, unknown = list[Setting](), list[_Array](), list[Tried]()
        for structure, some in parents.items():
            known = [one for one in self._tried.values() if one.setting.structure == structure]
            points = np.array([self._space.point(one.setting) for one in known])
            values = _logs(known)
            # a run that ended at a broken limit could not become worse
            tells = np.array([not (one.worst.ended and one.worst.excess > 0.0) for one in known])
            tells &= np.isfinite(values).all(axis=1)
            if tells.sum() <= 2 * len(structure.keys):
                unknown.append(some[0])
                continue
            new = self._neighbors(structure, some, step, random)
            at = np.array([self._space.point(one) for one in new]).reshape(-1, len(structure.keys))
            nearest = np.linalg.norm(at[:, None] - points, axis=2).argmin(axis=1)
            keeps = np.array([one.worst.excess <= 0.0 for one in known])[nearest]
            settings += [one for one, is_kept in zip(new, keeps, strict=True) if is_kept]
            figures += [*Surrogate(points[tells], values[tells]).at(at[keeps], _HOPE)]
        return self._choose(settings, np.array(figures).reshape(-1, 2), sound), unknown

    def _choose(self, settings: Sequence[Setting], figures: _Array, sound: Sequence[Tried]) -> list[Setting]:
        """Return settings that better the front most, one after another, and one for each inverse."""
        known = _logs(sound)
        reference = self._reference(sound)
        least_gain = _GAIN * _area(known, reference)
        chosen = list[int]()
        rivals = list(_rivals(sound).items())
        for inverse, least in [*rivals[: _RIVALS + 1], *[rivals[0]] * _LEAST_ERROR]:
            own = [
                i for i, one in enumerate(settings) if one.structure.inverse == inverse and i not in chosen
            ]
            if own:
                i = min(own, key=lambda i: float(figures[i, 1]))
                if figures[i, 1] < math.log(least) - NEW:
                    chosen.append(i)
                    known = np.vstack([known, figures[i]])
        while settings and len(chosen) < _CHOSEN:
            gained = gains(known, figures, reference)
            i = int(gained.argmax())
            if gained[i] <= least_gain:
                break
            chosen.append(i)
            known = np.vstack([known, figures[i]])
        return [settings[i] for i in dict.fromkeys(chosen)]

    def _neighbors(
        self, structure: Structure, parents: Sequence[Tried], step: float, random: np.random.Generator
    ) -> list[Setting]:
        """Return new settings beside some and between them."""
        points = np.array([self._space.point(one.setting) for one in parents])
        first, second = random.integers(len(points), size=(2, _GUESSES))
        first[: _GUESSES // 4] = min(range(len(points)), key=lambda i: parents[i].worst.error)
        share = np.where(random.random(_GUESSES) < 0.5, 0.0, random.uniform(-0.5, 1.5, _GUESSES))[:, None]
        off = (
            step
            * random.uniform(0.1, 1.0, (_GUESSES, 1))
            * random.standard_normal((_GUESSES, points.shape[1]))
        )
        found = points[first] + share * (points[second] - points[first]) + off
        settings = [self._space.at(structure, one) for one in np.clip(found, 0.0, 1.0)]
        new = dict.fromkeys(self._bearing.all_within(settings, self._space))
        return [one for one in new if one not in self._tried]

    def _worth_refining(self) -> list[Tried]:
        """Return the settings to refine on the scenarios; if none is feasible, the nearest."""
        sound = self._sound
        if sound:
            return self._parents(sound)
        near = sorted(self._known(), key=lambda one: (one.worst.excess, one.worst.error))
        far = sorted(self._tried.values(), key=lambda one: (one.worst.excess, one.worst.error))
        return self._possible([*near[:2], *far[: 2 * _RIVALS]])

    def _parents(self, known: Sequence[Tried]) -> list[Tried]:
        """Return the settings to refine: alternately from the front, and the best of some inverses."""
        bar = self._bar(known)
        assert bar is not None  # something is known
        near = [known[i] for i in front([one.worst.point for one in known])]
        near = [one for one in near if one.worst.error <= bar.wanted]
        refined = _unlike(best_of_each(sorted(known, key=lambda one: one.worst.error)))
        pairs = zip(_spread(near, 2 * len(refined)), [*refined, *refined], strict=True)
        return self._possible([one for pair in pairs for one in pair])

    def _possible(self, some: Iterable[Tried]) -> list[Tried]:
        """Return those whose structure can be chosen; the first structure as it is where none can."""
        allowed = [one for one in some if one.setting.structure in self._space.structures]
        return allowed or [Tried(self._space.usual(self._space.structures[0]), {})]

    # Runs -----------------------------------------------------------------------------------

    def _see(self, settings: Iterable[Setting], known: Sequence[Tried] = (), until: float = 0.0) -> None:
        """Run new settings on the model, as far as they count beside the known results."""
        assert self._trials.model is not None
        room = max(0, round((self._left - max(until, self._owed)) / self._trials.weight))
        new = [one for one in dict.fromkeys(settings) if one not in self._seen][:room]
        found = self._run([Tried(one, {}) for one in new], [self._trials.model], known)
        self._seen |= {one.setting: one for one in found}

    def _round(self, settings: Iterable[Setting]) -> None:
        """Run settings that are new on the hardest scenario, then on the next and with more feedback."""
        written = {(one.structure, one.numbers) for one in self._tried}
        new = [one for one in dict.fromkeys(settings) if (one.structure, one.numbers) not in written]
        first, *others = self._hardest()
        left = self._trials.scenarios - 1 + 2 * (self._trials.margin > 1.0)  # runs that follow if it counts
        most = self._room // (2 if left else 1)
        found = self._run([Tried(one, {}) for one in new[:most]], [first], self._sound)
        self._tried |= {one.setting: one for one in found}
        found = self._promising(found)[: self._room // max(1, left)]
        if others:
            found = self._run(found, others[: _HARDEST - 1], self._sound)
        self._bear(self._promising(found))

    def _unsettled(self) -> list[Tried]:
        """Return settings that count by the hardest scenarios but lack others, the most important first."""
        sound = self._sound
        preferred = best(sound)
        if preferred is None:
            return []
        inverse = preferred.setting.structure.inverse
        others = [one for one in sound if one.setting.structure.inverse != inverse]
        unlike = [one for one in others if not is_same(one, preferred)]
        each = best_of_each(sorted(others, key=lambda one: one.worst.error))[:_RIVALS]
        named = {id(one): one for one in (preferred, best(unlike), *each) if one}
        counts = [one for one in named.values() if not self._is_whole(one)]
        points = _logs(sound)
        reference = self._reference(sound)
        known = np.array([i for i, one in enumerate(sound) if self._is_whole(one) or one in counts], int)
        nothing = np.empty((0, 2))
        least = _WORTH * float(_area(points, reference))
        known = points[known] if len(known) else nothing
        while True:
            gained = gains(known, points, reference)
            i = int(gained.argmax())
            if gained[i] <= least:
                return counts
            counts.append(sound[i])
            known = np.vstack([known, points[i]])

    def _reference(self, sound: Sequence[Tried]) -> tuple[float, float]:
        """Return the logarithms of the peak rate and the error beyond which nothing counts."""
        bar = self._bar(sound)
        assert bar is not None
        rates = [rate for rate in (self._own.worst.peak_rate, bar.rates[-1]) if math.isfinite(rate)]
        rate, error = np.log(np.maximum((max(rates), bar.wanted), _NOTHING)) + _BEYOND
        return float(rate), float(error)

    def _settle(self) -> None:
        """Run settings that count by the hardest scenarios on all, until none is left."""
        while (some := self._unsettled()) and not self._trials.is_stopped:
            before = self._left
            self._complete(some)
            if self._left == before:
                return

    def _settle_best(self) -> None:
        """Run the best setting so far on all scenarios, where it is far better than those run there."""
        known, whole = best(self._sound), best(self.feasible)
        if known and (not whole or known.worst.error < _BETTER * whole.worst.error):
            self._complete([known])

    def _complete(self, some: Sequence[Tried]) -> None:
        """Run settings on the scenarios that are left of each, as far as there is room."""
        missing = [[c for c in range(self._trials.scenarios) if c not in one.outcomes] for one in some]
        fitting = np.cumsum([len(scenarios) for scenarios in missing]) <= self._left
        fitting[0] |= not self.feasible  # a result is worth more than a few runs
        jobs = [
            (one, case)
            for one, scenarios, fits in zip(some, missing, fitting, strict=True)
            if fits
            for case in scenarios
        ]
        self._left -= len(jobs)
        outcomes = self._trials.run([(one.setting, case) for one, case in jobs])
        for (one, case), out in zip(jobs, outcomes, strict=True):
            if out is not None:
                one.outcomes[case] = out

    def _hardest(self) -> list[int]:
        """Return the scenarios, that first on which the setting as written has its largest error."""
        errors = [self._own.outcomes[case].error for case in range(self._trials.scenarios)]
        first = int(np.argmax(errors))
        return [first, *(case for case in range(self._trials.scenarios) if case != first)]

    def _run(self, some: Sequence[Tried], scenarios: Sequence[int], known: Sequence[Tried]) -> list[Tried]:
        """Run settings on scenarios as far as they count beside others; return the uninterrupted ones."""
        rivals = _rivals(known)
        jobs = [(one, case) for case in scenarios for one in some]
        of_each = [rivals.get(one.setting.structure.inverse, math.inf) for one, _ in jobs]
        self._left -= len(jobs) * (self._trials.weight if scenarios == [self._trials.model] else 1.0)
        outcomes = self._trials.run([(one.setting, case) for one, case in jobs], self._bar(known), of_each)
        for (one, case), out in zip(jobs, outcomes, strict=True):
            if out is not None:
                one.outcomes[case] = out
        return [one for one in some if one.outcomes.keys() >= set(scenarios)]

    def _bear(self, some: Iterable[Tried]) -> bool:
        """Try settings with more feedback, if requested; return whether it was done.

        Settings with the largest feedback of each inverse come first; implied results are not run.
        """
        if self._trials.margin == 1.0:
            return True
        left = {one.setting: one for one in some if one.keeps_limits and one.bears is None}
        while left:
            for setting in [one for one in left if self._bearing.implies(one)]:
                one = left.pop(setting)
                one.bears, one.is_implied = STABLE, True
            if not self._ask([left.pop(one) for one in self._bearing.to_ask(list(left))]):
                return False
        return True

    def _ask(self, some: Sequence[Tried]) -> bool:
        """Run settings with more feedback; return whether they were run."""
        found = self._trials.bear([one.setting for one in some])
        self._left -= 2 * len(some)
        for one, out in zip(some, found, strict=True):
            if out is not None:
                one.bears, one.is_implied = out, False
                self._bearing.add(one.setting, bears=out.excess <= 0.0)
        return None not in found

    def judge(self) -> Verdict:
        """Return the verdict; the first two settings were run with more feedback, and on all loops."""
        while True:
            self._settle()
            verdict = judge(self.feasible, self.tried, self._own)
            named = [one for one in (verdict.recommended, verdict.second) if one]
            implied = [one for one in named if one.is_implied]
            new = [one for one in named if self._trials.loops and one.between is None]
            if not (self._ask(implied) if implied else new and self._cross(new)):
                return verdict

    def _cross(self, some: Sequence[Tried]) -> bool:
        """Run the scenario itself with settings on the other loops; return whether it was run."""
        found = self._trials.between([one.setting for one in some])
        self._left -= len(some) * len(self._trials.loops)
        for one, out in zip(some, found, strict=True):
            one.between = out
        return None not in found

    def _probe(self, setting: Setting) -> None:
        """Find the stable feedback of a setting, to a few percent, if requested."""
        if self._trials.margin == 1.0 or FEEDBACK in self._space.only:
            return
        high = self._space.limits[FEEDBACK][1]
        wanted = [share * high for share in _PROBED]
        while wanted and 2 * len(wanted) <= _PROBES * self._left and not self._trials.is_stopped:
            some = [with_feedback(setting, one, self._space) for one in wanted]
            self._left -= 2 * len(some)
            for one, out in zip(some, self._trials.bear(some), strict=True):
                if out is not None:
                    self._bearing.probed[one.feedback] = out.excess <= 0.0
            low, high = self._bearing.edge
            if low == 0.0:
                wanted = [share * high for share in _PROBED[1:]]
            else:
                wanted = list(np.geomspace(low, high, 5)[1:-1]) if low * NEAR < high < math.inf else []

    # Promising settings ---------------------------------------------------------------------

    def _bar(self, known: Sequence[Tried]) -> Bar | None:
        own = [self._own.worst.point] if self._own.keeps_limits else []
        return Bar.of([one.worst.point for one in known], own)

    def _promising(self, found: Sequence[Tried]) -> list[Tried]:
        """Return settings that may be on the front, best of their inverse, or smoothest of the best."""
        able = self._able(found)
        known, points = self._sound, [one.worst.point for one in able]
        bar, rivals = self._bar(known), _rivals(known)
        if bar is None:
            # if none is feasible, a setting nearer than before is run on all scenarios
            least = min((one.worst.excess for one in self._known()), default=math.inf)
            near = sorted(
                (one for one in found if one.worst.excess < least), key=lambda one: one.worst.excess
            )
            return able or near[:_NEAREST]
        kept = {id(able[i]) for i in front(points)} | {id(one) for one in best_of_each(able)[: _RIVALS + 1]}
        rival = np.array([rivals.get(one.setting.structure.inverse, math.inf) for one in able])
        rate, error = np.array([point[:2] for point in points]).reshape(-1, 2).T
        left = bar.beats(rate, error, rival)
        counts = [one for one, is_left in zip(able, left, strict=True) if id(one) in kept and not is_left]
        preferred = best([*known, *able])
        return counts if preferred in (*known, *counts) or preferred is None else [preferred, *counts]


def _logs(some: Sequence[Tried]) -> _Array:
    """Return the logarithms of peak rates and errors, (k, 2)."""
    return np.log(np.maximum([one.worst[1::-1] for one in some], _NOTHING))


def _area(points: _Array, reference: tuple[float, float]) -> float:
    """Return the area of a plane below a reference that points dominate."""
    area, kept = 0.0, np.empty((0, 2))
    for point in points[np.argsort(points[:, 0])]:
        area += float(gains(kept, point[None], reference)[0])
        kept = np.vstack([kept, point])
    return area


def _rivals(known: Sequence[Tried]) -> dict[tuple[str, str], float]:
    """Return the least error of each inverse."""
    by_error = sorted(known, key=lambda one: one.worst.error)
    return {one.setting.structure.inverse: one.worst.error for one in best_of_each(by_error)}


def _unlike(by_error: Sequence[Tried]) -> list[Tried]:
    """Return the first, and some later ones with other results."""
    first, *others = by_error
    return [first, *(one for one in others if not is_same(one, first))][: _RIVALS + 1]


def _spread(found: Sequence[Tried], number: int) -> list[Tried]:
    """Return this many items of a list, evenly spaced and including its ends; repeat a shorter list."""
    return [found[round(i * (len(found) - 1) / max(1, number - 1))] for i in range(number)]
