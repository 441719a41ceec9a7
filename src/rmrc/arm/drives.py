"""The arm's own actuators: which of the author's actuators move its joints, and the command that each takes.

The force of an actuator is gain · u + bias₀ + bias₁ · length + bias₂ · speed, where u is its control or the
output of its dynamics. These numbers make it a position servo, a servo of a position that it integrates, a
rate servo or a motor, whatever element of MJCF it was written as.
"""

import math
from collections.abc import Sequence
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.followers import Follower
from rmrc.arm.others import Others
from rmrc.arm.wiring import Wiring
from rmrc.support.legible import listed

Array = NDArray[np.float64]
Ends: TypeAlias = tuple[float, float]

# MuJoCo's arrays hold plain integers, which its enums do not equal.
_FIXED, _NO_BIAS, _AFFINE = (
    int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
)  # fmt: skip
_STATELESS, _INTEGRATOR = int(mujoco.mjtDyn.mjDYN_NONE), int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
# With moments scaled to a largest one of 1, less than this is rounding.
_RANK = 1e-9


class DriveKind(IntEnum):
    """The command that an actuator takes."""

    POSITION = 0  # the target position
    INTEGRATED = 1  # the rate of the target position
    RATE = 2  # the rate
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


class Servo(NamedTuple):
    """A servo of one joint, in constant proportion: its control is slope · (position or rate) + offset.

    Attributes:
        command: Kind of its command.
        joint: The joint, by its place in the arm.
        slope: Control for each unit of the joint's position or rate.
        offset: Control at 0.
        position: Least and largest position that it takes as a command [rad or m].
        rate: Least and largest rate [rad/s or m/s].
    """

    command: DriveKind
    joint: int
    slope: float
    offset: float
    position: Ends
    rate: Ends


_EVERYWHERE = -math.inf, math.inf


class OwnDrives:
    """The author's actuators that act on an arm's joints and on no others.

    A motor moves joints without a servo. Beside a servo it keeps its control, and so do actuators of other
    kinds.

    Attributes:
        kinds: Kind of the command of each actuator, by its id.
        idle: Ids of actuators that act on the arm's joints and get no commands.
    """

    def __init__(
        self, model: mujoco.MjModel, others: Others, wiring: Wiring, followers: Sequence[Follower]
    ) -> None:
        """Examine the actuators of a model.

        Args:
            model: The author's model.
            others: Its parts that are not the arm.
            wiring: Wiring of the arm.
            followers: Joints that follow those of the arm.
        """
        self._model, self._others, self._wiring, self._followers = model, others, wiring, followers
        kinds = {i: kind for i in sorted(others.replaced) if (kind := kind_of(model, i)) is not None}
        served = {joint for i, kind in kinds.items() if kind < DriveKind.MOTOR for joint in others.pulled(i)}
        self.kinds = {
            i: kind
            for i, kind in kinds.items()
            if kind < DriveKind.MOTOR or served.isdisjoint(others.pulled(i))
        }
        self.idle = tuple(i for i in sorted(others.replaced) if i not in self.kinds)

    @cached_property
    def joint_of(self) -> tuple[NDArray[np.int64], Array]:
        """Joint of the arm for each degree of freedom, or -1, and its speed at unit rate of that, (nv,)."""
        joint, ratio = np.full(self._model.nv, -1), np.zeros(self._model.nv)
        joint[self._wiring.dof], ratio[self._wiring.dof] = np.arange(len(self._wiring.dof)), 1.0
        for address, one in zip(self._wiring.follower_dof, self._followers, strict=True):
            joint[address], ratio[address] = one.leader, one.ratio
        return joint, ratio

    def moments(self, data: mujoco.MjData) -> Array:
        """Return the rate of length of each actuator at unit rate of each joint, (d, n)."""
        joint, ratio = self.joint_of
        moments = np.zeros((len(self.kinds), len(self._wiring.dof)))
        for row, i in zip(moments, self.kinds, strict=True):
            k = int(self._model.actuator_outadr[i])
            first, count = int(data.moment_rowadr[k]), int(data.moment_rownnz[k])
            for e in range(first, first + count):
                dof = int(data.moment_colind[e])
                if joint[dof] >= 0:
                    row[joint[dof]] += ratio[dof] * data.actuator_moment[e]
        return moments

    def servos(self, qpos: Array) -> dict[int, Servo]:
        """Return the servos that move one joint each in constant proportion, by their ids.

        Args:
            qpos: A configuration of the model, (nq,).
        """
        model, data, servos = self._model, mujoco.MjData(self._model), dict[int, Servo]()
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(model, data)
        q = data.qpos[self._wiring.qpos]
        for row, (i, command) in zip(self.moments(data), self.kinds.items(), strict=True):
            driven = np.flatnonzero(np.abs(row) > _RANK * np.abs(row).max())
            if command == DriveKind.MOTOR or len(driven) != 1 or not self._others.is_linear(i):
                continue
            j, terms = int(driven[0]), terms_of(model, i, command)
            slope, length = float(terms.scale * row[j]), float(data.actuator_length[model.actuator_outadr[i]])
            start = terms.offset + terms.scale * length - slope * q[j]  # control or activation at q = 0
            state = _ends(terms.state, slope, start)
            if command == DriveKind.POSITION:
                position = _ends(terms.control, slope, start)
                position = max(position[0], state[0]), min(position[1], state[1])
                servos[i] = Servo(command, j, slope, start, position, _EVERYWHERE)
            else:
                offset = terms.offset if command == DriveKind.RATE else 0.0
                servos[i] = Servo(command, j, slope, offset, state, _ends(terms.control, slope, offset))
        return servos

    def undriven(self, qpos: Array) -> list[int]:
        """Return the joints of the arm that the actuators cannot move one by one, by their indices.

        Args:
            qpos: A configuration of the model, (nq,).
        """
        data = mujoco.MjData(self._model)
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(self._model, data)
        moments = self.moments(data)
        size = np.abs(moments).max(axis=1, initial=0.0)
        moments = moments[size > mujoco.mjMINVAL] / size[size > mujoco.mjMINVAL, None]
        _, sigma, right = np.linalg.svd(moments, full_matrices=True)
        free = right[int((sigma > _RANK).sum()) :]
        return [j for j in range(moments.shape[1]) if np.abs(free[:, j]).max(initial=0.0) > _RANK]

    def forget(self, ctrl: Array, act: Array, has_ctrl: bool, has_act: bool) -> None:
        """Write NaN for controls and activations that no keyframe sets, or 0 if the actuator is idle.

        Args:
            ctrl: Controls of the model, (nu,).
            act: Its activations, (na,).
            has_ctrl: Whether the controls are a keyframe's.
            has_act: Whether the activations are.
        """
        model = self._model
        for i in (*self.kinds, *self.idle):
            unknown = np.nan if i in self.kinds else 0.0
            if not has_ctrl:
                first = int(model.actuator_ctrladr[i])
                ctrl[first : first + int(model.actuator_ctrlnum[i])] = unknown
            if not has_act:
                first = max(0, int(model.actuator_actadr[i]))
                act[first : first + int(model.actuator_actnum[i])] = unknown

    def named(self, actuators: Sequence[int]) -> str:
        """Return the names of actuators, or their numbers, as a list."""
        return listed(self._model.actuator(i).name or f"actuator{i}" for i in actuators)


