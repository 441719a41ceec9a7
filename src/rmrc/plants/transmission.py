"""The way of a command to the plant: transport, a lag or an oscillation of the actuator, and its backlash.

Times of transport are in ticks: command k, sent at time k, arrives later and is in effect from then on. A
command that arrives within a tick counts by its share of the tick: the plant gets the mean over the tick,
which is all that a plant that integrates can distinguish. Some commands may be lost.

Lag and oscillation are linear filters of one joint's rates, exact for a command that is constant during a
tick. The plant gets the mean of the filtered rate over the tick, so that a plant that integrates moves
exactly as far.

With backlash, an actuator that reverses crosses a gap before it moves the joint. The joint follows whichever
side of the gap the actuator pushes, and stays in place between the two. The gap has no mass, spring or
impact. MuJoCo does not move the actuator's side, so both share one joint.
"""

import math
from collections.abc import Iterator

import numpy as np

from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.plants.chance import TRANSPORT, uniforms, word
from rmrc.plants.past import past_of
from rmrc.plants.stage import Stage, in_ticks
from rmrc.scenario.choices import PLANTS

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
    """Send the plant the command in effect in tick t, [t, t + 1): the last one sent of those that arrived."""
    plant, t, n, past = world.plant, world.engine.next, world.n, past_of(world)
    for j in range(n):
        past[t % past.shape[0], n + j] = plant.qdot_sent[j]
    if plant.jitter > 0.0 or plant.loss > 0.0:
        carry_by_chance(world)
        return
    newest, rows, sent = t - math.floor(plant.latency), past.shape[0], plant.qdot_sent
    arrival = newest + plant.latency  # within this tick, or with it
    share = t + 1.0 - arrival
    for j in range(n):
        sent[j] = share * past[newest % rows, n + j] if newest >= 0 else 0.0
        if arrival > t and newest > 0:
            sent[j] += (arrival - t) * past[(newest - 1) % rows, n + j]


@compiled
def carry_by_chance(world: Record) -> None:
    """Do the same where each command has its own latency, or is lost.

    The loop goes back in time from the last command: each is in effect from its arrival to the arrival of a
    later one. The command in effect before this tick, or none, fills the rest.
    """
    plant, t, n, past = world.plant, world.engine.next, world.n, past_of(world)
    rows, arrival = past.shape[0], 2 * n
    later, chance = uniforms(plant.transport_seed, TRANSPORT, t)
    past[t % rows, arrival] = math.inf if chance < plant.loss else t + plant.latency + plant.jitter * later
    end, newest = t + 1.0, -1
    for j in range(n):
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


