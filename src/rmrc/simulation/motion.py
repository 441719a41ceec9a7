"""A recorded motion: read from a file, checked, interpolated smoothly, and sampled at any times.

Between rows the position and the quaternion are cubic splines with continuous acceleration, at rest at both
ends [Boor01, ch. IV]; the quaternion is normalized, and the angular velocity is that of the normalized one:

    ω = 2 Im(Q̇ Q*)/|Q|²,   ω̇ = 2 Im(Q̈ Q*)/|Q|² − 2 ω (Q̇ · Q)/|Q|²

A motion that moves at its first or last row therefore does not come from a recording from rest to rest.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario import TargetLimitsSection
from rmrc.simulation.tables import read_table
from rmrc.support.errors import TargetError, did_you_mean
from rmrc.support.legible import listed
from rmrc.support.spatial import exp_rotation, normalize, quat_conjugate, quat_multiply

Array = NDArray[np.float64]

# The columns of a row, by kind of motion.
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
KINDS = ("pose", "q", "twist")

# A quaternion this far from length 1 is an error, not the rounding of a file with few digits.
UNIT = 1e-2
# Beyond it a spline of quaternions could come near 0, and the direction of rotation is ambiguous [rad].
LARGEST_TURN = math.pi / 2
# The interpolation may exceed a limit by this factor, which is not a fault of the motion.
SLACK = 0.01
# A motion that is slowed to a limit stays below it by this factor.
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses over time.

    Attributes:
        time: Time of each row, from 0, rising, (R,) [s].
        pose: (R, 7) [m, 1]; neighboring quaternions have a positive product.
    """

    time: Array
    pose: Array

    @cached_property
    def _second(self) -> Array:
        """Second derivatives at the rows of the spline with zero first derivatives at both ends, (R, 7)."""
        return _second_derivatives(self.time, self.pose)

    def at(self, time: Array) -> Array:
        """Return pose, twist and acceleration at some times, (T, 19)."""
        row = np.clip(np.searchsorted(self.time, time, "right") - 1, 0, len(self.time) - 2)
        h = (self.time[row + 1] - self.time[row])[:, None]
        b = (time - self.time[row])[:, None] / h
        a, p, s = 1.0 - b, self.pose, self._second
        low, high, bend, end = p[row], p[row + 1], s[row], s[row + 1]
        value = a * low + b * high + ((a**3 - a) * bend + (b**3 - b) * end) * h**2 / 6
        slope = (high - low) / h + ((1 - 3 * a**2) * bend + (3 * b**2 - 1) * end) * h / 6
        curve = a * bend + b * end
        Q, dQ, ddQ = value[:, 3:], slope[:, 3:], curve[:, 3:]
        size2 = np.sum(Q * Q, axis=1, keepdims=True)
        omega = 2.0 * quat_multiply(dQ, quat_conjugate(Q))[:, 1:] / size2
        alpha = 2.0 * quat_multiply(ddQ, quat_conjugate(Q))[:, 1:] / size2
        alpha -= 2.0 * omega * np.sum(dQ * Q, axis=1, keepdims=True) / size2
        return np.hstack([value[:, :3], Q / np.sqrt(size2), slope[:, :3], omega, curve[:, :3], alpha])

    def slowed(self, factor: float) -> "Motion":
        """Return the motion with all times longer by a factor."""
        return Motion(factor * self.time, self.pose)


def _second_derivatives(t: Array, y: Array) -> Array:
    """Solve the spline's tridiagonal equations by elimination; the diagonal dominates, so no pivots."""
    h, last = np.diff(t)[:, None], len(t) - 1
    slope = np.diff(y, axis=0) / h
    right = 6.0 * np.diff(slope, axis=0, prepend=0.0 * slope[:1], append=0.0 * slope[:1])
    width = h[:, 0].tolist()
    diagonal = [2.0 * (u + v) for u, v in pairwise([0.0, *width, 0.0])]
    for i in range(1, last + 1):
        share = width[i - 1] / diagonal[i - 1]
        diagonal[i] -= share * width[i - 1]
        right[i] -= share * right[i - 1]
    right[last] /= diagonal[last]
    for i in range(last - 1, -1, -1):
        right[i] = (right[i] - width[i] * right[i + 1]) / diagonal[i]
    return right


