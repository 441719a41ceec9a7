"""The determinant of J as a product: a factor for each family of singularities, found from the geometry.

Only J at the configuration in question and at a few others is looked at: which columns stay perpendicular to
a joint's axis, and whether the last three axes meet, is the same at all configurations of one arm.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.law.task import Task

Array: TypeAlias = NDArray[np.float64]

# Configurations besides the one in question, at which a product is held against the determinant.
SAMPLES = 6
# What is a smaller share of its largest value is rounding.
ROUNDING = 1e-9

BOUNDARY, INTERIOR = "boundary", "interior"


@dataclass(frozen=True)
class Factor:
    """One factor of det J, and with it a family of singularities.

    Attributes:
        name: shoulder, elbow, boom, pivot, wrist, or arm: those of the first three joints that do not part.
        family: boundary or interior of the workspace; empty where it may be either.
        where: Where it vanishes, in words.
        value: Here [m, m², m³ or 1].
        power: How often it is in the product, 1 or 2.
        vanishes: Whether it is rounding here.
    """

    name: str
    family: str
    where: str
    value: float
    power: int
    vanishes: bool

    @property
    def term(self) -> str:
        """How it stands in the product: its name, with its power."""
        return self.name + "²" * (self.power == 2)


@dataclass(frozen=True)
class _Rule:
    """A factor as a function of J (6, n), rows [v; ω] of the site along world axes."""

    name: str
    family: str
    where: str
    of: Callable[[Array], float]
    power: int = 1


def factors(task: Task, J: Array) -> tuple[Factor, ...]:
    """Return det J of the task's rows as a product; none where they are not square or no structure is known.

    A wrist whose three axes meet parts from the arm: det J = det J_v(wrist point) · z₄·(z₅ × z₆) [Khatib08].
    Where two of three columns stay perpendicular to an axis a, det [c₁ c₂ c₃] = ±(a·c₁) a·(c₂ × c₃): shoulder
    and elbow, or shoulder and boom. With parallel axes 2 to 4, as of a UR, J parts along and
    across these.

    Args:
        task: The arm and the rows that count.
        J: At the configuration in question, rows [v; ω] along world axes, (6, n).

    Returns:
        The factors, whose product, each to its power, is the determinant.
    """
    arm, n = task.arm, task.arm.n
    if len(task.rows) != n or n not in (2, 3, 6):
        return ()
    others = [(arm.jacobian(q), arm.pose(q)) for q in arm.sampled(SAMPLES)]
    samples = [one for one, _ in others]
    rules = _rules(samples, task)
    if not rules:
        return ()
    dets = np.array([np.linalg.det(task.turned(one, pose)[task.rows]) for one, pose in others])
    values = np.array([[rule.of(one) for rule in rules] for one in samples])
    products = np.prod(values ** [rule.power for rule in rules], axis=1)
    sign = np.sign(dets @ products)
    if not sign or np.abs(sign * products - dets).max() > ROUNDING * np.abs(dets).max():
        return ()
    here = np.array([rule.of(J) for rule in rules])
    most = np.abs([*values, here]).max(axis=0)
    here[0] *= sign  # which is that of the rows' order
    return tuple(
        Factor(
            rule.name, rule.family, rule.where, float(value), rule.power, bool(abs(value) <= ROUNDING * large)
        )
        for rule, value, large in zip(rules, here, most, strict=True)
    )


def _rules(samples: Sequence[Array], task: Task) -> list[_Rule]:
    """Return the factors of an arm; none if its structure is not known."""
    joints, axes = task.arm.joints, set(task.axes)
    turns = {"rx", "ry", "rz"} & axes
    if len(axes) == 6:
        if not all(_wrist_point(J)[1] for J in samples):
            return _parallel_rules(samples, joints)
        arm = _arm_rules([_at_wrist(J) for J in samples], joints, "the wrist point")
        arm = arm or [_Rule("arm", "", f"{_listed(joints[:3])} cannot move the wrist point at will", _det)]
        return [
            *(_Rule(one.name, one.family, one.where, _behind(one.of), one.power) for one in arm),
            _wrist(joints[3:], lambda J: _triple(J[3:, 3:])),
        ]
    if axes == {"x", "y", "z"}:
        return _arm_rules(samples, joints, "the site")
    if len(turns) == 3 and len(axes) == 3:
        return [_wrist(joints, lambda J: _triple(J[3:]))]
    return _planar_rules(samples, joints, bool(turns))


def _wrist(joints: Sequence[str], of: Callable[[Array], float]) -> _Rule:
    return _Rule("wrist", INTERIOR, f"the axes of {_listed(joints)} lie in one plane", of)


def _arm_rules(samples: Sequence[Array], joints: Sequence[str], point: str) -> list[_Rule]:
    """Return the factors of three joints that move a point, by their columns of J there."""
    for hinge in range(3):
        if not all(J[3:, hinge].any() for J in samples):
            continue
        large = np.abs([J[:3, :3] for J in samples]).max()
        flat = np.array([np.abs(J[3:, hinge] @ J[:3, :3]) for J in samples]).max(axis=0) < ROUNDING * large
        if flat.sum() != 2:
            continue
        (single,), pair = np.flatnonzero(~flat), np.flatnonzero(flat)
        return _parted(samples, joints, point, hinge, int(single), pair)
    return []


def _parted(
    samples: Sequence[Array],
    joints: Sequence[str],
    point: str,
    hinge: int,
    single: int,
    pair: NDArray[np.intp],
) -> list[_Rule]:
    """Return the factors where the columns of a pair of joints are perpendicular to the axis of a hinge."""
    one, two = (int(i) for i in pair)

    def across(J: Array) -> float:
        return float(J[3:, hinge] @ J[:3, single])

    def within(J: Array) -> float:
        return float(J[3:, hinge] @ np.cross(J[:3, one], J[:3, two]))

    def tilt(J: Array) -> float:
        return float(J[3:, hinge] @ np.cross(J[3:, single], J[:3, slide]))

    outer = _Rule(
        "shoulder", INTERIOR, f"{joints[single]} cannot move {point} out of the arm's plane", across
    )
    slide = next((i for i in (two, one) if not samples[0][3:, i].any()), -1)
    if slide < 0:
        inner = _Rule("elbow", BOUNDARY, f"{point}, {joints[one]} and {joints[two]} are in line", within)
    else:
        turn = f"{joints[slide]} has drawn {point} beside the axis of {joints[one + two - slide]}"
        inner = _Rule("boom", INTERIOR, turn, lambda J: -within(J))
        if all(abs(abs(within(J) * tilt(J)) - abs(across(J))) < ROUNDING for J in samples):
            where = f"{joints[slide]} is parallel to the axis of {joints[single]}"
            return [_Rule("shoulder", INTERIOR, where, tilt), replace(inner, power=2)]
    # across is 1 for a slide along the axis
    return [inner] if all(abs(abs(across(J)) - 1.0) < ROUNDING for J in samples) else [outer, inner]


def _planar_rules(samples: Sequence[Array], joints: Sequence[str], turns: bool) -> list[_Rule]:
    """Return the one factor of two joints, or three hinges, that move a site in a plane."""
    n = len(joints)
    hinges = [bool(samples[0][3:, i].any()) for i in range(n)]
    if n != 2 + turns or not hinges[0] or (turns and not all(hinges)):
        return []

    def within(J: Array) -> float:
        a = J[3:, 0]
        v = J[:3] + np.cross(J[3:].T, np.cross(a, J[:3, 2])).T if turns else J[:3]
        return float(a @ np.cross(v[:, 0], v[:, 1]))

    if hinges[1]:
        return [_Rule("elbow", BOUNDARY, f"the links beside {joints[1]} are in line", within)]
    return [_Rule("pivot", INTERIOR, f"{joints[1]} has the site beside the axis of {joints[0]}", within)]


def _parallel_rules(samples: Sequence[Array], joints: Sequence[str]) -> list[_Rule]:
    """Return the factors of six hinges whose axes 2, 3 and 4 are parallel, and whose axes 5 and 6 meet.

    Joints 2 to 4 move all in a plane, and turn it about their axis a. Left to others are a·v and ω across a.
    """
    turned = [np.cross(J[3:, [1, 2]].T, J[3:, [2, 3]].T) for J in samples]
    if np.abs(turned).max() > ROUNDING or not all(_wrist_point(J, 4)[1] and J[3:, 1].any() for J in samples):
        return []

    def across(J: Array) -> float:
        point, _ = _wrist_point(J, 4)
        return float(J[3:, 1] @ (J[:3, 0] + np.cross(J[3:, 0], point)))

    def within(J: Array) -> float:
        a = J[3:, 1]
        v = J[:3] + np.cross(J[3:].T, np.cross(a, J[:3, 3])).T
        return float(a @ np.cross(v[:, 1], v[:, 2]))

    meet = f"the axes of {joints[4]} and {joints[5]} meet"
    return [
        _Rule(
            "shoulder",
            INTERIOR,
            f"{joints[0]} cannot move where {meet} along the axis of {joints[1]}",
            across,
        ),
        _Rule("elbow", BOUNDARY, f"{_listed(joints[1:4])} are in line", within),
        _wrist(joints[3:], lambda J: _triple(J[3:, 3:])),
    ]


def _wrist_point(J: Array, first: int = 3) -> tuple[Array, bool]:
    """Return the point that the joints from `first` on move least, from the site, (3,), and if it stays."""
    axes, v = J[3:, first:], J[:3, first:]
    # no velocity there: v + ω × p = 0
    rows = np.concatenate([_cross_matrix(axis) for axis in axes.T])
    point, *_ = np.linalg.lstsq(rows, -v.T.ravel(), rcond=None)
    missed = np.abs(rows @ point + v.T.ravel()).max()
    hinges = np.allclose(np.linalg.norm(axes, axis=0), 1.0, rtol=0.0, atol=ROUNDING)
    return np.asarray(point), bool(hinges and missed <= ROUNDING * (1.0 + np.abs(v).max()))


def _at_wrist(J: Array) -> Array:
    """Return J of the first three joints at the wrist point, (6, 3)."""
    point, _ = _wrist_point(J)
    return np.concatenate([J[:3] + np.cross(J[3:].T, point).T, J[3:]])[:, :3]


def _behind(of: Callable[[Array], float]) -> Callable[[Array], float]:
    """Return a factor of the first three joints as one of J at the site."""
    return lambda J: of(_at_wrist(J))


def _det(J: Array) -> float:
    return float(np.linalg.det(J[:3]))


def _triple(axes: Array) -> float:
    return float(np.linalg.det(axes))


def _cross_matrix(a: Array) -> Array:
    return np.asarray(np.cross(a, np.eye(3)).T)


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"
