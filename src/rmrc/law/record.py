"""What the compiled law reads and writes: one record a world, one record a tick.

Both are numpy structured types, so that a world's parameters have names in compiled code and the law
of all worlds takes one argument instead of fifty. Vectors over joints are padded to a capacity: arms
of up to eight joints share one compiled law.
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

ROWS = 6  # a twist has six rows, so a task has at most as many, and so has sigma
JOINTS = -1  # in the size of a field: as many as the record holds
CAPACITY = 8  # joints of the smallest record; larger arms get the next power of two


class Field(NamedTuple):
    """A field of a world's record, as its owner declares it.

    Attributes:
        name: As compiled code reads it.
        kind: `np.float64` or `np.int64`: every field takes whole words, so that none is misaligned.
        size: Its shape, of numbers, ROWS and JOINTS; () of a single value.
        start: What it holds before anything is written.

    >>> Field("position_limit", size=(2, JOINTS))
    Field(name='position_limit', kind=<class 'numpy.float64'>, size=(2, -1), start=0.0)
    """

    name: str
    kind: type[np.float64 | np.int64] = np.float64
    size: tuple[int, ...] = ()
    start: float = 0.0


class Writer(Protocol):
    """Who owns fields of a world's record: no one else writes them before the first tick."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """All that `write` writes, the same for every object of its class."""
        ...

    def write(self, world: np.void) -> None:
        """Write its own fields of one record, which hold their `start`; what is beyond n joints stays."""
        ...


def records(n: int, *worlds: Sequence[Writer]) -> NDArray[np.void]:
    """Return the records of worlds with n joints, (w,), as their Writers fill them.

    Args:
        n: Number of joints.
        worlds: The Writers of each world: of the same classes, in the same order.

    Raises:
        ValueError: Two Writers own the same field.
    """
    fields = tuple(field for writer in worlds[0] for field in writer.fields)
    made = np.zeros(len(worlds), composed(capacity(n), fields))
    for field in fields:
        if field.start:
            made[field.name] = field.start
    for world, writers in zip(made, worlds, strict=True):
        for writer in writers:
            writer.write(world)
    return made


