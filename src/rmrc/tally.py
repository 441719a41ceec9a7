"""What a scorecard needs of a run, as running sums: tick records in, one small record a world out.

The records can be fed in pieces of any size. Each tick is added to the sums of its own world in the order
of time, so that a figure has the same bits whatever the pieces, the threads and the worlds beside it.
"""

import math
from collections.abc import Callable, Sequence
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from rmrc.control.choices import Status
from rmrc.control.compiled import Record, compiled, entry, inlined, machine_code
from rmrc.control.records import capacity
from rmrc.spatial import AXES

# Rows of a tally's fields.
JOINTS = ("joint_rate", "joint_rate_cmd", "joint_acceleration", "tau")
RATE, COMMAND, ACCELERATION, TAU = range(4)
ERRORS = ("position_error", "orientation_error", "error_along", "error_across", "secondary_error")
POSITION, ORIENTATION, ALONG, ACROSS, SECONDARY = range(5)
LARGEST = ("condition", "damping")
SMALLEST = ("sigma", "manipulability", "path_rate", "secondary_sigma")
CONDITION, DAMPING = range(2)
SIGMA, MANIPULABILITY, PACE, SECONDARY_SIGMA = range(4)
BITS = len(Status)


def tally_type(n: int) -> np.dtype[np.void]:
    """Return the record of what is known so far of one world with n joints.

    A time is that of the first tick at which the extreme was reached; extremes are NaN before the first
    tick. Rows are those of JOINTS, ERRORS, LARGEST and SMALLEST. `status` counts the ticks without a
    status, then those with each bit.
    """
    return _tally_type(capacity(n))


@cache  # one object, as in rmrc.control.records
def _tally_type(c: int) -> np.dtype[np.void]:
    f = np.float64
    return np.dtype(
        [
            # given: joints, singular values, rows of the error that count, and their scale; length and period
            ("n", np.int64), ("k", np.int64), ("counts", f, (6,)), ("length", f), ("period", f),
            # ticks that were added, and what of the first and of the last one is needed
            ("ticks", np.int64), ("q_first", f, (c,)), ("q", f, (c,)), ("qdot", f, (c,)),
            ("pose_ref_first", f, (7,)), ("pose_ref", f, (7,)), ("path_time", f),
            # sums of squares, extremes, and when they were first
            ("square", f, (2, c)), ("peak", f, (len(JOINTS), c)), ("peak_time", f, (len(JOINTS), c)),
            ("error_square", f, (len(ERRORS),)), ("error_max", f, (len(ERRORS),)),
            ("error_max_time", f, (len(ERRORS),)), ("error_end", f, (len(ERRORS),)),
            ("largest", f, (len(LARGEST),)), ("smallest", f, (len(SMALLEST),)),
            ("sigma_time", f), ("status", np.int64, (BITS + 1,)),
        ]
    )  # fmt: skip


def begin(n: int, axes: Sequence[str], length: float, period: float) -> NDArray[np.void]:
    """Return the tally of a world before its first tick.

    Args:
        n: Number of joints.
        axes: Task axes that count.
        length: Characteristic length of the task [m].
        period: Control period [s].

    Returns:
        One record, (1,).

    >>> begin(2, ["x", "y"], 1.0, 0.001)["counts"]
    array([[1., 1., 0., 0., 0., 0.]])
    """
    tally = np.zeros(1, tally_type(n))
    for name in ("peak", "peak_time", "error_max", "error_max_time", "error_end", "largest", "smallest"):
        tally[name] = math.nan
    tally["sigma_time"] = math.nan
    tally["n"], tally["k"] = n, min(n, len(axes))
    tally["counts"] = [axis in axes for axis in AXES]
    tally["length"], tally["period"] = length, period
    return tally


def adder(tallies: NDArray[np.void], ticks: NDArray[np.void]) -> Callable[[NDArray[np.int64]], None]:
    """Return what adds to each tally the ticks of its world that it does not have yet, up to an end.

    It is compiled now if it is not yet, which takes SECONDS s once. It takes `ends`, (w,): one past the last
    tick to be added of each world.

    Args:
        tallies: One a world, (w,); written.
        ticks: Tick records, (rows, w): tick t is in row t modulo rows.
    """
    return partial(machine_code(add, tallies, ticks, np.zeros(len(tallies), np.int64)), tallies, ticks)


# Compiled ---------------------------------------------------------------------------------------


@entry
def add(tallies: Record, ticks: Record, ends: NDArray[np.int64]) -> None:
    """Add ticks to tallies, see `adder`."""
    for w in range(tallies.shape[0]):
        for t in range(tallies[w].ticks, ends[w]):
            _add_tick(tallies[w], ticks[t % ticks.shape[0], w])


