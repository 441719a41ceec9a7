"""Joint positions that bring the site of an arm to a goal: the nearest posture, or all of them.

It is a search (`rmrc.simulation.inverse_kinematics`) from a start and from random but always equal others.
MuJoCo's forward kinematics proves its results; other solutions may still exist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress, product
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.analysis.subject import Model, Packages, numbers, subject
from rmrc.law.task import Array, Task
from rmrc.simulation.inverse_kinematics import newton, search, turn_rotations, unwound
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import AXES, exp_rotation, normalize, pose_error, quat_multiply
from rmrc.support.text import brief

# All postures of a search -------------------------------------------------------------------------
#
# All joint positions that bring the site of an arm to a goal, as far as many starts lead to them.

# Starts of a search for all postures. A posture that a hundredth of them reaches is missed with probability
# 1e-9.
STARTS = 2000
# The seed differs from the default of `Arm.sampled`, which gives examples and tests their goals.
SEED = 6
# A damped try has converged or is stuck after some 30 steps.
STEPS = 300
# All searches end at rounding.
SHARP = 1e-13
# Two postures are one if no joint differs by more, hinges modulo whole turns [rad, or m over L]. Where two
# merge at a singularity, each is known only to the root of rounding, about 1e-7.
SAME = 1e-4
# Singular values below this share of the largest count as 0: A has lost a direction.
LOST = 1e-4
# Postures are neighbors of a continuum if such a step along a lost direction leads to another [rad, or m
# over L].
NUDGE = 0.05


@dataclass(frozen=True, eq=False)
class Postures:
    """All postures that were found for a goal.

    Attributes:
        q: Joint positions, (k, n), ascending; hinges in (−π, π] where limits allow. The postures of continua
            have one entry, the one of them that was found nearest to the start.
        hits: Number of starts that led to each, (k,).
        freedom: Number of directions in which each can move with the site at rest, (k,): 0 where it is
            isolated, or else n less the rank of the Jacobian.
        starts: Number of starts.
    """

    q: Array
    hits: NDArray[np.int64]
    freedom: NDArray[np.int64]
    starts: int

    @property
    def is_continuum(self) -> bool:
        """Whether there are infinitely many."""
        return bool(self.freedom.any())


def find_postures(
    task: Task, goal: Array, start: Array, *, limits: bool = True, tolerance: float, starts: int = STARTS
) -> Postures:
    """Find all isolated postures that bring the site to a goal, as far as many starts lead to them.

    A posture belongs to a continuum if the rank of A is below n there, and a small step along a direction
    that A loses leads to another posture, not back. This happens for an arm with more joints than task rows,
    and at some singular configurations, such as with a point on the first axis. A singular posture without
    neighbors, such as that of an arm stretched to its reach, is isolated.

    Args:
        task: The arm and the rows that count, along world axes.
        goal: Pose of the site, (7,).
        start: Joint positions, (n,), to begin at.
        limits: Whether to keep the model's position limits.
        tolerance: Tolerance of |e|: orientation in rad, position over L.
        starts: Number of starts.
    """
    limit = limits_of(task, limits)
    first = np.vstack([np.clip(start, *limit.T), random_starts(task, starts - 1, limits)])
    q, error = _reached(task, limit, goal, first)
    q, hits = _distinct(task, unwound(task.arm, limit, q[error <= tolerance], np.zeros((1, task.arm.n))))
    freedom = _freedom(task, limit, goal, q, tolerance)
    loose = np.flatnonzero(freedom)
    if len(loose):
        nearest = loose[np.argmin(np.linalg.norm(_gap(task, q[loose], start), axis=1))]
        hits[nearest] = hits[loose].sum()
        chosen = np.append(np.flatnonzero(freedom == 0), nearest)
        q, hits, freedom = q[chosen], hits[chosen], freedom[chosen]
    order = np.lexsort(q.round(6).T[::-1])  # rounding must not decide between equal first joints
    return Postures(q[order], hits[order], freedom[order], starts)


def limits_of(task: Task, limits: bool) -> Array:
    """Return the position limits to keep, (n, 2); infinite without `limits`."""
    return task.arm.position_limit if limits else np.tile([-np.inf, np.inf], (task.arm.n, 1))


def random_starts(task: Task, count: int, limits: bool) -> Array:
    """Return joint positions to begin at, (count, n), the same at every call.

    Without limits the range of a hinge is its circle, and a slide goes as far to either side of 0 as its
    farther limit.
    """
    if limits:
        return task.arm.sampled(count, SEED)
    farthest = np.abs(task.arm.position_limit).max(axis=1)
    span = np.where(task.arm.is_slide & np.isfinite(farthest), farthest, np.pi)
    return np.random.default_rng(SEED).uniform(-span, span, (count, task.arm.n))


def _reached(task: Task, limit: Array, goal: Array, first: Array) -> tuple[Array, Array]:
    """Return q, (S, n), to which each of S starts leads, and |e| there, (S,)."""
    goals, no_more = np.tile(goal, (len(first), 1)), np.empty((0, task.arm.n))
    return search(task, limit, SHARP, STEPS, goals, first, no_more)[:2]


def _gap(task: Task, a: Array, b: Array) -> Array:
    """Return scaled a − b of joint positions; hinges go the shorter way round."""
    gap = (a - b) / task.joint_scale
    return np.where(task.arm.comes_round, gap - 2.0 * np.pi * np.round(gap / (2.0 * np.pi)), gap)


def _distinct(task: Task, q: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the distinct ones of joint positions (N, n), and how often each occurs."""
    distinct, hits = list[Array](), list[int]()
    while len(q):
        same = (np.abs(_gap(task, q, q[0])) <= SAME).all(axis=1)
        distinct.append(q[0])
        hits.append(int(same.sum()))
        q = q[~same]
    return np.array(distinct).reshape(-1, task.arm.n), np.array(hits, np.int64)


