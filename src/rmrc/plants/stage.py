"""What a stage is: what stands between law and plant, in the worlds that have it.

A stage of the slot `sensed` changes what the law is told of the joints, `world.q` and `world.qdot`: the law
then takes the arm to be there. One of the slot `sent` changes what the plant is told, `world.qdot_sent`. The
truth is recorded, and what the law commanded; a stage may look back at it. A stage is a compiled function and
a class of `Stage`, in a module that says what it stands for; `rmrc.plants.stages` has them in order.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import ClassVar, Literal

import numpy as np

from rmrc.arm import Arm
from rmrc.law.record import Field
from rmrc.scenario import Scenario

# No run has so many ticks, and compiled code counts them in 64 bits.
_NEVER = 2.0**52
# Decimal fractions such as 0.3/0.1 are off by some 1e-16: a whole number of ticks is one.
_ROUNDING = 1e-9


class Stage(ABC):
    """A stage of one world.

    Attributes:
        slot: Whether it changes what is sensed, before the law, or what is sent, after it.
        uses: The field of a record that says whether its world has it.
        change: Compiled, (world, out, past, t): does what it does at tick t, whose record is `out`; that of
            an earlier tick k is `past[k % len(past)]`.
        fields: Of the record of a world, those that `write` writes; `uses` is one of them.
        memory: Those that `change` keeps for itself.
    """

    slot: ClassVar[Literal["sensed", "sent"]]
    uses: ClassVar[str]
    change: ClassVar[Callable[..., None]]
    fields: ClassVar[tuple[Field, ...]]
    memory: ClassVar[tuple[Field, ...]] = ()

    def __init__(self, scenario: Scenario, arm: Arm) -> None:
        """Bind it to a world.

        Args:
            scenario: Of the world.
            arm: That it names.
        """
        self.scenario, self.arm = scenario, arm

    @property
    @abstractmethod
    def is_used(self) -> bool:
        """Whether its world has it."""

    @property
    def moves_q(self) -> bool:
        """Whether the law then takes the joints to be elsewhere than they are."""
        return self.is_used and self.slot == "sensed"

    @property
    def span(self) -> int:
        """How many ticks back it looks."""
        return 0

    @abstractmethod
    def write(self, world: np.void) -> None:
        """Write its parameters into the record of its world."""

    @abstractmethod
    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield key and message of what it cannot do in this scenario."""

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield key and message of what is too much in a run of so many control ticks."""
        del ticks
        yield from ()


def in_ticks(time: float, period: float) -> float:
    """Return a time [s] in ticks of a period [s]: a whole number where it is one but for rounding."""
    ticks = min(time / period, _NEVER)
    return float(round(ticks)) if abs(ticks - round(ticks)) <= _ROUNDING * ticks else ticks


def refuse_unseen(stage: Stage, key: str) -> Iterator[tuple[str, str]]:
    """Yield what needs the law to see the arm as it is, for a key by which it does not.

    Args:
        stage: Which changes what is sensed.
        key: That has it do so.
    """
    arm, nullspace = stage.arm, stage.scenario.control.nullspace
    sites = [arm.site]
    if nullspace.objective == "secondary" and (nullspace.secondary.site or arm.site) in arm.sites:
        sites.append(nullspace.secondary.site or arm.site)
    for joint in dict.fromkeys(joint for site in sites for joint in arm.idle_before(site)):
        yield (
            key,
            f'joint "{joint}" of {arm.path} moves the site and is not driven, so that what the law believes '
            f"does not say where the site is; drive it, or leave {key} out",
        )
