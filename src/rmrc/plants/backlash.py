"""Backlash between an actuator and its joint: an actuator that reverses crosses it before it moves the joint.

The joint follows whichever side of the gap the actuator pushes, and stays in place between the two. The model
has no mass, spring or impact. MuJoCo does not move the actuator's side, so both share one joint.
"""

from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Record, inlined
from rmrc.law.record import JOINTS, Field
from rmrc.plants.stage import Stage
from rmrc.scenario.choices import PLANTS


@inlined
def cross_play(world: Record, out: Record, past: Record, t: int) -> None:  # noqa: ARG001 - as all
    """Remove from each rate the part that the actuator needs to cross the gap in its direction."""
    for j in range(world.n):
        rate, half = world.qdot_sent[j], world.half_play[j]
        side = 1.0 if rate > 0.0 else -1.0
        free = half - side * world.in_play[j]
        if abs(rate) * world.period < free:
            world.in_play[j] += rate * world.period
            world.qdot_sent[j] = 0.0
        else:
            world.in_play[j] = side * half
            world.qdot_sent[j] = rate - side * (free / world.period)


class Backlash(Stage):
    """Backlash of the actuators."""

    slot, uses, change = "sent", "has_play", staticmethod(cross_play)
    fields = (Field("has_play", np.int64), Field("half_play", size=(JOINTS,)))
    # the position of the actuator in it, from the middle on
    memory = (Field("in_play", size=(JOINTS,)),)

    @property
    def is_used(self) -> bool:
        """Whether any joint has backlash."""
        return bool(np.any(self.scenario.plant.backlash))

    def write(self, world: np.void) -> None:
        """Write half of each joint's backlash."""
        world["has_play"] = self.is_used
        world["half_play"][: self.arm.n] = np.multiply(0.5, self.scenario.plant.backlash)

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield a misfit for a plant without actuators."""
        if self.is_used and not PLANTS[self.scenario.plant.kind].physics:
            yield (
                "plant.backlash",
                f'"{self.scenario.plant.kind}" has no actuators that could have backlash; choose from '
                f"{PLANTS.physical}",
            )
