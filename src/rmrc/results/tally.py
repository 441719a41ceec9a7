"""What the metrics of a run need to know of its ticks, piece by piece.

A `Tally` takes the columns of a run in pieces of any length. Each quantity is computed over a piece by numpy
and joined with that of the pieces before; the result has the same bits whatever the pieces are. Inside,
arrays are (joints, ticks), so that each quantity is contiguous over time.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.results.columns import Recorded
from rmrc.results.events import CHATTER_FLOOR, Chatter, Conditions, Standstill, Statuses
from rmrc.scenario.choices import Status
from rmrc.support.spatial import AXES

Array = NDArray[np.float64]

# Quantities whose largest magnitudes are known: of the task, and of each joint.
ERRORS = (
    "position_error", "orientation_error", "position_error_along", "orientation_error_along",
    "position_error_across", "orientation_error_across", "secondary_error",
)  # fmt: skip
JOINTS = (
    "joint_rate", "joint_rate_cmd", "joint_acceleration_cmd", "joint_rate_plain", "joint_acceleration",
    "joint_jerk_cmd", "tau", "tau_total",
)  # fmt: skip
# The errors and these first ones of JOINTS also have a known mean square.
SQUARED = 3
# Columns whose smallest values are known, and those whose largest ones are.
LOWEST = ("sigma", "manipulability", "path_rate", "secondary_sigma")
HIGHEST = ("condition", "damping", "slip")

# The lost direction has no linear or no angular part where that part of u_min is smaller: it is rounding.
NO_PART = 1e-9

# Columns that a tally reads.
READ = (
    "time", "q", "qdot", "qdot_cmd", "qdot_plain", "pose_ref", "pose_error", "sigma", "damping",
    "manipulability", "condition", "u_min", "tau", "tau_gravity", "path_time", "path_rate",
    "secondary_error", "secondary_sigma", "slip", "status",
)  # fmt: skip


@dataclass(frozen=True)
class Peak:
    """The largest values of some quantities, and when each was first reached. NaN is above all numbers.

    Attributes:
        value: (c,).
        time: (c,) [s]; NaN where the value is NaN.
    """

    value: Array
    time: Array

    @classmethod
    def of(cls, time: Array, values: Array) -> "Peak":
        """Return the peaks of values (c, T) at times (T,), T > 0."""
        first = values.argmax(axis=1)  # of equals, or of NaNs
        value = values[np.arange(len(values)), first]
        return cls(value, np.where(np.isnan(value), math.nan, time[first]))

    def join(self, later: "Peak") -> "Peak":
        """Return the peaks of this and of a later piece."""
        stays = (self.value >= later.value) | np.isnan(self.value)
        return Peak(np.where(stays, self.value, later.value), np.where(stays, self.time, later.time))


class Tally:
    """What is known of the ticks of a world so far.

    Attributes:
        ticks: Their number.
        statuses: How often each status occurred.
        standstill: The longest stretch in which it was stuck.
        chatter: Changes of the commanded accelerations' signs.
        conditions: Commands that its profile refuses.
        limited: Joint of the first actuator at its limit, the nearest to its limit at that tick; -1: none.
        q: Joint positions at the first and the last tick, (2, n).
        pose_ref: Wanted poses at the first and the last tick, (2, 7).
        path_time: Time along the path at the last tick [s].
    """

    def __init__(self, run: Recorded) -> None:
        """Begin before the first tick.

        Args:
            run: The facts about the run; its columns are not read.
        """
        n = len(run.joints)
        self.ticks = 0
        self.statuses, self.standstill, self.limited = Statuses(), Standstill(), -1
        self.chatter = Chatter(np.array(run.chatter_floor or (CHATTER_FLOOR,) * n), run.period)
        self.conditions = Conditions(run.profile, n)
        self.q, self.pose_ref, self.path_time = np.full((2, n), math.nan), np.full((2, 7), math.nan), math.nan
        self._period = run.period
        self._torque_limit = np.array(run.torque_limit or (math.inf,) * n)[:, None]
        self._axes = np.array([AXES.index(axis) for axis in run.axes])
        meters = np.where(self._axes < 3, run.length, 1.0)
        self._scale = (np.sqrt(run.weights or np.ones(len(meters))) / meters)[:, None]  # S_x
        # before the first tick, all is at rest
        self._qdot, self._qdot_cmd, self._qddot_cmd = np.zeros((n, 1)), np.zeros((n, 1)), np.zeros((n, 1))
        sizes = (*[1] * len(ERRORS), *[n] * len(JOINTS))
        ends = pairwise(accumulate(sizes, initial=0))
        self._rows = {name: slice(*rows) for name, rows in zip((*ERRORS, *JOINTS), ends, strict=True)}
        self._peak, self._extreme = _nothing(sum(sizes)), _nothing(len(LOWEST) + len(HIGHEST))
        self._squares = np.zeros(len(ERRORS) + SQUARED * n)
        self._last = np.full(len(ERRORS), math.nan)

    def peak(self, name: str) -> Peak:
        """Return the largest magnitudes of one of JOINTS, (n,), or of ERRORS, (1,); NaN without ticks."""
        rows = self._rows[name]
        if name == "joint_acceleration" and self.ticks < 2:
            return _nothing(rows.stop - rows.start)
        return Peak(self._peak.value[rows], self._peak.time[rows])

    def rms(self, name: str) -> Array:
        """Return the root of the mean square over ticks of an error, (1,), or of joints, (n,)."""
        return np.sqrt(self._squares[self._rows[name]] / (self.ticks or math.nan))

    def last(self, name: str) -> float:
        """Return one of ERRORS at the last tick."""
        return float(self._last[ERRORS.index(name)])

    def extreme(self, name: str) -> tuple[float, float]:
        """Return the smallest value of one of LOWEST, or the largest of HIGHEST, and its first time."""
        row = (*LOWEST, *HIGHEST).index(name)
        sign = -1.0 if name in LOWEST else 1.0
        return sign * float(self._extreme.value[row]), float(self._extreme.time[row])

    def add(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Add the next ticks.

        Args:
            columns: At least those of READ, (T,) or (T, width); T may be 0.
        """
        if len(columns["time"]):
            with np.errstate(all="ignore"):  # of infinite values, differences are NaN
                self._add({name: columns[name].T for name in READ})

    def _add(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Add T > 0 ticks, (T,) or (width, T) each."""
        time, status = columns["time"], columns["status"].astype(np.int64)
        self.statuses.add(time, status)
        self.standstill.add(time, (status & Status.STUCK) != 0)
        if self.limited < 0:
            self._find_limited(columns["tau"][:, (status & Status.TORQUE_LIMITED) != 0])
        magnitudes = np.abs(np.vstack([*self._of_task(columns), *self._of_joints(columns)]))
        extremes = np.vstack(
            [-columns["sigma"][-1], *(-columns[name] for name in LOWEST[1:])]
            + [columns[name] for name in HIGHEST]
        )
        # a running sum, tick by tick, has the same rounding whatever the pieces are
        squares = magnitudes[: len(self._squares)] ** 2
        squares[:, 0] += self._squares
        self._squares = np.cumsum(squares, axis=1)[:, -1].copy()
        self._last = magnitudes[: len(ERRORS), -1].copy()
        if not self.ticks:
            # before the second tick there is no measured acceleration
            magnitudes[self._rows["joint_acceleration"], 0] = -math.inf
        peak, extreme = Peak.of(time, magnitudes), Peak.of(time, extremes)
        self._peak = self._peak.join(peak) if self.ticks else peak
        self._extreme = self._extreme.join(extreme) if self.ticks else extreme
        for ends, name in ((self.q, "q"), (self.pose_ref, "pose_ref")):
            if not self.ticks:
                ends[0] = columns[name][:, 0]
            ends[1] = columns[name][:, -1]
        self.path_time = float(columns["path_time"][-1])
        self.ticks += len(time)

    def _of_joints(self, columns: Mapping[str, Array]) -> tuple[Array, ...]:
        """Return the quantities of JOINTS at each tick, (n, T) each.

        Accelerations and jerks are difference quotients, each at the later of its ticks.
        """
        qdot, qdot_cmd = (np.ascontiguousarray(columns[name]) for name in ("qdot", "qdot_cmd"))
        before = self._qdot if self.ticks else qdot[:, :1]  # the measured rate may begin anywhere
        acceleration = np.diff(qdot, prepend=before) / self._period
        acceleration_cmd = np.diff(qdot_cmd, prepend=self._qdot_cmd) / self._period
        jerk_cmd = np.diff(acceleration_cmd, prepend=self._qddot_cmd) / self._period
        self.chatter.add(acceleration_cmd, self.ticks)
        self.conditions.add(columns["time"], columns["q"], qdot_cmd, acceleration_cmd, jerk_cmd)
        self._qdot, self._qdot_cmd = qdot[:, -1:].copy(), qdot_cmd[:, -1:].copy()
        self._qddot_cmd = acceleration_cmd[:, -1:].copy()
        return (
            qdot, qdot_cmd, acceleration_cmd, columns["qdot_plain"], acceleration, jerk_cmd,
            columns["tau"], columns["tau"] + columns["tau_gravity"],
        )  # fmt: skip

    def _of_task(self, columns: Mapping[str, Array]) -> list[Array]:
        """Return the quantities of ERRORS at each tick, (T,) each.

        The arm is losing the direction S_x u_min at that tick. Its linear part splits the error of positions
        into parts along and across it, and its angular part that of orientations.
        """
        error, u = (np.ascontiguousarray(columns[name][self._axes]) for name in ("pose_error", "u_min"))
        is_rotation = self._axes >= 3
        parts = [_split(error[r], (self._scale * u)[r], _norm(u[r])) for r in (~is_rotation, is_rotation)]
        return [size for sizes in zip(*parts, strict=True) for size in sizes] + [columns["secondary_error"]]

    def _find_limited(self, tau: Array) -> None:
        """Look for the first actuator at its limit, in torques at ticks with TORQUE_LIMITED, (n, …)."""
        shares = np.fmax(0.0, np.abs(tau) / self._torque_limit)
        ticks = np.flatnonzero(shares.any(axis=0))
        if len(ticks):
            self.limited = int(shares[:, ticks[0]].argmax())


def _split(error: Array, lost: Array, share: Array) -> tuple[Array, Array, Array]:
    """Return the norm of an error, and of its parts along and across the direction that is lost, (T,) each.

    Args:
        error: Rows of one unit, (r, T).
        lost: The part of the lost direction in these rows, (r, T).
        share: Norm of this part of u_min, whose norm is 1, (T,).
    """
    size, is_lost = _norm(error), share > NO_PART
    direction = np.where(is_lost, lost / np.where(is_lost, _norm(lost), 1.0), 0.0)
    along = sum(direction * error, np.zeros(len(size)))
    # rounding makes no part larger than the whole
    return size, np.minimum(np.abs(along), size), np.minimum(_norm(error - along * direction), size)


def _norm(rows: Array) -> Array:
    """Return the norms of vectors, (r, T); `sum` adds row to row, in the same order for any T."""
    return np.sqrt(sum(rows**2, np.zeros(rows.shape[1])))


def _nothing(size: int) -> Peak:
    """Return the peaks of quantities without ticks."""
    return Peak(np.full(size, math.nan), np.full(size, math.nan))