def _freedom(task: Task, limit: Array, goal: Array, q: Array, tolerance: float) -> NDArray[np.int64]:
    """Return the number of directions in which each posture, (k, n), can move with the site at rest."""
    J = np.array([task.arm.jacobian(row) for row in q]).reshape(-1, 6, task.arm.n)
    for posture, jacobian in zip(q, J, strict=True):
        turn_rotations(pose_error(goal, task.arm.pose(posture)), jacobian, task.arm.n)
    _, values, directions = np.linalg.svd(task.matrix(J))
    sigma = np.zeros(q.shape)
    sigma[:, : values.shape[1]] = values
    is_lost, moves = sigma <= LOST * sigma[:, :1], np.zeros(len(q), np.bool_)
    for i, sign in product(np.flatnonzero(is_lost.any(axis=0)), (1.0, -1.0)):
        some = is_lost[:, i]
        nudged = q[some] + sign * NUDGE * task.joint_scale * directions[some, i]
        there, error = _reached(task, limit, goal, np.clip(nudged, *limit.T))
        away = np.linalg.norm(_gap(task, there, q[some]), axis=1)
        moves[some] |= (away > 0.5 * NUDGE) & (error <= tolerance)
    return np.where(moves, is_lost.sum(axis=1), 0)


# The answer ---------------------------------------------------------------------------------------

Method: TypeAlias = Literal["damped", "newton"]

TOLERANCE = 1e-9
# The search has a smaller tolerance than promised, so that MuJoCo's rounding, 1e-15, does not break the
# promise.
AIM = 0.99
# Newton's method is lost if not done after this many steps.
NEWTON_STEPS = 50
# Number of other starts. Of 20,000 random poses of the PUMA arm, one in a hundred needs more than 19, one in
# a thousand more than 32, and one needed 133.
RESTARTS = 200
# A limit counts as reached within this distance, for rounding.
AT_LIMIT = 1e-9


@brief
@dataclass(frozen=True, eq=False)
class IkResult:
    """Joint positions that bring a site to a goal, or the nearest that were found.

    Attributes:
        task: The arm and the rows that count.
        goal: Target pose of the site, (7,).
        start: Joint positions at which the search began, (n,).
        method: "damped" or "newton".
        limits: Whether the model's position limits must be kept.
        tolerance: Tolerance of |e|: orientation in rad, position over L.
        q: Joint positions, (n,) [rad or m]; of all postures the nearest to the start.
        steps: Number of steps from all starts.
        tries: Number of starts up to the successful one; all, if none succeeded.
        iterates: Joint positions of each of Newton's k steps, (k + 1, n); None for damped steps.
        postures: All of them; None if only one was requested.
    """

    task: Task
    goal: Array
    start: Array
    method: Method
    limits: bool
    tolerance: float
    q: Array
    steps: int = 0
    tries: int = 0
    iterates: Array | None = None
    postures: Postures | None = None

    @cached_property
    def pose(self) -> Array:
        """Pose of the site, by MuJoCo, (7,)."""
        return self.task.arm.pose(self.q)

    @property
    def position_error(self) -> float:
        """|Δp| over the rows that count [m]."""
        rows = self.task.rows[self.task.rows < 3]
        return float(np.linalg.norm(pose_error(self.goal, self.pose)[rows]))

    @property
    def orientation_error(self) -> float:
        """|Δφ| over the rows that count [rad]."""
        rows = self.task.rows[self.task.rows >= 3]
        return float(np.linalg.norm(pose_error(self.goal, self.pose)[rows]))

    @property
    def error(self) -> float:
        """|e| = √(|Δp|²/L² + |Δφ|²); the nearest positions minimize it."""
        return float(np.hypot(self.position_error / self.task.length, self.orientation_error))

    @property
    def at_limit(self) -> dict[str, str]:
        """Joints at a limit: `lower` or `upper`; after Newton's steps some are `beyond`."""
        below, above = (limits_of(self.task, self.limits).T - self.q) * [[1.0], [-1.0]]
        sides = {
            "lower": np.abs(below) <= AT_LIMIT,
            "upper": np.abs(above) <= AT_LIMIT,
            "beyond": (below > AT_LIMIT) | (above > AT_LIMIT),
        }
        return {
            joint: side for side, there in sides.items() for joint in compress(self.task.arm.joints, there)
        }

    @property
    def found(self) -> bool:
        """Whether the goal is reached within the tolerance and the limits."""
        return self.error <= self.tolerance and "beyond" not in self.at_limit.values()


