"""The servo plant: a rate servo on each joint, in MuJoCo's physics."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import mujoco
import numpy as np

from rmrc.arm import Wiring
from rmrc.law.jit import Array, Record, compiled
from rmrc.plants.physics import Physical, push


@compiled
def tell_servos(world: Record, out: Record, state: Array) -> None:
    """Tell the servos the rates."""
    push(world, out, state)
    for j in range(world.n):
        state[world.ctrl_column[j]] = world.qdot_sent[j]


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

    name = "servo"
    obey = staticmethod(tell_servos)

    @property
    def kv(self) -> Array:
        """Gains, (n,) [N·m·s/rad or N·s/m].

        Without a number of the scenario's it is inertia over timestep: a rate error is then gone after one
        step. Less tracks worse, and much more makes servos chatter when they reach their torque limits.
        """
        kv = self.section.kv
        return self.arm.inertia / self.timestep if kv is None else np.full(self.arm.n, kv)

    @classmethod
    def drive(cls, plants: Sequence[Self]) -> RateServos:
        """Return servos with the gains of all worlds if they have the same, and else ones.

        So the model need not be compiled anew for other worlds whose gains differ.
        """
        gains = np.array([plant.kv for plant in plants])
        alike = (gains == gains[0]).all()
        return RateServos(tuple(gains[0].tolist()) if alike else (1.0,) * gains.shape[1])

    def known(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return what is different, the gains of this world's servos among it."""
        gain, bias = np.array(model.actuator_gainprm), np.array(model.actuator_biasprm)
        gain[wiring.actuator, 0], bias[wiring.actuator, 2] = self.kv, -self.kv
        return super().known(model, wiring) | {"actuator_gainprm": gain, "actuator_biasprm": bias}
