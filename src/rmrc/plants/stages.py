"""What stands between plant and law: stages, in order, each used by the worlds that have it.

A stage of the slot `sensed` changes what the law is told of the joints, `world.q` and `world.qdot`: the law
then takes the arm to be there. One of the slot `sent` changes what the plant is told, `world.qdot_sent`. The
truth is recorded, and what the law commanded. The site of a second task is where MuJoCo has it, so that a
stage which changes q must refuse one. A stage is a class here, and a compiled function.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from rmrc.arm import Arm
from rmrc.law.jit import Array, Record, chain, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.scenario import Scenario

# No joint of an arm is so far off [rad, m]; lengths of models are bounded alike.
_MOST_OFF = 1e6


class Stage(ABC):
    """A stage of one world.

    Attributes:
        slot: Whether it changes what is sensed, before the law, or what is sent, after it.
        uses: The field of a record that says whether its world has it.
        change: Compiled, (world, out): does what it does.
        fields: Of the record of a world, those that `write` writes; `uses` is one of them.
        memory: Those that `change` keeps for itself, 0 at first.
    """

    slot: ClassVar[Literal["sensed", "sent"]]
    uses: ClassVar[str]
    change: ClassVar[Callable[..., None]]
    fields: ClassVar[tuple[Field, ...]]
    memory: ClassVar[tuple[Field, ...]] = ()

    def __init__(self, scenario: Scenario, arm: Arm) -> None:
        """Bind it to a world.

        Args:
            scenario: Of the world.
            arm: That it names.
        """
        self.scenario, self.arm = scenario, arm

    @abstractmethod
    def write(self, world: np.void) -> None:
        """Write its parameters into the record of its world."""

    @abstractmethod
    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield key and message of what it cannot do in this scenario."""


@compiled
def add_offset(world: Record, out: Record) -> None:
    """Have the law take the joints to be at q + offset."""
    for j in range(world.n):
        world.q[j] = out.q[j] + world.encoder_offset[j]


class Encoders(Stage):
    """Encoders that are off: the law works with q + offset, where the arm is at q."""

    slot, uses, change = "sensed", "is_off", staticmethod(add_offset)
    fields = (Field("is_off", np.int64), Field("encoder_offset", size=(JOINTS,)))

    @cached_property
    def offset(self) -> Array:
        """What the encoders say too much, (n,): offset + deviation · z.

        z is `numpy.random.default_rng(seed).standard_normal(n)`, one number a joint.
        """
        encoder, n = self.scenario.arm.encoder, self.arm.n
        offset = np.full(n, encoder.offset)
        if not np.any(encoder.deviation):
            return offset
        return offset + encoder.deviation * np.random.default_rng(encoder.seed).standard_normal(n)

    def write(self, world: np.void) -> None:
        """Write the offset, and whether there is any."""
        world["is_off"], world["encoder_offset"][: self.arm.n] = self.offset.any(), self.offset

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield offsets beyond reason, and what needs encoders that are right."""
        encoder, arm = self.scenario.arm.encoder, self.arm
        for name, values in (("offset", encoder.offset), ("deviation", encoder.deviation)):
            most = float(np.max(np.abs(values)))
            if most > _MOST_OFF:
                yield f"arm.encoder.{name}", f"must be within ±{_MOST_OFF:g} rad or m, got {most:g}"
        if not (np.any(encoder.offset) or np.any(encoder.deviation)):
            return
        if self.scenario.control.nullspace.objective == "secondary":
            yield (
                "arm.encoder",
                'the objective "secondary" knows its site only where the encoders are right; '
                "take another control.nullspace.objective, or leave arm.encoder out",
            )
        if arm.idle:
            yield (
                "arm.encoder",
                f'joint "{arm.idle[0]}" of {arm.path} moves the site and is not driven, so that q + offset '
                "does not say where the site is; drive it, or leave arm.encoder out",
            )


# In the order in which they are passed.
STAGES: tuple[type[Stage], ...] = (Encoders,)


def _chain(slot: str) -> Callable[..., bool]:
    used = {f"world.{stage.uses}": stage.change for stage in STAGES if stage.slot == slot}
    return chain(slot, "world, out", used)


sensed, sent = _chain("sensed"), _chain("sent")
