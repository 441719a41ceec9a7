"""Limits of a model's joints: position, rate and torque."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.followers import Follower
from rmrc.arm.wiring import DRIVES_JOINT

Array = NDArray[np.float64]

# MuJoCo's arrays hold plain integers, which its enums do not equal.
NO_BIAS, NO_DYNAMICS = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtDyn.mjDYN_NONE)
FIXED_GAIN = int(mujoco.mjtGain.mjGAIN_FIXED)


def position_limit(model: mujoco.MjModel, joints: Sequence[str], followers: Sequence[Follower]) -> Array:
    """Return the range of each joint, (n, 2); the range of a follower also limits its leader."""

    def limit(name: str) -> Array:
        joint = model.joint(name).id
        return np.array(model.jnt_range[joint] if model.jnt_limited[joint] else [-np.inf, np.inf])

    limits = np.array([limit(name) for name in joints])
    for one in followers:
        if one.ratio != 0.0:
            ends = np.sort((limit(one.name) - one.offset) / one.ratio)
            limits[one.leader] = (
                max(limits[one.leader, 0], ends[0]),
                min(limits[one.leader, 1], ends[1]),
            )
    return limits


def leading_limit(
    model: mujoco.MjModel,
    joints: Sequence[str],
    followers: Sequence[Follower],
    limit: Callable[[int], float],
    power: int,
) -> Array:
    """Return the tightest limit of each joint and of those that follow it, (n,).

    Args:
        model: The author's model.
        joints: Names of the arm's joints, n of them.
        followers: Joints that follow them.
        limit: Limit of a joint, by its id.
        power: Power of the ratio that turns a follower's limit into one of its leader: −1 for rates, 1 for
            torques, which do the same work.
    """
    limits = np.array([limit(model.joint(name).id) for name in joints])
    for one in followers:
        if one.ratio != 0.0:
            own = limit(model.joint(one.name).id) * abs(one.ratio) ** power
            limits[one.leader] = min(limits[one.leader], own)
    return limits


def _actuators(model: mujoco.MjModel, joint: int) -> list[int]:
    return [
        i
        for i in range(model.nactuator)
        if model.actuator_trntype[i] == DRIVES_JOINT
        and model.actuator_trnid[i, 0] == joint
        and abs(model.actuator_gear[i, 0]) > mujoco.mjMINVAL  # otherwise it moves nothing
    ]


def rate_limit(model: mujoco.MjModel, joint: int) -> float:
    """The smaller end of a rate servo's control range: only such a control is a rate."""
    limits = [
        np.abs(model.actuator_ctrlrange[i]).min() / abs(model.actuator_gear[i, 0])
        for i in _actuators(model, joint)
        if model.actuator_ctrllimited[i]
        and model.actuator_biasprm[i, 1] == 0.0
        and model.actuator_biasprm[i, 2] < 0.0
        and model.actuator_dyntype[i] == NO_DYNAMICS
    ]
    return float(min(limits, default=np.inf))


def force_range(model: mujoco.MjModel, i: int) -> Array:
    """Return the least and largest force of an actuator, (2,), which a motor's control also limits."""
    limited, gain = model.actuator_forcelimited[i], model.actuator_gainprm[i, 0]
    ends = np.array(model.actuator_forcerange[i] if limited else [-np.inf, np.inf])
    # the force of a damper, whose gain is not constant, depends on its speed
    is_motor = model.actuator_biastype[i] == NO_BIAS and model.actuator_gaintype[i] == FIXED_GAIN
    if is_motor and model.actuator_ctrllimited[i]:
        least, most = np.sort(model.actuator_ctrlrange[i] * gain)
        ends = np.array([max(ends[0], least), min(ends[1], most)])
    return ends


def torque_limit(model: mujoco.MjModel, joint: int) -> float:
    """The tightest of the joint's and its actuators' force ranges, and of a motor's control range."""
    limits = [np.inf]
    if model.jnt_actfrclimited[joint]:
        limits.append(np.abs(model.jnt_actfrcrange[joint]).min())
    actuators = _actuators(model, joint)
    limits += [np.abs(force_range(model, i)).min() * abs(model.actuator_gear[i, 0]) for i in actuators]
    return float(min(limits))


class Forces(NamedTuple):
    """What joints can get: from the actuator that takes the command of each, and from all its actuators.

    Attributes:
        output: Place of that actuator in `actuator_force`, (n,); -1 without one.
        gear: Its gear, (n,).
        force: Its least and largest force, (2, n).
        torque: Least and largest torque of all actuators of a joint, (2, n).
    """

    output: NDArray[np.int64]
    gear: Array
    force: Array
    torque: Array


def forces(model: mujoco.MjModel, joints: Sequence[int]) -> Forces:
    """Return what can be given to some joints; a position servo takes the command before other actuators."""
    n = len(joints)
    unlimited = np.tile([[-np.inf], [np.inf]], n)
    result = Forces(np.full(n, -1), np.ones(n), unlimited, unlimited.copy())
    for j, joint in enumerate(joints):
        if model.jnt_actfrclimited[joint]:
            result.torque[:, j] = model.jnt_actfrcrange[joint]
        if actuators := _actuators(model, joint):
            i = max(actuators, key=lambda i: (model.actuator_biasprm[i, 1] < 0.0, i))
            result.output[j], result.gear[j] = model.actuator_outadr[i], model.actuator_gear[i, 0]
            result.force[:, j] = force_range(model, i)
    return result
