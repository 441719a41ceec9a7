"""Actuators of a model: the command that each takes, and the limits that they and the ranges of joints set.

The force of an actuator is gain · u + bias₀ + bias₁ · length + bias₂ · speed, where u is its control or the
output of its dynamics. These numbers make it a position servo, a servo of a position that it integrates, a
rate servo or a motor, whatever element of MJCF it was written as.
"""

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.equalities import Follower
from rmrc.arm.wiring import DRIVES_JOINT, dense

Array = NDArray[np.float64]
Ends: TypeAlias = tuple[float, float]

EVERYWHERE: Ends = (-math.inf, math.inf)

# The last of MuJoCo's kinds of dynamics that are none, an integrator or a filter; and of its linear biases.
_FILTER, _AFFINE = int(mujoco.mjtDyn.mjDYN_FILTEREXACT), int(mujoco.mjtBias.mjBIAS_AFFINE)


class DriveKind(IntEnum):
    """The command that an actuator takes, by the name of its usual element in MJCF."""

    POSITION = 0  # the target position
    INTVELOCITY = 1  # the rate of the target position
    VELOCITY = 2  # the rate
    MOTOR = 3  # the force


class Terms(NamedTuple):
    """The control that an actuator takes: scale · (length, speed or force) + offset, within a range.

    Attributes:
        scale: Control for each unit of length, speed or force.
        offset: Control at 0; none for the rate of an integrated position.
        stiffness: Force for each unit by which the length misses its target.
        control: Least and largest control; infinite without a range.
        state: Least and largest activation.
    """

    scale: float
    offset: float
    stiffness: float
    control: Ends
    state: Ends


def kind_of(model: mujoco.MjModel, i: int) -> DriveKind | None:
    """Return the command kind of an actuator; None for a muscle or another one that is no servo or motor."""
    gain, dynamics = model.actuator_gaintype[i], model.actuator_dyntype[i]
    is_affine = gain == mujoco.mjtGain.mjGAIN_FIXED and model.actuator_biastype[i] <= _AFFINE
    is_usual = is_affine and dynamics <= _FILTER and model.actuator_ctrlnum[i] == 1
    is_off = model.opt.disableactuator >> int(model.actuator_group[i]) & 1 or model.actuator_plugin[i] >= 0
    if not is_usual or is_off or abs(model.actuator_gainprm[i, 0]) <= mujoco.mjMINVAL:
        return None
    _, stiffness, damping = -_bias(model, i)
    integrates = dynamics == mujoco.mjtDyn.mjDYN_INTEGRATOR
    if stiffness > 0.0:
        return DriveKind.INTVELOCITY if integrates else DriveKind.POSITION
    if stiffness < 0.0 or damping < 0.0 or integrates:
        return None
    return DriveKind.VELOCITY if damping > 0.0 else DriveKind.MOTOR


def kind_word(model: mujoco.MjModel, i: int) -> str:
    """Return the name of the kind of an actuator by its computation, whichever element of MJCF it is."""
    kind, dynamics = kind_of(model, i), model.actuator_dyntype[i]
    if dynamics == mujoco.mjtDyn.mjDYN_MUSCLE:
        return "muscle"
    return "general" if kind is None or (kind == DriveKind.MOTOR and dynamics) else kind.name.lower()


def terms_of(model: mujoco.MjModel, i: int, kind: DriveKind) -> Terms:
    """Return the control that an actuator with a kind of command takes."""
    gain, (b0, b1, b2) = float(model.actuator_gainprm[i, 0]), _bias(model, i).tolist()
    scale = 1.0 if kind == DriveKind.MOTOR else -b2 if kind == DriveKind.VELOCITY else -b1
    clamps = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
    control = _ends(model.actuator_ctrllimited[i] and clamps, model.actuator_ctrlrange[i])
    state = _ends(model.actuator_actlimited[i], model.actuator_actrange[i])
    return Terms(scale / gain, -b0 / gain, -b1, control, state)


def _ends(is_limited: bool, ends: Array) -> Ends:
    return (float(ends[0]), float(ends[1])) if is_limited else EVERYWHERE


def _bias(model: mujoco.MjModel, i: int) -> Array:
    is_used = model.actuator_biastype[i] != mujoco.mjtBias.mjBIAS_NONE
    return np.asarray(model.actuator_biasprm[i, :3] if is_used else np.zeros(3))


