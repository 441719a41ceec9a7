"""The way of a command to the plant: it takes time, more or less of it, and some never arrive.

Times here are in ticks: command k, sent at time k, arrives at `arrival`, and is in effect from then on. What
arrives within a tick counts by its share of it: the plant is told the mean over the tick, which is all that
a plant which integrates can tell.
"""

import math
from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Array, Record, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.plants.chance import TRANSPORT, uniforms, word
from rmrc.plants.stage import Stage, in_ticks


@compiled
def carry(world: Record, out: Record, past: Record, t: int) -> None:
    """Tell the plant what is in effect in tick t, [t, t + 1): of all that is there, what was sent last."""
    if world.jitter > 0.0 or world.loss > 0.0:
        carry_by_chance(world, out, past, t)
        return
    newest, rows = t - math.floor(world.latency), past.shape[0]
    arrival = newest + world.latency  # within this tick, or with it
    for j in range(world.n):
        world.qdot_sent[j] = -0.0 if newest >= 0 else 0.0  # a sum that begins with -0 keeps the sign of zero
    if newest >= 0:
        add(world, t + 1.0 - arrival, past[newest % rows].qdot_cmd)
    if arrival > t and newest > 0:
        add(world, arrival - t, past[(newest - 1) % rows].qdot_cmd)


@compiled
def carry_by_chance(world: Record, out: Record, past: Record, t: int) -> None:
    """Do so where each command has a latency of its own, or is lost.

    From the command that was sent last back in time: each is in effect from its arrival to the arrival of
    one that was sent later. What was in effect before this tick, or nothing, has what is left.
    """
    later, chance = uniforms(world.transport_seed, TRANSPORT, t)
    out.arrival = math.inf if chance < world.loss else t + world.latency + world.jitter * later
    end, newest, rows = t + 1.0, -1, past.shape[0]
    for j in range(world.n):
        world.qdot_sent[j] = -0.0
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
    """Have rates be in effect for a share of the tick."""
    for j in range(world.n):
        world.qdot_sent[j] += share * rates[j]


class Transport(Stage):
    """Commands are on their way for a time, and may be lost."""

    slot, uses, change = "sent", "is_late", staticmethod(carry)
    fields = (
        Field("is_late", np.int64), Field("latency"), Field("jitter"), Field("loss"),
        Field("span", np.int64), Field("transport_seed", np.int64),
    )  # fmt: skip
    # the command that is in effect, and its number
    memory = (Field("in_effect", size=(JOINTS,)), Field("arrived", np.int64, start=-1))

    @property
    def latency(self) -> float:
        """How long a command takes at least, in ticks."""
        return in_ticks(self.scenario.plant.delay, self.scenario.control.period)

    @property
    def jitter(self) -> float:
        """How much longer it may take, in ticks."""
        return in_ticks(self.scenario.plant.jitter, self.scenario.control.period)

    @property
    def is_used(self) -> bool:
        """Whether commands take time, or are lost."""
        return self.latency > 0.0 or self.jitter > 0.0 or self.scenario.plant.loss > 0.0

    @property
    def span(self) -> int:
        """How many ticks a command takes at most."""
        return math.ceil(self.latency + self.jitter)

    def write(self, world: np.void) -> None:
        """Write how long commands take, how many are lost, and what is drawn."""
        plant = self.scenario.plant
        world["is_late"], world["span"] = self.is_used, self.span
        world["latency"], world["jitter"], world["loss"] = self.latency, self.jitter, plant.loss
        world["transport_seed"] = word(plant.seed)

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield nothing: any arm can be told late."""
        yield from ()

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield a delay within which the run ends."""
        if self.latency >= ticks:
            period, delay = self.scenario.control.period, self.scenario.plant.delay
            yield (
                "plant.delay",
                f"must be less than the {ticks * period:g} s that the run takes, as no command would arrive, "
                f"got {delay:g} s; lower it, or lengthen target.path",
            )
