"""The determinant of J as a product: a factor for each family of singularities.

Each known structure of arms proposes a product. It is kept if it is the determinant at a few random
configurations: what the geometry of an arm makes so at these holds at all others.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.directions import listed
from rmrc.law.task import Task

Array: TypeAlias = NDArray[np.float64]
Place: TypeAlias = Callable[[Array], Array]
"""Returns J of some point of the last link for J of the site."""

# Number of configurations at which a product is compared with the determinant.
SAMPLES = 6
# Shares of the largest value below this are rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Rule:
    """One factor of det J as a function of J, and with it a family of singularities.

    Attributes:
        name: shoulder, elbow, boom, pivot, wrist, or arm: the first three joints without a known structure.
        where: Condition under which it vanishes, in words.
        of: The function of J (..., 6, n), rows [v; ω] of the site along world axes; its values are (...).
        power: Its power in the product, 1 or 2.
    """

    name: str
    where: str
    of: Callable[[Array], Any]
    power: int = 1

    @property
    def family(self) -> str:
        """Whether the singularities are at the boundary or in the interior of the workspace, if known."""
        return {"elbow": "boundary", "arm": ""}.get(self.name, "interior")


@dataclass(frozen=True)
class Product:
    """The determinant of an arm's J as a product of factors.

    Attributes:
        rules: The factors; the product contains each to its power.
        largest: The largest magnitude of each at random configurations, (k,).
        sign: Sign of the first, by the order of the rows.
    """

    rules: tuple[Rule, ...]
    largest: Array
    sign: float

    def values(self, J: Array) -> Array:
        """Return the factors, (..., k), at J (..., 6, n)."""
        first, *others = (rule.of(J) for rule in self.rules)
        return np.stack([self.sign * first, *others], axis=-1)


def product(task: Task, columns: Sequence[int] | None = None) -> Product | None:
    """Return det J of the task's rows as a product; None where they are not square or no structure is known.

    Args:
        task: The arm and the rows that count.
        columns: The joints that count; None for all. The others must not move these rows.
    """
    arm = task.arm
    chosen = np.arange(arm.n) if columns is None else np.asarray(columns)
    if len(task.rows) != len(chosen):
        return None
    q = arm.sampled(SAMPLES)
    J = np.stack([arm.jacobian(each)[:, chosen] for each in q])
    dets = np.linalg.det(task.turned(J, np.stack([arm.pose(each) for each in q]))[:, task.rows])
    for rules in _proposals(J, [arm.joints[i] for i in chosen], arm.is_slide[chosen], task.axes):
        values = np.stack([rule.of(J) for rule in rules], axis=-1)
        products = np.prod(values ** [rule.power for rule in rules], axis=1)
        sign = float(np.sign(dets @ products))
        if sign and np.abs(sign * products - dets).max() <= ROUNDING * np.abs(dets).max():
            return Product(rules, np.abs(values).max(axis=0), sign)
    return None


def factors(task: Task, J: Array) -> list[dict[str, Any]]:
    """Return the factors of det J at a configuration; none where `product` has none.

    Args:
        task: The arm and the rows that count.
        J: J at the configuration, rows [v; ω] along world axes, (6, n).

    Returns:
        Name, family, where and power of each, as in `Rule`; the term, which is the name with the power; its
        value [m, m², m³ or 1]; and whether it vanishes. The product of the values, each to its power, is the
        determinant.
    """
    known = product(task)
    if known is None:
        return []
    values = known.values(J)
    vanish = np.abs(values) <= ROUNDING * known.largest
    return [
        {"name": rule.name, "term": rule.name + "²" * (rule.power == 2), "family": rule.family,
         "where": rule.where, "power": rule.power, "value": float(value), "vanishes": bool(zero)}
        for rule, value, zero in zip(known.rules, values, vanish, strict=True)
    ]  # fmt: skip


def _proposals(
    J: Array, joints: Sequence[str], slides: NDArray[np.bool_], axes: Sequence[str]
) -> Iterator[tuple[Rule, ...]]:
    """Yield the factors of the known structures of arms with these rows."""
    turns, n = len({"rx", "ry", "rz"} & set(axes)), len(joints)
    in_plane = f"the axes of {listed(joints[-3:])} lie in one plane"
    wrist = Rule("wrist", in_plane, lambda J: np.linalg.det(J[..., 3:, -3:]))
    if n == 6:
        # A wrist whose axes meet: det J = det J_v(wrist point) · z₄·(z₅ × z₆) [Khatib08].
        at_wrist = partial(_at_meeting, 3)
        for arm in _arm(J, joints, slides, "the wrist point", at_wrist):
            yield (*arm, wrist)
        where = f"{listed(joints[:3])} cannot move the wrist point at will"
        yield Rule("arm", where, lambda J: np.linalg.det(at_wrist(J)[..., :3, :3])), wrist
        # Parallel axes 2 to 4, as of a UR: joint 1 alone moves along them the point where axes 5 and 6 meet.
        meet = f"the axes of {joints[4]} and {joints[5]} meet along the axis of {joints[1]}"
        across = partial(_across, partial(_at_meeting, 4), 1, 0)
        shoulder = Rule("shoulder", f"{joints[0]} cannot move where {meet}", across)
        in_line = f"{listed(joints[1:4])} are in line"
        yield shoulder, Rule("elbow", in_line, partial(_area, partial(_at_axis, 1, 3), 1, 1, 2)), wrist
    elif n == 3 and turns == 3:
        yield (wrist,)
    elif n == 3 and not turns:
        yield from _arm(J, joints, slides, "the site", _at_site)
    elif n == 2 and slides[1]:
        where = f"{joints[1]} has the site beside the axis of {joints[0]}"
        yield (Rule("pivot", where, partial(_area, _at_site, 0, 0, 1)),)
    elif n == 2 or (n == 3 and not slides.any()):
        place = _at_site if n == 2 else partial(_at_axis, 0, 2)
        yield (Rule("elbow", f"the links beside {joints[1]} are in line", partial(_area, place, 0, 0, 1)),)


def _arm(
    J: Array, joints: Sequence[str], slides: NDArray[np.bool_], point: str, place: Place
) -> Iterator[tuple[Rule, ...]]:
    """Yield factors of three joints that move a point.

    Where two of three columns stay normal to an axis a, det [c₁ c₂ c₃] = ±(a·c₁) a·(c₂ × c₃): shoulder and
    elbow, or shoulder and boom. Where the third is along a, the second factor is alone.

    Args:
        J: J of the site at some configurations, (N, 6, n).
        joints: Their names.
        slides: Whether each slides.
        point: The point in words.
        place: Returns J of the point.
    """
    for hinge in (joint for joint in range(3) if not slides[joint]):
        for single in range(3):
            i, j = sorted({0, 1, 2} - {single}, key=lambda joint: not slides[joint])
            if any(np.abs(_across(place, hinge, joint, J)).max() > ROUNDING for joint in (i, j)):
                continue
            where = f"{joints[single]} cannot move {point} out of the arm's plane"
            shoulder = Rule("shoulder", where, partial(_across, place, hinge, single))
            area = partial(_area, place, hinge, i, j)
            if slides[i]:
                where = f"{joints[i]} has drawn {point} beside the axis of {joints[j]}"
                inner = Rule("boom", where, area)
                where = f"{joints[i]} is parallel to the axis of {joints[single]}"
                tilted = Rule("shoulder", where, partial(_tilt, hinge, single, i))
                yield tilted, Rule("boom", inner.where, area, 2)
            else:
                inner = Rule("elbow", f"{point}, {joints[i]} and {joints[j]} are in line", area)
            yield (inner,)
            yield shoulder, inner


def _across(place: Place, hinge: int, joint: int, J: Array) -> Any:
    """Return a·v, the velocity of a place by a joint, along the axis a of a hinge."""
    return (J[..., 3:, hinge] * place(J)[..., :3, joint]).sum(axis=-1)


def _area(place: Place, hinge: int, i: int, j: int, J: Array) -> Any:
    """Return a·(v₁ × v₂), the velocities of a place by two joints, a the axis of a hinge."""
    v = place(J)[..., :3, :]
    return (J[..., 3:, hinge] * np.cross(v[..., i], v[..., j])).sum(axis=-1)


def _tilt(hinge: int, joint: int, slide: int, J: Array) -> Any:
    """Return a·(z × v), a and z the axes of two hinges, v the direction of a slide."""
    return (J[..., 3:, hinge] * np.cross(J[..., 3:, joint], J[..., :3, slide])).sum(axis=-1)


def _at_site(J: Array) -> Array:
    return J


def _at_axis(hinge: int, joint: int, J: Array) -> Array:
    """Return J on the axis of a joint, which is parallel to that of a hinge."""
    return _moved(J, np.cross(J[..., 3:, hinge], J[..., :3, joint]))


def _at_meeting(first: int, J: Array) -> Array:
    """Return J where the axes of the joints from `first` on meet, or are nearest to it."""
    axes, v = np.swapaxes(J[..., 3:, first:], -1, -2), np.swapaxes(J[..., :3, first:], -1, -2)
    # The velocity of that point is zero: v + ω × p = 0.
    rows = np.cross(axes[..., None, :], np.eye(3)).swapaxes(-1, -2).reshape(*J.shape[:-2], -1, 3)
    return _moved(J, -(np.linalg.pinv(rows) @ v.reshape(*J.shape[:-2], -1, 1))[..., 0])


def _moved(J: Array, point: Array) -> Array:
    """Return J of a point of the last link, (..., 3) from the site."""
    v = J[..., :3, :] + np.cross(J[..., 3:, :], point[..., None], axis=-2)
    return np.concatenate([v, J[..., 3:, :]], axis=-2)
