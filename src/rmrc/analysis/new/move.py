"""A motion through the nearest singularity and back, or towards it and back if the workspace ends there."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rmrc.analysis.new.nearest import Nearest, ascend, nearest_singularity
from rmrc.analysis.new.scaling import CLEAR, PATH_SHARE, Scales
from rmrc.arm.geometry import tidy
from rmrc.law.task import Array
from rmrc.support.spatial import exp_rotation, log_rotation, quat_conjugate, quat_multiply

# How far behind the singularity a motion through it turns back, as a share of the distance to it.
BEYOND = 0.5
# Distance at which the motion passes it [rad, or of the arm's size]: an exact crossing asks nothing of the
# lost direction, and hides the problem.
BESIDE = 0.02
# Shares of the way from the singularity to the start at which a motion begins; the next if one fails.
NEARER = (1.0, 0.5, 0.25)
# Length of a motion without a singularity [of the arm's size, or rad].
SHORT = 0.2
# Smaller values relative to the arm's size, or in radians, are rounding.
NOTHING = 1e-5


@dataclass(frozen=True, eq=False)
class Move:
    """The start, turning point and speed of a scenario's motion.

    Attributes:
        start: Joint positions, (n,).
        is_home: Whether they are those of `home`.
        how: `through`, `towards`, or `aside` without a singularity.
        by: Displacement of the site on the way out, (3,) [m].
        turn: Rotation vector on the way out, (3,) [rad].
        epsilon: σ_min below which the law damps.
        speed: Norm of the scaled twist S_x [v; ω] [rad/s].
        velocity: Largest speed [m/s].
        angular_velocity: Largest angular speed [rad/s].
        nearest: The singularity.
    """

    start: Array
    is_home: bool
    how: str
    by: Array
    turn: Array
    epsilon: float
    speed: float
    velocity: float
    angular_velocity: float
    nearest: Nearest


def begin(scales: Scales) -> tuple[Array, bool]:
    """Return the start of a scenario, and whether it is `home`; otherwise the nearest clear configuration."""
    arm = scales.task.arm
    home = arm.configuration("home")[arm.wiring.qpos]
    lower, upper = arm.position_limit.T
    if (home >= lower).all() and (home <= upper).all() and scales.sigma_at(home) >= scales.below:
        return home, True
    near = np.clip(home, scales.lower, scales.upper)
    found = near if scales.sigma_at(near) >= scales.below else ascend(scales, near, CLEAR * scales.below)
    return np.array([round(float(value), 3) for value in found]), False


def moves(scales: Scales) -> Iterator[Move]:
    """Yield motions, the most instructive first."""
    start, is_home = begin(scales)
    nearest = nearest_singularity(scales, start)
    for share in NEARER:
        q = start if share == 1.0 else np.round(nearest.q + share * (start - nearest.q), 3)
        if scales.sigma_at(q) < scales.below / CLEAR:
            continue
        at = is_home and share == 1.0
        beyond = np.clip(nearest.q + BEYOND * (nearest.q - q), scales.lower, scales.upper)
        yield _move(scales, nearest, q, at, "through", beyond)
        yield _move(scales, nearest, q, at, "towards", nearest.q)
    for sign in (1.0, -1.0):
        yield _aside(scales, nearest, start, is_home, sign)


def _move(scales: Scales, nearest: Nearest, start: Array, is_home: bool, how: str, end: Array) -> Move:
    """Return a motion from a start to the pose at other joint positions."""
    arm = scales.task.arm
    first, last = arm.pose(start), arm.pose(end)
    beside = BESIDE * scales.size / scales.task.length * nearest.twist if how == "through" else np.zeros(6)
    by = last[:3] - first[:3] + beside[:3]
    turned = quat_multiply(exp_rotation(beside[3:]), last[3:])
    return _timed(
        scales,
        nearest,
        start,
        is_home,
        how,
        by,
        log_rotation(quat_multiply(turned, quat_conjugate(first[3:]))),
    )


def _aside(scales: Scales, nearest: Nearest, start: Array, is_home: bool, sign: float) -> Move:
    """Return a short motion in the direction in which the arm moves best at the start."""
    task = scales.task
    best = np.zeros(6)
    best[task.rows] = np.linalg.svd(task.matrix(task.arm.jacobian(start)))[0][:, 0] / task.row_scale
    best *= sign * SHORT * scales.size / task.length
    return _timed(scales, nearest, start, is_home, "aside", best[:3], best[3:])


def _timed(
    scales: Scales, nearest: Nearest, start: Array, is_home: bool, how: str, by: Array, turn: Array
) -> Move:
    rows, length = set(scales.task.rows.tolist()), scales.task.length
    by = np.array(
        [tidy(x, 4) if i in rows and abs(x) > NOTHING * scales.size else 0.0 for i, x in enumerate(by)]
    )
    # a single rotational row is turned about alone; two of them do not commute, and use all three
    turning = rows & {3, 4, 5}
    wanted = [len(turning) > 1 or i + 3 in turning for i in range(3)]
    turn = np.array(
        [tidy(x, 4) if w and abs(x) > NOTHING else 0.0 for x, w in zip(turn, wanted, strict=True)]
    )
    epsilon = tidy(min(scales.below, scales.sigma_at(start) / CLEAR))
    speed = PATH_SHARE * epsilon * scales.slowest
    each = speed / math.sqrt(2.0) if by.any() and turn.any() else speed
    return Move(start, is_home, how, by, turn, epsilon, speed, tidy(each * length), tidy(each), nearest)