def moments_of(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return the rate of length of each actuator at unit rates of all joints of a model, (nactuator, nv)."""
    rows = dense(data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind, model.nv)
    return np.asarray(rows[model.actuator_outadr])


# Limits -----------------------------------------------------------------------------------------


def limits(
    model: mujoco.MjModel, joints: Sequence[str], followers: Sequence[Follower], rates: Mapping[str, float]
) -> tuple[Array, Array, Array]:
    """Return position limits, (n, 2), rate limits, (n,), and torque limits, (n,); infinite without any.

    The limits of a follower also limit its leader: its torque does the same work.

    Args:
        model: The author's model.
        joints: Names of the arm's joints, n of them.
        followers: Joints that follow them.
        rates: Largest rates that the file has beside the model, by the names of joints: a URDF's.
    """

    def limits_of(name: str) -> list[float]:
        joint, rate = model.joint(name).id, rates.get(name, np.inf)
        torque = np.abs(_ends(model.jnt_actfrclimited[joint], model.jnt_actfrcrange[joint])).min()
        for i in _actuators(model, joint):
            gear = abs(model.actuator_gear[i, 0])
            torque = min(torque, gear * np.abs(_forces(model, i)).min())
            if model.actuator_ctrllimited[i] and kind_of(model, i) == DriveKind.VELOCITY:
                # of both ends the smaller one; only such a control is a rate
                rate = min(rate, np.abs(model.actuator_ctrlrange[i]).min() / gear)
        return [*_ends(model.jnt_limited[joint], model.jnt_range[joint]), rate, torque]

    table = np.array([limits_of(name) for name in joints])
    for each in (each for each in followers if each.ratio):
        *ends, rate, torque = limits_of(each.name)
        row, size = table[each.leader], abs(each.ratio)
        low, high = np.sort((np.array(ends) - each.offset) / each.ratio)
        row[:] = max(row[0], low), min(row[1], high), min(row[2], rate / size), min(row[3], torque * size)
    return table[:, :2], table[:, 2], table[:, 3]


def _actuators(model: mujoco.MjModel, joint: int) -> list[int]:
    """Return the actuators that drive a joint alone, and not with a gear of 0."""
    drives = (model.actuator_trntype == DRIVES_JOINT) & (model.actuator_trnid[:, 0] == joint)
    return np.flatnonzero(drives & (np.abs(model.actuator_gear[:, 0]) > mujoco.mjMINVAL)).tolist()


def _forces(model: mujoco.MjModel, i: int) -> Ends:
    """Return the least and largest force of an actuator, which a motor's control also limits."""
    least, most = _ends(model.actuator_forcelimited[i], model.actuator_forcerange[i])
    # the force of a damper, whose gain is not constant, depends on its speed
    has_no_bias = model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE
    is_motor = has_no_bias and model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED
    if is_motor and model.actuator_ctrllimited[i]:
        low, high = np.sort(model.actuator_ctrlrange[i] * model.actuator_gainprm[i, 0]).tolist()
        least, most = max(least, low), min(most, high)
    return least, most


def forces(model: mujoco.MjModel, joints: Sequence[int]) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """Return what joints can get: from the actuator that takes the command of each, and from all of them.

    A position servo takes the command before other actuators.

    Returns:
        The place of that actuator in `actuator_force`, (n,), -1 without one, its gear, (n,), its least and
        largest force, (2, n), and the least and largest torque of all actuators of a joint, (2, n).
    """
    output, gear = np.full(len(joints), -1), np.ones(len(joints))
    force, torque = np.tile(np.reshape(EVERYWHERE, (2, 1)), (2, 1, len(joints)))
    for j, joint in enumerate(joints):
        torque[:, j] = _ends(model.jnt_actfrclimited[joint], model.jnt_actfrcrange[joint])
        if actuators := _actuators(model, joint):
            i = max(actuators, key=lambda i: (model.actuator_biasprm[i, 1] < 0.0, i))
            output[j], gear[j] = model.actuator_outadr[i], model.actuator_gear[i, 0]
            force[:, j] = _forces(model, i)
    return output, gear, force, torque