def read_motion(
    path: Path, kind: str | None, joints: Sequence[str], pose_at: Callable[[Array], Array], start: Array
) -> Motion:
    """Return the motion of a file in the frame in which it is written.

    Args:
        path: A CSV or Parquet file, or the npz of a run.
        kind: `pose`, `pose_ref`, `twist` or `q`; None: the first of pose, q, twist that the file has.
        joints: Names of the arm's joints, as in the columns of `q`.
        pose_at: Returns the pose of the site at joint positions, (n,), in that frame.
        start: Start pose for integrating a twist, (7,), in that frame.

    Raises:
        TargetError: The file cannot be read, lacks columns, or holds no motion.
    """
    names = {"pose": POSE, "twist": TWIST, "q": tuple(joints)}
    table = _run_columns(path, joints) if path.suffix == ".npz" else _numbers(path)
    if kind == "pose_ref":
        names["pose_ref"] = tuple(f"{name}_ref" for name in POSE)
    wanted = kind or next((one for one in KINDS if names[one] and set(names[one]) <= table.keys()), "pose")
    missing = [name for name in ("t", *names[wanted]) if name not in table]
    if missing:
        near = did_you_mean(missing[0], set(table) - set(names[wanted]))
        raise TargetError(
            f'"{path}" has no column "{missing[0]}"{near}; {wanted} needs t and {" ".join(names[wanted])}, '
            f"it has {listed(list(table)) or 'none'}"
        )
    time = _checked_time(path, table["t"])
    rows = np.column_stack([table[name] for name in names[wanted]])
    _check_finite(path, names[wanted], rows)
    if wanted == "q":
        rows = np.array([pose_at(q) for q in rows])
    elif wanted == "twist":
        rows = _integrated(time, rows, start)
    return Motion(time, _checked_poses(path, rows))


def _run_columns(path: Path, joints: Sequence[str]) -> Mapping[str, Array]:
    """Return the columns of a run's file under their names in a CSV file."""
    try:
        with np.load(path, allow_pickle=False) as file:
            columns = {name: np.asarray(file[name], np.float64) for name in ("time", "pose", "pose_ref", "q")}
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise TargetError(f'"{path}" is not the file of a run: {error}') from None
    if columns["q"].shape[1] != len(joints):
        count = columns["q"].shape[1]
        raise TargetError(f'"{path}" is the run of an arm of {count} joints, this one has {len(joints)}')
    poses = dict(zip(POSE, columns["pose"].T, strict=True))
    wanted = {f"{name}_ref": column for name, column in zip(POSE, columns["pose_ref"].T, strict=True)}
    return {"t": columns["time"], **poses, **wanted, **dict(zip(joints, columns["q"].T, strict=True))}


def _numbers(path: Path) -> Mapping[str, Array]:
    """Return the columns of numbers in a CSV or Parquet file, by name."""
    try:
        return read_table(path).numbers
    except (OSError, ValueError) as error:
        raise TargetError(f'"{path}" cannot be read: {error}') from None


def _checked_time(path: Path, time: Array) -> Array:
    """Return the times from 0 on, or raise their fault."""
    if len(time) < 2:
        raise TargetError(f'"{path}" must have 2 rows or more, got {len(time)}')
    _check_finite(path, ("t",), time[:, None])
    falls = np.flatnonzero(np.diff(time) <= 0)
    if len(falls):
        row = int(falls[0]) + 1
        values = f"row {row + 1} has {time[row]:g} after {time[row - 1]:g}"
        raise TargetError(f'"{path}": t must rise, but {values}')
    return np.asarray(time - time[0])


def _check_finite(path: Path, names: Sequence[str], rows: Array) -> None:
    bad = np.argwhere(~np.isfinite(rows))
    if len(bad):
        row, column = bad[0]
        value = rows[row, column]
        raise TargetError(f'"{path}": row {row + 1} of {names[column]} must be finite, got {value:g}')


