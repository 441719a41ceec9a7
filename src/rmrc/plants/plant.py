"""The interface of plants: how they turn commanded rates into motion, and which parts of MuJoCo they use.

A plant is declared in `rmrc.scenario.choices.PLANTS` and implemented by the module of its name here: by two
compiled functions, which a tick calls before and after the law, and by a class of `Plant`, with one object
per world. `rmrc.plants.kinds` finds it by its name.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Self, TypeAlias

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from rmrc.arm import Arm, Wiring
from rmrc.arm.differences import stretched_fields
from rmrc.law.jit import Array
from rmrc.law.record import Field
from rmrc.scenario import PlantSection
from rmrc.scenario.choices import PLANTS

# Fields of MuJoCo's model that differ in one world, whole, by their names.
Difference: TypeAlias = Mapping[str, Array]

# Called before MuJoCo steps, with the numbers of the worlds to step, or None for all.
BeforeSteps: TypeAlias = Callable[[NDArray[np.intp] | None], None]


@dataclass(frozen=True, eq=False)
class Wired:
    """Worlds that are stepped together, as a plant sees them.

    Attributes:
        model: The model that they share.
        wiring: Wiring of the arm in it.
        worlds: Their records, (w,).
        batch: MuJoCo's part.
        take: Returns another batch of the same worlds, each with its own differences.
    """

    model: mujoco.MjModel
    wiring: Wiring
    worlds: NDArray[np.void]
    batch: Batch
    take: Callable[[Sequence[Difference]], Batch]


class Assumed(NamedTuple):
    """A deviation of a run from the model as its author wrote it.

    Attributes:
        text: Description.
        is_otherwise: Whether the author chose a different value, rather than none.
    """

    text: str
    is_otherwise: bool


class Plant(ABC):
    """The plant of one world, which obeys the rates.

    Attributes:
        section: The section `plant` of the scenario.
        arm: The arm that it moves.
        period: Control period [s].
        name: Its declared name.
        sense: Compiled, (world, out, state, force): writes `out.q`, `out.qdot` and `out.tau`, from MuJoCo's
            state row and the forces of the last step.
        obey: Compiled, (world, out, state): writes `world.qdot_sent` into MuJoCo's state row.
        fields: Fields of a world's record that `write` writes.
        memory: Fields that the compiled functions keep for themselves, 0 at first.
        forces: The field of MjData with the forces of the last step for `sense`.
        stage: How far MuJoCo computes the consequences of a new state, until all input of `sense` is current.
        batches: Largest number of MuJoCo batches that it takes.
        works_between: Whether `before_steps` returns anything: then MuJoCo's loop ends after each tick.
    """

    name: ClassVar[str]
    sense: ClassVar[Callable[..., None]]
    obey: ClassVar[Callable[..., None]]
    fields: ClassVar[tuple[Field, ...]] = ()
    memory: ClassVar[tuple[Field, ...]] = ()
    forces: ClassVar[str] = "actuator_force"
    stage: ClassVar[mujoco.mjtStage]
    batches: ClassVar[int] = 1
    works_between: ClassVar[bool] = False

    def __init__(self, section: PlantSection, arm: Arm, period: float) -> None:
        """Bind it to a world.

        Args:
            section: The section `plant` of the scenario.
            arm: The arm that it moves.
            period: Control period [s].
        """
        self.section, self.arm, self.period = section, arm, period

    @property
    def has_physics(self) -> bool:
        """Whether MuJoCo steps it, with gravity, loads and torques."""
        return PLANTS[self.name].physics

    @property
    def compensates(self) -> bool:
        """Whether its actuators compensate damping and dry friction of the joints."""
        return False

    @property
    @abstractmethod
    def substeps(self) -> int:
        """MuJoCo's steps in a control period; 0 where it only computes kinematics."""

    @property
    def stretch(self) -> Mapping[str, float]:
        """Factors on the true lengths of bodies, by name: the known factors times the unknown."""
        known, secret = self.arm.stretch, self.section.stretch
        return {name: known.get(name, 1.0) * secret.get(name, 1.0) for name in {**known, **secret}}

    @property
    def shares(self) -> Hashable:
        """The common properties of worlds that are stepped together."""
        arm = self.arm
        return self.section.kind, arm.path, arm.site, arm.joints, arm.variant, arm.frees_others

    @classmethod
    @abstractmethod
    def model(cls, plants: Sequence[Self]) -> mujoco.MjModel:
        """Return the model that one or more worlds share: see `Arm.adapted`."""

    def difference(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return the differences of this world from the model that it shares with others.

        Args:
            model: The model, as `model` returned it.
            wiring: Wiring of the arm in it.
        """
        fields = self.known(model, wiring)
        return fields | stretched_fields(model, self.stretch) if self.section.stretch else fields

    def known(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return the known part of the differences."""
        del wiring
        return stretched_fields(model, self.arm.stretch)

    def write(self, world: np.void) -> None:  # noqa: B027 - not all have any
        """Write its own parameters into the record of its world."""

    @classmethod
    def before_steps(cls, plants: Sequence[Self], wired: Wired) -> BeforeSteps | None:
        """Return a function to call before MuJoCo steps these worlds, or None."""
        del plants, wired
        return None

    def assumed(self) -> Iterator[Assumed]:
        """Yield its deviations from the model."""
        yield from ()

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield key and message of each feature that it lacks or that does not fit this arm."""
        yield from ()

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield key and message of each excess in a run of this many control ticks."""
        del ticks
        yield from ()
