"""The interface of plants: how they turn commanded rates into motion, and which parts of MuJoCo they use.

A plant is declared in `rmrc.scenario.choices.PLANTS`, implemented by the module of its name here, and listed
in `rmrc.plants.hardware`. The module has a class of `Plant`, with one object per world, and a method that a
tick calls after the law. New fields of a world's record stand in its group `plant`.
"""

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm, Wiring
from rmrc.arm.adapting import set_fields, stretched_fields
from rmrc.law.compiling import Array, Method
from rmrc.scenario import PlantSection
from rmrc.scenario.choices import PLANTS


class Assumed(NamedTuple):
    """A deviation of a run from the model as its author wrote it, or what its user left open.

    Attributes:
        text: Description.
        is_otherwise: Whether the author chose a different value, rather than none, or the run has a number
            that its user did not give.
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
        obey: Has MuJoCo obey `plant.qdot_sent`.
        begins: MuJoCo's function that computes all input of `sense` and of the law from a new state.
    """

    name: ClassVar[str]
    obey: ClassVar[Method]
    begins: ClassVar[str]

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
    def rubs(self) -> bool:
        """Whether there is friction that the model lacks, which no compensation includes."""
        friction = self.section.friction
        return bool(np.any(friction.coulomb) or np.any(friction.viscous))

    @property
    def carries_springs(self) -> NDArray[np.bool_]:
        """Joints whose springs do not hold it back: its actuators compensate them, (n,)."""
        return np.ones(self.arm.n, np.bool_)

    @property
    @abstractmethod
    def substeps(self) -> int:
        """MuJoCo's steps in a control period; 0 where it only computes kinematics."""

    @property
    def stretch(self) -> Mapping[str, float]:
        """Factors on the true lengths of bodies, by name: the known factors times the unknown."""
        known, secret = self.arm.stretch, self.section.stretch
        return {name: known.get(name, 1.0) * secret.get(name, 1.0) for name in {**known, **secret}}

    @abstractmethod
    def model(self) -> mujoco.MjModel:
        """Return the model that it shares with other worlds: see `Arm.adapted`."""

    def difference(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return the differences of this world from the model that it shares with others.

        Args:
            model: The model, as `model` returned it.
            wiring: Wiring of the arm in it.
        """
        return self.known(model, wiring) | stretched_fields(model, self.stretch)

    def own_model(self) -> mujoco.MjModel:
        """Return a copy of the model with the differences of this world, for a loop of your own."""
        shared = self.model()
        model = copy.copy(shared)
        set_fields(model, self.difference(shared, self.arm.wire(shared)))
        return model

    def known(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return the known part of the differences."""
        del wiring
        return stretched_fields(model, self.arm.stretch)

    def write(self, world: np.void) -> None:  # noqa: B027 - not all have any
        """Write its own parameters into the record of its world."""

    @property
    def knows_all(self) -> bool:
        """Whether the arm is the one whose dynamics the plant computes, if it computes any."""
        return True

    def wire(self, world: np.void, model: mujoco.MjModel, wiring: Wiring, data: mujoco.MjData) -> list[Any]:
        """Write what it needs of a model into its world's record.

        Args:
            world: The record; its `engine` knows the arm's joints.
            model: The model that it shares with others, without its differences.
            wiring: Wiring of the arm in it.
            data: Data at the start, whose kinematics are up to date; controls may be written.

        Returns:
            The tables whose addresses it has written, to be kept as long as the world.
        """
        del world, model, wiring, data
        return []

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