# Cached, so that equal types are one object: a call of compiled code compares the types of its arguments,
# which takes longer than the law when it has to look into them.
@cache
def composed(c: int, fields: tuple[Field, ...]) -> np.dtype[np.void]:
    """Return the type of a record that holds c joints.

    Raises:
        ValueError: Two fields have the same name.
    """
    return np.dtype(
        [(f.name, f.kind, tuple(c if size == JOINTS else size for size in f.size)) for f in fields]
    )


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
            # sizes: joints, task rows, singular values; the rank of the task almost everywhere
            ("n", np.int64), ("m", np.int64), ("k", np.int64), ("rank", np.int64),
            # life: its reference and how many ticks that has, number of ticks to run at most, the tick at
            # which it diverged or -1, and the joint
            ("reference", np.int64), ("path_ticks", np.int64), ("ticks", np.int64),
            ("diverged", np.int64), ("diverged_joint", np.int64),
            # wiring: MuJoCo's ids, and columns of the state row; of a task's record, `joint` is the row of
            # `axis` and `anchor`
            ("joint", np.int64, (c,)), ("is_slide", np.int64, (c,)), ("pitch", np.float64, (c,)),
            ("dof", np.int64, (c,)),
            ("actuator", np.int64, (c,)), ("site", np.int64), ("body", np.int64),
            ("qpos_column", np.int64, (c,)), ("qvel_column", np.int64, (c,)),
            ("ctrl_column", np.int64, (c,)), ("wrench_column", np.int64),
            ("travel_column", np.int64, (c,)), ("travel_ratio", np.float64, (c,)),
            # task: rows of the twist that count, S_x and S_q
            ("row", np.int64, (ROWS,)), ("row_scale", np.float64, (ROWS,)),
            ("joint_scale", np.float64, (c,)),
            # control
            ("period", np.float64), ("feedback", np.float64), ("feedforward", np.float64),
            ("method", np.int64), ("tolerance", np.float64), ("cutoff", np.float64), ("gamma", np.float64),
            ("rate_bound", np.float64),
            ("schedule", np.int64), ("damping_maximum", np.float64), ("damping_below", np.float64),
            ("manipulability_below", np.float64), ("error_gain", np.float64),
            ("objective", np.int64), ("objective_gain", np.float64), ("posture", np.float64, (c,)),
            ("wished", np.float64, (c,)), ("position_range", np.float64, (2, c)),
            ("at_singularity", np.int64), ("slow_change", np.float64), ("slow_patience", np.float64),
            ("stop_sigma", np.float64), ("stop_condition", np.float64), ("stop_change", np.float64),
            # limits
            ("on_excess", np.int64), ("rate_limit", np.float64, (c,)),
            ("acceleration_limit", np.float64, (c,)), ("braking", np.float64, (c,)),
            ("position_limit", np.float64, (2, c)),
            # second task: its site, rows, scales, and the joints that move it
            ("m_2", np.int64), ("site_2", np.int64), ("moves_2", np.int64, (c,)),
            ("row_2", np.int64, (ROWS,)), ("row_scale_2", np.float64, (ROWS,)),
            ("pose_ref_2", np.float64, (7,)), ("feedback_2", np.float64), ("priority", np.int64),
            ("damping_2", np.float64),
            # plant
            ("plant", np.int64), ("qdot_sent", np.float64, (c,)),
            ("bandwidth", np.float64), ("sent_before", np.float64, (c,)), ("wrench", np.float64, (6,)),
            ("lever", np.float64, (3,)),
            # encoders: whether they are off, and by how much
            ("is_off", np.int64), ("encoder_offset", np.float64, (c,)),
            # geometry of the arm at 0, and its axes where it is: only where kinematics are not MuJoCo's
            ("zero_axis", np.float64, (c, 3)), ("zero_step", np.float64, (c, 3)),
            ("tip_step", np.float64, (3,)), ("tip_quat", np.float64, (4,)),
            ("axis", np.float64, (c, 3)), ("anchor", np.float64, (c, 3)),
            # measurement
            ("q", np.float64, (c,)), ("qdot", np.float64, (c,)), ("pose", np.float64, (7,)),
            ("J", np.float64, (ROWS, c)), ("pose_2", np.float64, (7,)), ("J_2", np.float64, (ROWS, c)),
            # memory from tick to tick: vectors of the decomposition, last command, ticks of the path behind
            # it, its pace and the fastest within the rate limits, how fast that fell, share of the rates
            # left, how long the site has stood still while it should move
            ("u", np.float64, (ROWS, c)), ("v", np.float64, (ROWS, c)), ("age", np.int64),
            ("v_last", np.float64, (c,)),
            ("qdot_cmd_last", np.float64, (c,)), ("path_tick", np.float64),
            ("pace", np.float64), ("fastest", np.float64), ("falling", np.float64), ("waited", np.float64),
            ("share", np.float64), ("still", np.float64),
            # scratch of one tick: the task; bounds and parts of the rates; a second decomposition, of what is
            # left of A for a second task, or for the joints that are not saturated
            ("twist_cmd", np.float64, (6,)), ("task", np.float64, (ROWS,)), ("asked", np.float64, (ROWS,)),
            ("error", np.float64),
            ("A", np.float64, (ROWS, c)), ("qdot0", np.float64, (c,)), ("qddot", np.float64, (c,)),
            ("lower", np.float64, (c,)), ("upper", np.float64, (c,)), ("held", np.float64, (c,)),
            ("rest_lower", np.float64, (c,)), ("rest_upper", np.float64, (c,)), ("fade", np.float64, (c,)),
            ("drift", np.float64, (c,)), ("best", np.float64, (c,)),
            ("part_a", np.float64, (c,)), ("part_b", np.float64, (c,)),
            ("work", np.float64, (c,)), ("error_2", np.float64, (6,)),
            ("B", np.float64, (ROWS, c)), ("task_B", np.float64, (ROWS,)), ("asked_B", np.float64, (ROWS,)),
            ("sigma_B", np.float64, (ROWS,)),
            ("gain_B", np.float64, (ROWS,)), ("u_B", np.float64, (ROWS, c)), ("v_B", np.float64, (ROWS, c)),
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
            ("tau", np.float64, (c,)), ("path_time", np.float64), ("path_rate", np.float64),
            ("secondary_error", np.float64), ("secondary_sigma", np.float64), ("status", np.int64),
        ]
    )  # fmt: skip
