"""What is tried next: points of every structure, then neighbors of the best, on the hardest copy first.

The scenario's own setting comes first, on all copies, and tells which of them is the hardest. Where there is
a model that is cheap to run, all structures are looked at on that, and the best of what was seen goes on.
What is tried is run on the hardest copy, and ends once it can no longer count: see `rmrc.tuning.bar`. What is
left of it is run on the other copies, one after another, and is raced in the same way, as the worst of more
runs is never better; then more feedback is tried. So nothing is lost that betters the front by more than is
told apart. Nondominated sorting is that of NSGA-II [Deb02]; that what does badly gets no more runs is the
idea of successive halving [Jamieson16].
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import count

import numpy as np

from rmrc.study.sobol import sobol_point
from rmrc.tuning.bar import Bar
from rmrc.tuning.front import front, ranks
from rmrc.tuning.space import Setting, Space
from rmrc.tuning.trials import Trials
from rmrc.tuning.tried import Tried, best, best_of_each, is_same

# Shares of the runs for the first look at all structures, and until the best of a look at a model are known
# on the copies.
_LOOK, _CONFIRM = 0.25, 0.5
# Settings that are tried at a time: enough for a batch on each of some cores, and few enough for what is
# found to end those that come after.
_ROUND = 64
# Steps in the unit cube, whose sides are two or three decades: the first, the last, and by how much they
# shrink after a round that brought something new, and after one that did not.
_FIRST_STEP, _LAST_STEP, _SHRINK = 0.25, 0.003, (0.6, 0.4)
# Other inverses than the best whose own best is refined as well, so that the comparison with it is fair.
_RIVALS = 4
# Where nothing keeps the limits, so many of a round that are nearest to it are run on the other copies.
_NEAREST = 2


class Search:
    """Settings that were tried, in their order: the same for a seed, whatever the threads."""

    def __init__(self, space: Space, trials: Trials, budget: int, seed: int) -> None:
        """Keep what a search needs.

        Args:
            space: What can be chosen.
            trials: Runs settings.
            budget: Runs in all.
            seed: Of what is drawn.
        """
        self._space, self._trials, self._seed = space, trials, seed
        self._left = self._budget = budget
        self._tried: dict[Setting, Tried] = {}
        self._seen: dict[Setting, Tried] = {}

    @property
    def tried(self) -> list[Tried]:
        """All settings that have a run on a copy."""
        return list(self._tried.values())

    @property
    def looks(self) -> int:
        """How many settings were looked at on a model."""
        return len(self._seen)

    @property
    def feasible(self) -> list[Tried]:
        """Those that keep all limits on all copies, and to what the search is restricted to."""
        return [one for one in self._whole() if one.keeps_limits and self._space.allows(one.setting)]

    def begin(self, own: Setting, slower: float) -> bool:
        """Run the scenario's own setting, by whose times the others are measured; say whether it was done.

        Args:
            own: As written.
            slower: Times its duration that the others may take; where it does not complete its path, times
                the duration of the path.
        """
        planned = self._trials.planned
        outcomes = self._trials.run([(own, copy) for copy in range(len(planned))])
        self._left -= len(planned)
        done = [one for one in outcomes if one is not None]
        if len(done) < len(planned):
            return False
        self._trials.allow(
            [
                slower * (one.time if one.completed == 1.0 else plan)
                for one, plan in zip(done, planned, strict=True)
            ]
        )
        self._own = self._tried[own] = Tried(own, dict(enumerate(done[: self._trials.copies])))
        return bool(self._bear([self._own]))

    def run(self) -> None:
        """Spend the runs, or as many of them as there is time for and as bring anything new."""
        if self._trials.model is None:
            for settings in self._looks():
                self._round(settings)
        else:
            for settings in self._looks():
                self._see(settings, self._trials.model)
            self._confirm()
        self._refine()

    def _whole(self) -> list[Tried]:
        """Return what was run to the end on all copies, and with more feedback where that is asked."""
        return [
            one
            for one in self._tried.values()
            if len(one.outcomes) == self._trials.copies and not one.worst.ended
            and (one.bears is not None or self._trials.margin == 1.0 or one.worst.excess > 0.0)
        ]  # fmt: skip

    def _looks(self) -> Iterator[list[Setting]]:
        """Yield each structure with the scenario's numbers, and points that fill its cube, as rounds."""
        structures, until = self._space.structures, self._left - int(_LOOK * self._budget)
        settings = [self._space.usual(one) for one in structures]
        for index in count():
            settings += [
                self._space.at(one, sobol_point(index, len(one.keys), self._seed)) for one in structures
            ]
            if len(settings) >= _ROUND:
                before = self._left
                yield settings[: before - until]
                settings = []
                if self._left <= max(until, 0) or self._left == before or self._trials.is_stopped:
                    return  # where nothing is new, the space is finite

    def _see(self, settings: Iterable[Setting], model: int) -> None:
        """Run settings that are new on a model, as far as they count there."""
        new = [one for one in dict.fromkeys(settings) if one not in self._seen][: self._left]
        known = [one for one in self._seen.values() if one.keeps_limits]
        found = self._run([Tried(one, {}) for one in new], model, known)
        self._seen |= {one.setting: one for one in found}

    def _confirm(self) -> None:
        """Try what did best on the model: the best of each inverse, then the first of the fronts."""
        able = sorted(
            (one for one in self._seen.values() if one.keeps_limits), key=lambda one: one.worst.error
        )
        first = best_of_each(able)
        first += best_of_each(one for one in able if one not in first)
        order = dict(zip(map(id, able), ranks([one.worst.point for one in able]), strict=True))
        rest = sorted((one for one in able if one not in first), key=lambda one: order[id(one)])
        until = int((1.0 - _CONFIRM) * self._budget)
        chosen = [one.setting for one in (*first, *rest) if order[id(one)] < 2 or one in first]
        for begin in range(0, len(chosen), _ROUND):
            if self._left > until and not self._trials.is_stopped:
                self._round(chosen[begin : begin + _ROUND])

    def _refine(self) -> None:
        """Try neighbors of the front and of the best of some inverses, in steps that shrink."""
        rounds, step = 0, _FIRST_STEP
        while self._left > 0 and step >= _LAST_STEP and not self._trials.is_stopped:
            random = np.random.default_rng((self._seed, rounds))
            parents = self._parents()
            children = []
            for child in range(_ROUND):
                parent = parents[child % len(parents)]
                point = self._space.point(parent) + step * random.standard_normal(len(parent.numbers))
                children.append(self._space.at(parent.structure, np.clip(point, 0.0, 1.0)))
            before = len(self._whole())
            self._round(children)
            step *= _SHRINK[len(self._whole()) == before]
            rounds += 1

    def _round(self, settings: Iterable[Setting]) -> None:
        """Run settings that are new on the hardest copy, and what counts then on the others."""
        written = {(one.structure, one.numbers) for one in self._tried}
        new = [one for one in dict.fromkeys(settings) if (one.structure, one.numbers) not in written]
        first, *others = self._hardest()
        found = self._run([Tried(one, {}) for one in new[: self._left]], first, self.feasible)
        self._tried |= {one.setting: one for one in found}
        for copy in others:
            found = self._run(self._promising(found)[: self._left], copy, self.feasible)
        able = [one for one in self._promising(found) if one.keeps_limits]
        self._bear(able[: max(0, self._left) // 2])

    def _hardest(self) -> list[int]:
        """Return the copies, that first on which most settings have their largest error."""
        most = Counter(max(one.outcomes, key=lambda i: one.outcomes[i].error) for one in self._whole())
        return sorted(range(self._trials.copies), key=lambda copy: (-most[copy], copy))

    def _run(self, some: Sequence[Tried], copy: int, known: Sequence[Tried]) -> list[Tried]:
        """Run settings on a copy as far as they count beside others; return what was not interrupted."""
        rivals = _rivals(known)
        of_each = [rivals.get(one.setting.structure.inverse, math.inf) for one in some]
        self._left -= len(some)
        jobs = [(one.setting, copy) for one in some]
        outcomes = self._trials.run(jobs, self._bar(known), of_each)
        done = [(one, out) for one, out in zip(some, outcomes, strict=True) if out is not None]
        for one, out in done:
            one.outcomes[copy] = out
        return [one for one, _ in done]

    def _bear(self, some: Sequence[Tried]) -> bool:
        """Try settings with more feedback, where that is asked; say whether it was done."""
        if self._trials.margin == 1.0 or not some:
            return True
        found = self._trials.bear([one.setting for one in some])
        self._left -= 2 * len(some)
        for one, out in zip(some, found, strict=True):
            one.bears = out
        return None not in found

    def _bar(self, known: Sequence[Tried]) -> Bar | None:
        own = [self._own.worst.point] if self._own.keeps_limits else []
        return Bar.of([one.worst.point for one in known], own)

    def _promising(self, found: Sequence[Tried]) -> list[Tried]:
        """Return what may still be on the front, or the best of its inverse, or the smoothest of the best."""
        able = sorted((one for one in found if one.keeps_limits), key=lambda one: one.worst.error)
        known, points = self.feasible, [one.worst.point for one in able]
        bar, rivals = self._bar(known), _rivals(known)
        if bar is None:
            # where nothing is feasible, what is nearer than before is worth its copies
            least = min((one.worst.excess for one in self._whole()), default=math.inf)
            near = sorted(
                (one for one in found if one.worst.excess < least), key=lambda one: one.worst.excess
            )
            return able or near[:_NEAREST]
        kept = {id(able[i]) for i in front(points)} | {id(one) for one in best_of_each(able)}
        rival = np.array([rivals.get(one.setting.structure.inverse, math.inf) for one in able])
        rate, error = np.array([point[:2] for point in points]).reshape(-1, 2).T
        left = bar.beats(rate, error, rival)
        counts = [one for one, is_left in zip(able, left, strict=True) if id(one) in kept and not is_left]
        preferred = best([*known, *able])
        return counts if preferred in (*known, *counts) or preferred is None else [preferred, *counts]

    def _parents(self) -> list[Setting]:
        """Return what is worth refining, the best first."""
        feasible = self.feasible
        if not feasible:
            near = sorted(self._whole(), key=lambda one: (one.worst.excess, one.worst.error))
            far = sorted(self._tried.values(), key=lambda one: (one.worst.excess, one.worst.error))
            found = [one.setting for one in [*near[:2], *far[: 2 * _RIVALS]]]
        else:
            bar = self._bar(feasible)
            assert bar is not None  # something is feasible
            on_front = [feasible[i] for i in front([one.worst.point for one in feasible])]
            near = [one for one in on_front if one.worst.error <= bar.wanted]
            first, *others = best_of_each(sorted(feasible, key=lambda one: one.worst.error))
            refined = [first, *(one for one in others if not is_same(one, first))][: _RIVALS + 1]
            # each second child is of the front, the others of the best few
            found = [
                one.setting
                for pair in zip(_spread(near, 2 * len(refined)), [*refined, *refined], strict=True)
                for one in pair
            ]
        allowed = [one for one in found if one.structure in self._space.structures]
        return allowed or [self._space.usual(self._space.structures[0])]


def _rivals(known: Sequence[Tried]) -> dict[tuple[str, str], float]:
    """Return the least error of each inverse."""
    by_error = sorted(known, key=lambda one: one.worst.error)
    return {one.setting.structure.inverse: one.worst.error for one in best_of_each(by_error)}


def _spread(found: Sequence[Tried], number: int) -> list[Tried]:
    """Return so many of a list, evenly, its ends included; again from the start where it is shorter."""
    return [found[round(i * (len(found) - 1) / max(1, number - 1))] for i in range(number)]
