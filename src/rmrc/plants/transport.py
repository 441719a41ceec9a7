"""The transport of commands to the plant: it takes a variable time, and some commands are lost.

Times here are in ticks: command k, sent at time k, arrives at `arrival` and is in effect from then on. A
command that arrives within a tick counts by its share of the tick: the plant gets the mean over the tick,
which is all that a plant that integrates can distinguish.
"""

import math
from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Array, Record, compiled, inlined
from rmrc.law.record import JOINTS, Field
from rmrc.plants.chance import TRANSPORT, uniforms, word
from rmrc.plants.stage import Stage, in_ticks


@inlined
def carry(world: Record, out: Record, past: Record, t: int) -> None:
    """Send the plant the command in effect in tick t, [t, t + 1): the last one sent of those that arrived."""
    if world.jitter > 0.0 or world.loss > 0.0:
        carry_by_chance(world, out, past, t)
        return
    newest, rows, sent = t - math.floor(world.latency), past.shape[0], world.qdot_sent
    arrival = newest + world.latency  # within this tick, or with it
    share, last = t + 1.0 - arrival, past[newest % rows].qdot_cmd
    if newest < 0:
        for j in range(world.n):
            sent[j] = 0.0
    elif arrival > t and newest > 0:
        before = past[(newest - 1) % rows].qdot_cmd
        for j in range(world.n):
            sent[j] = share * last[j] + (arrival - t) * before[j]
    else:
        for j in range(world.n):
            sent[j] = share * last[j]


@compiled
def carry_by_chance(world: Record, out: Record, past: Record, t: int) -> None:
    """Do the same where each command has its own latency, or is lost.

    The loop goes back in time from the last command: each is in effect from its arrival to the arrival of a
    later one. The command in effect before this tick, or none, fills the rest.
    """
    later, chance = uniforms(world.transport_seed, TRANSPORT, t)
    out.arrival = math.inf if chance < world.loss else t + world.latency + world.jitter * later
    end, newest, rows = t + 1.0, -1, past.shape[0]
    for j in range(world.n):
        world.qdot_sent[j] = -0.0  # a sum that begins with -0 keeps the sign of zero
    for k in range(min(t, math.floor(end - world.latency)), max(world.arrived, t - world.span - 1), -1):
        command = past[k % rows]
        if command.arrival < end:
            begin = max(command.arrival, float(t))
            add(world, end - begin, command.qdot_cmd)
            newest, end = max(newest, k), begin
        if end <= t:
            break
    if end > t:
        add(world, end - t, world.in_effect)
    if newest >= 0:
        world.arrived = newest
        for j in range(world.n):
            world.in_effect[j] = past[newest % rows].qdot_cmd[j]


@compiled
def add(world: Record, share: float, rates: Array) -> None:
    """Add rates that are in effect for a share of the tick."""
    for j in range(world.n):
        world.qdot_sent[j] += share * rates[j]


class Transport(Stage):
    """The transport of commands, with latency and loss."""

    slot, uses, change = "sent", "is_late", staticmethod(carry)
    fields = (
        Field("is_late", np.int64), Field("latency"), Field("jitter"), Field("loss"),
        Field("span", np.int64), Field("transport_seed", np.int64),
    )  # fmt: skip
    # the command in effect, and its number
    memory = (Field("in_effect", size=(JOINTS,)), Field("arrived", np.int64, start=-1))

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

    def write(self, world: np.void) -> None:
        """Write latency, loss and the seed of their random numbers."""
        plant = self.scenario.plant
        world["is_late"], world["span"] = self.is_used, self.span
        world["latency"], world["jitter"], world["loss"] = self.latency, self.jitter, plant.loss
        world["transport_seed"] = word(plant.seed)

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield nothing: every arm can have latency."""
        yield from ()

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield a delay that is longer than the run."""
        if self.latency >= ticks:
            period, delay = self.scenario.control.period, self.scenario.plant.delay
            yield (
                "plant.delay",
                f"must be less than the {ticks * period:g} s that the run takes, as no command would arrive, "
                f"got {delay:g} s; lower it, or lengthen target.path",
            )
