"""The geometry of a chain of joints, as forward kinematics needs it, and the masses that its joints move.

Masses are those of links, with all joints of the arm at 0, along world axes. A link is everything that moves
with a joint and with no joint behind it. Followers have links of their own, on the chain to the site or
beside it, and so have both halves of a screw. Bodies on joints that are not the arm's are a part of the link,
in their rest position.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.arm.wiring import SLIDE, joints_above
from rmrc.textbook.screws import joint_screw

Array = NDArray[np.float64]


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

    @property
    def kinds(self) -> tuple[str, ...]:
        """`hinge`, `slide` or `screw` of each axis."""
        return kinds_of(self.pitch)

    def gathered(self, values: Array, n: int) -> Array:
        """Return the sums over the axes of each joint, times their ratios, (..., n), of values (..., ℓ)."""
        gather = np.zeros((len(self.leader), n))
        gather[np.arange(len(self.leader)), self.leader] = self.ratio
        return np.asarray(values @ gather)


def kinds_of(pitch: Array) -> tuple[str, ...]:
    """Return `hinge`, `slide` or `screw` of joints with these pitches, (n,)."""
    return tuple("slide" if np.isinf(h) else "screw" if h else "hinge" for h in pitch)


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
