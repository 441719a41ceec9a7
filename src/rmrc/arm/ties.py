"""Constraints that tie an arm, so that it is no open chain: welds, connects and other equalities."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.followers import active_equalities
from rmrc.arm.others import Others

Array = NDArray[np.float64]

# MuJoCo's arrays hold plain integers, which its enums do not equal.
_EQUALITY = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
_KINDS = {
    int(mujoco.mjtEq.mjEQ_CONNECT): ("connect", mujoco.mjtObj.mjOBJ_BODY),
    int(mujoco.mjtEq.mjEQ_WELD): ("weld", mujoco.mjtObj.mjOBJ_BODY),
    int(mujoco.mjtEq.mjEQ_JOINT): ("joint equality", mujoco.mjtObj.mjOBJ_JOINT),
    int(mujoco.mjtEq.mjEQ_TENDON): ("tendon equality", mujoco.mjtObj.mjOBJ_TENDON),
    int(mujoco.mjtEq.mjEQ_FLEX): ("equality", mujoco.mjtObj.mjOBJ_FLEX),
    int(mujoco.mjtEq.mjEQ_FLEXVERT): ("equality", mujoco.mjtObj.mjOBJ_FLEX),
    int(mujoco.mjtEq.mjEQ_FLEXSTRAIN): ("equality", mujoco.mjtObj.mjOBJ_FLEX),
}
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)

# Configurations at which the constraints are examined besides the start. A constraint ties the arm only if it
# does so at all of them: at a single one, a linkage may be stretched.
_SAMPLES = 2
# A smaller share of the largest entry is rounding.
_ROUNDING = 1e-9


def find_ties(
    model: mujoco.MjModel, qpos: Array, dofs: Sequence[int], follow: Array, others: Others
) -> tuple[str, ...]:
    """Return the equalities that remove freedom from the joints of an arm, in words.

    With the rows G of all equalities, motions of the arm are free if other joints can make up for them. The
    arm is tied if (1 − G_o G_o⁺) G_a is not 0, with the columns a of the arm and o of the joints that are
    free to move: neither locked nor held by an actuator. A weld to the world, a mocap body or a second arm
    ties it; an object welded to the hand, or a linkage within a gripper, does not.

    Args:
        model: The author's model.
        qpos: Start configuration, (nq,).
        dofs: Addresses in qvel of all joints on the chain that move with the arm.
        follow: Their motion for each joint of the arm, (len(dofs), n).
        others: The parts that are not the arm.
    """
    if not active_equalities(model):
        return ()
    held = others.locked.union(*(others.pulled(i) for i in others.kept if others.holds(i)))
    still = {dof for joint in held for dof in _dofs(model, joint)}
    free = [dof for dof in range(model.nv) if dof not in still and dof not in set(dofs)]
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    tied: set[int] | None = None
    for sample in range(1 + _SAMPLES):
        data.qpos[:] = qpos
        if sample:
            mujoco.mj_integratePos(model, data.qpos, rng.uniform(-0.5, 0.5, model.nv), 1.0)
        rows, number, _ = equality_rows(model, data)
        own, loose = rows[:, dofs] @ follow, rows[:, free]
        if not own.any():
            return ()
        kept = own - loose @ (np.linalg.pinv(loose, rcond=_ROUNDING) @ own) if loose.any() else own
        acts = np.abs(kept).max(axis=1) > _ROUNDING * np.abs(rows).max()
        here = set(number[acts].tolist())
        tied = here if tied is None else tied & here
    return tuple(_in_words(model, i) for i in sorted(tied or ()))


def equality_rows(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, NDArray[np.int32], Array]:
    """Return the rows of all active equalities, (rows, nv), the number of the equality of each, its gap."""
    mujoco.mj_fwdKinematics(model, data)
    data.ncon = 0
    mujoco.mj_makeConstraint(model, data)
    if mujoco.mj_isSparse(model):
        full = np.zeros((data.nefc, model.nv))
        mujoco.mju_sparse2dense(full, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    else:
        # behind the rows there can be space that MuJoCo allocated and did not use
        full = np.array(data.efc_J)[: data.nefc * model.nv].reshape(data.nefc, model.nv)
    chosen = data.efc_type == _EQUALITY
    return full[chosen], np.array(data.efc_id)[chosen], np.array(data.efc_pos)[chosen]


def _dofs(model: mujoco.MjModel, joint: int) -> range:
    first = int(model.jnt_dofadr[joint])
    return range(first, int(model.jnt_dofadr[joint + 1]) if joint + 1 < model.njnt else model.nv)


def _in_words(model: mujoco.MjModel, i: int) -> str:
    """Return a text such as `weld "grip" of body "hand" to body "mocap"`."""
    kind, of = _KINDS.get(int(model.eq_type[i]), ("equality", None))
    name = f'{kind} "{model.equality(i).name}"' if model.equality(i).name else f"{kind} {i}"
    if of is None:
        return name
    of = mujoco.mjtObj.mjOBJ_SITE if model.eq_objtype[i] == _SITE else of
    word = of.name.removeprefix("mjOBJ_").lower()
    ids = [int(one) for one in (model.eq_obj1id[i], model.eq_obj2id[i]) if one >= 0]
    first, *rest = (
        f'{word} "{mujoco.mj_id2name(model, of, one) or f"{word}{one}"}"'
        if one or word != "body"
        else "the world"
        for one in ids
    )
    return f"{name} of {first}" + "".join(f" to {one}" for one in rest)
