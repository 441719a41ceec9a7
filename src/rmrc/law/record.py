"""The data that the compiled law reads and writes: one record per world, one record per tick.

Both are numpy structured types: a world's parameters have names in compiled code, and the law of all worlds
takes one argument instead of fifty. Vectors over joints are padded to a capacity: arms of up to eight joints
share one compiled law.

A world's record consists of the fields of its Writers and of the fields that the law measures, remembers and
computes. Each Writer owns some fields and fills them before the first tick. Worlds of runs and of controllers
begin alike, with the fields that the law uses. The record is flat: with nested records the law takes up to
1.8 times as long.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

ROWS = 6  # a twist has six rows; a task, and so sigma, has at most as many
JOINTS = -1  # in the size of a field: the number of joints that the record holds
CHAIN = -2  # the number of axes of the chain: more than joints, where some follow others
# Rows of a chain, per axis: half its angle and its way along itself, per position of its joint; the axis, and
# the step from the one before, at 0; 1 if it turns or 0; its way per radian, or 1 if it slides.
HALF, ALONG, AXIS, STEP, TURNS, ADVANCE, ROWS_OF_CHAIN = 0, 1, 2, 5, 8, 9, 10
CAPACITY = 8  # joints of the smallest record; larger arms get the next power of two
# The last field of the Writer of a law. MEASUREMENT to ADDRESSES follow, and then what not all laws have.
LAST = "period"


class Field(NamedTuple):
    """A field of a world's record, as its owner declares it.

    Attributes:
        name: Name in compiled code.
        kind: `np.float64` or `np.int64`: every field takes whole words, so that none is misaligned.
        size: Its shape, made of numbers, ROWS, JOINTS and CHAIN; () of a single value.
        start: Its initial value.

    >>> Field("position_limit", size=(2, JOINTS))
    Field(name='position_limit', kind=<class 'numpy.float64'>, size=(2, -1), start=0.0)
    """

    name: str
    kind: type[np.float64 | np.int64] = np.float64
    size: tuple[int, ...] = ()
    start: float = 0.0


class Writer(Protocol):
    """An owner of fields of a world's record: nothing else writes them before the first tick."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """All fields that `write` writes, the same for every object of its class."""
        ...

    def write(self, world: np.void) -> None:
        """Write its own fields of one record, which hold their `start`; entries beyond n joints stay."""
        ...


# The measurement of the arm at a tick: by MuJoCo, by its own chain, or by the caller.
MEASUREMENT = (
    Field("q", size=(JOINTS,)), Field("qdot", size=(JOINTS,)),
    Field("pose", size=(7,)), Field("J", size=(ROWS, JOINTS)),
    Field("pose_2", size=(7,)), Field("J_2", size=(ROWS, JOINTS)),
    Field("columns", size=(ROWS, CHAIN)), Field("columns_2", size=(ROWS, CHAIN)),
)  # fmt: skip

# Memory from tick to tick: vectors of the decomposition; the last command, its change, and the course from
# which the next change starts; how far the joint lags behind its wish, and the change of that; its position
# if it had obeyed since it strayed; sums that give its lag. Then ticks of the path so far, its pace, the
# fastest pace within the rate limits and its fall, the share of the rates left; how long the site has stood
# still while it should move; the joints that were held at their bounds, and when.
MEMORY = (
    Field("u", size=(ROWS, JOINTS)), Field("v", size=(ROWS, JOINTS)), Field("age", np.int64),
    Field("v_last", size=(JOINTS,)), Field("qdot_cmd_last", size=(JOINTS,)),
    Field("change_last", size=(JOINTS,)), Field("course", size=(JOINTS,)), Field("lag", size=(JOINTS,)),
    Field("slope", size=(JOINTS,)), Field("q_sent", size=(JOINTS,), start=math.nan),
    Field("behind", size=(4, JOINTS)), Field("path_tick"), Field("pace", start=1.0), Field("fastest"),
    Field("falling"), Field("waited"), Field("share", start=1.0), Field("still"),
    Field("active", size=(JOINTS,)), Field("active_age", np.int64),
)  # fmt: skip

