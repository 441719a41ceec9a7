"""What can be chosen, by name: the schema of a scenario, the law and the tables take the names from here."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from functools import cached_property
from typing import Literal, NamedTuple


class Status(IntFlag):
    """What happened at a tick; several may hold at once."""

    OK = 0
    DAMPED = 1
    SLOWED = 2
    RATE_LIMITED = 4
    ACCELERATION_LIMITED = 8
    POSITION_LIMITED = 16
    SINGULAR = 32
    STOPPED = 64
    STUCK = 128


class Method(IntEnum):
    """The inverses: each a filter g(sigma), in `inverse`."""

    INVERSE = 0
    PSEUDOINVERSE = 1
    TRUNCATED = 2
    TRANSPOSE = 3
    DAMPED = 4
    FILTERED = 5
    SELECTIVELY_DAMPED = 6
    JPARSE = 7


class Schedule(IntEnum):
    """How the damping lambda of the method `damped` follows the arm, in `inverse`."""

    CONSTANT = 0
    MANIPULABILITY = 1
    SMALLEST_SINGULAR_VALUE = 2
    ERROR = 3
    RATE_BOUND = 4


class Objective(IntEnum):
    """What the null space is used for."""

    NONE = 0
    POSTURE = 1
    JOINT_LIMITS = 2
    MANIPULABILITY = 3
    RATES = 4
    SECONDARY = 5


class Priority(IntEnum):
    """How a second task is kept out of the first."""

    CLASSICAL = 0
    ROBUST = 1


class OnExcess(IntEnum):
    """What happens to rates beyond their limits."""

    NONE = 0
    SCALE = 1
    CLAMP = 2
    REDISTRIBUTE = 3


class AtSingularity(IntEnum):
    """What happens near a singularity."""

    DAMP = 0
    SLOW = 1
    STOP = 2


class Parameter(NamedTuple):
    """A number of a choice.

    Attributes:
        key: Its key in a section.
        meaning: As the schema tells it.
        default: None: null.
        unit: As the schema tells it.
        null: What null means, nan if only the arm knows; None: it may not be null.
        kind: A number > 0, or one for all joints or for each.
    """

    key: str
    meaning: str
    default: float | None
    unit: str
    null: float | None = None
    kind: Literal["number", "each"] = "number"


@dataclass(frozen=True)
class Plant:
    """What turns commanded rates into motion.

    Attributes:
        name: Its value in a scenario, and of its class in `rmrc.plants`.
        meaning: What it does.
        source: Keys of `docs/references.md`.
        parameters: That it alone reads.
        physics: Whether MuJoCo steps it, with gravity, loads and torques; else it has kinematics alone.
    """

    name: str
    meaning: str
    source: str = ""
    parameters: tuple[Parameter, ...] = ()
    physics: bool = True


@dataclass(frozen=True)
class Plants:
    """The plants; the code of each is its position."""

    default: str
    options: tuple[Plant, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(one.name for one in self.options)

    def __getitem__(self, name: str) -> Plant:
        """Return the one with a name."""
        return self.options[self.names.index(name)]

    @property
    def meaning(self) -> str:
        """What each of them does."""
        *others, last = (one.meaning for one in self.options)
        return f"{', '.join(others)}, or {last}"

    @property
    def parameters(self) -> Iterator[Parameter]:
        """What each has for itself."""
        return (parameter for one in self.options for parameter in one.parameters)

    @property
    def physical(self) -> str:
        """The names of those that MuJoCo steps."""
        return ", ".join(one.name for one in self.options if one.physics)


IDEAL = Plant("ideal", "exact integration of the rates", "Whitney72", physics=False)
SERVO = Plant(
    "servo", "joint-rate servos", "",
    (
        Parameter(
            "kv",
            "servo: torque or force for a given rate error, of all joints or of each; "
            "null: each joint's inertia at home over the timestep",
            None, "N·m·s/rad or N·s/m", null=math.nan, kind="each",
        ),
    ),
)  # fmt: skip
TORQUE = Plant(
    "torque", "computed torques", "Luh80",
    (Parameter("bandwidth", "torque: acceleration for a given rate error", 500.0, "1/s"),),
)  # fmt: skip

PLANTS = Plants("servo", (IDEAL, SERVO, TORQUE))
