"""`control.state: integrated`: the law integrates its own commands and never reads the encoders again."""

from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Record, inlined
from rmrc.law.record import Field
from rmrc.plants.stage import Stage, refuse_unseen


@inlined
def integrate_commands(world: Record, out: Record, past: Record, t: int) -> None:  # noqa: ARG001 - as all
    """Have the law use q⁺ = q + period · qdot_cmd, from the encoders' reading at the start."""
    if t > 0:
        last = past[(t - 1) % past.shape[0]]
        for j in range(world.n):
            world.q[j] = last.q_believed[j] + world.period * last.qdot_cmd[j]


class Integral(Stage):
    """The integral of the commands, in place of the encoders' readings; rates stay the measured ones."""

    slot, uses, change = "sensed", "integrates", staticmethod(integrate_commands)
    fields = (Field("integrates", np.int64),)

    @property
    def is_used(self) -> bool:
        """Whether the law uses the integral."""
        return bool(self.scenario.control.state == "integrated")

    @property
    def span(self) -> int:
        """Number of past ticks that it reads: those of its last estimate and command."""
        return int(self.is_used)

    def write(self, world: np.void) -> None:
        """Write whether it is used."""
        world["integrates"] = self.is_used

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield features that need an arm that is sensed as it is."""
        if self.is_used:
            yield from refuse_unseen(self, "control.state")
