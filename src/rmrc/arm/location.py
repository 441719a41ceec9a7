"""An arm in a model that is not its own: a scene with other joints, or the arm mounted elsewhere."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.limits import Forces, forces
from rmrc.arm.wiring import base_of

if TYPE_CHECKING:
    from rmrc.arm.chain import Chain

Array = NDArray[np.float64]

_JOINT = mujoco.mjtObj.mjOBJ_JOINT


class Place(NamedTuple):
    """The place of a site on a body.

    Attributes:
        site: Id of the site; -1 where the model lacks it.
        body: Id of its body.
        position: Position on the body, (3,) [m].
        quat: Orientation on the body, (4,).
    """

    site: int
    body: int
    position: Array
    quat: Array


class Location(NamedTuple):
    """An arm in a model.

    Attributes:
        joint: Ids of its joints, n of them.
        axis: Ids of the joints on the axes of its chain, ℓ of them.
        base: Id of its base.
        places: Places of its sites.
        forces: What its actuators there can give.
    """

    joint: list[int]
    axis: list[int]
    base: int
    places: tuple[Place, ...]
    forces: Forces

    def pose(self, data: mujoco.MjData) -> Array:
        """Return the pose of the first site, (7,), by the kinematics of MuJoCo's data."""
        place, pose = self.places[0], np.empty(7)
        frame = data.xpos[place.body], data.xquat[place.body]
        mujoco.mju_mulPose(pose[:3], pose[3:], *frame, place.position, place.quat)
        return pose

    def base_pose(self, data: mujoco.MjData) -> Array:
        """Return the pose of the base, (7,)."""
        return np.concatenate([data.xpos[self.base], data.xquat[self.base]])

    def jacobian(self, data: mujoco.MjData, chain: "Chain") -> Array:
        """Return J (6, n) of the first site from the axes of the chain in MuJoCo's data."""
        slides = np.isinf(chain.pitch)[:, None]
        axis, way = data.xaxis[self.axis], np.where(slides[:, 0], 1.0, chain.pitch)[:, None]
        turning = np.cross(axis, self.pose(data)[:3] - data.xanchor[self.axis])
        columns = np.hstack([np.where(slides, 0.0, turning) + way * axis, np.where(slides, 0.0, axis)])
        J = np.zeros((len(self.joint), 6))
        np.add.at(J, chain.leader, chain.ratio[:, None] * columns)
        return J.T


def locate(
    model: mujoco.MjModel,
    joints: Sequence[str],
    axes: Sequence[str],
    home: mujoco.MjModel,
    sites: Sequence[str],
) -> Location:
    """Resolve the names of an arm in a model; a site that it lacks is on the body of its name there.

    Args:
        model: The model.
        joints: Names of the arm's joints.
        axes: Names of the joints on the axes of its chain.
        home: The arm's own model.
        sites: Names of sites of the arm.

    Raises:
        KeyError: The model lacks a joint, or the body of a site.
    """
    for name in (*joints, *axes):
        if model.joint(name).type[0] != home.joint(name).type[0]:
            raise KeyError(f'its joint "{name}" is of another type')
    joint = [model.joint(name).id for name in joints]
    known = {model.site(i).name for i in range(model.nsite)}
    places = []
    for name in sites:
        site = (model if name in known else home).site(name)
        body = int((model if name in known else home).site_bodyid[site.id])
        if name not in known:
            body = model.body(home.body(body).name).id
        places.append(Place(site.id if name in known else -1, body, site.pos, site.quat))
    axis = [model.joint(name).id for name in axes]
    return Location(joint, axis, base_of(model, joint[0]), tuple(places), forces(model, joint))


def moved(data: mujoco.MjData) -> mujoco.MjData:
    """Return other data of the same model with the same positions, whose kinematics belong to them."""
    fresh = mujoco.MjData(data.model)
    fresh.qpos[:], fresh.mocap_pos[:], fresh.mocap_quat[:] = data.qpos, data.mocap_pos, data.mocap_quat
    mujoco.mj_fwdKinematics(data.model, fresh)
    return fresh


def copy_joint(data: mujoco.MjData, home: mujoco.MjModel, joint: int, qpos: Array) -> None:
    """Copy the position of the joint with the same name in MuJoCo's data, if there is one.

    Args:
        data: The data, of any model.
        home: The model of the configuration.
        joint: Id of its joint.
        qpos: A configuration of that model, (nq,), changed.
    """
    model, name = data.model, home.joint(joint).name
    there = joint if model is home else mujoco.mj_name2id(model, _JOINT, name) if name else -1
    if there >= 0 and model.jnt_type[there] == home.jnt_type[joint]:
        count = len(home.joint(joint).qpos0)
        to, start = int(home.jnt_qposadr[joint]), int(model.jnt_qposadr[there])
        qpos[to : to + count] = data.qpos[start : start + count]
