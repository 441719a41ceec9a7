"""The joint state that the law gets, if it differs from the true one: encoders, or the law's own integral.

A reading is delayed, offset, noisy and rounded, in this order. Encoders that only have an offset leave the
rates unchanged, because a constant has none. Otherwise there is no tachometer, and a rate is the difference
quotient of readings. With `control.state: integrated` the law integrates its own commands and never reads the
encoders again.
"""

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from rmrc.arm import Arm
from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.plants.fields import chance_of, past_of
from rmrc.scenario import Scenario

# A larger offset of a joint is an error of the input [rad, m]; the same bound is on lengths of models.
_MOST_OFF = 1e6
# Finer steps [rad, m] are lost in the rounding of positions, and their number overflows.
_FINEST = 1e-12
_SIZES = "offset", "deviation", "noise", "resolution"
# No run has this many ticks, and compiled code counts them in 64 bits.
_NEVER = 2.0**52
# Decimal fractions such as 0.3/0.1 are off by some 1e-16: a whole number of ticks is one.
_ROUNDING = 1e-9


@compiled
def delay(world: Record) -> None:
    """Replace the positions by earlier ones, interpolated between ticks and constant before the first."""
    state, t, past = world.state, world.engine.next, past_of(world)
    for j in range(world.n):
        past[t % past.shape[0], j] = state.q[j]
    when = max(t - world.plant.encoder_delay, 0.0)
    before, after = math.floor(when), math.ceil(when)
    first, last = past[before % past.shape[0]], past[after % past.shape[0]]
    for j in range(world.n):
        state.q[j] = last[j] + (after - when) * (first[j] - last[j])


@Method
def readings(world: Record) -> None:
    """Have the law take the readings of the encoders for the joint positions, or integrate its commands."""
    plant, state, t = world.plant, world.state, world.engine.next
    if plant.encoder_delay > 0.0:
        delay(world)
    noise = chance_of(world)
    for j in range(world.n):
        q, step = state.q[j] + plant.encoder_offset[j], plant.encoder_resolution[j]
        if plant.is_noisy:
            q += plant.encoder_noise[j] * noise[j]
        if step > 0.0:
            q = step * math.floor(q / step + 0.5)
        state.q[j] = q
        if plant.differentiates:  # filtered difference quotients of the readings: y⁺ = u + exp(−T/τ) (y − u)
            quotient = (q - plant.q_read[j]) / world.period if t > 0 else 0.0
            rate = quotient + plant.rate_decay * (plant.qdot_read[j] - quotient)
            plant.q_read[j], plant.qdot_read[j], state.qdot[j] = q, rate, rate
    if plant.integrates and t > 0:  # from the reading at the start
        for j in range(world.n):
            state.q[j] = plant.q_last[j] + world.period * world.memory.qdot_cmd[j]


class Encoders:
    """The encoders of one world, or the integral of its commands in their place.

    Where a world has any of an offset, a delay, noise, a resolution, or an arm with lengths unknown to the
    law, the law takes the readings for q, and computes the site from them and from the lengths that it knows.
    """

    def __init__(self, scenario: Scenario, arm: Arm) -> None:
        """Bind them to a world.

        Args:
            scenario: Scenario of the world.
            arm: The arm that it names.
        """
        self.scenario, self.arm = scenario, arm
        encoder, control = scenario.arm.encoder, scenario.control
        self.integrates = control.state == "integrated"
        self.is_noisy = bool(np.any(encoder.noise))
        self.delay = in_ticks(encoder.delay, control.period)
        # whether rates are difference quotients: readings are no longer q plus a constant
        self.differentiates = bool(self.is_noisy or np.any(encoder.resolution) or encoder.delay)

    @cached_property
    def offset(self) -> Array:
        """Offset of the readings, (n,): offset + deviation · z − the plant's joint_offset.

        z is `numpy.random.default_rng(seed).standard_normal(n)`, one number per joint.
        """
        encoder, n = self.scenario.arm.encoder, self.arm.n
        z = np.random.default_rng(encoder.seed).standard_normal(n)
        return (
            np.full(n, encoder.offset) + np.multiply(encoder.deviation, z) - self.scenario.plant.joint_offset
        )

    @property
    def moves_q(self) -> bool:
        """Whether the law takes the joints to be somewhere else than they are."""
        return bool(self.offset.any() or self.differentiates or self.integrates)

    @property
    def is_used(self) -> bool:
        """Whether readings differ from q, or the arm has other lengths than the law knows."""
        return self.moves_q or bool(self.scenario.plant.stretch)

    def write(self, plant: np.void) -> None:
        """Write the parameters of the readings into the group `plant` of a world's record."""
        scenario, n = self.scenario, self.arm.n
        encoder, control = scenario.arm.encoder, scenario.control
        plant["encoder_offset"][:n], plant["integrates"] = self.offset, self.integrates
        plant["differentiates"], plant["encoder_delay"] = self.differentiates, self.delay
        filtered = control.rate_filter
        plant["rate_decay"] = math.exp(-control.period / filtered) if filtered else 0.0
        plant["is_noisy"], plant["encoder_noise"][:n] = self.is_noisy, encoder.noise
        plant["encoder_resolution"][:n] = encoder.resolution

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield numbers out of range, and features that need an arm that is sensed as it is."""
        encoder, plant = self.scenario.arm.encoder, self.scenario.plant
        sizes = {f"arm.encoder.{name}": getattr(encoder, name) for name in _SIZES}
        for key, values in (*sizes.items(), ("plant.joint_offset", plant.joint_offset)):
            most = np.abs(values).max()
            if most > _MOST_OFF:
                yield key, f"must be within ±{_MOST_OFF:g} rad or m, got {most:g}"
        finest = np.min(encoder.resolution, where=np.greater(encoder.resolution, 0.0), initial=math.inf)
        if finest < _FINEST:
            yield "arm.encoder.resolution", f"must be 0 or at least {_FINEST:g} rad or m, got {finest:g}"
        for key, is_used in (
            ("arm.encoder", encoder.delay or any(map(np.any, sizes.values()))),
            ("plant.stretch", plant.stretch), ("plant.joint_offset", np.any(plant.joint_offset)),
            ("control.state", self.integrates),
        ):  # fmt: skip
            if is_used:
                yield from self._blind_joints(key)

    def _blind_joints(self, key: str) -> Iterator[tuple[str, str]]:
        """Yield joints whose positions the law cannot know, for a key because of which it must."""
        arm, nullspace = self.arm, self.scenario.control.nullspace
        sites = [arm.site]
        if nullspace.objective == "secondary" and (nullspace.secondary.site or arm.site) in arm.sites:
            sites.append(nullspace.secondary.site or arm.site)
        for joint in dict.fromkeys(joint for site in sites for joint in arm.idle(site)):
            yield (
                key,
                f'joint "{joint}" of {arm.path} moves the site and is not actuated, so the law cannot '
                f"compute the pose of the site; actuate it, or leave {key} out",
            )


def in_ticks(time: float, period: float) -> float:
    """Return a time [s] in ticks of a period [s]: a whole number if it is one up to rounding."""
    ticks = min(time / period, _NEVER)
    return float(round(ticks)) if abs(ticks - round(ticks)) <= _ROUNDING * ticks else ticks
