"""Joint resistance, damping and dry friction, as the actuators compensate it."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm, Wiring
from rmrc.law.jit import Record, compiled
from rmrc.law.record import JOINTS, Field

# MuJoCo's dry friction is a force −clip(I (q̈ + b q̇), ±loss): a drag up to a creeping rate, the loss beyond.
RESISTANCE = (
    Field("resists", np.int64, (JOINTS,)),
    Field("damping", size=(JOINTS, 3)),  # of q̇, q̇|q̇| and q̇³
    Field("friction_loss", size=(JOINTS,)),
    Field("friction_inertia", size=(JOINTS,)),  # I
    Field("friction_decay", size=(JOINTS,)),  # b [1/s]
)

_OF_JOINT = int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF)


@compiled
def damping_at(world: Record, j: int, rate: float) -> Any:
    """Return the damping of joint j at a rate."""
    d, size = world.damping[j], abs(rate)
    return rate * (d[0] + size * (d[1] + size * d[2]))


@compiled
def friction_at(world: Record, j: int, acceleration: float, rate: float) -> Any:
    """Return the dry friction of joint j, positive against a positive rate."""
    force = world.friction_inertia[j] * (acceleration + world.friction_decay[j] * rate)
    return min(max(force, -world.friction_loss[j]), world.friction_loss[j])


def write_resistance(
    worlds: NDArray[np.void], model: mujoco.MjModel, wiring: Wiring, arm: Arm, compensates: NDArray[np.bool_]
) -> None:
    """Write these fields of the records of a batch.

    A follower of a joint, such as the slide of a screw, resists with its own damping and friction, by its
    ratio.

    Args:
        worlds: The records, (w,).
        model: The model that the worlds share.
        wiring: Wiring of the arm in it.
        arm: The arm.
        compensates: Whether the actuators of each world compensate resistance, (w,).
    """
    damping = np.column_stack([model.dof_damping, model.dof_dampingpoly])
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_DAMPER:
        damping[:] = 0.0
    loss, inertia, decay = _friction(model)
    own = wiring.dof
    damping_of, loss_of, inertia_of = damping[own], loss[own], inertia[own]
    for address, one in zip(wiring.follower_dof, arm.followers, strict=True):
        ratio = abs(one.ratio)
        damping_of[one.leader] += damping[address] * ratio ** np.array([2.0, 3.0, 4.0])
        loss_of[one.leader] += ratio * loss[address]
        inertia_of[one.leader] += ratio**2 * inertia[address]
    resists = damping_of.any(axis=1) | (loss_of > 0.0)
    worlds["resists"][:, : arm.n] = resists & compensates[:, None]
    worlds["damping"][:, : arm.n], worlds["friction_loss"][:, : arm.n] = damping_of, loss_of
    worlds["friction_inertia"][:, : arm.n], worlds["friction_decay"][:, : arm.n] = inertia_of, decay[own]


def _friction(model: mujoco.MjModel) -> tuple[NDArray[np.float64], ...]:
    """Return loss, I and b of each degree of freedom, (nv,) each, by MuJoCo's definitions."""
    loss, inertia, decay = np.zeros((3, model.nv))
    if model.dof_frictionloss.any():
        data = mujoco.MjData(model)
        mujoco.mj_fwdPosition(model, data)
        rows = np.flatnonzero(data.efc_type == _OF_JOINT)
        dof = data.efc_id[rows]
        loss[dof], inertia[dof], decay[dof] = (
            data.efc_frictionloss[rows], data.efc_D[rows], data.efc_KBIP[rows, 1]
        )  # fmt: skip
    return loss, inertia, decay
