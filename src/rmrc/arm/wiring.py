"""The indices of an arm in a model: its site, and the chain of joints to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.support.errors import ModelError, did_you_mean
from rmrc.support.text import listed

# MuJoCo's arrays hold plain integers, which its enums do not equal.
HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
DRIVES_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)


@dataclass(frozen=True)
class Wiring:
    """Indices of the arm in a model that MuJoCo compiled: four kinds, never mixed up.

    Attributes:
        joint: Joint ids, (n,).
        axis: Id of the joint on each axis of the chain, (ℓ,): see `Chain`.
        qpos: Addresses in qpos, (n,).
        dof: Addresses in qvel, (n,).
        actuator: Actuator ids, (n,); -1 where the model has none.
        follower_joint: Ids of the joints that follow others, in the order of `Arm.followers`.
        follower_qpos: Their addresses in qpos.
        follower_dof: Their addresses in qvel.
        site: Site id.
        body: Id of the body that carries the site.
        base: Id of the base: the body that carries the first joint's body, or the world.
    """

    joint: NDArray[np.int64]
    axis: NDArray[np.int64]
    qpos: NDArray[np.int64]
    dof: NDArray[np.int64]
    actuator: NDArray[np.int64]
    follower_joint: NDArray[np.int64]
    follower_qpos: NDArray[np.int64]
    follower_dof: NDArray[np.int64]
    site: int
    body: int
    base: int


def wire(
    model: mujoco.MjModel, joints: Sequence[str], followers: Sequence[str], axes: Sequence[str], site: str
) -> Wiring:
    """Resolve the names of joints, of their followers, of all joints with an axis, and of the site."""
    joint, following, axis = (
        np.array([model.joint(name).id for name in names], np.int64) for names in (joints, followers, axes)
    )
    drives = {
        int(model.actuator_trnid[i, 0]): i for i in np.flatnonzero(model.actuator_trntype == DRIVES_JOINT)
    }
    qpos, dof = model.jnt_qposadr.astype(np.int64), model.jnt_dofadr.astype(np.int64)
    return Wiring(
        joint=joint, axis=axis, qpos=qpos[joint], dof=dof[joint],
        actuator=np.array([drives.get(i, -1) for i in joint.tolist()], np.int64), follower_joint=following,
        follower_qpos=qpos[following], follower_dof=dof[following], site=model.site(site).id,
        body=int(model.site(site).bodyid[0]), base=int(model.body_parentid[model.jnt_bodyid[joint[0]]]),
    )  # fmt: skip


def find(
    path: Path, model: mujoco.MjModel, kind: Literal["site", "body"], wanted: str, about: str = ""
) -> int:
    """Return the id of a site or a body.

    Args:
        path: Path of the model.
        model: Compiled.
        kind: Which of them.
        wanted: Its name.
        about: The key that an error names; "": the kind.

    Raises:
        ModelError: None has that name.
    """
    ids = range(model.nsite) if kind == "site" else range(1, model.nbody)
    names = {name: i for i in ids if (name := getattr(model, kind)(i).name)}
    if wanted not in names:
        hint, plural = did_you_mean(wanted, names), "sites" if kind == "site" else "bodies"
        known = f"its {plural}: {listed(names) or 'none'}"
        raise ModelError(f'{path}: has no {kind} "{wanted}"{hint}; {known}', about or kind)
    return names[wanted]


def dense(values: Any, counts: Any, firsts: Any, columns: Any, nv: int) -> NDArray[np.float64]:
    """Return a sparse Jacobian of MuJoCo as a full matrix, (rows, nv)."""
    full = np.zeros((len(counts), nv))
    mujoco.mju_sparse2dense(full, values, counts, firsts, columns)
    return full


def soft_bodies(model: mujoco.MjModel) -> frozenset[int]:
    """Return the bodies that are points of a flex: only slides move them, and they have no geom."""
    slides = model.jnt_type == SLIDE
    points = {*model.flex_vertbodyid.tolist(), *model.flex_nodebodyid.tolist()}
    joints = {b: joints_of(model, b) for b in points if b >= 0 and not model.body_geomnum[b]}
    return frozenset(b for b, its in joints.items() if its and slides[its.start : its.stop].all())


def flex_name(model: mujoco.MjModel, flex: int) -> str:
    """Return the name of a flex."""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex) or f"flex{flex}"


def joints_of(model: mujoco.MjModel, body: int) -> range:
    """Return the joints of a body."""
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """Return the name of a joint, or `joint` and its number."""
    return model.joint(joint).name or f"joint{joint}"


def joints_above(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the joints between the world and a body, including its own, the last first."""
    joints: list[int] = []
    while body > 0:
        joints += reversed(joints_of(model, body))
        body = int(model.body_parentid[body])
    return joints
