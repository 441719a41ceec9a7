"""The hardware between commanded and sensed rates: plant and stages of a world."""

import math
from collections.abc import Callable, Mapping

import numpy as np

from rmrc.arm import Arm
from rmrc.law.compiling import Array, Method
from rmrc.plants.ideal import Ideal
from rmrc.plants.model import Model
from rmrc.plants.plant import Plant
from rmrc.plants.servo import Servo
from rmrc.plants.stages import Encoders, Transmission, readings, transmission
from rmrc.plants.torque import Torque
from rmrc.scenario import Scenario

KINDS: Mapping[str, type[Plant]] = {kind.name: kind for kind in (Ideal, Servo, Torque, Model)}


class Hardware:
    """Plant and stages of a world.

    Attributes:
        plant: The plant.
        encoders: What the law reads.
        sent: The way of commands to the plant.
        stages: Both; what the world does not use does nothing.
        span: Number of past ticks that they read.
        is_direct: Whether the plant gets the commands of the law unchanged and without delay.
    """

    def __init__(self, scenario: Scenario, arm: Arm) -> None:
        """Bind them to a world.

        Args:
            scenario: Scenario of the world.
            arm: The arm that it names.
        """
        section = scenario.plant
        self._scenario = scenario
        self.plant = KINDS[section.kind](section, arm, scenario.control.period)
        self.encoders, self.sent = Encoders(scenario, arm), Transmission(scenario, arm)
        self.stages = self.encoders, self.sent
        self.span = max(math.ceil(self.encoders.delay), self.sent.span)
        self.is_direct = not self.sent.is_used

    @property
    def is_misled(self) -> bool:
        """Whether the law takes the arm to be somewhere else than it is."""
        return self.encoders.is_used

    @property
    def moves_q(self) -> bool:
        """Whether the law takes the joints, not only bodies and site, to be somewhere else than they are."""
        return self.encoders.moves_q

    @property
    def methods(self) -> Mapping[str, Method]:
        """The methods that a tick calls, by their fields in a world's record."""
        methods = {"obey": self.plant.obey}
        if self.is_misled:
            methods["readings"] = readings
        if not self.is_direct:
            methods["transmission"] = transmission
        return methods

    def chance(self) -> Callable[[int], Array] | None:
        """Return a function that draws the random numbers of so many further ticks, (T, n + 2), or None.

        They are n standard normal numbers for the encoders, and two from [0, 1) for the transport. Those of a
        tick depend on its number and the seeds alone: numpy draws the same in pieces as at once.
        """
        if not (self.encoders.is_noisy or self.sent.is_late):
            return None
        n, section = self.plant.arm.n, self._scenario
        noise, transport = (
            np.random.default_rng([seed, i])
            for i, seed in enumerate((section.arm.encoder.seed, section.plant.seed))
        )
        return lambda ticks: np.hstack([noise.standard_normal((ticks, n)), transport.random((ticks, 2))])

    def write(self, world: np.void) -> None:
        """Write the parameters of plant and stages."""
        self.plant.write(world)
        for stage in self.stages:
            stage.write(world["plant"])
