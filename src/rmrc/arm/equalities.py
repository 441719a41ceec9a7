"""Equalities of a model: which joints follow others, and which constraints tie an arm."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.wiring import HINGE, SLIDE, dense, joint_name
from rmrc.support.errors import ModelError

Array = NDArray[np.float64]

# A screw's slide is parallel to its hinge up to the 1 − cos that eight digits of an axis in a file leave.
PARALLEL = 1e-9
# Configurations at which equalities are examined besides the start. One ties the arm only if it does so at
# all of them: at a single one, a linkage may be stretched.
_SAMPLES = 2
# A smaller share of the largest entry is rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Follower:
    """A joint that follows another: position = offset + ratio · (position of its leader).

    Attributes:
        name: Name of the joint.
        leader: The joint of the arm that it follows; in `find_links` the id of the joint in the model that it
            finally follows, or -1 if it is held still.
        ratio: Its motion for each rad or m of its leader [m or rad].
        offset: [m or rad]
        pitch: Pitch of the screw formed with its leader, an adjacent hinge on the same axis: ± ratio, by the
            direction in which it slides along that axis [m/rad]; 0 where it forms none.
    """

    name: str
    leader: int
    ratio: float
    offset: float
    pitch: float = 0.0


def active_equalities(model: mujoco.MjModel) -> list[int]:
    """Return the equalities that are active from the start."""
    off = mujoco.mjtDisableBit.mjDSBL_EQUALITY | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return [] if model.opt.disableflags & off else np.flatnonzero(model.eq_active0).tolist()


# Followers --------------------------------------------------------------------------------------


def find_links(path: Path, model: mujoco.MjModel, chain: Sequence[str]) -> dict[str, Follower]:
    """Return what follows, by its name, through other joints to one that follows none.

    Followers on the chain come first, outward. Other followers are left out if their link is invalid.

    Raises:
        ModelError: A joint of the chain follows another by a polynomial, two of them, or in a circle.
    """
    rules: dict[int, list[int]] = {}
    for i in (i for i in active_equalities(model) if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT):
        rules.setdefault(int(model.eq_obj1id[i]), []).append(i)
    names = [model.joint(joint).name for joint in rules]
    links = {}
    for name in [*(n for n in chain if n in names), *(n for n in names if n and n not in chain)]:
        try:
            links[name] = _followed(path, model, name, rules)
        except ModelError:
            if name in chain:
                raise
    return links


def _followed(path: Path, model: mujoco.MjModel, name: str, rules: Mapping[int, Sequence[int]]) -> Follower:
    """Return the final link of a joint."""
    zero, joint, ratio, offset = model.qpos0[model.jnt_qposadr], model.joint(name).id, 1.0, 0.0
    passed = {joint}
    while joint in rules:
        leader, polynomial = int(model.eq_obj2id[rules[joint][0]]), model.eq_data[rules[joint][0], :5]
        if len(rules[joint]) > 1 or polynomial[2:].any() or leader in passed:
            why = "follows another by two equalities, in a circle, or not linearly"
            way = "on the chain to a site there must be one, with polycoef a b 0 0 0, got"
            numbers = " ".join(f"{value:g}" for value in polynomial)
            raise ModelError(f'{path}: joint "{joint_name(model, joint)}" {why}; {way} {numbers}')
        offset += ratio * float(polynomial[0] + zero[joint])
        ratio *= float(polynomial[1]) if leader >= 0 else 0.0
        offset -= ratio * float(zero[leader])
        joint = leader
        passed.add(joint)
    return Follower(name, joint, ratio, offset)


def followers(
    model: mujoco.MjModel, chain: Sequence[str], links: Mapping[str, Follower], driven: Sequence[str]
) -> tuple[Follower, ...]:
    """Return the joints that follow actuated ones, on the chain or not.

    Args:
        model: The author's model.
        chain: Names of its joints, outward.
        links: The links of the followers.
        driven: Names of the joints of the arm.
    """
    places = {model.joint(name).id: i for i, name in enumerate(driven)}
    following = [link for link in links.values() if link.leader in places]
    if not following:
        return ()
    data, screws = mujoco.MjData(model), set[int]()
    mujoco.mj_fwdKinematics(model, data)
    for i, link in enumerate(following):
        leader, joint, pitch = model.joint(link.leader), model.joint(link.name), 0.0
        along = float(data.xaxis[leader.id] @ data.xaxis[joint.id])
        is_beside = link.name in chain and abs(chain.index(leader.name) - chain.index(link.name)) == 1
        is_pair = (leader.type[0], joint.type[0]) == (HINGE, SLIDE) and leader.id not in screws
        if is_pair and is_beside and abs(abs(along) - 1.0) < PARALLEL and link.ratio:
            pitch = link.ratio if along > 0.0 else -link.ratio
            screws.add(leader.id)
        following[i] = replace(link, leader=places[link.leader], pitch=pitch)
    return tuple(following)


def motion(model: mujoco.MjModel, joints: Sequence[str], following: Sequence[Follower]) -> Array:
    """Return F, (nv, n): the rates of all joints of a model for unit rates of an arm's joints."""
    F = np.zeros((model.nv, len(joints)))
    F[[model.joint(name).dofadr[0] for name in joints], np.arange(len(joints))] = 1.0
    for each in following:
        F[model.joint(each.name).dofadr[0], each.leader] = each.ratio
    return F


