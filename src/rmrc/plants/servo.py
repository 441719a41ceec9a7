"""The servo plant: a rate servo on each joint, in MuJoCo's physics."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import mujoco
import numpy as np

from rmrc.arm import Wiring
from rmrc.law.jit import Array, Record, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.plants.physics import Physical, push
from rmrc.plants.resistance import damping_at, friction_at


@compiled
def tell_servos(world: Record, out: Record, state: Array) -> None:
    """Command the rates to the servos, plus the torque of damping and friction at these rates, as a rate."""
    push(world, out, state)
    for j in range(world.n):
        rate = world.qdot_sent[j]
        state[world.ctrl_column[j]] = rate
        if world.resists[j]:
            resistance = damping_at(world, j, rate) + friction_at(world, j, 0.0, rate)
            state[world.ctrl_column[j]] += resistance / world.kv[j]


@dataclass(frozen=True)
class RateServos:
    """A rate servo on each joint: torque = gain · (commanded rate − rate).

    Attributes:
        kv: Gains, (n,) [N·m·s/rad or N·s/m].
    """

    kv: tuple[float, ...]

    def __call__(self, actuator: mujoco.MjsActuator, joint: int) -> None:
        """Make an actuator the servo of a joint."""
        actuator.set_to_velocity(kv=self.kv[joint])


class Servo(Physical):
    """Servos that take rates."""

    name, drives = "servo", ("rate servos", "velocity")
    obey = staticmethod(tell_servos)
    fields = (*Physical.fields, Field("kv", size=(JOINTS,)))

    @property
    def compensates(self) -> bool:
        """Whether their commands include the damping and dry friction of the joints."""
        return self.section.friction_compensation

    @property
    def kv(self) -> Array:
        """Gains, (n,) [N·m·s/rad or N·s/m].

        If the scenario gives no number, a gain is inertia over timestep plus the joint's damping, which
        MuJoCo's step takes implicitly: a rate error then vanishes after one step. Lower gains track worse;
        much higher ones make servos chatter at their torque limits.
        """
        kv, arm = self.section.kv, self.arm
        return arm.inertia / self.timestep + arm.damping if kv is None else np.full(arm.n, kv)

    @classmethod
    def drive(cls, plants: Sequence[Self]) -> RateServos:
        """Return servos with the gains of all worlds if these are equal, or else with gains of 1.

        The model is then not compiled again for other worlds with different gains.
        """
        gains = np.array([plant.kv for plant in plants])
        alike = (gains == gains[0]).all()
        return RateServos(tuple(gains[0].tolist()) if alike else (1.0,) * gains.shape[1])

    def write(self, world: np.void) -> None:
        """Write the wrench and the gains."""
        super().write(world)
        world["kv"][: self.arm.n] = self.kv

    def known(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return the known differences, including the gains of this world's servos."""
        gain, bias = np.array(model.actuator_gainprm), np.array(model.actuator_biasprm)
        gain[wiring.actuator, 0], bias[wiring.actuator, 2] = self.kv, -self.kv
        return super().known(model, wiring) | {"actuator_gainprm": gain, "actuator_biasprm": bias}
