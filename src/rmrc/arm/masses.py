"""The masses that an arm's joints move, from which its inertia M(q) follows."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.followers import Follower
from rmrc.arm.wiring import SLIDE, Wiring, joints_above

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Masses:
    """The links that the joints of an arm move, with all of these at 0, along world axes.

    A link is everything that moves with a joint and with no joint behind it. Followers have links of their
    own, on the chain to the site or beside it, and so have both halves of a screw. Bodies on joints that are
    not the arm's are a part of the link, in their rest position.

    Attributes:
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

    parent: NDArray[np.int64]
    leader: NDArray[np.int64]
    ratio: Array
    is_slide: NDArray[np.bool_]
    axis: Array
    step: Array
    mass: Array
    moment: Array
    inertia: Array
    armature: Array


def find_masses(
    model: mujoco.MjModel, data: mujoco.MjData, wiring: Wiring, followers: Sequence[Follower]
) -> Masses:
    """Return the links of an arm.

    Args:
        model: The arm.
        data: Data with up-to-date kinematics, the joints of the arm at 0.
        wiring: Its joints, and their followers.
        followers: The links of the followers.
    """
    n = len(wiring.joint)
    moved = [*((int(joint), j, 1.0) for j, joint in enumerate(wiring.joint))]
    pairs = zip(wiring.follower_joint, followers, strict=True)
    moved = sorted([*moved, *((int(joint), one.leader, one.ratio) for joint, one in pairs)])
    ids, leader, ratio = (np.array(values) for values in zip(*moved, strict=True))
    number = {int(joint): link for link, joint in enumerate(ids)}

    def above(body: int, joint: int | None = None) -> int:
        """Return the last link at or above a body; before a joint of it, if one is given."""
        joints = joints_above(model, body)
        joints = joints[joints.index(joint) + 1 :] if joint is not None else joints
        return next((number[one] for one in joints if one in number), -1)

    parent = np.array([above(int(model.jnt_bodyid[joint]), int(joint)) for joint in ids])
    anchor = np.array(data.xanchor[ids])
    mass, moment, inertia = np.zeros(len(ids)), np.zeros((len(ids), 3)), np.zeros((len(ids), 3, 3))
    for body in range(1, model.nbody):
        link = above(body)
        if link < 0:
            continue
        m, way = float(model.body_mass[body]), data.xipos[body] - anchor[link]
        turn = data.ximat[body].reshape(3, 3)
        mass[link] += m
        moment[link] += m * way
        inertia[link] += turn * model.body_inertia[body] @ turn.T
        inertia[link] += m * (way @ way * np.eye(3) - np.outer(way, way))
    armature = np.zeros(n)
    np.add.at(armature, leader, ratio**2 * model.dof_armature[model.jnt_dofadr[ids]])
    before = np.where(parent[:, None] >= 0, anchor[parent], anchor[0])
    return Masses(
        parent=parent, leader=leader, ratio=ratio, is_slide=model.jnt_type[ids] == SLIDE,
        axis=np.array(data.xaxis[ids]), step=anchor - before, mass=mass, moment=moment, inertia=inertia,
        armature=armature,
    )  # fmt: skip