def ik(
    model: Model,
    to: ArrayLike | None = None,
    q: ArrayLike | None = None,
    *,
    quat: ArrayLike | None = None,
    to_q: ArrayLike | None = None,
    keyframe: str | None = None,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    axes: Sequence[str] | None = None,
    task_frame: str | None = None,
    length: float | None = None,
    method: Method = "damped",
    limits: bool = True,
    every: bool = False,
    tolerance: float = TOLERANCE,
) -> IkResult:
    """Find joint positions that bring the site of an arm to a goal; the function behind `rmrc ik`.

    Args:
        model: An arm, an MJCF file, or a scenario.
        to: The goal: a value for each row that counts [m, rad], see `goal_pose`; with `quat` one for each of
            x, y, z that counts.
        q: Joint positions to begin at, (n,) [rad or m]; None: those of the keyframe.
        quat: The goal's orientation [w, x, y, z], of any length but 0.
        to_q: The goal instead: the pose of the site at these joint positions, (n,) [rad or m].
        keyframe: Name of the joint positions to begin at; None: the start of a scenario, or else `home`.
        site: The site to bring there; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.tree`.
        body: The body whose frame to bring there, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        axes: Rows that count, of x y z rx ry rz; None: those of a scenario, or else those that the arm can
            move independently.
        task_frame: Frame of the rows: `world`, `base` or `site`; None: that of the scenario whose rows they
            are, or else `world`. A goal is a pose in the world: in another frame, all three positions count
            or none, and likewise rotations.
        length: Characteristic length, which makes meters and radians comparable [m]; None: that of a
            scenario, or else of the arm.
        method: `damped` steps from several starts, or `newton`'s from one.
        limits: Whether to keep the model's position limits.
        every: Whether to search for all postures, from many starts, by damped steps.
        tolerance: Tolerance of |e|: orientation in rad, position over L.

    Returns:
        The result. A goal that is not reached is no error: then `found` is False, and `q` is where |e| is
        smallest.

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: There is no goal or more than one, or any of the others does not fit the arm.

    Example:
        >>> answer = ik("models/planar_2link.xml", [1.0, 1.0])
        >>> answer.found, np.degrees(answer.q).round(6).tolist()
        (True, [90.0, -90.0])
        >>> answer = ik("models/planar_2link.xml", [1.0, 1.0], every=True)
        >>> (np.degrees(answer.postures.q).round(6) + 0.0).tolist()
        [[0.0, 90.0], [90.0, -90.0]]
    """
    if method not in get_args(Method):
        raise QuestionError(f'method must be one of {", ".join(get_args(Method))}, got "{method}"')
    if every and method != "damped":
        raise QuestionError(f'all postures are searched for by the method "damped", got "{method}"')
    if not tolerance > 0.0:
        raise QuestionError(f"tolerance must be > 0, got {tolerance}")
    question = subject(model, q, keyframe, site, axes, length, body, packages, task_frame)
    question.arm.require_open()
    task, start = _in_world(question.task), question.q
    goal = goal_pose(task, to, quat, to_q)
    postures = find_postures(task, goal, start, limits=limits, tolerance=tolerance) if every else None
    if postures is None or not len(postures.q):
        nearest = solve_ik(task, goal, start, method=method, limits=limits, tolerance=tolerance)
        return replace(nearest, postures=postures)
    near = unwound(task.arm, limits_of(task, limits), postures.q, start[None])
    best = near[np.argmin(np.linalg.norm((near - start) / task.joint_scale, axis=1))]
    return IkResult(task, goal, start, method, limits, tolerance, best, postures=postures)