# Ties -------------------------------------------------------------------------------------------


def find_ties(model: mujoco.MjModel, qpos: Array, F: Array, still: Collection[int]) -> tuple[str, ...]:
    """Return the equalities that remove freedom from the joints of an arm, in words.

    With the rows G of all equalities, motions of the arm are free if other joints can make up for them. The
    arm is tied if (1 − G_o G_o⁺) G F is not 0, with the columns o of the joints that are free to move:
    neither locked nor held by an actuator. A weld to the world, a mocap body or a second arm ties it; an
    object welded to the hand, or a linkage within a gripper, does not.

    Args:
        model: The author's model.
        qpos: Start configuration, (nq,).
        F: Motion of all joints for each of the arm's, (nv, n).
        still: Joints that are locked or held.
    """
    if not active_equalities(model):
        return ()
    free = np.flatnonzero(~F.any(axis=1) & ~np.isin(model.dof_jntid, list(still)))
    data, rng, ties = mujoco.MjData(model), np.random.default_rng(0), set(range(model.neq))
    for sample in range(1 + _SAMPLES):
        data.qpos[:] = qpos
        if sample:
            mujoco.mj_integratePos(model, data.qpos, rng.uniform(-0.5, 0.5, model.nv), 1.0)
        rows, number, _ = equality_rows(model, data)
        own, loose = rows @ F, rows[:, free]
        if loose.any():
            own -= loose @ (np.linalg.pinv(loose, rcond=_ROUNDING) @ own)
        acts = np.abs(own).max(axis=1, initial=0.0) > _ROUNDING * np.abs(rows).max(initial=0.0)
        ties &= set(number[acts].tolist())
    return tuple(_in_words(model, i) for i in sorted(ties))


def equality_rows(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, NDArray[np.int32], Array]:
    """Return the rows of all active equalities, (rows, nv), the number of the equality of each, its gap."""
    mujoco.mj_fwdKinematics(model, data)
    mujoco.mj_makeConstraint(model, data)
    if mujoco.mj_isSparse(model):
        full = dense(data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind, model.nv)
    else:
        # behind the rows there can be space that MuJoCo allocated and did not use
        full = np.array(data.efc_J)[: data.nefc * model.nv].reshape(data.nefc, model.nv)
    chosen = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    return full[chosen], np.array(data.efc_id)[chosen], np.array(data.efc_pos)[chosen]


def _in_words(model: mujoco.MjModel, i: int) -> str:
    """Return a text such as `weld "grip"`, or `weld 3` if it has no name."""
    kind, name = (
        mujoco.mjtEq(int(model.eq_type[i])).name.removeprefix("mjEQ_").lower(),
        model.equality(i).name,
    )
    return f'equality {kind} "{name}"' if name else f"equality {kind} {i}"