# Scratch of one tick: axes of the arm's own chain, and their anchors; the task, with the twist wanted along
# the axes of its frame; bounds and parts of the rates; a second decomposition, of the remaining A for a
# second task, or for the joints that are not saturated.
SCRATCH = (
    Field("outward", size=(6, CHAIN)), Field("axis_rate", size=(CHAIN,)),
    Field("twist_task", size=(6,)), Field("twist_cmd", size=(6,)),
    Field("task", size=(ROWS,)), Field("asked", size=(ROWS,)), Field("error"),
    Field("A", size=(ROWS, JOINTS)), Field("angles", size=(ROWS, JOINTS)), Field("qdot0", size=(JOINTS,)),
    Field("lower", size=(JOINTS,)), Field("upper", size=(JOINTS,)), Field("held", size=(JOINTS,)),
    Field("rest_lower", size=(JOINTS,)), Field("rest_upper", size=(JOINTS,)), Field("fade", size=(JOINTS,)),
    Field("drift", size=(JOINTS,)), Field("best", size=(JOINTS,)),
    Field("part_a", size=(JOINTS,)), Field("part_b", size=(JOINTS,)),
    Field("wish", size=(JOINTS,)), Field("kept", size=(JOINTS,)), Field("group", np.int64, (JOINTS,)),
    Field("strayed", np.int64, (JOINTS,)), Field("coast", size=(JOINTS,)),
    Field("work", size=(JOINTS,)), Field("error_2", size=(6,)),
    Field("B", size=(ROWS, JOINTS)), Field("task_B", size=(ROWS,)), Field("asked_B", size=(ROWS,)),
    Field("sigma_B", size=(ROWS,)), Field("gain_B", size=(ROWS,)),
    Field("u_B", size=(ROWS, JOINTS)), Field("v_B", size=(ROWS, JOINTS)),
    Field("direction", size=(ROWS,)), Field("missing", size=(ROWS,)), Field("pull", size=(ROWS,)),
    Field("magnitude", size=(ROWS,)),
    # the metric of the joints: their axes, poses of their links, the inertias that these carry, its factors
    Field("axis", size=(CHAIN, 3)), Field("anchor", size=(CHAIN, 3)),
    Field("turn", size=(CHAIN, 4)), Field("point", size=(3,)), Field("half_turned", size=(3, 3)),
    Field("moving_mass", size=(CHAIN,)), Field("moving_moment", size=(CHAIN, 3)),
    Field("moving_inertia", size=(CHAIN, 3, 3)),
    Field("link_twist", size=(CHAIN, 6)), Field("link_momentum", size=(CHAIN, 6)),
    Field("metric", size=(JOINTS, JOINTS)), Field("root", size=(JOINTS, JOINTS)),
    Field("root_B", size=(JOINTS, JOINTS)), Field("shape", size=(JOINTS,)), Field("sway", size=(JOINTS,)),
    # singular values that must not fall faster: gradients, bounds, shortfalls, and multipliers
    Field("slopes", size=(ROWS, JOINTS)), Field("barrier", size=(ROWS, JOINTS)),
    Field("least", size=(ROWS,)), Field("need", size=(ROWS,)), Field("push", size=(ROWS,)),
)  # fmt: skip

# Addresses in this process of machine code that only some worlds need (`rmrc.law.jit.apart`), or few ticks.
ADDRESSES = tuple(
    Field(f"call_{name}", np.int64)
    for name in (
        "metric", "damping", "gains", "null_space", "objective", "policy", "hold_off", "limits", "eased",
        "rest_bounds", "best", "rest", "sharpen", "late", "way", "frame_error",
        "frame",
    )
)  # fmt: skip

TICK = (
    Field("time"), Field("q", size=(JOINTS,)), Field("q_believed", size=(JOINTS,)),
    Field("qdot", size=(JOINTS,)), Field("qdot_cmd", size=(JOINTS,)),
    Field("qdot_arrived", size=(JOINTS,)), Field("qdot_plain", size=(JOINTS,)),
    Field("pose", size=(7,)), Field("pose_ref", size=(7,)),
    Field("twist_ref", size=(6,)), Field("pose_error", size=(6,)),
    Field("sigma", size=(ROWS,)), Field("gain", size=(ROWS,)),
    Field("damping"), Field("manipulability"), Field("condition"),
    Field("u_min", size=(6,)), Field("v_min", size=(JOINTS,)),
    Field("tau", size=(JOINTS,)), Field("tau_gravity", size=(JOINTS,)),
    Field("path_time"), Field("path_rate"),
    Field("secondary_error"), Field("secondary_sigma"), Field("status", np.int64),
    Field("arrival"),  # no column: the arrival of its command, in ticks, where commands take time
)  # fmt: skip


def records(
    n: int, *worlds: Sequence[Writer], beside: Sequence[Field] = (), axes: int = 0
) -> NDArray[np.void]:
    """Return the records of worlds with n joints, (w,), as their Writers fill them.

    Args:
        n: Number of joints.
        worlds: The Writers of each world: of the same classes, in the same order.
        beside: Fields without a Writer: those of all worlds at once, and the memory of plants.
        axes: Number of axes of the chain, if more than n.

    Raises:
        ValueError: A field has two owners.
    """
    owned = [field for writer in worlds[0] for field in writer.fields]
    at = next((i for i, field in enumerate(owned, 1) if field.name == LAST), len(owned))
    fields = (*owned[:at], *MEASUREMENT, *MEMORY, *SCRATCH, *ADDRESSES, *owned[at:], *beside)
    made = np.zeros(len(worlds), _type(capacity(n), fields, capacity(max(n, axes))))
    for field in fields:
        if field.start:
            made[field.name] = field.start
    for world, writers in zip(made, worlds, strict=True):
        for writer in writers:
            writer.write(world)
    return made


def tick_type(n: int) -> np.dtype[np.void]:
    """Return the record type of one tick of one world; a run's columns are its fields."""
    return _type(capacity(n), TICK, 0)


def capacity(n: int) -> int:
    """Return the number of joints that the records of an n-joint arm hold.

    >>> capacity(2), capacity(8), capacity(9)
    (8, 8, 16)
    """
    return max(CAPACITY, 1 << (n - 1).bit_length())


# Cached, so that equal types are one object: a call of compiled code compares its arguments' types. With
# different objects that takes longer than the law.
@cache
def _type(joints: int, fields: tuple[Field, ...], axes: int) -> np.dtype[np.void]:
    sizes = {JOINTS: joints, CHAIN: axes}
    return np.dtype([(f.name, f.kind, tuple(sizes.get(size, size) for size in f.size)) for f in fields])
