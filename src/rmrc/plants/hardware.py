"""The hardware between commanded and sensed rates: plant and stages of a world."""

from collections.abc import Iterator

import numpy as np

from rmrc.arm import Arm
from rmrc.law.record import JOINTS, Field
from rmrc.plants.kinds import CLASSES, KINDS
from rmrc.plants.plant import Plant
from rmrc.plants.stage import Stage
from rmrc.plants.stages import STAGES
from rmrc.scenario import Scenario
from rmrc.scenario.choices import PLANTS

# Worlds of all plants, with and without stages, have records of one type, so that one tick is compiled.
_PARTS: tuple[type[Plant] | type[Stage], ...] = (*CLASSES, *STAGES)


class Hardware:
    """Plant and stages of a world; a Writer of their fields and of those of the other plants.

    Attributes:
        plant: The plant.
        stages: All stages, in order; those that the world does not use do nothing.
        memory: The fields that compiled functions keep from tick to tick, including the last rates sent.
    """

    fields = (
        Field("plant", np.int64),
        Field("is_sensed", np.int64),
        Field("is_sent", np.int64),
        *dict.fromkeys(field for part in _PARTS for field in part.fields),
    )
    memory = (
        Field("qdot_sent", size=(JOINTS,)),
        Field("true_error", size=(6,)),
        Field("true_error_2", start=np.nan),
        *dict.fromkeys(field for part in _PARTS for field in part.memory),
    )

    def __init__(self, scenario: Scenario, arm: Arm) -> None:
        """Bind them to a world.

        Args:
            scenario: Scenario of the world.
            arm: The arm that it names.
        """
        section = scenario.plant
        self.plant = KINDS[section.kind](section, arm, scenario.control.period)
        self.stages = tuple(stage(scenario, arm) for stage in STAGES)

    @property
    def span(self) -> int:
        """Number of past ticks that its stages read."""
        return max(stage.span for stage in self.stages)

    @property
    def is_misled(self) -> bool:
        """Whether the law takes the arm to be somewhere else than it is."""
        return any(stage.is_used for stage in self.stages if stage.slot == "sensed")

    @property
    def moves_q(self) -> bool:
        """Whether the law takes the joints, not only bodies and site, to be somewhere else than they are."""
        return any(stage.moves_q for stage in self.stages)

    @property
    def is_direct(self) -> bool:
        """Whether the plant gets the commands of the law unchanged and without delay."""
        return not any(stage.is_used for stage in self.stages if stage.slot == "sent")

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield key and message of each excess in a run of this many control ticks."""
        yield from self.plant.excesses(ticks)
        for stage in self.stages:
            yield from stage.excesses(ticks)

    def write(self, world: np.void) -> None:
        """Write the kind of plant, whether it has stages, and the parameters of all."""
        world["plant"] = PLANTS.names.index(self.plant.name)
        world["is_sensed"], world["is_sent"] = self.is_misled, not self.is_direct
        self.plant.write(world)
        for stage in self.stages:
            stage.write(world)