class Transport(Stage):
    """The transport of commands, with latency and loss."""

    @property
    def latency(self) -> float:
        """Least latency of a command, in ticks."""
        return in_ticks(self.scenario.plant.delay, self.scenario.control.period)

    @property
    def jitter(self) -> float:
        """Largest additional latency, in ticks."""
        return in_ticks(self.scenario.plant.jitter, self.scenario.control.period)

    @property
    def is_used(self) -> bool:
        """Whether commands take time, or are lost."""
        return self.latency > 0.0 or self.jitter > 0.0 or self.scenario.plant.loss > 0.0

    @property
    def span(self) -> int:
        """Largest latency of a command, in ticks."""
        return math.ceil(self.latency + self.jitter)

    def write(self, plant: np.void) -> None:
        """Write latency, loss and the seed of their random numbers."""
        section = self.scenario.plant
        plant["is_late"], plant["span"], plant["arrived"] = self.is_used, self.span, -1
        plant["latency"], plant["jitter"], plant["loss"] = self.latency, self.jitter, section.loss
        plant["transport_seed"] = word(section.seed)

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield a delay that is longer than the run."""
        if self.latency >= ticks:
            period, delay = self.scenario.control.period, self.scenario.plant.delay
            yield (
                "plant.delay",
                f"must be less than the {ticks * period:g} s that the run takes, as no command would arrive, "
                f"got {delay:g} s; lower it, or lengthen target.path",
            )


class Lag(Stage):
    """Rates follow with a time constant."""

    @property
    def lag(self) -> Array:
        """Time constants, (n,) [s]."""
        return np.broadcast_to(np.asarray(self.scenario.plant.lag, np.float64), self.arm.n)

    @property
    def is_used(self) -> bool:
        """Whether any joint lags."""
        return bool(np.any(self.scenario.plant.lag))

    def write(self, plant: np.void) -> None:
        """Write the step 1 − exp(−period/lag) of each joint, and how far the mean of a tick is behind u."""
        n, ticks = self.arm.n, np.minimum(self.lag / self.scenario.control.period, _ALWAYS)
        with np.errstate(divide="ignore"):
            step = -np.expm1(-1.0 / ticks)
        plant["lags"], plant["lag_step"][:n], plant["lag_mean"][:n] = self.is_used, step, step * ticks


class Resonance(Stage):
    """Rates oscillate about the command, as with a spring in the actuator."""

    @property
    def is_used(self) -> bool:
        """Whether there is a frequency."""
        return self.scenario.plant.resonance.frequency is not None

    def write(self, plant: np.void) -> None:
        """Write the matrix of a step, and the row that gives the mean of a tick."""
        plant["swings"] = self.is_used
        resonance = self.scenario.plant.resonance
        if resonance.frequency is not None:
            angle = math.tau * resonance.frequency * self.scenario.control.period
            plant["swing_step"], plant["swing_mean"] = oscillator(angle, resonance.damping)

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield a plant without a mass to oscillate, and numbers out of range."""
        plant, period = self.scenario.plant, self.scenario.control.period
        frequency, damping = plant.resonance.frequency, plant.resonance.damping
        if frequency is None:
            return
        if not PLANTS[plant.kind].physics:
            yield (
                "plant.resonance",
                f'"{plant.kind}" has no mass that could oscillate; choose from {PLANTS.physical}, '
                "or use plant.lag instead",
            )
        least, most = _SLOWEST / period, _FASTEST / period
        if not least <= frequency <= most:
            yield (
                "plant.resonance.frequency",
                f"must be between {least:g} and {most:g} Hz, at a control.period of {period:g} s, "
                f"got {frequency:g} Hz",
            )
        if damping > _MOST_DAMPED:
            yield (
                "plant.resonance.damping",
                f"must be at most {_MOST_DAMPED:g}, got {damping:g}; so much damping is a plant.lag",
            )


class Backlash(Stage):
    """Backlash of the actuators."""

    @property
    def is_used(self) -> bool:
        """Whether any joint has backlash."""
        return bool(np.any(self.scenario.plant.backlash))

    def write(self, plant: np.void) -> None:
        """Write half of each joint's backlash."""
        plant["has_play"] = self.is_used
        plant["half_play"][: self.arm.n] = np.multiply(0.5, self.scenario.plant.backlash)

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield a misfit for a plant without actuators."""
        if self.is_used and not PLANTS[self.scenario.plant.kind].physics:
            yield (
                "plant.backlash",
                f'"{self.scenario.plant.kind}" has no actuators that could have backlash; choose from '
                f"{PLANTS.physical}",
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
    square = (1.0 - damping) * (1.0 + damping)
    d = math.sqrt(abs(square))
    if square > 0.0:
        decay = math.exp(-damping * angle)
        same, other = decay * math.cos(d * angle), decay * math.sin(d * angle) / d
    else:  # the slower root is −ζ + d, without its cancellation
        slow = math.exp(-angle / (damping + d))
        same = slow * (1.0 + math.exp(-2.0 * d * angle)) / 2.0
        other = slow * (angle if d == 0.0 else -math.expm1(-2.0 * d * angle) / (2.0 * d))
    E = np.array([[same + damping * other, other], [-other, same - damping * other]])
    rise = E - np.eye(2)
    return E, -(2.0 * damping * rise[0] + rise[1]) / angle
