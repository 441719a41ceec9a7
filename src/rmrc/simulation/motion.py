"""A recorded motion: read from a file, checked, and interpolated smoothly or held.

Between rows the position and the quaternion are cubic splines with continuous acceleration, at rest at both
ends [Boor01, ch. IV]. A motion that moves at its first or last row therefore does not come from a recording
from rest to rest. Held rows are the steps of a signal that is sampled less often than the law: the target
stays at a row, at rest, until the next.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario import TargetLimitsSection
from rmrc.scenario.target import Motion
from rmrc.simulation.reference import Spline
from rmrc.simulation.rows import read_rows
from rmrc.support.errors import TargetError
from rmrc.support.spatial import (
    AXES,
    exp_rotation,
    normalize,
    pose_inverse,
    pose_product,
    quat_multiply,
    rotate,
)

Array = NDArray[np.float64]

# A quaternion this far from length 1 is an error, not the rounding of a file with few digits.
UNIT = 1e-2
# Beyond it a spline of quaternions could come near 0, and the direction of rotation is ambiguous [rad].
LARGEST_TURN = math.pi / 2
# A motion that is slowed to a limit stays below it by this factor.
ROUNDING = 1e-6
# A motion may exceed a limit by this factor: its interpolation is not its fault.
SLACK = 0.01
# Rows that are further apart than this many median periods, and than this [s], have a gap between them.
GAP_PERIODS, GAP = 3.0, 0.1
# The values of a held signal change at least this often [s]: policies do so at 5 to 50 Hz. Way-points with
# pauses look alike, but change more slowly.
HELD = 0.2
# A motion at full pace beside a gap takes at least this time to start or stop, unless it does so at once [s].
SHORTEST_RAMP = 0.05
# A tick that is this much before a row is at it: sums of periods are rounded [s].
EARLY = 1e-9


def read_motion(
    file: Motion,
    joints: Sequence[str],
    pose_at: Callable[[Array], Array],
    origin: Array,
    start: Array,
    axes: Sequence[str] = AXES,
) -> tuple[Array, Array, tuple[str, ...]]:
    """Return the rising times of the rows of a file from 0 on, (r,) [s], the poses there, (r, 7), and notes.

    Args:
        file: The file, and which of its columns count.
        joints: Names of the arm's joints, as in the columns of `q`.
        pose_at: Returns the pose of the site at joint positions, (n,).
        origin: Pose of the frame in which the file is written, (7,).
        start: Pose of the site from which a twist is integrated, (7,).
        axes: Axes of the task: a file need not have the others.

    Returns:
        Neighboring quaternions have a positive product. Each note says what was assumed about the file.

    Raises:
        TargetError: The file cannot be read, lacks columns, or holds no motion.
    """
    form, time, rows, notes = read_rows(file, joints, axes, pose_product(pose_inverse(origin), start))
    if form == "q":
        poses = np.array([pose_at(q) for q in rows])
    elif form == "twist":
        v, w = rotate(origin[3:], np.array([rows[:, :3], rows[:, 3:]]))
        width = np.diff(time)
        if file.gaps == "stop":
            width[gaps(time)] = 0.0
        poses = _integrated(width, v, w, start)
    else:
        poses = pose_product(origin, rows)
    return time, _checked(poses), notes


def _refuse(is_bad: NDArray[np.bool_], rule: str, values: Array) -> None:
    """Raise the fault of the first bad row."""
    if is_bad.any():
        row = int(np.argmax(is_bad))
        raise TargetError(f"row {row + 1} {rule}, got {values[row]:.4g}")


def _checked(poses: Array) -> Array:
    """Return poses with unit quaternions whose neighbors are near, or raise their fault."""
    size = np.linalg.norm(poses[:, 3:], axis=1)
    _refuse(np.abs(size - 1.0) > UNIT, "must have a unit quaternion, of length 1", size)
    quat = normalize(poses[:, 3:])
    products = np.sum(quat[1:] * quat[:-1], axis=1)
    quat[1:] *= np.cumprod(np.where(products < 0, -1.0, 1.0))[:, None]
    turn = np.degrees(2.0 * np.arccos(np.clip(np.abs([1.0, *products]), 0.0, 1.0)))
    most = math.degrees(LARGEST_TURN)
    _refuse(turn > most, f"must turn by at most {most:g} deg from the row before, or have rows between", turn)
    return np.hstack([poses[:, :3], quat])


def _integrated(width: Array, v: Array, w: Array, start: Array) -> Array:
    """Return the poses that twists reach from a start; the twists are linear over the intervals of the rows.

    The rotation of an interval is exp of h (ω₀ + ω₁)/2 + h² (ω₁ × ω₀)/12, of fourth order [Magnus54].
    """
    h = width[:, None]
    steps = 0.5 * h * (v[:-1] + v[1:])
    turns = exp_rotation(0.5 * h * (w[:-1] + w[1:]) + h**2 * np.cross(w[1:], w[:-1]) / 12.0)
    poses = [start]
    for step, turn in zip(steps, turns, strict=True):
        poses.append(np.hstack([poses[-1][:3] + step, quat_multiply(turn, poses[-1][3:])]))
    return np.array(poses)


def gaps(time: Array) -> NDArray[np.intp]:
    """Return the rows before the gaps in the times of a motion."""
    width = np.diff(time)
    least = max(GAP, GAP_PERIODS * float(np.median(width)))
    return np.flatnonzero(width > least * (1.0 + ROUNDING))


def is_held(time: Array, pose: Array) -> bool:
    """Return whether rows, (r,) and (r, 7), are a held signal: most changes are followed by a repetition."""
    changes = np.any(np.diff(pose, axis=0) != 0.0, axis=1)
    repeated, changed = changes[:-1] & ~changes[1:], time[1:][changes]
    is_mostly = len(changed) > 1 and repeated.sum() >= 0.5 * changes[:-1].sum()
    return bool(is_mostly and np.median(np.diff(changed)) <= HELD)


def held(time: Array, pose: Array) -> Spline:
    """Return the steps of a motion, (r,) and (r, 7), which is at rest at each row until the next."""
    coefficients = np.zeros((4, len(time) - 1, 7))
    coefficients[0] = pose[:-1]
    return Spline(np.append(np.maximum(time[:-1] - EARLY, 0.0), time[-1]), coefficients)


def spline(time: Array, pose: Array, moves: tuple[bool, bool] = (False, False)) -> Spline:
    """Return the spline through the rows of a motion.

    The equations of the second derivatives are tridiagonal; their diagonal dominates, so no pivots.

    Args:
        time: Rising, (r,) [s].
        pose: (r, 7) [m, 1].
        moves: Whether it may move at its first and at its last row, where the second derivative is then zero
            instead of the first one.
    """
    time = time - time[0]
    h = np.diff(time)
    slope = np.diff(pose, axis=0) / h[:, None]
    bend = 6.0 * np.diff(slope, axis=0, prepend=0.0, append=0.0)
    diagonal = 2.0 * (np.append(h, 0.0) + np.append(0.0, h))
    diagonal[[0, -1]] += np.where(moves, math.inf, 0.0)
    for i, width in enumerate(h):
        share = width / diagonal[i]
        diagonal[i + 1] -= share * width
        bend[i + 1] -= share * bend[i]
    bend[-1] /= diagonal[-1]
    for i in range(len(h) - 1, -1, -1):
        bend[i] = (bend[i] - h[i] * bend[i + 1]) / diagonal[i]
    linear = slope - h[:, None] * (2.0 * bend[:-1] + bend[1:]) / 6.0
    cubic = np.diff(bend, axis=0) / h[:, None] / 6.0
    return Spline(time, np.array([pose[:-1], linear, bend[:-1] / 2.0, cubic]))


def eased(time: Array, pose: Array, limits: TargetLimitsSection, moves: tuple[bool, bool]) -> Spline:
    """Return the spline through rows from rest to rest.

    Where the rows move at an end, their pace rises or falls there, as 3 s² − 2 s³ over a time that is doubled
    until the motion keeps the limits. Rows that do not last as long are slowed.

    Args:
        time: Rising, (r,) [s].
        pose: (r, 7) [m, 1].
        limits: Limits of the target.
        moves: Whether the rows may move at the first one, and at the last.
    """
    motion, ramp = spline(time, pose), 0.0
    while any(moves) and motion.duration and _excess(motion, limits)[0] > 1.0 + SLACK:
        ramp = max(2.0 * ramp, SHORTEST_RAMP)
        if ramp > time[-1] - time[0]:
            return motion.slowed(needed(motion, limits)[0])
        rising, falling = _delay(time - time[0], ramp * moves[0]), _delay(time[-1] - time, ramp * moves[1])
        motion = spline(time + rising - falling, pose)
    return motion


def _delay(time: Array, ramp: float) -> Array:
    """Return by how much rows, (r,) [s], come later if their pace rises from 0 to 1 over a time [s]."""
    share = np.linspace(0.0, 1.0, 1001)
    rising = ramp * np.interp(time / (ramp or 1.0), share**3 - share**4 / 2, share)
    return rising + np.maximum(time - ramp / 2, 0.0) - time


def needed(motion: Spline, limits: TargetLimitsSection) -> tuple[float, str]:
    """Return the factor by which a motion must be slower to keep the limits, and the strictest limit.

    Args:
        motion: The motion.
        limits: Limits of the target.
    """
    (factor, reason), slower = _excess(motion, limits), 1.0
    while factor > 1.0:  # the time over which jerk is averaged does not stretch with the motion
        slower *= factor * (1.0 + ROUNDING)
        factor, _ = _excess(motion.slowed(slower), limits)
    return slower, reason


def _excess(motion: Spline, limits: TargetLimitsSection) -> tuple[float, str]:
    """Return the factor by which a motion is too fast for the limits, and the limit that it exceeds most.

    The jerk of single rows is noise: with values rounded to r every h, r/h³. Its mean with the weights of a
    triangle is a second difference of velocities, and no larger than the jerk itself. The triangle is as long
    as the allowed jerk takes to build up the acceleration. It shows a jump of acceleration, and hides r.
    """
    time, worst = motion.times, (0.0, "")
    times = np.concatenate([time, 0.5 * (time[1:] + time[:-1])])
    samples = motion.at(times)
    for prefix, unit, first in (("", "m", 7), ("angular_", "rad", 10)):
        acceleration, jerk = (getattr(limits, prefix + name) for name in ("acceleration", "jerk"))
        speed, rise = (np.linalg.norm(samples[:, i : i + 3], axis=1).max() for i in (first, first + 6))
        span = 0.5 * max(rise, 0.5 * acceleration) / jerk
        middle = np.concatenate([times - span, times, times + span])
        before, now, after = (motion.at(middle + shift)[:, first : first + 3] for shift in (-span, 0.0, span))
        # a span of 1e200 s has no square
        shake = np.linalg.norm((before - 2.0 * now + after) / span / span, axis=1).max()
        rows = (1, "velocity", "s", speed), (2, "acceleration", "s²", rise), (3, "jerk", "s³", shake)
        for power, name, per, value in rows:
            limit = getattr(limits, prefix + name)
            reason = f"asks for {value:.4g} {unit}/{per} where target.limits.{prefix}{name} is {limit:g}"
            worst = max(worst, (float((value / limit) ** (1.0 / power)), reason))
    return worst
