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

from rmrc.arm import Arm
from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.plants.fields import chance_of, past_of
from rmrc.plants.sensing import in_ticks
from rmrc.scenario import Scenario

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
