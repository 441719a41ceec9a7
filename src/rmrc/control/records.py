"""What the compiled law reads and writes: one record a world, one record a tick.

Both are numpy structured types, so that a world's parameters have names in compiled code and the law
of all worlds takes one argument instead of fifty. Vectors over joints are padded to a capacity: arms
of up to eight joints share one compiled law.
"""

from enum import IntEnum, IntFlag
from functools import cache

import numpy as np

ROWS = 6  # a twist has six rows, so a task has at most as many, and so has sigma
CAPACITY = 8  # joints of the smallest record; larger arms get the next power of two


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


class Method(IntEnum):
    """The inverses: each a filter g(sigma)."""

    INVERSE = 0
    PSEUDOINVERSE = 1
    DAMPED = 2


class Schedule(IntEnum):
    """How the damping lambda follows the singular values."""

    CONSTANT = 0
    SMALLEST_SINGULAR_VALUE = 1


class Objective(IntEnum):
    """What the null space is used for."""

    NONE = 0
    POSTURE = 1


class OnExcess(IntEnum):
    """What happens to rates beyond their limits."""

    NONE = 0
    SCALE = 1
    CLAMP = 2


def capacity(n: int) -> int:
    """Return the number of joints that the records of an n-joint arm hold.

    >>> capacity(2), capacity(8), capacity(9)
    (8, 8, 16)
    """
    return max(CAPACITY, 1 << (n - 1).bit_length())


def world_type(n: int) -> np.dtype[np.void]:
    """Return the record of one world with n joints: wiring, parameters, measurement, memory."""
    return _world_type(capacity(n))


def tick_type(n: int) -> np.dtype[np.void]:
    """Return the record of one tick of one world: what a run's columns are cut from."""
    return _tick_type(capacity(n))


# Cached, so that equal types are one object: a call of compiled code compares the types of its arguments,
# which takes longer than the law when it has to look into them.
@cache
def _world_type(c: int) -> np.dtype[np.void]:
    return np.dtype(
        [
            # sizes: joints, task rows, singular values
            ("n", np.int64), ("m", np.int64), ("k", np.int64),
            # life: its reference, number of ticks, the tick at which it diverged or -1, and the joint
            ("reference", np.int64), ("ticks", np.int64),
            ("diverged", np.int64), ("diverged_joint", np.int64),
            # wiring: MuJoCo's ids, and columns of the state row
            ("joint", np.int64, (c,)), ("is_slide", np.int64, (c,)), ("dof", np.int64, (c,)),
            ("actuator", np.int64, (c,)), ("site", np.int64), ("body", np.int64),
            ("qpos_column", np.int64, (c,)), ("qvel_column", np.int64, (c,)),
            ("ctrl_column", np.int64, (c,)), ("wrench_column", np.int64),
            # task: rows of the twist that count, S_x and S_q
            ("row", np.int64, (ROWS,)), ("row_scale", np.float64, (ROWS,)),
            ("joint_scale", np.float64, (c,)),
            # control
            ("period", np.float64), ("feedback", np.float64), ("feedforward", np.float64),
            ("method", np.int64), ("tolerance", np.float64),
            ("schedule", np.int64), ("damping_maximum", np.float64), ("damping_below", np.float64),
            ("objective", np.int64), ("objective_gain", np.float64), ("posture", np.float64, (c,)),
            ("rate_limit", np.float64, (c,)), ("on_excess", np.int64),
            # plant
            ("plant", np.int64), ("bandwidth", np.float64), ("wrench", np.float64, (6,)),
            ("lever", np.float64, (3,)),
            # measurement
            ("q", np.float64, (c,)), ("qdot", np.float64, (c,)), ("pose", np.float64, (7,)),
            ("J", np.float64, (ROWS, c)),
            # memory from tick to tick: vectors of the decomposition, last command
            ("u", np.float64, (ROWS, c)), ("v", np.float64, (ROWS, c)),
            ("qdot_cmd_last", np.float64, (c,)), ("age", np.int64),
            # scratch of one tick
            ("twist_cmd", np.float64, (6,)), ("task", np.float64, (ROWS,)),
            ("A", np.float64, (ROWS, c)), ("qdot0", np.float64, (c,)), ("qddot", np.float64, (c,)),
        ]
    )  # fmt: skip


@cache
def _tick_type(c: int) -> np.dtype[np.void]:
    return np.dtype(
        [
            ("time", np.float64),
            ("q", np.float64, (c,)), ("qdot", np.float64, (c,)), ("qdot_cmd", np.float64, (c,)),
            ("pose", np.float64, (7,)), ("pose_ref", np.float64, (7,)),
            ("twist_ref", np.float64, (6,)), ("pose_error", np.float64, (6,)),
            ("sigma", np.float64, (ROWS,)), ("gain", np.float64, (ROWS,)),
            ("damping", np.float64), ("manipulability", np.float64), ("condition", np.float64),
            ("u_min", np.float64, (6,)), ("v_min", np.float64, (c,)),
            ("tau", np.float64, (c,)), ("status", np.int64),
        ]
    )  # fmt: skip
