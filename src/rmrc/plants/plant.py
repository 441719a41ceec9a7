"""What a plant is: what turns commanded rates into motion, and what it asks of MuJoCo for that.

A plant is declared in `rmrc.scenario.choices.PLANTS`, and done by the module of its name here: by two
compiled functions, which a tick calls before and after the law, and by a class of `Plant`, of which every
world has an object. `rmrc.plants.kinds` finds it by its name.
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

# Fields of MuJoCo's model that one world has different, whole, by their names.
Difference: TypeAlias = Mapping[str, Array]

# Called before MuJoCo steps, with the numbers of the worlds that it will step, or None for all.
BeforeSteps: TypeAlias = Callable[[NDArray[np.intp] | None], None]


@dataclass(frozen=True, eq=False)
class Wired:
    """Worlds that are stepped together, as a plant finds them.

    Attributes:
        model: What they share.
        wiring: Of the arm in it.
        worlds: Their records, (w,).
        batch: MuJoCo's part.
        take: Returns another batch of the same worlds, each with differences of its own.
    """

    model: mujoco.MjModel
    wiring: Wiring
    worlds: NDArray[np.void]
    batch: Batch
    take: Callable[[Sequence[Difference]], Batch]


class Assumed(NamedTuple):
    """What a run has otherwise than the model's author wrote it.

    Attributes:
        text: In words.
        is_otherwise: Whether the author chose something else, or nothing.
    """

    text: str
    is_otherwise: bool


class Plant(ABC):
    """What obeys the rates of one world.

    Attributes:
        section: What the scenario says of it.
        arm: What is to be moved.
        period: Control period [s].
        name: As it is declared.
        sense: Compiled, (world, out, state, force): writes `out.q`, `out.qdot` and `out.tau`, from MuJoCo's
            state row and the forces of the last step.
        obey: Compiled, (world, out, state): brings `world.qdot_sent` into MuJoCo's state row.
        fields: Of the record of a world, those that `write` writes.
        memory: Those that the compiled functions keep for themselves, 0 at first.
        forces: The field of MjData that `sense` gets for the forces of the last step.
        stage: How far MuJoCo computes what follows from a new state: all that `sense` reads is fresh.
        batches: How many of MuJoCo's it takes at most.
        works_between: Whether `before_steps` returns anything: then MuJoCo's loop is left at each tick.
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
            section: What the scenario says of it.
            arm: What is to be moved.
            period: Control period [s].
        """
        self.section, self.arm, self.period = section, arm, period

    @property
    def has_physics(self) -> bool:
        """Whether MuJoCo steps it, with gravity, loads and torques."""
        return PLANTS[self.name].physics

    @property
    def compensates(self) -> bool:
        """Whether its drives take damping and dry friction of the joints out."""
        return False

    @property
    @abstractmethod
    def substeps(self) -> int:
        """MuJoCo's steps in a control period; 0 where it computes kinematics and nothing else."""

    @property
    def stretch(self) -> Mapping[str, float]:
        """Factors on the lengths of bodies as they are, by name: what the law knows times the rest."""
        known, secret = self.arm.stretch, self.section.stretch
        return {name: known.get(name, 1.0) * secret.get(name, 1.0) for name in {**known, **secret}}

    @property
    def shares(self) -> Hashable:
        """What worlds must have in common to be stepped together."""
        arm = self.arm
        return self.section.kind, arm.path, arm.site, arm.joints, arm.variant, arm.frees_others

    @classmethod
    @abstractmethod
    def model(cls, plants: Sequence[Self]) -> mujoco.MjModel:
        """Return the model that worlds share, one or more: see `Arm.adapted`."""

    def difference(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return what this world has different from the model that it shares with others.

        Args:
            model: As `model` returned it.
            wiring: Of the arm in it.
        """
        fields = self.known(model, wiring)
        return fields | stretched_fields(model, self.stretch) if self.section.stretch else fields

    def known(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return what of the difference is no secret."""
        del wiring
        return stretched_fields(model, self.arm.stretch)

    def write(self, world: np.void) -> None:  # noqa: B027 - not all have any
        """Write its own parameters into the record of its world."""

    @classmethod
    def before_steps(cls, plants: Sequence[Self], wired: Wired) -> BeforeSteps | None:
        """Return what is to be done before MuJoCo steps these worlds, or None if nothing is."""
        del plants, wired
        return None

    def assumed(self) -> Iterator[Assumed]:
        """Yield what it has otherwise than the model."""
        yield from ()

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield key and message of what it cannot do with this arm."""
        yield from ()

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield key and message of what is too much in a run of so many control ticks."""
        del ticks
        yield from ()