def kind_of(model: mujoco.MjModel, i: int) -> DriveKind | None:
    """Return the command kind of an actuator; None for a muscle or another one that is no servo or motor."""
    gain, bias, dynamics = (
        int(kinds[i]) for kinds in (model.actuator_gaintype, model.actuator_biastype, model.actuator_dyntype)
    )
    if (
        gain != _FIXED
        or bias not in (_NO_BIAS, _AFFINE)
        or dynamics not in (_STATELESS, _INTEGRATOR, *_FILTERS)
        or abs(model.actuator_gainprm[i, 0]) <= mujoco.mjMINVAL
        or model.actuator_ctrlnum[i] != 1
        or model.actuator_plugin[i] >= 0
        or model.opt.disableactuator >> int(model.actuator_group[i]) & 1
    ):
        return None
    stiffness, damping = -model.actuator_biasprm[i, 1:3] if bias == _AFFINE else (0.0, 0.0)
    if stiffness > 0.0:
        return DriveKind.INTEGRATED if dynamics == _INTEGRATOR else DriveKind.POSITION
    if stiffness < 0.0 or damping < 0.0 or dynamics == _INTEGRATOR:
        return None
    return DriveKind.RATE if damping > 0.0 else DriveKind.MOTOR


def terms_of(model: mujoco.MjModel, i: int, command: DriveKind) -> Terms:
    """Return the control that an actuator with a kind of command takes."""
    gain, bias = float(model.actuator_gainprm[i, 0]), [float(b) for b in model.actuator_biasprm[i, :3]]
    b0, b1, b2 = bias if model.actuator_biastype[i] != _NO_BIAS else (0.0, 0.0, 0.0)
    scale = 1.0 if command == DriveKind.MOTOR else -b2 if command == DriveKind.RATE else -b1
    clamps = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
    control, state = (
        (float(ends[0]), float(ends[1])) if is_limited else _EVERYWHERE
        for is_limited, ends in (
            (model.actuator_ctrllimited[i] and clamps, model.actuator_ctrlrange[i]),
            (model.actuator_actlimited[i], model.actuator_actrange[i]),
        )
    )
    return Terms(scale / gain, -b0 / gain, -b1, control, state)


def _ends(ends: Ends, slope: float, offset: float) -> Ends:
    """Return least and largest value whose control, slope · value + offset, is between two ends."""
    first, last = sorted((end - offset) / slope for end in ends)
    return first, last
