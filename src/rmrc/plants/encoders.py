"""Encoders: the joint state that the law gets, if it differs from the true one.

A reading is delayed, offset, noisy and rounded, in this order. Encoders that only have an offset leave the
rates unchanged, because a constant has none. Otherwise there is no tachometer, and a rate is the difference
quotient of readings.
"""

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from rmrc.law.jit import Array, Record, compiled, inlined
from rmrc.law.record import JOINTS, Field
from rmrc.plants.chance import ENCODER_NOISE, normals, word
from rmrc.plants.stage import Stage, in_ticks, refuse_unseen

# A larger offset of a joint is an error of the input [rad, m]; the same bound is on lengths of models.
_MOST_OFF = 1e6
# Finer steps [rad, m] are lost in the rounding of positions, and their number overflows.
_FINEST = 1e-12
# Noise of this many ticks is drawn at once: between two ticks MuJoCo and the law evict its code and tables
# from the first caches.
AHEAD = 32


@inlined
def read_encoders(world: Record, out: Record, past: Record, t: int) -> None:  # noqa: ARG001 - as all
    """Have the law take the readings of the encoders for the joint positions."""
    if world.encoder_delay > 0.0:
        look_back(world, past, t)
    noise, first = world.noise[t % AHEAD], t - t % AHEAD
    if world.is_noisy and world.noise_from != first:
        world.noise_from = first
        normals(world.encoder_seed, ENCODER_NOISE, first, world.n, world.drawn, world.noise)
    for j in range(world.n):
        q, step = world.q[j] + world.encoder_offset[j], world.encoder_resolution[j]
        if world.is_noisy:
            q += world.encoder_noise[j] * noise[j]
        if step > 0.0:
            q = step * math.floor(q / step + 0.5)
        world.q[j] = q
        if world.differentiates:  # filtered difference quotients of the readings: y⁺ = u + exp(−T/τ) (y − u)
            quotient = (q - world.q_read[j]) / world.period if t > 0 else 0.0
            rate = quotient + world.rate_decay * (world.qdot_read[j] - quotient)
            world.q_read[j], world.qdot_read[j], world.qdot[j] = q, rate, rate


@compiled
def look_back(world: Record, past: Record, t: int) -> None:
    """Write earlier joint positions, interpolated between ticks; before the first tick they are constant."""
    when, rows = max(t - world.encoder_delay, 0.0), past.shape[0]
    before, after = math.floor(when), math.ceil(when)
    first, last = past[before % rows].q, past[after % rows].q
    for j in range(world.n):
        world.q[j] = last[j] + (after - when) * (first[j] - last[j])


class Encoders(Stage):
    """Encoders with an offset, a delay, noise or a resolution, and an arm with lengths unknown to the law.

    Where a world has any of these, the law takes the readings for q, and computes the site from them and from
    the lengths that it knows.
    """

    slot, uses, change = "sensed", "is_misled", staticmethod(read_encoders)
    fields = (
        Field("is_misled", np.int64), Field("encoder_offset", size=(JOINTS,)),
        Field("differentiates", np.int64), Field("rate_decay"), Field("encoder_delay"),  # in ticks
        Field("is_noisy", np.int64), Field("encoder_noise", size=(JOINTS,)), Field("encoder_seed", np.int64),
        Field("encoder_resolution", size=(JOINTS,)),
        # standard noise of the ticks from `noise_from` on, which follows from the seed; scratch
        Field("noise", size=(AHEAD, JOINTS)), Field("noise_from", np.int64),
        Field("drawn", np.int64, (JOINTS,)),
    )  # fmt: skip
    memory = Field("q_read", size=(JOINTS,)), Field("qdot_read", size=(JOINTS,))

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

    def write(self, world: np.void) -> None:
        """Write the parameters of the readings."""
        scenario, n = self.scenario, self.arm.n
        encoder, control = scenario.arm.encoder, scenario.control
        world["is_misled"], world["encoder_offset"][:n] = self.is_used, self.offset
        world["differentiates"], world["encoder_delay"] = self.differentiates, self.delay
        world["noise"] = world["drawn"] = 0
        world["noise_from"] = -1
        filtered = control.rate_filter
        world["rate_decay"] = math.exp(-control.period / filtered) if filtered else 0.0
        world["is_noisy"], world["encoder_noise"][:n] = np.any(encoder.noise), encoder.noise
        world["encoder_seed"], world["encoder_resolution"][:n] = word(encoder.seed), encoder.resolution

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
                yield from refuse_unseen(self, key)


def _each(values: float | tuple[float, ...]) -> tuple[float, ...]:
    return values if isinstance(values, tuple) else (values,)


_SIZES = "offset", "deviation", "noise", "resolution"
