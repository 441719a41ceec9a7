"""The model as a plant needs it: the author's, with actuators on the arm's joints and other joints locked."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.actuators import reset
from rmrc.arm.compiling import compiled, in_our_words
from rmrc.arm.differences import PAYLOAD
from rmrc.arm.others import Others
from rmrc.arm.wiring import soft_bodies

Array = NDArray[np.float64]

# Makes an actuator the one of a joint.
Drive: TypeAlias = Callable[[mujoco.MjsActuator], None]
# The author's own actuators.
Own: TypeAlias = Literal["own"]

# Number of the last compiled plant models that an arm keeps: few sweeps use more in turn.
_MOST = 8

# MuJoCo's own softness of an equality: solref and solimp where its author wrote none.
UNSAID = (0.02, 1.0, 0.9, 0.95, 0.001, 0.5, 2.0)
# The time constant of a stiff one [timestep], of which the integrator `discrete` bears any: with this one, a
# gap is gone after a step. And its impedance, the largest that MuJoCo takes.
_STEPS, _IMPEDANCE = 0.1, 0.9999


@dataclass(frozen=True, eq=False)
class Adaptations:
    """Models for plants, each compiled once for equal requests: see `Arm.adapted`.

    Attributes:
        path: Path of the author's file.
        model: The author's model.
        spec: The same, without textures; it is copied.
        others: The parts that are not the arm.
        joints: Names of the arm's joints.
        followers: Names of the joints that follow them.
        torque_limit: (n,) [N·m or N]; infinite where the model has none.
        site: Name of the controlled site.
        known: The compiled models, by their requests.
    """

    path: Path
    model: mujoco.MjModel
    spec: mujoco.MjSpec
    others: Others
    joints: tuple[str, ...]
    followers: frozenset[str]
    torque_limit: Array
    site: str
    known: dict[object, mujoco.MjModel]

    @property
    def root(self) -> int:
        """Id of the first body that the arm moves."""
        return int(self.model.jnt_bodyid[self.model.joint(self.joints[0]).id])

    def get(
        self,
        drive: Drive | Own | None,
        timestep: float,
        gravity_compensation: bool,
        loaded: bool,
        frees: bool,
    ) -> mujoco.MjModel:
        """Return a model.

        Args:
            drive: This and the arguments up to `loaded` are as in `Arm.adapted`.
            timestep: MuJoCo's step [s].
            gravity_compensation: Whether the weight of the arm's bodies is compensated.
            loaded: Whether a body for a payload is added.
            frees: Whether other joints that no actuator holds are free to move.
        """
        key = drive, timestep, gravity_compensation, loaded, frees
        model = self.known.get(key)
        if model is None:
            model = self._compiled(*key)
            while len(self.known) >= _MOST:
                self.known.pop(next(iter(self.known)), None)
            self.known[key] = model
        return model

    def _compiled(
        self,
        drive: Drive | Own | None,
        timestep: float,
        gravity_compensation: bool,
        loaded: bool,
        frees: bool,
    ) -> mujoco.MjModel:
        spec = self.spec.copy()
        locks = drive is not None and not frees and bool(self.others.locked)
        with in_our_words(self.path):  # a specification refuses some errors before it is compiled
            self._adapt(spec, drive, gravity_compensation, loaded)
            if locks:
                self.others.lock(spec, self.path)
        option = spec.option
        option.timestep = timestep
        if drive is not None and self.followers:
            self._hold_followers(spec, timestep, drive)
        elif drive != "own":
            option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
        if drive is None:
            option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        model = compiled(self.path, spec)
        if locks:  # MuJoCo's solver uses it to decide when to stop
            model.stat.meaninertia = self.model.stat.meaninertia
        return model

    def _adapt(
        self, spec: mujoco.MjSpec, drive: Drive | Own | None, gravity_compensation: bool, loaded: bool
    ) -> None:
        """Remove keyframes and the arm's actuators, and add the parts that a plant needs: see `adapted`."""
        for key in list(spec.keys):  # their controls no longer fit; `configuration` has their positions
            spec.delete(key)
        replaced = [actuator for actuator in spec.actuators if actuator.id in self.others.replaced]
        for actuator in (one for one in spec.actuators if one.id not in self.others.replaced):
            actuator.delay, actuator.nsample = (
                0.0,
                0,
            )  # the delay of a constant control does not matter
        if drive != "own":
            self._replace_actuators(spec, replaced, drive)
        if gravity_compensation:
            soft = soft_bodies(self.model)
            for body in spec.bodies:
                if body.id not in soft and descends(self.model, body.id, self.root):
                    body.gravcomp = 1.0
        if loaded:
            site = spec.site(self.site)
            site.parent.add_body(name=PAYLOAD, pos=site.pos, ipos=[0.0, 0.0, 0.0], explicitinertial=True)
            spec.compiler.fusestatic = False  # otherwise it would merge into the body that carries it

    def _hold_followers(self, spec: mujoco.MjSpec, timestep: float, drive: Drive | Own) -> None:
        """Have followers stay with their leaders: see `Arm.adapted`.

        Servos and dampers are taken implicitly. The other integrators add their inertia after the equalities
        are solved, which then answer forces that never come: followers slip, and the arm chatters.
        """
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        of_joints = [each for each in spec.equalities if each.type == mujoco.mjtEq.mjEQ_JOINT]
        for equality in of_joints:
            is_unsaid = (*equality.solref, *equality.solimp) == UNSAID
            if equality.name1 in self.followers and (is_unsaid or drive != "own"):
                equality.solref = [_STEPS * timestep, 1.0]
                equality.solimp[:2] = _IMPEDANCE

    def _replace_actuators(
        self, spec: mujoco.MjSpec, replaced: Sequence[mujoco.MjsActuator], drive: Drive | None
    ) -> None:
        gone = {actuator.name for actuator in replaced}
        sensors = [sensor for sensor in spec.sensors if sensor.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR]
        for element in [*(one for one in sensors if one.objname in gone), *replaced]:
            spec.delete(element)  # chosen before, as ids change with every deletion
        if drive is None:
            return
        for joint, limit in zip(self.joints, self.torque_limit, strict=True):
            actuator = spec.add_actuator(
                name=f"rate:{joint}", target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT
            )
            reset(actuator)
            drive(actuator)
            if np.isfinite(limit):
                actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
                actuator.forcerange = [-limit, limit]


def descends(model: mujoco.MjModel, body: int, root: int) -> bool:
    """Return whether a body is another one or one of its descendants."""
    while body > root:
        body = model.body_parentid[body]
    return bool(body == root)
