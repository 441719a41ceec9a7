"""What is best of all that was tried, and what it is held against."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rmrc.tuning.front import dominates, front
from rmrc.tuning.search import Tried
from rmrc.tuning.space import all_structures

# Errors within this share of the smallest one are as good, because other copies make more of a difference:
# the lower peak rate decides.
ALIKE = 0.02
# Figures that differ by less than three digits show are those of one behavior.
_SAME = 1e-3

_ORDER = {structure: i for i, structure in enumerate(all_structures())}


@dataclass(frozen=True)
class Verdict:
    """What is best.

    Attributes:
        front: Feasible settings that no other dominates, by rising peak rate; of those that come to the same
            figures, the simplest.
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
    simplest = sorted(feasible, key=_simplicity)
    points = {one.worst.point: one for one in reversed(simplest)}
    on_front = [points[point] for point in (list(points)[i] for i in front(list(points)))]
    recommended = _best(simplest)
    if recommended is None:
        nearest = min(tried, key=lambda one: (-len(one.outcomes), one.worst.excess, one.worst.error))
        return Verdict((), None, (), None, None, nearest)
    inverse = recommended.setting.structure.inverse
    rivals = [one for one in simplest if one.setting.structure.inverse != inverse]
    equal = [one for one in rivals if _is_same(one, recommended)]
    same = {one.setting.structure.inverse: one for one in reversed(equal)}
    others = [one for one in rivals if one.setting.structure.inverse not in same]
    better = [one for one in simplest if dominates(one.worst.point, own.worst.point)]
    return Verdict(
        tuple(on_front),
        recommended,
        tuple(sorted(same.values(), key=_simplicity)),
        _best(others),
        recommended if recommended in better else _best(better),
        None,
    )


def _is_same(one: Tried, other: Tried) -> bool:
    """Say whether two settings come to the same, as inverses do that differ only where the arm never is."""
    return np.allclose(one.worst[:3], other.worst[:3], rtol=_SAME, atol=0.0)


def _best(simplest: Sequence[Tried]) -> Tried | None:
    """Return the setting with the smallest error; of errors that are alike, with the lowest peak rate."""
    if not simplest:
        return None
    least = min(one.worst.error for one in simplest)
    alike = [one for one in simplest if one.worst.error <= least * (1.0 + ALIKE)]
    return min(alike, key=lambda one: (one.worst.peak_rate, one.worst.time))


def _simplicity(one: Tried) -> tuple[bool, int, tuple[float, ...]]:
    """Return what comes first of equals: as written, then what does the least beside inverting."""
    return not one.setting.is_written, _ORDER[one.setting.structure], one.setting.numbers
