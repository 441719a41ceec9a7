"""The determinant of J as a product: a factor for each family of singularities, found from the geometry.

The search uses only J at the configuration in question and at a few others: which columns stay normal to a
joint's axis, and whether the last three axes meet, is the same at all configurations of one arm.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.law.task import Task

Array: TypeAlias = NDArray[np.float64]

# Number of further configurations at which a product is compared with the determinant.
SAMPLES = 6
# Shares of the largest value below this are rounding.
ROUNDING = 1e-9

BOUNDARY, INTERIOR = "boundary", "interior"


@dataclass(frozen=True)
class Factor:
    """One factor of det J, and with it a family of singularities.

    Attributes:
        name: shoulder, elbow, boom, pivot, wrist, or arm: the first three joints without a known structure.
        family: boundary or interior of the workspace; empty where it may be either.
        where: Condition under which it vanishes, in words.
        value: Its value [m, m², m³ or 1].
        power: Its power in the product, 1 or 2.
        vanishes: Whether its value is rounding.
    """

    name: str
    family: str
    where: str
    value: float
    power: int
    vanishes: bool

    @property
    def term(self) -> str:
        """The factor as written in the product: its name, with its power."""
        return self.name + "²" * (self.power == 2)


@dataclass(frozen=True)
class Rule:
    """A factor as a function of J (..., 6, n), rows [v; ω] of the site along world axes.

    Attributes:
        name: As in `Factor`.
        family: As in `Factor`.
        where: As in `Factor`.
        of: The function; its values are (...).
        power: As in `Factor`.
    """

    name: str
    family: str
    where: str
    of: Callable[[Array], Array]
    power: int = 1


@dataclass(frozen=True)
class Product:
    """The determinant of an arm's J as a product of factors.

    Attributes:
        rules: The factors; the product contains each to its power.
        largest: The largest magnitude of each at random configurations, (k,).
    """

    rules: tuple[Rule, ...]
    largest: Array

    def values(self, J: Array) -> Array:
        """Return the factors, (..., k), at J (..., 6, n)."""
        return np.stack([rule.of(J) for rule in self.rules], axis=-1)

    def nearest(self, J: Array) -> NDArray[np.intp]:
        """Return which factor is nearest to 0, relative to its largest, (...), at J (..., 6, n)."""
        return np.asarray(np.argmin(np.abs(self.values(J)) / self.largest, axis=-1))


def product(task: Task, columns: Sequence[int] | None = None) -> Product | None:
    """Return det J of the task's rows as a product; None where they are not square or no structure is known.

    A wrist whose three axes meet separates: det J = det J_v(wrist point) · z₄·(z₅ × z₆) [Khatib08]. Where two
    of three columns stay normal to an axis a, det [c₁ c₂ c₃] = ±(a·c₁) a·(c₂ × c₃): shoulder and elbow, or
    shoulder and boom. With parallel axes 2 to 4, as in a UR, J separates into parts along and across these
    axes.

    Args:
        task: The arm and the rows that count.
        columns: The joints that count; None for all. The others must not move these rows.
    """
    arm = task.arm
    chosen = np.arange(arm.n) if columns is None else np.asarray(columns)
    if len(task.rows) != len(chosen) or len(chosen) not in (2, 3, 6):
        return None
    q = arm.sampled(SAMPLES)
    samples = np.stack([arm.jacobian(one)[:, chosen] for one in q])
    rules = _rules(samples, task.axes, [arm.joints[i] for i in chosen])
    if not rules:
        return None
    turned = [task.turned(J, arm.pose(one))[task.rows] for J, one in zip(samples, q, strict=True)]
    dets = np.linalg.det(np.stack(turned))
    found = Product(tuple(rules), np.ones(len(rules)))
    values = found.values(samples)
    products = np.prod(values ** [rule.power for rule in rules], axis=1)
    sign = np.sign(dets @ products)
    if not sign or np.abs(sign * products - dets).max() > ROUNDING * np.abs(dets).max():
        return None
    if sign < 0.0:  # that of the order of the rows
        rules[0] = replace(rules[0], of=_negated(rules[0].of))
    return Product(tuple(rules), np.abs(values).max(axis=0))


def factors(task: Task, J: Array) -> tuple[Factor, ...]:
    """Return the factors of det J at a configuration; none where `product` has none.

    Args:
        task: The arm and the rows that count.
        J: J at the configuration, rows [v; ω] along world axes, (6, n).

    Returns:
        The factors, whose product, each to its power, is the determinant.
    """
    found = product(task)
    if found is None:
        return ()
    here = found.values(J)
    vanish = np.abs(here) <= ROUNDING * np.maximum(np.abs(here), found.largest)
    return tuple(
        Factor(rule.name, rule.family, rule.where, float(value), rule.power, bool(zero))
        for rule, value, zero in zip(found.rules, here, vanish, strict=True)
    )


def _rules(samples: Array, axes: Sequence[str], joints: Sequence[str]) -> list[Rule]:
    """Return the factors of an arm from J at some configurations; none if its structure is not known."""
    turns = {"rx", "ry", "rz"} & set(axes)
    if len(axes) == 6:
        if not _wrist_point(samples)[1]:
            return _parallel_rules(samples, joints)
        arm = _arm_rules(_at_wrist(samples), joints, "the wrist point")
        arm = arm or [Rule("arm", "", f"{_listed(joints[:3])} cannot move the wrist point at will", _det)]
        return [
            *(Rule(one.name, one.family, one.where, _behind(one.of), one.power) for one in arm),
            _wrist(joints[3:], lambda J: _triple(J[..., 3:, 3:])),
        ]
    if set(axes) == {"x", "y", "z"}:
        return _arm_rules(samples, joints, "the site")
    if len(turns) == 3 and len(axes) == 3:
        return [_wrist(joints, lambda J: _triple(J[..., 3:, :]))]
    return _planar_rules(samples, joints, bool(turns))


def _wrist(joints: Sequence[str], of: Callable[[Array], Array]) -> Rule:
    return Rule("wrist", INTERIOR, f"the axes of {_listed(joints)} lie in one plane", of)


def _arm_rules(samples: Array, joints: Sequence[str], point: str) -> list[Rule]:
    """Return the factors of three joints that move a point, from their columns of J there."""
    for hinge in range(3):
        if not samples[:, 3:, hinge].any(axis=1).all():
            continue
        large = np.abs(samples[:, :3, :3]).max()
        along = np.einsum("nc,nck->nk", samples[:, 3:, hinge], samples[:, :3, :3])
        flat = np.abs(along).max(axis=0) < ROUNDING * large
        if flat.sum() != 2:
            continue
        (single,), pair = np.flatnonzero(~flat), np.flatnonzero(flat)
        return _parted(samples, joints, point, hinge, int(single), pair)
    return []


def _parted(
    samples: Array,
    joints: Sequence[str],
    point: str,
    hinge: int,
    single: int,
    pair: NDArray[np.intp],
) -> list[Rule]:
    """Return the factors if the columns of a pair of joints are normal to the axis of a hinge."""
    one, two = (int(i) for i in pair)

    def across(J: Array) -> Array:
        return _dot(J[..., 3:, hinge], J[..., :3, single])

    def within(J: Array) -> Array:
        return _dot(J[..., 3:, hinge], np.cross(J[..., :3, one], J[..., :3, two]))

    def tilt(J: Array) -> Array:
        return _dot(J[..., 3:, hinge], np.cross(J[..., 3:, single], J[..., :3, slide]))

    outer = Rule("shoulder", INTERIOR, f"{joints[single]} cannot move {point} out of the arm's plane", across)
    slide = next((i for i in (two, one) if not samples[0, 3:, i].any()), -1)
    if slide < 0:
        inner = Rule("elbow", BOUNDARY, f"{point}, {joints[one]} and {joints[two]} are in line", within)
    else:
        turn = f"{joints[slide]} has drawn {point} beside the axis of {joints[one + two - slide]}"
        inner = Rule("boom", INTERIOR, turn, _negated(within))
        if (np.abs(np.abs(within(samples) * tilt(samples)) - np.abs(across(samples))) < ROUNDING).all():
            where = f"{joints[slide]} is parallel to the axis of {joints[single]}"
            return [Rule("shoulder", INTERIOR, where, tilt), replace(inner, power=2)]
    # across is 1 for a slide along the axis
    return [inner] if (np.abs(np.abs(across(samples)) - 1.0) < ROUNDING).all() else [outer, inner]


def _planar_rules(samples: Array, joints: Sequence[str], turns: bool) -> list[Rule]:
    """Return the one factor of two joints, or three hinges, that move a site in a plane."""
    n = len(joints)
    hinges = [bool(samples[0, 3:, i].any()) for i in range(n)]
    if n != 2 + turns or not hinges[0] or (turns and not all(hinges)):
        return []

    def within(J: Array) -> Array:
        return _in_plane(J, 0, 1, 2 if turns else None)

    if hinges[1]:
        return [Rule("elbow", BOUNDARY, f"the links beside {joints[1]} are in line", within)]
    return [Rule("pivot", INTERIOR, f"{joints[1]} has the site beside the axis of {joints[0]}", within)]


def _parallel_rules(samples: Array, joints: Sequence[str]) -> list[Rule]:
    """Return the factors of six hinges whose axes 2, 3 and 4 are parallel, and whose axes 5 and 6 meet.

    Joints 2 to 4 move everything in a plane, and turn it about their axis a. The others determine a·v and ω
    across a.
    """
    turned = np.cross(samples[:, 3:, [1, 2]], samples[:, 3:, [2, 3]], axis=1)
    if (
        np.abs(turned).max() > ROUNDING
        or not _wrist_point(samples, 4)[1]
        or not samples[:, 3:, 1].any(axis=1).all()
    ):
        return []

    def across(J: Array) -> Array:
        point, _ = _wrist_point(J, 4)
        return _dot(J[..., 3:, 1], J[..., :3, 0] + np.cross(J[..., 3:, 0], point))

    def within(J: Array) -> Array:
        return _in_plane(J, 1, 2, 3)

    meet = f"the axes of {joints[4]} and {joints[5]} meet"
    return [
        Rule(
            "shoulder",
            INTERIOR,
            f"{joints[0]} cannot move where {meet} along the axis of {joints[1]}",
            across,
        ),
        Rule("elbow", BOUNDARY, f"{_listed(joints[1:4])} are in line", within),
        _wrist(joints[3:], lambda J: _triple(J[..., 3:, 3:])),
    ]


def _in_plane(J: Array, one: int, two: int, at: int | None) -> Array:
    """Return a·(v₁ × v₂) of two joints, a the axis of the first, at the site or at the axis of a joint."""
    a, v = J[..., 3:, one], J[..., :3, :]
    if at is not None:
        point = np.cross(a, J[..., :3, at])
        v = v + np.cross(J[..., 3:, :], point[..., None], axis=-2)
    return _dot(a, np.cross(v[..., one], v[..., two]))


def _wrist_point(J: Array, first: int = 3) -> tuple[Array, bool]:
    """Return the point that joints from `first` on move least, from the site, (..., 3), and if it stays."""
    axes, v = np.swapaxes(J[..., 3:, first:], -1, -2), np.swapaxes(J[..., :3, first:], -1, -2)
    # its velocity is zero: v + ω × p = 0
    rows = np.cross(axes[..., None, :], np.eye(3)).swapaxes(-1, -2).reshape(*J.shape[:-2], -1, 3)
    still = v.reshape(*J.shape[:-2], -1)
    point = -(np.linalg.pinv(rows) @ still[..., None])[..., 0]
    missed = np.abs((rows @ point[..., None])[..., 0] + still).max()
    hinges = np.allclose(np.linalg.norm(axes, axis=-1), 1.0, rtol=0.0, atol=ROUNDING)
    return np.asarray(point), bool(hinges and missed <= ROUNDING * (1.0 + np.abs(v).max()))


def _at_wrist(J: Array) -> Array:
    """Return J of the first three joints at the wrist point, (..., 6, 3)."""
    point, _ = _wrist_point(J)
    v = J[..., :3, :] + np.cross(J[..., 3:, :], point[..., None], axis=-2)
    return np.concatenate([v, J[..., 3:, :]], axis=-2)[..., :3]


def _behind(of: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return a factor of the first three joints as a function of J at the site."""
    return lambda J: of(_at_wrist(J))


def _negated(of: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda J: -of(J)


def _det(J: Array) -> Array:
    return _triple(J[..., :3, :])


def _triple(axes: Array) -> Array:
    return np.asarray(np.linalg.det(axes))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1))


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"
