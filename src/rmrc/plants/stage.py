"""The interface of stages: effects between law and plant, in the worlds that use them.

A stage of the slot `sensed` changes the joint state that the law gets, `world.q` and `world.qdot`, and the
law takes the arm to be there. A stage of the slot `sent` changes the command that the plant gets,
`world.qdot_sent`. The true state and the law's command are recorded; a stage may read past ones. A stage is a
compiled function and a class of `Stage`, in a module of their own; `rmrc.plants.stages` lists them in order.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import ClassVar, Literal

import numpy as np

from rmrc.arm import Arm
from rmrc.law.record import Field
from rmrc.scenario import Scenario

# No run has this many ticks, and compiled code counts them in 64 bits.
_NEVER = 2.0**52
# Decimal fractions such as 0.3/0.1 are off by some 1e-16: a whole number of ticks is one.
_ROUNDING = 1e-9


class Stage(ABC):
    """A stage of one world.

    Attributes:
        slot: Whether it changes the sensed state, before the law, or the command sent, after it.
        uses: The field of a record that is set if its world uses the stage.
        change: Compiled, (world, out, past, t): acts at tick t, whose record is `out`; the record of an
            earlier tick k is `past[k % len(past)]`.
        fields: Fields of a world's record that `write` writes, including `uses`.
        memory: Fields that `change` keeps for itself.
    """

    slot: ClassVar[Literal["sensed", "sent"]]
    uses: ClassVar[str]
    change: ClassVar[Callable[..., None]]
    fields: ClassVar[tuple[Field, ...]]
    memory: ClassVar[tuple[Field, ...]] = ()

    def __init__(self, scenario: Scenario, arm: Arm) -> None:
        """Bind it to a world.

        Args:
            scenario: Scenario of the world.
            arm: The arm that it names.
        """
        self.scenario, self.arm = scenario, arm

    @property
    @abstractmethod
    def is_used(self) -> bool:
        """Whether its world uses it."""

    @property
    def moves_q(self) -> bool:
        """Whether the law then takes the joints to be elsewhere than they are."""
        return self.is_used and self.slot == "sensed"

    @property
    def span(self) -> int:
        """Number of past ticks that it reads."""
        return 0

    @abstractmethod
    def write(self, world: np.void) -> None:
        """Write its parameters into the record of its world."""

    @abstractmethod
    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield key and message of each feature that does not fit this scenario."""

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield key and message of each excess in a run of this many control ticks."""
        del ticks
        yield from ()


def in_ticks(time: float, period: float) -> float:
    """Return a time [s] in ticks of a period [s]: a whole number if it is one up to rounding."""
    ticks = min(time / period, _NEVER)
    return float(round(ticks)) if abs(ticks - round(ticks)) <= _ROUNDING * ticks else ticks


def refuse_unseen(stage: Stage, key: str) -> Iterator[tuple[str, str]]:
    """Yield features that need a law that senses the arm as it is, for a key that prevents this.

    Args:
        stage: The stage that changes the sensed state.
        key: The key that enables it.
    """
    arm, nullspace = stage.arm, stage.scenario.control.nullspace
    sites = [arm.site]
    if nullspace.objective == "secondary" and (nullspace.secondary.site or arm.site) in arm.sites:
        sites.append(nullspace.secondary.site or arm.site)
    for joint in dict.fromkeys(joint for site in sites for joint in arm.idle_before(site)):
        yield (
            key,
            f'joint "{joint}" of {arm.path} moves the site and is not actuated, so the law cannot compute '
            f"the pose of the site; actuate it, or leave {key} out",
        )