def _checked_poses(path: Path, poses: Array) -> Array:
    """Return poses with unit quaternions whose neighbors are near, or raise their fault."""
    size = np.linalg.norm(poses[:, 3:], axis=1)
    row = int(np.argmax(np.abs(size - 1.0)))
    if abs(size[row] - 1.0) > UNIT:
        got = f"got one of length {size[row]:g}"
        raise TargetError(f'"{path}": row {row + 1} must have a unit quaternion, {got}')
    quat = normalize(poses[:, 3:])
    signs = np.where(np.sum(quat[1:] * quat[:-1], axis=1) < 0, -1.0, 1.0)
    quat[1:] *= np.cumprod(signs)[:, None]
    turn = 2.0 * np.arccos(np.clip(np.sum(quat[1:] * quat[:-1], axis=1), -1.0, 1.0))
    row = int(np.argmax(turn))
    if turn[row] > LARGEST_TURN:
        raise TargetError(
            f'"{path}": row {row + 2} must turn by at most {math.degrees(LARGEST_TURN):g} deg from the row '
            f"before, got {math.degrees(turn[row]):.4g} deg; give rows in between"
        )
    return np.hstack([poses[:, :3], quat])


def _integrated(time: Array, twist: Array, start: Array) -> Array:
    """Return the poses that twists reach from a start; the twists are linear between the rows.

    The rotation of an interval is exp of h (ω₀ + ω₁)/2 + h² (ω₁ × ω₀)/12, of fourth order [Magnus54].
    """
    h = np.diff(time)[:, None]
    v, w = twist[:, :3], twist[:, 3:]
    point = start[:3] + np.vstack([np.zeros(3), np.cumsum(0.5 * h * (v[:-1] + v[1:]), axis=0)])
    turns = exp_rotation(0.5 * h * (w[:-1] + w[1:]) + h**2 * np.cross(w[1:], w[:-1]) / 12.0)
    quat = [start[3:]]
    for turn in turns:
        quat.append(quat_multiply(turn, quat[-1]))
    return np.hstack([point, quat])


def needed(motion: Motion, limits: TargetLimitsSection) -> tuple[float, str]:
    """Return the factor by which a motion must be slower to keep the limits, and the strictest limit.

    Args:
        motion: The motion as it is.
        limits: Limits of the target.
    """
    (factor, said), slower = excess(motion, limits), 1.0
    while factor > 1.0:  # the time over which jerk is averaged does not stretch with the motion
        slower *= factor * (1.0 + ROUNDING)
        factor, _ = excess(motion.slowed(slower), limits)
    return (slower if slower > 1.0 else factor), said


def excess(motion: Motion, limits: TargetLimitsSection) -> tuple[float, str]:
    """Return the factor by which a motion is too fast for the limits, and the limit that it exceeds most."""
    times = np.concatenate([motion.time, 0.5 * (motion.time[1:] + motion.time[:-1])])
    samples = motion.at(times)
    worst = 0.0, ""
    for turning, first in (("", 7), ("angular_", 10)):
        unit = "rad" if turning else "m"
        rate, rise = (np.linalg.norm(samples[:, i : i + 3], axis=1).max() for i in (first, first + 6))
        most, jerk = (getattr(limits, f"{turning}{one}") for one in ("acceleration", "jerk"))
        span = 0.5 * max(rise, 0.5 * most) / jerk
        shake = np.linalg.norm(_mean_jerk(motion, times, span)[:, first - 7 : first - 4], axis=1).max()
        for power, name, per, value in (
            (1.0, "velocity", "s", rate), (0.5, "acceleration", "s²", rise), (1.0 / 3.0, "jerk", "s³", shake),
        ):  # fmt: skip
            limit = getattr(limits, f"{turning}{name}")
            said = f"asks for {value:.4g} {unit}/{per} where target.limits.{turning}{name} is {limit:g}"
            worst = max(worst, (float((value / limit) ** power), said))
    return worst


def _mean_jerk(motion: Motion, times: Array, span: float) -> Array:
    """Return means of [v̈; ω̈] about some times, (3 T, 6), with the weights of a triangle of two spans.

    They are second differences of velocities over the square of the span, and no larger than the jerk itself.
    The jerk of single rows is noise: with values rounded to r every h, r/h³. The span is half the time in
    which the allowed jerk builds up the acceleration. It shows a jump of acceleration, and hides r.
    """

    def velocity(time: Array) -> Array:  # at rest before and after
        return motion.at(np.clip(time, 0.0, motion.time[-1]))[:, 7:13]

    middle = np.concatenate([times - span, times, times + span])
    change = velocity(middle - span) - 2.0 * velocity(middle) + velocity(middle + span)
    return np.asarray(change / span / span)  # a span of 1e200 s has no square
