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
    """Tell the servos the rates, and what damping and friction take at these, as a rate of as much torque."""
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
    """Servos that are told the rates."""

    name, drives = "servo", ("rate servos", "velocity")
    obey = staticmethod(tell_servos)
    fields = (*Physical.fields, Field("kv", size=(JOINTS,)))

    @property
    def compensates(self) -> bool:
        """Whether they are told what damping and dry friction of the joints take besides."""
        return self.section.friction_compensation

    @property
    def kv(self) -> Array:
        """Gains, (n,) [N·m·s/rad or N·s/m].

        Without a number of the scenario's it is inertia over timestep, with what a step of MuJoCo's takes
        damping for: a rate error is then gone after one step. Less tracks worse, and much more makes servos
        chatter when they reach their torque limits.
        """
        kv, arm = self.section.kv, self.arm
        return arm.inertia / self.timestep + arm.damping if kv is None else np.full(arm.n, kv)

    @classmethod
    def drive(cls, plants: Sequence[Self]) -> RateServos:
        """Return servos with the gains of all worlds if they have the same, and else ones.

        So the model need not be compiled anew for other worlds whose gains differ.
        """
        gains = np.array([plant.kv for plant in plants])
        alike = (gains == gains[0]).all()
        return RateServos(tuple(gains[0].tolist()) if alike else (1.0,) * gains.shape[1])

    def write(self, world: np.void) -> None:
        """Write the wrench and the gains."""
        super().write(world)
        world["kv"][: self.arm.n] = self.kv

    def known(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return what is different, the gains of this world's servos among it."""
        gain, bias = np.array(model.actuator_gainprm), np.array(model.actuator_biasprm)
        gain[wiring.actuator, 0], bias[wiring.actuator, 2] = self.kv, -self.kv
        return super().known(model, wiring) | {"actuator_gainprm": gain, "actuator_biasprm": bias}
