"""How drives follow what arrives, whatever the plant: with a lag.

Each is a linear filter of one joint's rates, exact for a command that is constant during a tick; the plant is
told the mean of the filtered rate over the tick, so that one which integrates goes exactly as far.
"""

from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Array, Record, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.plants.stage import Stage

# Ticks of a lag without which a joint does not move to speak of.
_ALWAYS = 2.0**52


@compiled
def lag_behind(world: Record, out: Record, past: Record, t: int) -> None:  # noqa: ARG001 - as all
    """Follow u, what arrived, by lag · dy/dt = u − y: the plant is told the mean of y."""
    for j in range(world.n):
        u = world.qdot_sent[j]
        behind = u - world.lagging[j]
        world.qdot_sent[j] = u - world.lag_mean[j] * behind
        world.lagging[j] += world.lag_step[j] * behind


class Lag(Stage):
    """Rates follow with a time constant."""

    slot, uses, change = "sent", "lags", staticmethod(lag_behind)
    fields = (Field("lags", np.int64), Field("lag_step", size=(JOINTS,)), Field("lag_mean", size=(JOINTS,)))
    memory = (Field("lagging", size=(JOINTS,)),)

    @property
    def lag(self) -> Array:
        """Time constants, (n,) [s]."""
        return np.broadcast_to(np.asarray(self.scenario.plant.lag, np.float64), self.arm.n)

    @property
    def is_used(self) -> bool:
        """Whether any joint lags."""
        return bool(np.any(self.scenario.plant.lag))

    def write(self, world: np.void) -> None:
        """Write the step 1 − exp(−period/lag) of each joint, and how far the mean of a tick is behind u."""
        n, ticks = self.arm.n, np.minimum(self.lag / self.scenario.control.period, _ALWAYS)
        with np.errstate(divide="ignore"):
            step = -np.expm1(-1.0 / ticks)
        world["lags"], world["lag_step"][:n], world["lag_mean"][:n] = self.is_used, step, step * ticks

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield nothing: any lag will do."""
        yield from ()
