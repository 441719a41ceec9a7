"""The masses that an arm's joints move, from which its inertia M(q) follows.

They are links, with all joints of the arm at 0, along world axes. A link is everything that moves with a
joint and with no joint behind it. Followers have links of their own, on the chain to the site or beside it,
and so have both halves of a screw. Bodies on joints that are not the arm's are a part of the link, in their
rest position.
"""

from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.wiring import SLIDE, joints_above


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
