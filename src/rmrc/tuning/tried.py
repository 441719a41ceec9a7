"""A setting and its outcomes, and the best of several."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rmrc.scenario.choices import INVERSES
from rmrc.tuning.bar import ALIKE, SAME
from rmrc.tuning.space import AT_SINGULARITY, WORDS, Setting
from rmrc.tuning.trials import Outcome, worst

# If κ reaches this, a plain inverse is a matter of luck: the arm may come nearer, with higher rates.
SINGULAR = 100.0
# Feedback within this share counts as equal: then the structure decides.
SLOW = 0.1


@dataclass
class Tried:
    """A setting and its runs.

    Attributes:
        setting: The setting.
        outcomes: By the numbers of the scenarios, 0 for the scenario itself.
        bears: Outcome with more feedback: None if unknown.
        is_implied: Whether only another setting implies that outcome.
        between: The worst outcome of the scenario itself on more loops: None if unknown.
    """

    setting: Setting
    outcomes: dict[int, Outcome]
    bears: Outcome | None = None
    is_implied: bool = False
    between: Outcome | None = None
    _worst: Outcome = field(init=False, repr=False, compare=False)  # used repeatedly
    _of: tuple[object, ...] = field(default=(), init=False, repr=False, compare=False)

    @property
    def worst(self) -> Outcome:
        """The worst of its runs."""
        beside = self.bears, self.between  # an implied outcome may turn out to be wrong
        known = len(self.outcomes), *beside
        if self._of != known:
            every = [*self.outcomes.values(), *filter(None, beside)]
            self._worst, self._of = worst(every), known
        return self._worst

    @property
    def keeps_limits(self) -> bool:
        """Whether all its runs so far kept the limits."""
        return self.worst.excess <= 0.0 and not self.worst.ended

    @property
    def feedback(self) -> float:
        """Its feedback [1/s]."""
        return self.setting.feedback

    @property
    def is_bounded(self) -> bool:
        """Whether its rates stay bounded if the arm comes nearer to a singularity than in its runs."""
        is_plain = INVERSES[self.setting.structure.method].preference >= INVERSES["pseudoinverse"].preference
        return not is_plain or self.worst.condition < SINGULAR


def is_same(one: Tried, other: Tried) -> bool:
    """Return whether two settings have equal results, as inverses that differ only in unvisited states."""
    share = np.array([ALIKE, SAME, SAME])
    a, b = np.array(one.worst[:3]), np.array(other.worst[:3])
    return bool((np.abs(a - b) <= share * np.minimum(a, b)).all())


def best(some: Iterable[Tried]) -> Tried | None:
    """Return the setting with the smallest error; of nearly equal errors, the smoothest; None of none.

    Of equally smooth settings, the one with the lowest feedback; then the preferred structure, and its
    smallest error. A setting that is unbounded near a singularity only counts if there is no other.
    """
    able = sorted(some, key=preference)
    alike = _least([one for one in able if one.is_bounded] or able, lambda one: one.worst.error, ALIKE)
    alike = _least(alike, lambda one: one.worst.roughness, ALIKE)
    alike = _least(alike, lambda one: one.feedback, SLOW)
    alike = [one for one in alike if _structure(one) == _structure(alike[0])]
    return min(alike, key=lambda one: (one.worst.error, one.worst.time), default=None)


def _least(some: Sequence[Tried], figure: Callable[[Tried], float], share: float) -> list[Tried]:
    """Return those with the smallest metric, or more by at most a share."""
    most = min(map(figure, some), default=0.0) * (1.0 + share)
    return [one for one in some if figure(one) <= most]


def _structure(one: Tried) -> tuple[object, bool]:
    return one.setting.structure, one.setting.is_written


def preference(one: Tried) -> tuple[bool, int, bool, int, float, tuple[float, ...]]:
    """Return the rank of equal settings: as written, then the simplest policy."""
    structure, out = one.setting.structure, one.worst
    policy = WORDS[AT_SINGULARITY].index(structure.at_singularity)
    return (
        not one.setting.is_written,
        policy,
        structure.on_excess != "",
        INVERSES[structure.method].preference,
        out.error,
        one.setting.numbers,
    )


def best_of_each(by_error: Iterable[Tried]) -> list[Tried]:
    """Return the first of each inverse."""
    found: dict[tuple[str, str], Tried] = {}
    for one in by_error:
        found.setdefault(one.setting.structure.inverse, one)
    return list(found.values())
