"""Why the drives do not give what statics says: what else bears a part of a wrench, and the way out."""

from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.statics.hold import LAST, HoldResult
from rmrc.arm import Arm
from rmrc.arm.inventory import contacts
from rmrc.arm.wiring import flex_bodies, flex_name, joints_above
from rmrc.show.sheets import number

Array = NDArray[np.float64]

# A joint or tendon is at the end of its range this near to it [rad or m]: MuJoCo's limits give a little.
NEAR = 1e-3
# A joint beside the arm that is faster moves [rad/s or m/s]; slower it creeps below its friction.
MOVES = 1e-6


def borne(held: HoldResult) -> str:
    """Say what else bears a part of the wrench, and the way out; "" where nothing is found."""
    arm, qpos = held.wanted.arm, held.run["qpos"][-1]
    found = [*_ends(arm, qpos), *(f"{a} touches {b}" for a, b in _touching(held)[:1]), *_tendons(arm, qpos)]
    said = []
    if found:
        said.append(f"{' and '.join(found)}, which bears a part: give other positions by --q or --keyframe")
    if pulls := list(_pulls(arm, qpos)):
        said.append(f"{' and '.join(pulls)}, which statics leaves out: take it out of a copy of the model")
    if not said and (moves := _moves(held)):
        said.append(f"{moves} still moves beside the arm: hold it for longer")
    return "".join(f"; {one}" for one in said)


def _touching(held: HoldResult) -> list[tuple[str, str]]:
    """Return the bodies that touch where it ended, two each, which the arm moves against each other."""
    return [one.bodies for one in contacts(held.wanted.arm, held.run["qpos"][-1:]) if one.is_moved]


def _ends(arm: Arm, qpos: Array) -> Iterator[str]:
    """Yield which of the arm's joints are at the end of their ranges."""
    q, near = qpos[arm.wiring.qpos], NEAR + arm.model.jnt_margin[arm.wiring.joint]
    lower, upper = arm.position_limit.T
    at_end = (q < lower + near) | (q > upper - near)
    if names := [name for name, is_there in zip(arm.joints, at_end, strict=True) if is_there]:
        yield f"{', '.join(names)} {'are' if len(names) > 1 else 'is'} at the end of the range"


def _tendons(arm: Arm, qpos: Array) -> Iterator[str]:
    """Yield the tendons that the arm moves and that are at the end of their range."""
    model, own = arm.model, frozenset([*arm.wiring.joint, *arm.wiring.follower_joint])
    length = _data(arm, qpos).ten_length
    for i in range(model.ntendon):
        (lower, upper), near = model.tendon_range[i], NEAR + model.tendon_margin[i]
        is_at_end = model.tendon_limited[i] and not lower + near <= length[i] <= upper - near
        if is_at_end and not own.isdisjoint(arm.others.along(i)):
            yield f'tendon "{model.tendon(i).name or i}" is at the end of its range'


def _pulls(arm: Arm, qpos: Array) -> Iterator[str]:
    """Yield the actuators that pull at the arm and at something else, and what hangs at it and is soft."""
    model, own = arm.model, frozenset([*arm.wiring.joint, *arm.wiring.follower_joint])
    data = _data(arm, qpos)
    data.ctrl[:], data.act[:] = arm.others.controls(qpos, None, None, every=True)
    mujoco.mj_fwdActuation(model, data)
    for i in arm.others.kept:
        if data.actuator_force[model.actuator_outadr[i]] and not own.isdisjoint(arm.others.pulled(i)):
            yield f'actuator "{model.actuator(i).name or i}" pulls at the arm'
    for i in range(model.nflex):
        if any(not own.isdisjoint(joints_above(model, body)) for body in flex_bodies(model, i)):
            yield f'flex "{flex_name(model, i)}" hangs at the arm'


def _moves(held: HoldResult) -> str:
    """Return the joint beside the arm that moved most in the last tenth of a second, and how fast."""
    model, others = held.wanted.arm.model, held.wanted.arm.others.addresses
    last = held.run["qpos"][-round(LAST / held.run.period) :, others]
    rates = np.ptp(last, axis=0) / LAST
    if not len(rates) or rates.max() < MOVES:
        return ""
    joint = int(np.flatnonzero(model.jnt_qposadr <= others[np.argmax(rates)])[-1])
    return f'joint "{model.joint(joint).name or joint}" ({number(rates.max())} rad/s or m/s)'


def _data(arm: Arm, qpos: Array) -> mujoco.MjData:
    """Return the state of the author's model at rest at a configuration, (nq,)."""
    data = mujoco.MjData(arm.model)
    data.qpos[:] = qpos
    arm.place_mocap(data)
    mujoco.mj_fwdPosition(arm.model, data)
    mujoco.mj_fwdVelocity(arm.model, data)
    return data
