"""The stages between the law and the plant: what the law senses, and the way of a command.

The joint state that the law gets may differ from the true one. A reading is delayed, offset, noisy and
rounded, in this order. Encoders that only have an offset leave the rates unchanged, because a constant has
none. Otherwise there is no tachometer, and a rate is the difference quotient of readings. With
`control.state: integrated` the law integrates its own commands and never reads the encoders again.

A command has transport, a lag or an oscillation of the actuator, and its backlash on its way. Times of
transport are in ticks: command k, sent at time k, arrives later and is in effect from then on. A command
that arrives within a tick counts by its share of the tick: the plant gets the mean over the tick, which is
all that a plant that integrates can distinguish. Some commands may be lost.

Lag and oscillation are linear filters of one joint's rates, exact for a command that is constant during a
tick. The plant gets the mean of the filtered rate over the tick, so that a plant that integrates moves
exactly as far.

With backlash, an actuator that reverses crosses a gap before it moves the joint. The joint follows whichever
side of the gap the actuator pushes, and stays in place between the two. The gap has no mass, spring or
impact. MuJoCo does not move the actuator's side, so both share one joint.
"""

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from rmrc.arm import Arm
from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.plants.engine import chance_of, past_of
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


# After this many ticks of a lag a joint has not moved noticeably.
_ALWAYS = 2.0**52

# Beyond these shares of the control rate a frequency is an error of units: oscillations of 100,000 ticks, and
# a thousand oscillations in one. More damping is a lag. Within them `oscillator` is off by at most 1e-11.
_SLOWEST, _FASTEST, _MOST_DAMPED = 1e-5, 1e3, 10.0


@Method
def transmission(world: Record) -> None:
    """Apply what lies between the command, in `plant.qdot_sent`, and the plant."""
    plant = world.plant
    if plant.is_late:
        carry(world)
    if plant.lags:
        lag_behind(world)
    if plant.swings:
        swing(world)
    if plant.has_play:
        cross_play(world)


@compiled
def carry(world: Record) -> None:
    """Send the plant the command in effect in tick t, [t, t + 1): the last one sent of those that arrived.

    Each command has its own latency, or is lost. The loop goes back in time from the last command: each is in
    effect from its arrival to the arrival of a later one. The command in effect before this tick, or none,
    fills the rest.
    """
    plant, t, n, past = world.plant, world.engine.next, world.n, past_of(world)
    rows, arrival, chance = past.shape[0], 2 * n, chance_of(world)
    past[t % rows, arrival] = t + plant.latency + plant.jitter * chance[n]
    if chance[n + 1] < plant.loss:
        past[t % rows, arrival] = math.inf
    end, newest = t + 1.0, -1
    for j in range(n):
        past[t % rows, n + j] = plant.qdot_sent[j]
        plant.qdot_sent[j] = -0.0  # a sum that begins with -0 keeps the sign of zero
    for k in range(min(t, math.floor(end - plant.latency)), max(plant.arrived, t - plant.span - 1), -1):
        command = past[k % rows]
        if command[arrival] < end:
            begin = max(command[arrival], float(t))
            for j in range(n):
                plant.qdot_sent[j] += (end - begin) * command[n + j]
            newest, end = max(newest, k), begin
        if end <= t:
            break
    for j in range(n if end > t else 0):
        plant.qdot_sent[j] += (end - t) * plant.in_effect[j]
    if newest >= 0:
        plant.arrived = newest
        for j in range(n):
            plant.in_effect[j] = past[newest % rows, n + j]


@compiled
def lag_behind(world: Record) -> None:
    """Follow the arriving rate u by lag · dy/dt = u − y; the plant gets the mean of y."""
    plant = world.plant
    for j in range(world.n):
        u = plant.qdot_sent[j]
        behind = u - plant.lagging[j]
        plant.qdot_sent[j] = u - plant.lag_mean[j] * behind
        plant.lagging[j] += plant.lag_step[j] * behind


@compiled
def swing(world: Record) -> None:
    """Follow the arriving rate u by y" + 2ζω y' + ω² y = ω² u; the plant gets the mean of y.

    The state is [y − u; y'/ω], each joint by itself.
    """
    plant = world.plant
    step, mean = plant.swing_step, plant.swing_mean
    for j in range(world.n):
        u = plant.qdot_sent[j]
        off, rate = plant.swinging[0, j] - u, plant.swinging[1, j]
        plant.qdot_sent[j] = u + (mean[0] * off + mean[1] * rate)
        plant.swinging[0, j] = u + (step[0, 0] * off + step[0, 1] * rate)
        plant.swinging[1, j] = step[1, 0] * off + step[1, 1] * rate


