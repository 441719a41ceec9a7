"""`control.state: integrated`: the law believes its own commands, and never looks again."""

from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Record, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.plants.stage import Stage, refuse_unseen


@compiled
def integrate_commands(world: Record, out: Record) -> None:  # noqa: ARG001 - as all stages
    """Have the law take q⁺ = q + period · qdot_cmd, from where the encoders said that it started."""
    for j in range(world.n):
        if world.has_begun:
            world.q_integral[j] += world.period * world.qdot_cmd_last[j]
        else:
            world.q_integral[j] = world.q[j]
        world.q[j] = world.q_integral[j]
    world.has_begun = 1


class Integral(Stage):
    """The integral of what was commanded, in place of what the encoders say; rates stay the measured ones."""

    slot, uses, change = "sensed", "integrates", staticmethod(integrate_commands)
    fields = (Field("integrates", np.int64),)
    memory = (Field("has_begun", np.int64), Field("q_integral", size=(JOINTS,)))

    @property
    def is_used(self) -> bool:
        """Whether the law takes the integral."""
        return bool(self.scenario.control.state == "integrated")

    def write(self, world: np.void) -> None:
        """Write whether it is used."""
        world["integrates"] = self.is_used

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield what needs an arm that is seen as it is."""
        if self.is_used:
            yield from refuse_unseen(self, "control.state")
