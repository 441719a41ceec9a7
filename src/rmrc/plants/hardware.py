"""The hardware between commanded and sensed rates: plant and stages of a world."""

from collections.abc import Iterator, Mapping

import numpy as np

from rmrc.arm import Arm
from rmrc.law.compiling import Method
from rmrc.plants.ideal import Ideal
from rmrc.plants.model import Model
from rmrc.plants.plant import Plant
from rmrc.plants.sensing import Encoders, Integral, readings
from rmrc.plants.servo import Servo
from rmrc.plants.stage import Stage
from rmrc.plants.torque import Torque
from rmrc.plants.transmission import Backlash, Lag, Resonance, Transport, transmission
from rmrc.scenario import Scenario
from rmrc.scenario.choices import PLANTS

KINDS: Mapping[str, type[Plant]] = {kind.name: kind for kind in (Ideal, Servo, Torque, Model)}
if KINDS.keys() != set(PLANTS.names):
    raise ImportError(f"plants are declared as {PLANTS.names}, and implemented as {tuple(KINDS)}")


class Hardware:
    """Plant and stages of a world.

    Attributes:
        plant: The plant.
        encoders: What the law reads.
        integral: What the law may use in their place.
        sent: The stages between command and plant, in order.
    """

    def __init__(self, scenario: Scenario, arm: Arm) -> None:
        """Bind them to a world.

        Args:
            scenario: Scenario of the world.
            arm: The arm that it names.
        """
        section = scenario.plant
        self.plant = KINDS[section.kind](section, arm, scenario.control.period)
        self.encoders, self.integral = Encoders(scenario, arm), Integral(scenario, arm)
        self.sent = tuple(stage(scenario, arm) for stage in (Transport, Lag, Resonance, Backlash))

    @property
    def stages(self) -> tuple[Stage, ...]:
        """All stages; those that the world does not use do nothing."""
        return (self.encoders, self.integral, *self.sent)

    @property
    def span(self) -> int:
        """Number of past ticks that its stages read."""
        return max(stage.span for stage in self.stages)

    @property
    def is_misled(self) -> bool:
        """Whether the law takes the arm to be somewhere else than it is."""
        return self.encoders.is_used or self.integral.is_used

    @property
    def moves_q(self) -> bool:
        """Whether the law takes the joints, not only bodies and site, to be somewhere else than they are."""
        return self.encoders.moves_q or self.integral.is_used

    @property
    def is_direct(self) -> bool:
        """Whether the plant gets the commands of the law unchanged and without delay."""
        return not any(stage.is_used for stage in self.sent)

    @property
    def methods(self) -> Mapping[str, Method]:
        """The methods that a tick calls, by their fields in a world's record."""
        methods = {"sense": self.plant.sense, "obey": self.plant.obey}
        if self.is_misled:
            methods["readings"] = readings
        if not self.is_direct:
            methods["transmission"] = transmission
        return methods

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield key and message of each excess in a run of this many control ticks."""
        yield from self.plant.excesses(ticks)
        for stage in self.stages:
            yield from stage.excesses(ticks)

    def write(self, world: np.void) -> None:
        """Write the parameters of plant and stages."""
        self.plant.write(world)
        for stage in self.stages:
            stage.write(world["plant"])
