"""What can be chosen, by name: the schema of a scenario, the law and the tables take the names from here."""

from enum import IntEnum, IntFlag


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
