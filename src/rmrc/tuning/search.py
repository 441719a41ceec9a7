"""What is tried next: points of every structure, then the best of them on the copies, then their neighbors.

The scenario itself comes first. Of the first look, the best of each inverse and the first fronts are run on
the copies, as far as the runs go. Of the neighbors, all that are not beaten already are: the worst of more
runs is never better, so that no neighbor that belongs on the front is lost. Nondominated sorting is that of
NSGA-II [Deb02]; that what does badly at first gets no more runs is the idea of successive halving
[Jamieson16].
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rmrc.study.sobol import sobol_point
from rmrc.tuning.front import dominates, front, ranks
from rmrc.tuning.space import Setting, Space
from rmrc.tuning.trials import Outcome, Trials, worst

# Shares of the runs for the first look at all structures, and until the best are known on the copies.
_EXPLORE, _CONFIRM = 0.4, 0.6
# Settings that are tried at a time at first: enough for any number of cores, and few enough for Ctrl-C.
_TOGETHER = 1000
# Neighbors that are tried at a time.
_ROUND = 32
# Steps in the unit cube, whose sides are two or three decades, from the first round to the last.
_FIRST_STEP, _LAST_STEP = 0.25, 0.003
# Other inverses than the best whose own best is refined as well, so that the comparison with it is fair.
_RIVALS = 4
# Errors within this share of the smallest one are as good, because other copies make more of a difference.
ALIKE = 0.02
# Peak rates and times within this share are the same to the digits that are shown.
SAME = 1e-3
# Where errors are so many times the smallest one, a front leads nowhere that anybody wants to go.
_FAR = 10.0


@dataclass
class Tried:
    """A setting and its runs.

    Attributes:
        setting: What was tried.
        outcomes: On the scenario itself, and then on the copies or on none of them.
    """

    setting: Setting
    outcomes: list[Outcome]
    _worst: Outcome = field(init=False, repr=False, compare=False)  # asked for again and again
    _of: int = field(default=0, init=False, repr=False, compare=False)

    @property
    def worst(self) -> Outcome:
        """The worst of its runs."""
        if self._of != len(self.outcomes):
            self._worst, self._of = worst(self.outcomes), len(self.outcomes)
        return self._worst

    @property
    def keeps_limits(self) -> bool:
        """Whether all its runs kept what is allowed."""
        return self.worst.excess <= 0.0


def is_same(one: Tried, other: Tried) -> bool:
    """Say whether two settings come to the same, as inverses do that differ only where the arm never is."""
    share = np.array([ALIKE, SAME, SAME])
    a, b = np.array(one.worst[:3]), np.array(other.worst[:3])
    return bool((np.abs(a - b) <= share * np.minimum(a, b)).all())


class Search:
    """Settings that were tried, in their order: the same for a seed, whatever the threads."""

    def __init__(self, space: Space, trials: Trials, copies: int, budget: int, seed: int) -> None:
        """Keep what a search needs.

        Args:
            space: What can be chosen.
            trials: Runs settings.
            copies: How many copies there are, the scenario itself counted.
            budget: Runs in all.
            seed: Of what is drawn.
        """
        self._space, self._trials, self._copies, self._seed = space, trials, copies, seed
        self._left = self._budget = budget
        self._tried: dict[Setting, Tried] = {}

    @property
    def tried(self) -> list[Tried]:
        """All settings that have a run."""
        return list(self._tried.values())

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
        outcomes = self._trials.run([(own, copy) for copy in range(self._copies)])
        self._left -= self._copies
        done = [one for one in outcomes if one is not None]
        if len(done) < self._copies:
            return False
        pairs = zip(done, self._trials.planned, strict=True)
        self._trials.allow([slower * (one.time if one.completed == 1.0 else plan) for one, plan in pairs])
        self._tried[own] = Tried(own, done)
        return True

    def run(self) -> None:
        """Spend the runs, or as many of them as there is time for."""
        self._explore()
        self._confirm()
        self._refine()

    def _whole(self) -> list[Tried]:
        return [one for one in self._tried.values() if len(one.outcomes) == self._copies]

    def _first(self, settings: Iterable[Setting]) -> list[Tried]:
        """Run settings on the scenario itself, those that are new and within the budget."""
        written = {(one.structure, one.numbers) for one in self._tried}
        new = [one for one in dict.fromkeys(settings) if (one.structure, one.numbers) not in written][
            : self._left
        ]
        self._left -= len(new)
        outcomes = self._trials.run([(one, 0) for one in new])
        found = [Tried(one, [out]) for one, out in zip(new, outcomes, strict=True) if out is not None]
        self._tried |= {one.setting: one for one in found}
        return found

    def _others(self, chosen: Sequence[Tried]) -> None:
        """Run settings on the copies, as many as are within the budget."""
        more = self._copies - 1
        chosen = chosen[: self._left // more] if more else []
        self._left -= more * len(chosen)
        outcomes = self._trials.run(
            [(one.setting, copy) for one in chosen for copy in range(1, self._copies)]
        )
        for i, one in enumerate(chosen):
            own = [out for out in outcomes[i * more : (i + 1) * more] if out is not None]
            if len(own) == more:
                one.outcomes += own

    def _explore(self) -> None:
        """Try each structure with the scenario's numbers, and at points that fill its cube."""
        structures, share = self._space.structures, int(_EXPLORE * self._budget)
        settings = [self._space.usual(one) for one in structures]
        for index in range(share // len(structures)):
            settings += [
                self._space.at(one, sobol_point(index, len(one.keys), self._seed)) for one in structures
            ]
            if len(settings) >= _TOGETHER:
                self._first(settings)
                settings = []
            if self._trials.is_stopped:
                return
        self._first(settings)

    def _confirm(self) -> None:
        """Run the first of the fronts on the copies, and before them the best of each inverse."""
        able = [one for one in self._tried.values() if one.keeps_limits and len(one.outcomes) < self._copies]
        able.sort(key=lambda one: one.worst.error)
        first = _best_of_each(able)
        first += _best_of_each(one for one in able if one not in first)
        far = _FAR * min((one.worst.error for one in self._tried.values() if one.keeps_limits), default=0.0)
        order = dict(zip(map(id, able), ranks([one.worst.point for one in able]), strict=True))
        able.sort(key=lambda one: (one.worst.error > far, order[id(one)], one.worst.error))
        until = self._left - int((1.0 - _CONFIRM) * self._budget)
        most = max(len(first), until // max(1, self._copies - 1))
        self._others([*first, *(one for one in able if one not in first)][:most])

    def _refine(self) -> None:
        """Try neighbors of the front and of the best of some inverses, in steps that shrink."""
        begun, rounds = self._left, 0
        while self._left >= self._copies and not self._trials.is_stopped:
            before, step = self._left, _FIRST_STEP * (_LAST_STEP / _FIRST_STEP) ** (1.0 - self._left / begun)
            random = np.random.default_rng((self._seed, rounds))
            parents = self._parents()
            children = []
            for child in range(_ROUND):
                parent = parents[child % len(parents)]
                point = self._space.point(parent) + step * random.standard_normal(len(parent.numbers))
                children.append(self._space.at(parent.structure, np.clip(point, 0.0, 1.0)))
            found, feasible = self._first(children), self.feasible
            self._others([one for one in found if self._is_promising(one, feasible)])
            rounds = rounds + 1
            if self._left == before:  # nothing is new: the space is finite
                break

    def _parents(self) -> list[Setting]:
        """Return what is worth refining, the best first."""
        feasible = self.feasible
        if not feasible:
            near = sorted(self._whole(), key=lambda one: (one.worst.excess, one.worst.error))
            far = sorted(self._tried.values(), key=lambda one: (one.worst.excess, one.worst.error))
            found = [one.setting for one in [*near[:2], *far[: 2 * _RIVALS]]]
        else:
            least = min(one.worst.error for one in feasible)
            on_front = [feasible[i] for i in front([one.worst.point for one in feasible])]
            near = [one for one in on_front if one.worst.error <= _FAR * least]
            first, *others = _best_of_each(sorted(feasible, key=lambda one: one.worst.error))
            best = [first, *(one for one in others if not is_same(one, first))][: _RIVALS + 1]
            # each second child is of the front, the others of the best few
            found = [
                one.setting
                for pair in zip(_spread(near, 2 * len(best)), [*best, *best], strict=True)
                for one in pair
            ]
        allowed = [one for one in found if one.structure in self._space.structures]
        return allowed or [self._space.usual(self._space.structures[0])]

    def _is_promising(self, one: Tried, feasible: Sequence[Tried]) -> bool:
        """Say whether a setting may still be on the front, or the best of its inverse."""
        if not one.keeps_limits:
            # where nothing is feasible, what is nearer than before is worth its copies
            return not feasible and one.worst.excess < min(other.worst.excess for other in self._whole())
        inverse, point = one.setting.structure.inverse, one.worst.point
        rivals = [other.worst for other in feasible if other.setting.structure.inverse == inverse]
        if all(other.error > point.error for other in rivals):
            return True
        return not any(dominates(other.worst.point, point) for other in feasible)


def _best_of_each(by_error: Iterable[Tried]) -> list[Tried]:
    """Return the first of each inverse."""
    best: dict[tuple[str, str], Tried] = {}
    for one in by_error:
        best.setdefault(one.setting.structure.inverse, one)
    return list(best.values())


def _spread(found: Sequence[Tried], count: int) -> list[Tried]:
    """Return so many of a list, evenly, its ends included; again from the start where it is shorter."""
    return [found[round(i * (len(found) - 1) / max(1, count - 1))] for i in range(count)]