@compiled
def _add_tick(tally: Record, tick: Record) -> None:
    is_first = tally.ticks == 0
    _add_joints(tally, tick, is_first)
    _add_errors(tally, tick, is_first)
    if _exceeds(-tick.sigma[tally.k - 1], -tally.smallest[SIGMA], is_first):
        tally.smallest[SIGMA], tally.sigma_time = tick.sigma[tally.k - 1], tick.time
    _keep_smallest(tally, MANIPULABILITY, tick.manipulability, is_first)
    _keep_smallest(tally, PACE, tick.path_rate, is_first)
    _keep_smallest(tally, SECONDARY_SIGMA, tick.secondary_sigma, is_first)
    if _exceeds(tick.condition, tally.largest[CONDITION], is_first):
        tally.largest[CONDITION] = tick.condition
    if _exceeds(tick.damping, tally.largest[DAMPING], is_first):
        tally.largest[DAMPING] = tick.damping
    if tick.status == 0:
        tally.status[0] += 1
    for bit in range(BITS):
        tally.status[bit + 1] += (tick.status >> bit) & 1
    for i in range(7):
        if is_first:
            tally.pose_ref_first[i] = tick.pose_ref[i]
        tally.pose_ref[i] = tick.pose_ref[i]
    tally.path_time = tick.path_time
    tally.ticks += 1


@compiled
def _add_joints(tally: Record, tick: Record, is_first: bool) -> None:
    """Add rates, torques and the difference quotients of the rates, each at the later of its ticks."""
    for j in range(tally.n):
        _keep_peak(tally, RATE, j, tick.qdot[j], tick.time, is_first)
        _keep_peak(tally, COMMAND, j, tick.qdot_cmd[j], tick.time, is_first)
        _keep_peak(tally, TAU, j, tick.tau[j], tick.time, is_first)
        tally.square[RATE, j] += tick.qdot[j] * tick.qdot[j]
        tally.square[COMMAND, j] += tick.qdot_cmd[j] * tick.qdot_cmd[j]
        if is_first:
            tally.q_first[j] = tick.q[j]
        else:
            acceleration = (tick.qdot[j] - tally.qdot[j]) / tally.period
            _keep_peak(tally, ACCELERATION, j, acceleration, tick.time, tally.ticks == 1)
        tally.q[j], tally.qdot[j] = tick.q[j], tick.qdot[j]


@compiled
def _add_errors(tally: Record, tick: Record, is_first: bool) -> None:
    """Add the sizes of the errors: of the rows that count; of all of them along u_min and across it."""
    position = orientation = across = along = 0.0
    for i in range(3):
        e, turn = tick.pose_error[i] * tally.counts[i], tick.pose_error[3 + i] * tally.counts[3 + i]
        position += e * e
        orientation += turn * turn
        along += tick.u_min[i] * e + tick.u_min[3 + i] * (turn * tally.length)
    for i in range(6):
        e = tick.pose_error[i] * tally.counts[i] * (1.0 if i < 3 else tally.length) - tick.u_min[i] * along
        across += e * e
    _keep_error(tally, POSITION, math.sqrt(position), tick.time, is_first)
    _keep_error(tally, ORIENTATION, math.sqrt(orientation), tick.time, is_first)
    _keep_error(tally, ALONG, abs(along), tick.time, is_first)
    _keep_error(tally, ACROSS, math.sqrt(across), tick.time, is_first)
    _keep_error(tally, SECONDARY, abs(tick.secondary_error), tick.time, is_first)


@inlined
def _keep_peak(tally: Record, row: int, j: int, value: float, time: float, is_first: bool) -> None:
    if _exceeds(abs(value), tally.peak[row, j], is_first):
        tally.peak[row, j], tally.peak_time[row, j] = abs(value), time


@compiled
def _keep_error(tally: Record, row: int, size: float, time: float, is_first: bool) -> None:
    tally.error_square[row] += size * size
    tally.error_end[row] = size
    if _exceeds(size, tally.error_max[row], is_first):
        tally.error_max[row], tally.error_max_time[row] = size, time


@inlined
def _keep_smallest(tally: Record, row: int, value: float, is_first: bool) -> None:
    if _exceeds(-value, -tally.smallest[row], is_first):
        tally.smallest[row] = value


@compiled
def _exceeds(value: float, extreme: float, is_first: bool) -> bool:
    """Whether a value is the new extreme: the first of equals stays, and the first NaN for good."""
    return is_first or value > extreme or (math.isnan(value) and not math.isnan(extreme))
