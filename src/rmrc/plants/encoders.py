"""Encoders: what the law is told of the joints, where they are off."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from rmrc.law.jit import Array, Record, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.plants.stage import Stage

# No joint of an arm is so far off [rad, m]; lengths of models are bounded alike.
_MOST_OFF = 1e6


@compiled
def add_offset(world: Record, out: Record, past: Record, t: int) -> None:  # noqa: ARG001 - as all
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

    @property
    def is_used(self) -> bool:
        """Whether any is off."""
        return bool(self.offset.any())

    def write(self, world: np.void) -> None:
        """Write the offset, and whether there is any."""
        world["is_off"], world["encoder_offset"][: self.arm.n] = self.is_used, self.offset

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
