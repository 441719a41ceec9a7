"""The servo plant: a rate servo on each joint, in MuJoCo's physics."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Wiring
from rmrc.law.compiling import Array, Method, Record
from rmrc.law.measurement import read_at_joints
from rmrc.plants.engine import ctrl_of
from rmrc.plants.physics import Physical, damping_at, friction_at, push


@Method
def tell_servos(world: Record) -> None:
    """Command the rates to the servos, plus the torque of resistance and springs, as a rate."""
    plant, engine, ctrl = world.plant, world.engine, ctrl_of(world)
    push(world)
    if plant.carries_springs:
        read_at_joints(world, engine.qfrc_spring, plant.torque)
    for j in range(world.n):
        rate = plant.qdot_sent[j]
        ctrl[engine.ctrl_at[j]] = rate
        if plant.resists[j]:
            resistance = damping_at(world, j, rate) + friction_at(world, j, 0.0, rate)
            ctrl[engine.ctrl_at[j]] += resistance / plant.kv[j]
        if plant.carries_springs:
            ctrl[engine.ctrl_at[j]] -= plant.torque[j] / plant.kv[j]


def rate_servo(actuator: mujoco.MjsActuator) -> None:
    """Make an actuator a rate servo: torque = gain · (commanded rate − rate), with a gain of each world."""
    actuator.set_to_velocity(kv=1.0)


class Servo(Physical):
    """Servos that take rates."""

    name, drives = "servo", ("rate servos", "velocity")
    obey, drive = tell_servos, staticmethod(rate_servo)

    @property
    def carries_springs(self) -> NDArray[np.bool_]:
        """All joints, or none: a spring is a load at rest, as the weight."""
        return np.full(self.arm.n, self.section.is_compensated)

    @property
    def kv(self) -> Array:
        """Gains, (n,) [N·m·s/rad or N·s/m].

        If the scenario gives no number, a gain is inertia over timestep plus the joint's damping, which
        MuJoCo's step takes implicitly: a rate error then vanishes after one step. Lower gains track worse;
        much higher ones make servos chatter at their torque limits.
        """
        kv, arm = self.section.kv, self.arm
        damping = arm.model.dof_damping @ arm.motion**2
        return arm.inertia / self.timestep + damping if kv is None else np.full(arm.n, kv)

    def write(self, world: np.void) -> None:
        """Write the wrench and the gains."""
        super().write(world)
        world["plant"]["carries_springs"] = self.section.is_compensated
        world["plant"]["kv"][: self.arm.n] = self.kv

    def known(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return the known differences, including the gains of this world's servos."""
        gain, bias = np.array(model.actuator_gainprm), np.array(model.actuator_biasprm)
        gain[wiring.actuator, 0], bias[wiring.actuator, 2] = self.kv, -self.kv
        return super().known(model, wiring) | {"actuator_gainprm": gain, "actuator_biasprm": bias}