@compiled
def cross_play(world: Record) -> None:
    """Remove from each rate the part that the actuator needs to cross the gap in its direction."""
    plant = world.plant
    for j in range(world.n):
        rate, half = plant.qdot_sent[j], plant.half_play[j]
        side = 1.0 if rate > 0.0 else -1.0
        free = half - side * plant.in_play[j]
        if abs(rate) * world.period < free:
            plant.in_play[j] += rate * world.period
            plant.qdot_sent[j] = 0.0
        else:
            plant.in_play[j] = side * half
            plant.qdot_sent[j] = rate - side * (free / world.period)


class Transmission:
    """The way of commands in one world."""

    def __init__(self, scenario: Scenario, arm: Arm) -> None:
        """Bind it to a world.

        Args:
            scenario: Scenario of the world.
            arm: The arm that it names.
        """
        self.section, self.arm, self.period = scenario.plant, arm, scenario.control.period
        plant = self.section
        # least latency of a command and its largest addition, in ticks; the largest latency in whole ticks
        self.latency, self.jitter = in_ticks(plant.delay, self.period), in_ticks(plant.jitter, self.period)
        self.span = math.ceil(self.latency + self.jitter)
        self.is_late = self.span > 0 or plant.loss > 0.0
        self.lags, self.swings = bool(np.any(plant.lag)), plant.resonance.frequency is not None
        self.has_play = bool(np.any(plant.backlash))
        self.is_used = self.is_late or self.lags or self.swings or self.has_play

    def write(self, plant: np.void) -> None:
        """Write its parameters into the group `plant` of a world's record.

        Those of a lag are its step 1 − exp(−period/lag), and how far the mean of a tick is behind u.
        """
        section, n = self.section, self.arm.n
        plant["is_late"], plant["span"], plant["arrived"] = self.is_late, self.span, -1
        plant["latency"], plant["jitter"], plant["loss"] = self.latency, self.jitter, section.loss
        with np.errstate(divide="ignore"):
            ticks = np.minimum(np.divide(section.lag, self.period), _ALWAYS)
            step = -np.expm1(-1.0 / ticks)
        plant["lags"], plant["lag_step"][:n], plant["lag_mean"][:n] = self.lags, step, step * ticks
        plant["swings"], resonance = self.swings, section.resonance
        if resonance.frequency is not None:
            angle = math.tau * resonance.frequency * self.period
            plant["swing_step"], plant["swing_mean"] = oscillator(angle, resonance.damping)
        plant["has_play"], plant["half_play"][:n] = self.has_play, np.multiply(0.5, section.backlash)

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield numbers out of range."""
        frequency, damping = self.section.resonance.frequency, self.section.resonance.damping
        least, most = _SLOWEST / self.period, _FASTEST / self.period
        if frequency is not None and not least <= frequency <= most:
            yield (
                "plant.resonance.frequency",
                f"must be between {least:g} and {most:g} Hz, at a control.period of {self.period:g} s, "
                f"got {frequency:g} Hz",
            )
        if frequency is not None and damping > _MOST_DAMPED:
            yield (
                "plant.resonance.damping",
                f"must be at most {_MOST_DAMPED:g}, got {damping:g}; so much damping is a plant.lag",
            )

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield a delay that is longer than a run of this many ticks."""
        if self.latency >= ticks:
            yield (
                "plant.delay",
                f"must be less than the {ticks * self.period:g} s that the run takes, as no command would "
                f"arrive, got {self.section.delay:g} s; lower it, or lengthen target.path",
            )


def oscillator(angle: float, damping: float) -> tuple[Array, Array]:
    """Return the effect of a tick on x = [y; y'/ω] of y" + 2ζω y' + ω² y = 0: its end E x, the mean m x of y.

    E = exp(ωT A) by its closed form, with A = [[0, 1], [−1, −2ζ]], and m the first row of A⁻¹ (E − I)/(ωT).

    Args:
        angle: ωT [rad].
        damping: ζ.

    Returns:
        E, (2, 2), and m, (2,).

    >>> oscillator(math.pi, 0.0)[0].round(12) + 0.0
    array([[-1.,  0.],
           [ 0., -1.]])
    """
    d = np.sqrt(complex((damping - 1.0) * (damping + 1.0)))
    slow = np.exp(-angle / (damping + d))  # of the root −ζ + d, without its cancellation
    gone = np.expm1(-2.0 * d * angle)
    same, other = (slow * (1.0 + 0.5 * gone)).real, (slow * (-0.5 * gone / d if d else angle)).real
    E = np.array([[same + damping * other, other], [-other, same - damping * other]])
    rise = E - np.eye(2)
    return E, -(2.0 * damping * rise[0] + rise[1]) / angle
