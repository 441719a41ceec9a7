"""The verdict of a search: the best settings, and the ones for comparison."""

from collections.abc import Sequence
from dataclasses import dataclass

from rmrc.tuning.front import dominates, front
from rmrc.tuning.tried import Tried, best, is_same, preference


@dataclass(frozen=True)
class Verdict:
    """The verdict.

    Attributes:
        front: Feasible nondominated settings, by rising peak rate; of settings with equal metrics, the
            preferred one.
        recommended: The best setting; None if nothing is feasible.
        alike: The best of each other inverse with the metrics of the recommended one.
        second: The best with an inverse or schedule that has other metrics; None without one.
        better: The best that dominates the setting as written; None if that is on the front.
        nearest: The setting with the smallest excess over the limits, if nothing is feasible.
    """

    front: tuple[Tried, ...]
    recommended: Tried | None
    alike: tuple[Tried, ...]
    second: Tried | None
    better: Tried | None
    nearest: Tried | None


def judge(feasible: Sequence[Tried], tried: Sequence[Tried], own: Tried) -> Verdict:
    """Return the verdict.

    Args:
        feasible: Settings that keep the limits on all scenarios.
        tried: All tried settings, at least one.
        own: The setting as written.
    """
    preferred = sorted(feasible, key=preference)
    points = {one.worst.point: one for one in reversed(preferred)}
    on_front = [points[point] for point in (list(points)[i] for i in front(list(points)))]
    recommended = best(preferred)
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
        tuple(sorted(same.values(), key=preference)),
        best(others),
        recommended if recommended in better else best(better),
        None,
    )
