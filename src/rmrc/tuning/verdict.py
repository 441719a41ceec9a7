"""What is best of all that was tried, and what it is held against."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rmrc.scenario.choices import INVERSES
from rmrc.tuning.front import dominates, front
from rmrc.tuning.search import ALIKE, SAME, Tried, is_same
from rmrc.tuning.space import AT_SINGULARITY, WORDS
from rmrc.tuning.trials import Outcome


@dataclass(frozen=True)
class Verdict:
    """What is best.

    Attributes:
        front: Feasible settings that no other dominates, by rising peak rate; of those that come to the same
            figures, the one that is preferred.
        recommended: The best setting; None where nothing is feasible.
        alike: The best of each other inverse that comes to the figures of the recommended one.
        second: The best with an inverse or schedule that comes to other figures; None where there is none.
        better: The best that dominates the setting as written; None where it is on the front.
        nearest: The setting that misses what is allowed by least, where nothing is feasible.
    """

    front: tuple[Tried, ...]
    recommended: Tried | None
    alike: tuple[Tried, ...]
    second: Tried | None
    better: Tried | None
    nearest: Tried | None


def judge(feasible: Sequence[Tried], tried: Sequence[Tried], own: Tried) -> Verdict:
    """Return what is best.

    Args:
        feasible: Settings that keep what is allowed on all copies.
        tried: All that were tried, one at least.
        own: The setting as written.
    """
    preferred = sorted(feasible, key=_preference)
    points = {one.worst.point: one for one in reversed(preferred)}
    on_front = [points[point] for point in (list(points)[i] for i in front(list(points)))]
    recommended = _best(preferred)
    if recommended is None:
        nearest = min(tried, key=lambda one: (-len(one.outcomes), one.worst.excess, one.worst.error))
        return Verdict((), None, (), None, None, nearest)
    inverse = recommended.setting.structure.inverse
    rivals = [one for one in preferred if one.setting.structure.inverse != inverse]
    equal = [one for one in rivals if is_same(one, recommended)]
    same = {one.setting.structure.inverse: one for one in reversed(equal)}
    others = [one for one in rivals if one.setting.structure.inverse not in same]
    better = [one for one in preferred if dominates(one.worst.point, own.worst.point)]
    return Verdict(
        tuple(on_front),
        recommended,
        tuple(sorted(same.values(), key=_preference)),
        _best(others),
        recommended if recommended in better else _best(better),
        None,
    )


def _best(preferred: Sequence[Tried]) -> Tried | None:
    """Return the setting with the smallest error; of errors that are alike, with the lowest peak rate.

    Of rates that no digit shown tells apart, the structure that is preferred, and its smallest error.
    """
    alike = _least(preferred, lambda out: out.error, ALIKE)
    alike = _least(alike, lambda out: out.peak_rate, SAME)
    alike = [one for one in alike if _structure(one) == _structure(alike[0])]
    return min(alike, key=lambda one: (one.worst.error, one.worst.time), default=None)


def _least(some: Sequence[Tried], figure: Callable[[Outcome], float], share: float) -> list[Tried]:
    """Return those whose figure is the least one, or more by a share at most."""
    most = min((figure(one.worst) for one in some), default=0.0) * (1.0 + share)
    return [one for one in some if figure(one.worst) <= most]


def _structure(one: Tried) -> tuple[object, bool]:
    return one.setting.structure, one.setting.is_written


def _preference(one: Tried) -> tuple[bool, int, int, float, tuple[float, ...]]:
    """Return what comes first of equals: as written, then what does the least beside inverting."""
    structure, out = one.setting.structure, one.worst
    policy = WORDS[AT_SINGULARITY].index(structure.at_singularity)
    return (
        not one.setting.is_written,
        policy,
        INVERSES[structure.method].preference,
        out.error,
        one.setting.numbers,
    )
