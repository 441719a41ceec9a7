"""Forces on an arm at rest beside its actuators: ends of ranges, other actuators, attached flexes."""

from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.arm import Arm
from rmrc.arm.wiring import flex_bodies, flex_name, joints_above

Array = NDArray[np.float64]

# A joint or tendon this near to the end of its range is at the end [rad or m]: MuJoCo's limits are soft.
NEAR = 1e-3


def ends(arm: Arm, qpos: Array) -> Iterator[str]:
    """Yield the joints of an arm, and the tendons that it moves, at the end of their ranges.

    Args:
        arm: The arm.
        qpos: Configuration of the model, (nq,).
    """
    q, near = qpos[arm.wiring.qpos], NEAR + arm.model.jnt_margin[arm.wiring.joint]
    lower, upper = arm.position_limit.T
    at_end = (q < lower + near) | (q > upper - near)
    if names := [name for name, is_there in zip(arm.joints, at_end, strict=True) if is_there]:
        yield f"{', '.join(names)} {'are' if len(names) > 1 else 'is'} at the end of the range"
    model, length = arm.model, _at_rest(arm, qpos).ten_length
    for i in np.flatnonzero(model.tendon_limited):
        (low, high), gap = model.tendon_range[i], NEAR + model.tendon_margin[i]
        if not low + gap <= length[i] <= high - gap and not _own(arm).isdisjoint(arm.others.along(int(i))):
            yield f'tendon "{model.tendon(i).name or i}" is at the end of its range'


def pulls(arm: Arm, start: Array, qpos: Array) -> Iterator[str]:
    """Yield the actuators that act on an arm and on something else, and each flex that is attached to it.

    Args:
        arm: The arm.
        start: Configuration of the model for which their controls were chosen, (nq,).
        qpos: Present configuration, (nq,).
    """
    model, data = arm.model, _at_rest(arm, qpos)
    data.ctrl[:], data.act[:] = arm.others.controls(start, None, None, every=True)
    mujoco.mj_fwdActuation(model, data)
    for i in arm.others.kept:
        if data.actuator_force[model.actuator_outadr[i]] and not _own(arm).isdisjoint(arm.others.pulled(i)):
            yield f'actuator "{model.actuator(i).name or i}" acts on the arm'
    for i in range(model.nflex):
        if any(not _own(arm).isdisjoint(joints_above(model, body)) for body in flex_bodies(model, i)):
            yield f'flex "{flex_name(model, i)}" is attached to the arm'


def _own(arm: Arm) -> frozenset[int]:
    return frozenset([*arm.wiring.joint.tolist(), *arm.wiring.follower_joint.tolist()])


def _at_rest(arm: Arm, qpos: Array) -> mujoco.MjData:
    data = mujoco.MjData(arm.model)
    data.qpos[:] = qpos
    arm.place_mocap(data)
    mujoco.mj_fwdPosition(arm.model, data)
    mujoco.mj_fwdVelocity(arm.model, data)
    return data
