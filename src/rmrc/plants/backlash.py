"""Play between a drive and its joint: who turns back moves nothing until the play is crossed.

The joint is where one side of the drive holds it, and stays where it is between the two: a play without mass,
spring or impact. The drive is not what MuJoCo moves, so that both share one joint.
"""

from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Record, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.plants.stage import Stage
from rmrc.scenario.choices import PLANTS


@compiled
def cross_play(world: Record, out: Record, past: Record, t: int) -> None:  # noqa: ARG001 - as all
    """Take from each rate what the drive needs to reach the side of the play towards which it goes."""
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
    """Drives have play."""

    slot, uses, change = "sent", "has_play", staticmethod(cross_play)
    fields = (Field("has_play", np.int64), Field("half_play", size=(JOINTS,)))
    # where the drive is in it, from the middle on
    memory = (Field("in_play", size=(JOINTS,)),)

    @property
    def is_used(self) -> bool:
        """Whether any joint has play."""
        return bool(np.any(self.scenario.plant.backlash))

    def write(self, world: np.void) -> None:
        """Write half of the play of each joint."""
        world["has_play"] = self.is_used
        world["half_play"][: self.arm.n] = np.multiply(0.5, self.scenario.plant.backlash)

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield a plant without drives."""
        if self.is_used and not PLANTS[self.scenario.plant.kind].physics:
            yield (
                "plant.backlash",
                f'"{self.scenario.plant.kind}" has no drives that could have play; take one of '
                f"{PLANTS.physical}",
            )
