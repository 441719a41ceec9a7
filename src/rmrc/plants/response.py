"""The response of actuators to their commands, for any plant: a lag, or an oscillation.

Each is a linear filter of one joint's rates, exact for a command that is constant during a tick. The plant
gets the mean of the filtered rate over the tick, so that a plant that integrates moves exactly as far.
"""

import math
from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Array, Record, inlined
from rmrc.law.record import JOINTS, Field
from rmrc.plants.stage import Stage
from rmrc.scenario.choices import PLANTS

# After this many ticks of a lag a joint has not moved noticeably.
_ALWAYS = 2.0**52

# Beyond these shares of the control rate a frequency is an error of units: oscillations of 100,000 ticks, and
# a thousand oscillations in one. More damping is a lag. Within them `oscillator` is off by at most 1e-11.
_SLOWEST, _FASTEST, _MOST_DAMPED = 1e-5, 1e3, 10.0


@inlined
def lag_behind(world: Record, out: Record, past: Record, t: int) -> None:  # noqa: ARG001 - as all
    """Follow the arriving rate u by lag · dy/dt = u − y; the plant gets the mean of y."""
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
        """Yield nothing: every lag is possible."""
        yield from ()


@inlined
def swing(world: Record, out: Record, past: Record, t: int) -> None:  # noqa: ARG001 - as all
    """Follow the arriving rate u by y" + 2ζω y' + ω² y = ω² u; the plant gets the mean of y.

    The state is [y − u; y'/ω], each joint by itself.
    """
    step, mean = world.swing_step, world.swing_mean
    for j in range(world.n):
        u = world.qdot_sent[j]
        off, rate = world.swinging[0, j] - u, world.swinging[1, j]
        world.qdot_sent[j] = u + (mean[0] * off + mean[1] * rate)
        world.swinging[0, j] = u + (step[0, 0] * off + step[0, 1] * rate)
        world.swinging[1, j] = step[1, 0] * off + step[1, 1] * rate


class Resonance(Stage):
    """Rates oscillate about the command, as with a spring in the actuator."""

    slot, uses, change = "sent", "swings", staticmethod(swing)
    fields = (Field("swings", np.int64), Field("swing_step", size=(2, 2)), Field("swing_mean", size=(2,)))
    memory = (Field("swinging", size=(2, JOINTS)),)

    @property
    def is_used(self) -> bool:
        """Whether there is a frequency."""
        return self.scenario.plant.resonance.frequency is not None

    def write(self, world: np.void) -> None:
        """Write the matrix of a step, and the row that gives the mean of a tick."""
        world["swings"] = self.is_used
        resonance = self.scenario.plant.resonance
        if resonance.frequency is not None:
            angle = math.tau * resonance.frequency * self.scenario.control.period
            world["swing_step"], world["swing_mean"] = oscillator(angle, resonance.damping)

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
