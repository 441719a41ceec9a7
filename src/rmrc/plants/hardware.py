"""What is between the rates that the law commands and those that it senses: plant and stages of a world."""

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

# Worlds of all plants, with all stages and with none, have records of one type: so one tick is compiled.
_PARTS: tuple[type[Plant] | type[Stage], ...] = (*CLASSES, *STAGES)


class Hardware:
    """Plant and stages of a world; a Writer of their fields, those of other plants among them.

    Attributes:
        plant: What obeys.
        stages: All there are, in order: those that its world does not have do nothing.
        memory: What compiled functions keep from tick to tick, the rates that were sent last among it.
    """

    fields = (
        Field("plant", np.int64),
        Field("is_sensed", np.int64),
        Field("is_sent", np.int64),
        *dict.fromkeys(field for part in _PARTS for field in part.fields),
    )
    memory = (
        Field("qdot_sent", size=(JOINTS,)),
        *dict.fromkeys(field for part in _PARTS for field in part.memory),
    )

    def __init__(self, scenario: Scenario, arm: Arm) -> None:
        """Bind them to a world.

        Args:
            scenario: Of the world.
            arm: That it names.
        """
        section = scenario.plant
        self.plant = KINDS[section.kind](section, arm, scenario.control.period)
        self.stages = tuple(stage(scenario, arm) for stage in STAGES)

    @property
    def span(self) -> int:
        """How many ticks back its stages look."""
        return max(stage.span for stage in self.stages)

    @property
    def is_misled(self) -> bool:
        """Whether the law takes the arm to be elsewhere than it is."""
        return any(stage.is_used for stage in self.stages if stage.slot == "sensed")

    @property
    def moves_q(self) -> bool:
        """Whether the law takes the joints to be elsewhere than they are, and not only bodies and site."""
        return any(stage.moves_q for stage in self.stages)

    @property
    def is_direct(self) -> bool:
        """Whether the plant is told what the law commands, at once."""
        return not any(stage.is_used for stage in self.stages if stage.slot == "sent")

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield key and message of what is too much in a run of so many control ticks."""
        yield from self.plant.excesses(ticks)
        for stage in self.stages:
            yield from stage.excesses(ticks)

    def write(self, world: np.void) -> None:
        """Write which plant it is, whether it has stages, and the parameters of all."""
        world["plant"] = PLANTS.names.index(self.plant.name)
        world["is_sensed"], world["is_sent"] = self.is_misled, not self.is_direct
        self.plant.write(world)
        for stage in self.stages:
            stage.write(world)
