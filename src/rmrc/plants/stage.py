"""Stages between law and plant: encoders before the law, the way of commands after it.

A stage changes the joint state that the law gets, `state.q` and `state.qdot`, or the command that the plant
gets, `plant.qdot_sent`. The true state and the law's command are recorded.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np

from rmrc.arm import Arm
from rmrc.scenario import Scenario

# No run has this many ticks, and compiled code counts them in 64 bits.
_NEVER = 2.0**52
# Decimal fractions such as 0.3/0.1 are off by some 1e-16: a whole number of ticks is one.
_ROUNDING = 1e-9


class Stage(ABC):
    """The stage of one world."""

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
    def span(self) -> int:
        """Number of past ticks that it reads."""
        return 0

    @abstractmethod
    def write(self, plant: np.void) -> None:
        """Write its parameters into the group `plant` of a world's record."""

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield key and message of each feature that does not fit this scenario."""
        yield from ()

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield key and message of each excess in a run of this many control ticks."""
        del ticks
        yield from ()


def in_ticks(time: float, period: float) -> float:
    """Return a time [s] in ticks of a period [s]: a whole number if it is one up to rounding."""
    ticks = min(time / period, _NEVER)
    return float(round(ticks)) if abs(ticks - round(ticks)) <= _ROUNDING * ticks else ticks
