"""The geometry, the masses and the proportions of an arm.

From its proportions follow the length and the damping of a law where nobody gives them:

    L      rms distance of the site from the hinges' axes: a radian of a hinge moves the site by L
    σ_m    the usual σ_min: its median over configurations within the limits
    ε      σ_m/3: the law damps where the arm has lost two thirds of its usual mobility
    λ_max  ε/√2: with λ² = (1 − (σ/ε)²) λ_max² it is the least at which σ/(σ² + λ²) never exceeds 1/ε

L is 1 m where it would only change the unit of σ: if no row of the task is linear, or if all are and the
joints are of one kind. ε is then in this unit. A median needs few configurations, and the shipped arms are
below a third of it in 11 to 25 % of random ones. An arm whose σ never changes is never damped.

The gain of a direction is g(σ) = σ/(σ² + λ²). With λ_max = c ε, σ² + λ² = (1 − c²) σ² + c² ε², so that g is
largest at σ = c ε/√(1 − c²), where it is 1/(2 c ε √(1 − c²)): 1/ε for c = 1/√2, and more for smaller c. For
the same largest gain, a smaller c needs a larger ε, damps more often, and loses as much of the motion.

Masses are those of links, with all joints of the arm at 0, along world axes. A link is everything that moves
with a joint and with no joint behind it. Followers have links of their own, on the chain to the site or
beside it, and so have both halves of a screw. Bodies on joints that are not the arm's are a part of the link,
in their rest position.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.arm.wiring import SLIDE, joints_above
from rmrc.textbook.chains import joint_screw

Array = NDArray[np.float64]

# Configurations: the median of σ_min over them is known to 7 % for the shipped arms, L to 2 %.
COUNT = 128
# The share of the usual σ_min below which the law damps, and λ_max over that.
SHARE, RATIO = 1.0 / 3.0, math.sqrt(0.5)
# A site nearer than this to all axes is on them [m].
ON_AXES = 1e-6


@dataclass(frozen=True, eq=False)
class Proportions:
    """An arm at configurations that cover its joints' ranges evenly.

    Attributes:
        q: Joint positions, (COUNT, n).
        jacobian: J of the site along world axes, (COUNT, 6, n).
        distance: L [m]; 1 for an arm without hinges, or with a site on all of their axes.
        has_both: Whether some of the joints are hinges and some slides.
    """

    q: Array
    jacobian: Array
    distance: float
    has_both: bool

    def length(self, rows: Iterable[int]) -> float:
        """Return the characteristic length of a task with these rows of the twist [m]."""
        are_linear = {row < 3 for row in rows}
        return self.distance if len(are_linear) == 2 or (True in are_linear and self.has_both) else 1.0


def proportions(
    lower: Array, upper: Array, is_slide: NDArray[np.bool_], jacobian_at: Callable[[Array], Array]
) -> Proportions:
    """Return the proportions of an arm, the same at every call.

    Args:
        lower: Lower ends of the joints' ranges, (n,).
        upper: Upper ends, (n,).
        is_slide: Whether each joint slides, (n,).
        jacobian_at: Returns J at joint positions.
    """
    q = lower + (upper - lower) * even_points(COUNT, len(lower))
    jacobian = np.array([jacobian_at(at) for at in q])
    hinges = jacobian[:, :3, ~is_slide]
    distance = math.sqrt(float((hinges**2).sum(axis=1).mean())) if hinges.size else 0.0
    length = tidy(distance) if distance > ON_AXES else 1.0
    return Proportions(q, jacobian, length, bool(is_slide.any() and not is_slide.all()))


def even_points(count: int, n: int) -> Array:
    """Return points that cover a unit cube evenly, (count, n) [Roberts18].

    They are multiples, modulo 1, of the powers of 1/g, where g is the root of g^(n+1) = g + 1.
    """
    g = 2.0
    for _ in range(60):  # each step takes at least half of the distance
        g = (1.0 + g) ** (1.0 / (n + 1.0))
    steps = g ** -np.arange(1.0, n + 1.0)
    return np.asarray((0.5 + np.arange(1.0, count + 1.0)[:, None] * steps) % 1.0)


def damping_below(usual: float) -> float:
    """Return ε for a usual σ_min."""
    return tidy(SHARE * usual)


def damping_maximum(below: float) -> float:
    """Return λ_max for ε, rounded up, so that no gain exceeds 1/ε."""
    return tidy(RATIO * below, up=True)


def tidy(value: float, digits: int = 2, up: bool = False) -> float:
    """Return a number of few digits, nearest or not smaller.

    >>> tidy(0.4382), tidy(0.4312, up=True), tidy(0.0)
    (0.44, 0.44, 0.0)
    """
    if value == 0.0 or not math.isfinite(value):
        return value
    power = digits - 1 - math.floor(math.log10(abs(value)))
    found = round(value, power)
    return round(found + 10.0**-power, power) if up and found < value else found


# Geometry and masses ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Chain:
    """The arm's geometry with all its joints at 0, as forward kinematics needs it.

    It has an axis for each joint, and for each follower; both halves of a screw have one axis.

    Attributes:
        names: Names of the joint on each axis, outward, ℓ of them.
        leader: The joint of the arm that moves it, (ℓ,).
        ratio: Its motion for each rad or m of that joint, (ℓ,).
        pitch: As `Arm.pitch`, (ℓ,).
        axis: Unit vectors in the world, (ℓ, 3).
        step: From a point on the previous axis (the first: the world's origin) to one on this axis, (ℓ, 3)
            [m].
        tip_step: From the last of these points to the site, (3,) [m].
        tip_quat: Orientation of the site, (4,).
    """

    names: tuple[str, ...]
    leader: NDArray[np.int64]
    ratio: Array
    pitch: Array
    axis: Array
    step: Array
    tip_step: Array
    tip_quat: Array

    def positions(self, q: ArrayLike) -> Array:
        """Return the displacement of each axis from its zero position, (ℓ,), for positions (n,)."""
        return np.asarray(self.ratio * np.asarray(q, dtype=np.float64)[self.leader])

    @cached_property
    def screws(self) -> tuple[tuple[float, ...], ...]:
        """Screws [ω; v at the world's origin] of the axes, per unit of the joint that moves each, (ℓ, 6)."""
        found = self.ratio[:, None] * joint_screw(self.axis, np.cumsum(self.step, axis=0), self.pitch)
        return tuple(map(tuple, found.tolist()))

    def gathered(self, values: Array, n: int) -> Array:
        """Return the sums over the axes of each joint, times their ratios, (..., n), of values (..., ℓ)."""
        gather = np.zeros((len(self.leader), n))
        gather[np.arange(len(self.leader)), self.leader] = self.ratio
        return np.asarray(values @ gather)


def find_masses(
    model: mujoco.MjModel, data: mujoco.MjData, F: NDArray[np.float64]
) -> dict[str, NDArray[Any]]:
    """Return the links of an arm.

    Args:
        model: The arm.
        data: Data with up-to-date kinematics, the joints of the arm at 0.
        F: Rates of all joints of the model for unit rates of the arm's, (nv, n).

    Returns:
        parent: The link that carries each, or -1, (ℓ,); links come after their parents.
        leader: The joint of the arm that moves it, (ℓ,).
        ratio: Its motion for each rad or m of that joint, (ℓ,).
        is_slide: Whether it slides, (ℓ,).
        axis: Unit vectors, (ℓ, 3).
        step: From the joint of the parent to its own, (ℓ, 3) [m].
        mass: (ℓ,) [kg].
        moment: Mass times the vector from its joint to its center of mass, (ℓ, 3) [kg·m].
        inertia: About its joint, (ℓ, 3, 3) [kg·m²].
        armature: Inertia of the rotors at each joint, (n,) [kg·m² or kg].
    """
    dofs = np.flatnonzero(F.any(axis=1))
    ids, count = model.dof_jntid[dofs], len(dofs)
    number = {int(joint): link for link, joint in enumerate(ids)}
    carriers = [[number[j] for j in joints_above(model, b) if j in number] for b in range(model.nbody)]
    parent, anchor = np.full(count, -1), np.array(data.xanchor[ids])
    mass, moment, inertia = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 3, 3))
    for body, (link, *others) in ((body, links) for body, links in enumerate(carriers) if links):
        for behind, before in pairwise((link, *others)):
            parent[behind] = before
        m, way = float(model.body_mass[body]), data.xipos[body] - anchor[link]
        turn = data.ximat[body].reshape(3, 3)
        mass[link] += m
        moment[link] += m * way
        inertia[link] += turn * model.body_inertia[body] @ turn.T
        inertia[link] += m * (way @ way * np.eye(3) - np.outer(way, way))
    return {
        "parent": parent, "leader": np.abs(F[dofs]).argmax(axis=1), "ratio": F[dofs].sum(axis=1),
        "is_slide": model.jnt_type[ids] == SLIDE, "axis": np.array(data.xaxis[ids]),
        "step": anchor - np.where(parent[:, None] >= 0, anchor[parent], anchor[0]), "mass": mass,
        "moment": moment, "inertia": inertia, "armature": model.dof_armature @ F**2,
    }  # fmt: skip