def solve_ik(
    task: Task, goal: Array, start: Array, *, method: Method = "damped", limits: bool = True,
    tolerance: float = TOLERANCE, restarts: int = RESTARTS,
) -> IkResult:  # fmt: skip
    """Find joint positions that bring the site to a goal.

    damped: z = Σ_i σ_i/(σ_i² + λ²) v_i u_iᵀ e, with λ² proportional to |e|² and limits as an active set
    [Levenberg44], [Chan88], [Sugihara11], [Fan03]; from other starts if it does not succeed.
    newton: q⁺ = q + S_q A⁺ e, the Newton-Raphson method of the notes [Selig92, §6.3], from one start; limits
    are ignored until it ends. They are `descend` and `newton` of `rmrc.simulation.inverse_kinematics`.

    Args:
        task: The arm and the rows that count, and the length L that weighs rotation against position.
        goal: Pose of the site, [p, quat w x y z], (7,); see `goal_pose`.
        start: Joint positions, (n,). The damped method begins at the nearest within limits.
        method: "damped" or "newton".
        limits: Whether to keep the model's position limits.
        tolerance: Tolerance of |e|: orientation in rad, position over L.
        restarts: Other starts to try.

    Returns:
        Joint positions, hinges at most half a turn from the start where limits allow.
    """
    arm, limit, aim, iterates, tries = task.arm, limits_of(task, limits), AIM * tolerance, None, 1
    if method == "newton":
        trace = np.full((NEWTON_STEPS + 1, arm.n + 2), np.nan)
        q, steps = newton(task, aim, NEWTON_STEPS, goal, start, trace)
        iterates = trace[~np.isnan(trace[:, 0]), : arm.n]
    else:
        first, more = np.clip(start, *limit.T)[None], random_starts(task, restarts, limits)
        (q,), (error,), ((steps, winner),) = search(task, limit, aim, STEPS, goal[None], first, more)
        tries += int(winner) if error <= aim else restarts
    q = unwound(arm, limit, q[None], start[None])[0]
    return IkResult(task, goal, start, method, limits, tolerance, q, int(steps), tries, iterates)


def goal_pose(
    task: Task, to: ArrayLike | None = None, quat: ArrayLike | None = None, to_q: ArrayLike | None = None
) -> Array:
    """Return the pose (7,) of a goal, with a unit quaternion of w >= 0, like that of a site.

    In `to`, rx, ry, rz are the rotation vector of the orientation if all three count. If only some do, they
    turn the site from its orientation with all joints at 0, which for parallel axes is the sum of the joint
    angles; rows that do not count stay 0:

        R_ref = exp([rx, ry, rz]),   or   exp([rx, ry, rz]) R(0)

    Args:
        task: The arm and the rows that count.
        to: One value for each row [m, rad]; for each of x, y, z that counts, if `quat` is given.
        quat: The orientation [w, x, y, z], of any length but 0.
        to_q: The goal instead: the pose of the site at these joint positions, (n,) [rad or m].

    Raises:
        QuestionError: There is no goal or more than one; its values are too many, too few, or not finite; or
            the quaternion is zero.

    Example:
        >>> from pathlib import Path
        >>> from rmrc.law.task import choose
        >>> from rmrc.arm import load
        >>> task = choose(load(Path("models/planar_3link.xml")))
        >>> task.axes, goal_pose(task, [0.5, 0.3, np.pi]).round(12) + 0.0
        (('x', 'y', 'rz'), array([0.5, 0.3, 0. , 0. , 0. , 0. , 1. ]))
    """
    if (to_q is None) == (to is None and quat is None):
        each = ", ".join(task.axes)
        raise QuestionError(f"give one goal: to, with a value for each of {each}, or to_q")
    if to_q is not None:
        return task.arm.pose(numbers("to_q", to_q, task.arm.joints))
    rows = task.rows if quat is None else task.rows[task.rows < 3]
    full = np.zeros(6)
    full[rows] = numbers("to", () if to is None else to, [AXES[row] for row in rows])
    orientation = exp_rotation(full[3:])
    if quat is not None:
        orientation = numbers("quat", quat, ("w", "x", "y", "z"))
        if not orientation.any():
            raise QuestionError("quat must not be zero, got 0, 0, 0, 0")
    elif np.count_nonzero(rows >= 3) < 3:
        orientation = quat_multiply(orientation, task.arm.chain.tip_quat)
    return np.append(full[:3], normalize(orientation) * np.copysign(1.0, orientation[0]))


def _in_world(task: Task) -> Task:
    """Return the task along world axes: for whole positions and rotations it is the same.

    Raises:
        QuestionError: It has only some of three rows along axes of the site or of the base.
    """
    for three in (slice(0, 3), slice(3, 6)) if task.frame != "world" else ():
        counted = [axis for axis in AXES[three] if axis in task.axes]
        if len(counted) in (1, 2):
            raise QuestionError(
                f"rows {', '.join(counted)} along the axes of the {task.frame} are not searched for; give "
                f"axes with all of {', '.join(AXES[three])} or none, or a task frame of world"
            )
    return Task(task.arm, task.rows, task.length)
