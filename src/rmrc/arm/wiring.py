"""The indices of an arm in a model: its site, and the chain of joints to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.support.errors import ModelError, did_you_mean
from rmrc.support.legible import listed

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
    joints_alone = np.flatnonzero(model.actuator_trntype == DRIVES_JOINT)
    drives = {int(model.actuator_trnid[i, 0]): int(i) for i in joints_alone}
    return Wiring(
        joint=joint,
        axis=axis,
        qpos=model.jnt_qposadr[joint].astype(np.int64),
        dof=model.jnt_dofadr[joint].astype(np.int64),
        actuator=np.array([drives.get(i, -1) for i in joint.tolist()]),
        follower_joint=following,
        follower_qpos=model.jnt_qposadr[following].astype(np.int64),
        follower_dof=model.jnt_dofadr[following].astype(np.int64),
        site=model.site(site).id,
        body=int(model.site_bodyid[model.site(site).id]),
        base=base_of(model, int(joint[0])),
    )


def base_of(model: mujoco.MjModel, joint: int) -> int:
    """Return the body that carries the body of an arm's first joint: the base, or the world."""
    return int(model.body_parentid[model.jnt_bodyid[joint]])


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


def soft_bodies(model: mujoco.MjModel) -> frozenset[int]:
    """Return the bodies that are points of a flex: only slides move them, and they have no geom."""
    slides = model.jnt_type == SLIDE
    points = set().union(*(flex_bodies(model, i) for i in range(model.nflex)))
    joints = {b: joints_of(model, b) for b in points if not model.body_geomnum[b]}
    return frozenset(b for b, its in joints.items() if its and slides[its.start : its.stop].all())


def flex_bodies(model: mujoco.MjModel, flex: int) -> set[int]:
    """Return the bodies that carry points of a flex, including the world where the flex is pinned there."""
    points = (
        (model.flex_vertbodyid, model.flex_vertadr, model.flex_vertnum),
        (model.flex_nodebodyid, model.flex_nodeadr, model.flex_nodenum),
    )
    spans = (body[first[flex] : first[flex] + count[flex]] for body, first, count in points)
    return {int(b) for span in spans for b in span if b >= 0}


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


def find_chain(path: Path, model: mujoco.MjModel, site: str, refuses_balls: bool = False) -> list[str]:
    """Return the names of the hinge and slide joints between the world and a site, outward.

    Raises:
        ModelError: There is none, one has no name, or there is a ball joint where these are refused.
    """
    chain: list[str] = []
    for i in joints_above(model, int(model.site_bodyid[model.site(site).id])):
        joint, body = model.joint(i), model.body(model.jnt_bodyid[i])
        called = f'body "{body.name or f"body{body.id}"}"'
        if refuses_balls and joint.type[0] == mujoco.mjtJoint.mjJNT_BALL:
            raise ModelError(
                f'{path}: the joint of {called} on the chain to site "{site}" is a ball joint; only hinge '
                "and slide joints can be driven at a rate: list those in joints",
                "joints",
            )
        if joint.type[0] in (HINGE, SLIDE):
            if not joint.name:
                raise ModelError(f"{path}: a joint of {called} has no name; give it one")
            chain.append(joint.name)
    if not chain:
        raise ModelError(f'{path}: no joint moves site "{site}"; choose a site on a moving body', "site")
    return chain[::-1]
