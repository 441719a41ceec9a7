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

from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.plants.chance import ENCODER_NOISE, normals, word
from rmrc.plants.past import past_of
from rmrc.plants.stage import Stage, in_ticks

# A larger offset of a joint is an error of the input [rad, m]; the same bound is on lengths of models.
_MOST_OFF = 1e6
# Finer steps [rad, m] are lost in the rounding of positions, and their number overflows.
_FINEST = 1e-12


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
    if plant.is_noisy:
        normals(plant.encoder_seed, ENCODER_NOISE, t, world.n, plant.drawn, plant.noise)
    for j in range(world.n):
        q, step = state.q[j] + plant.encoder_offset[j], plant.encoder_resolution[j]
        if plant.is_noisy:
            q += plant.encoder_noise[j] * plant.noise[j]
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


class Encoders(Stage):
    """Encoders with an offset, a delay, noise or a resolution, and an arm with lengths unknown to the law.

    Where a world has any of these, the law takes the readings for q, and computes the site from them and from
    the lengths that it knows.
    """

    @cached_property
    def offset(self) -> Array:
        """Offset of the readings, (n,): offset + deviation · z − the plant's joint_offset.

        z is `numpy.random.default_rng(seed).standard_normal(n)`, one number per joint.
        """
        encoder, n = self.scenario.arm.encoder, self.arm.n
        offset = np.full(n, encoder.offset)
        if np.any(encoder.deviation):
            offset += encoder.deviation * np.random.default_rng(encoder.seed).standard_normal(n)
        beyond = self.scenario.plant.joint_offset
        return offset - beyond if np.any(beyond) else offset

    @cached_property
    def differentiates(self) -> bool:
        """Whether rates are difference quotients: readings are no longer q plus a constant."""
        encoder = self.scenario.arm.encoder
        return bool(any(_each(encoder.noise)) or any(_each(encoder.resolution)) or encoder.delay)

    @property
    def delay(self) -> float:
        """Delay of a reading, in ticks."""
        return in_ticks(self.scenario.arm.encoder.delay, self.scenario.control.period)

    @property
    def span(self) -> int:
        """Largest delay of a reading, in whole ticks."""
        return math.ceil(self.delay)

    @property
    def moves_q(self) -> bool:
        """Whether readings differ from q."""
        return bool(self.offset.any() or self.differentiates)

    @property
    def is_used(self) -> bool:
        """Whether readings differ from q, or the arm has other lengths than the law knows."""
        return self.moves_q or bool(self.scenario.plant.stretch)

    def write(self, plant: np.void) -> None:
        """Write the parameters of the readings."""
        scenario, n = self.scenario, self.arm.n
        encoder, control = scenario.arm.encoder, scenario.control
        plant["encoder_offset"][:n] = self.offset
        plant["differentiates"], plant["encoder_delay"] = self.differentiates, self.delay
        filtered = control.rate_filter
        plant["rate_decay"] = math.exp(-control.period / filtered) if filtered else 0.0
        plant["is_noisy"], plant["encoder_noise"][:n] = np.any(encoder.noise), encoder.noise
        plant["encoder_seed"], plant["encoder_resolution"][:n] = word(encoder.seed), encoder.resolution

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield numbers out of range, and features that need an arm that is sensed as it is."""
        encoder, plant = self.scenario.arm.encoder, self.scenario.plant
        beyond = "plant.joint_offset", plant.joint_offset
        for key, values in (*((f"arm.encoder.{name}", getattr(encoder, name)) for name in _SIZES), beyond):
            most = max(map(abs, _each(values)))
            if most > _MOST_OFF:
                yield key, f"must be within ±{_MOST_OFF:g} rad or m, got {most:g}"
        finest = min((step for step in _each(encoder.resolution) if step > 0.0), default=_FINEST)
        if finest < _FINEST:
            yield "arm.encoder.resolution", f"must be 0 or at least {_FINEST:g} rad or m, got {finest:g}"
        off = any(any(_each(getattr(encoder, name))) for name in _SIZES)
        for key, is_used in (
            ("arm.encoder", off or encoder.delay), ("plant.stretch", plant.stretch),
            ("plant.joint_offset", any(_each(plant.joint_offset))),
        ):  # fmt: skip
            if is_used:
                yield from _refuse_unseen(self, key)


def _each(values: float | tuple[float, ...]) -> tuple[float, ...]:
    return values if isinstance(values, tuple) else (values,)


_SIZES = "offset", "deviation", "noise", "resolution"


class Integral(Stage):
    """The integral of the commands, in place of the encoders' readings; rates stay the measured ones."""

    @property
    def is_used(self) -> bool:
        """Whether the law uses the integral."""
        return bool(self.scenario.control.state == "integrated")

    def write(self, plant: np.void) -> None:
        """Write whether it is used."""
        plant["integrates"] = self.is_used

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield features that need an arm that is sensed as it is."""
        if self.is_used:
            yield from _refuse_unseen(self, "control.state")


def _refuse_unseen(stage: Stage, key: str) -> Iterator[tuple[str, str]]:
    """Yield features that need a law that senses the arm as it is, for a key that prevents this.

    Args:
        stage: The stage that changes the sensed state.
        key: The key that enables it.
    """
    arm, nullspace = stage.arm, stage.scenario.control.nullspace
    sites = [arm.site]
    if nullspace.objective == "secondary" and (nullspace.secondary.site or arm.site) in arm.sites:
        sites.append(nullspace.secondary.site or arm.site)
    for joint in dict.fromkeys(joint for site in sites for joint in arm.idle_before(site)):
        yield (
            key,
            f'joint "{joint}" of {arm.path} moves the site and is not actuated, so the law cannot compute '
            f"the pose of the site; actuate it, or leave {key} out",
        )
