"""An arm in a model that is not its own: a scene with other joints, or the arm mounted elsewhere.

Its kinematics are those of MuJoCo's data. These can be behind their positions: then MuJoCo computes them
again, in other data.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.actuators import forces
from rmrc.arm.equalities import Follower, motion
from rmrc.support.errors import ModelError

Array = NDArray[np.float64]

# Kinematics of the same positions differ at most by rounding [m, and parts of a quaternion].
ROUNDING = 1e-9


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
        followers: Joints on its chain that follow them.
        base: Id of its base.
        places: Places of its sites.
        forces: What its actuators there can give: see `rmrc.arm.actuators.forces`.
        motion: Rates of all joints of the model for unit rates of the arm's, (nv, n).
    """

    joint: list[int]
    axis: list[int]
    followers: list[Follower]
    base: int
    places: tuple[Place, ...]
    forces: tuple[NDArray[np.int64], Array, Array, Array]
    motion: Array

    def pose(self, data: mujoco.MjData) -> Array:
        """Return the pose of the first site, (7,), by the kinematics of MuJoCo's data."""
        place, pose = self.places[0], np.empty(7)
        frame = data.xpos[place.body], data.xquat[place.body]
        mujoco.mju_mulPose(pose[:3], pose[3:], *frame, place.position, place.quat)
        return pose

    def base_pose(self, data: mujoco.MjData) -> Array:
        """Return the pose of the base, (7,)."""
        return np.concatenate([data.xpos[self.base], data.xquat[self.base]])

    def jacobian(self, data: mujoco.MjData) -> Array:
        """Return J (6, n) of the first site."""
        J = np.zeros((6, data.model.nv))
        mujoco.mj_comPos(data.model, data)
        mujoco.mj_jac(data.model, data, J[:3], J[3:], self.pose(data)[:3], self.places[0].body)
        return np.asarray(J @ self.motion)


def locate(arm: Any, model: mujoco.MjModel, sites: Sequence[str]) -> Location:
    """Resolve the names of an arm in a model; a site that it lacks is on the body of its name there.

    Args:
        arm: The `rmrc.arm.Arm`.
        model: The model.
        sites: Names of sites of the arm.

    Raises:
        ModelError: The model lacks a joint, or the body of a site.
    """
    known = {model.site(i).name for i in range(model.nsite)}
    followers = [each for each in arm.followers if each.pitch or each.name in arm.axis_names]

    def place(name: str) -> Place:
        site = (model if name in known else arm.model).site(name)
        if name in known:
            return Place(site.id, int(site.bodyid[0]), site.pos, site.quat)
        return Place(-1, model.body(arm.model.body(site.bodyid[0]).name).id, site.pos, site.quat)

    try:
        for name in (*arm.joints, *arm.axis_names):
            if model.joint(name).type[0] != arm.model.joint(name).type[0]:
                raise KeyError(f'its joint "{name}" is of another type')
        joint, axis = ([model.joint(name).id for name in names] for names in (arm.joints, arm.axis_names))
        base, places = int(model.body_parentid[model.jnt_bodyid[joint[0]]]), tuple(map(place, sites))
        F = motion(model, arm.joints, followers)
        return Location(joint, axis, followers, base, places, forces(model, joint), F)
    except KeyError as error:
        text = " ".join(str(error).strip("'\"").split())
        raise ModelError(f"the model of the data lacks a part of {arm.path}: {text}") from None


def moved(data: mujoco.MjData, other: mujoco.MjData | None = None) -> mujoco.MjData:
    """Return other data of the same model with the same positions, and bodies where these place them.

    Args:
        data: The data.
        other: Other data, overwritten; None: new ones.
    """
    other = mujoco.MjData(data.model) if other is None else other
    other.qpos[:], other.mocap_pos[:], other.mocap_quat[:] = data.qpos, data.mocap_pos, data.mocap_quat
    mujoco.mj_kinematics(data.model, other)
    return other


class Freshness:
    """Checks whether the poses of some bodies in the data are those of the data's positions."""

    def __init__(self, data: mujoco.MjData, bodies: Sequence[int], scratch: mujoco.MjData | None) -> None:
        """Bind it to data.

        Args:
            data: The data to check.
            bodies: The bodies whose poses are compared.
            scratch: Other data of the same model, which are overwritten; None: new ones.
        """
        self.scratch = mujoco.MjData(data.model) if scratch is None else scratch
        self._data, self._bodies = data, np.unique(np.asarray(bodies, np.int64))

    def __call__(self) -> bool:
        """Return whether the poses are those of the present positions; True if these are not finite."""
        data, other, bodies = self._data, moved(self._data, self.scratch), self._bodies
        gaps = other.xpos[bodies] - data.xpos[bodies], other.xquat[bodies] - data.xquat[bodies]
        with np.errstate(invalid="ignore"):
            return not any((np.abs(gap) > ROUNDING).any() for gap in gaps)
