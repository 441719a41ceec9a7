"""Joint positions that bring the site of an arm to a goal: one posture, or all of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.analysis.ik.solve import (
    METHODS,
    STEPS,
    TOLERANCE,
    Method,
    Solution,
    begin_at,
    goal_pose,
    judge,
    limits_of,
    normalized_goal,
    random_starts,
    solve_ik,
)  # fmt: skip
from rmrc.analysis.subject import Model, Packages, numbers, subject
from rmrc.law.task import Array, Task
from rmrc.simulation.inverse_kinematics import search, turn_rotations, unwound
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import AXES, pose_error

# Starts of a search for all postures. A posture that a hundredth of them reaches is missed with probability
# 1e-9.
STARTS = 2000
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
        freedom: Number of directions in which each can move with the site at rest, (k,); 0: it is isolated.
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


@brief
@dataclass(frozen=True, eq=False)
class IkResult:
    """The result of `ik`.

    Attributes:
        task: The arm and the rows that count.
        goal: Target pose of the site, (7,).
        start: Joint positions at which the search began, (n,).
        limits: Whether the search kept the model's position limits.
        tolerance: Tolerance of |e|: orientation in rad, position over L.
        solution: Joint positions at the goal, or the nearest ones found; of all postures the nearest to
            the start.
        postures: All of them; None if only one was requested.
    """

    task: Task
    goal: Array
    start: Array
    limits: bool
    tolerance: float
    solution: Solution
    postures: Postures | None

    @property
    def found(self) -> bool:
        """Whether the goal is reached within the tolerance and the limits."""
        return self.solution.found

    @property
    def q(self) -> Array:
        """Joint positions of the solution, (n,) [rad or m]."""
        return self.solution.q


def ik(
    model: Model,
    to: ArrayLike | None = None,
    q: ArrayLike | None = None,
    *,
    quat: ArrayLike | None = None,
    to_q: ArrayLike | None = None,
    pose: ArrayLike | None = None,
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
        to: The goal: a value for each row that counts [m, rad], see `rmrc.analysis.ik.solve.goal_pose`; with
            `quat` one for each of x, y, z that counts.
        q: Joint positions to begin at, (n,) [rad or m]; None: those of the keyframe.
        quat: The goal's orientation [w, x, y, z], of any length but 0.
        to_q: The goal instead: the pose of the site at these joint positions, (n,) [rad or m].
        pose: The goal instead: [p, quat w x y z], (7,); rows that do not count are ignored.
        keyframe: Name of the joint positions to begin at; None: the start of a scenario, or else `home`.
        site: The site to bring there; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.frames`.
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
    if method not in METHODS:
        raise QuestionError(f'method must be one of {", ".join(METHODS)}, got "{method}"')
    if every and method != "damped":
        raise QuestionError(f'every takes the method "damped" alone, got "{method}"')
    question = subject(model, q, keyframe, site, axes, length, body, packages, task_frame)
    question.arm.require_open()
    task, start = searchable(question.task), question.q
    goal = _goal(task, to, quat, to_q, pose)
    postures = find_postures(task, goal, start, limits=limits, tolerance=tolerance) if every else None
    if postures is not None and len(postures.q):
        limit = limits_of(task.arm, limits)
        near = unwound(task.arm, limit, postures.q, start[None])
        best = near[np.argmin(np.linalg.norm((near - start) / task.joint_scale, axis=1))]
        solution = judge(task, limit, best, normalized_goal(goal), tolerance)
    else:
        solution = solve_ik(task, goal, start, method=method, limits=limits, tolerance=tolerance)
    return IkResult(task, goal, start, limits, tolerance, solution, postures)


def searchable(task: Task) -> Task:
    """Return the task along world axes: for whole positions and rotations it is the same.

    Raises:
        QuestionError: It has only some of three rows along axes of the site or of the base.
    """
    if task.frame == "world":
        return task
    for three in (slice(0, 3), slice(3, 6)):
        counted = [axis for axis in AXES[three] if axis in task.axes]
        if len(counted) in (1, 2):
            raise QuestionError(
                f"rows {', '.join(counted)} along the axes of the {task.frame} are not searched for; give "
                f"axes with all of {', '.join(AXES[three])} or none, or a task frame of world"
            )
    return Task(task.arm, task.rows, task.length)


def find_postures(
    task: Task, goal: ArrayLike, start: ArrayLike | None = None, *, limits: bool = True,
    tolerance: float = TOLERANCE, starts: int = STARTS, threads: int | None = None,
) -> Postures:  # fmt: skip
    """Find all isolated postures that bring the site to a goal, as far as many starts lead to them.

    A posture belongs to a continuum if the rank of A is below n there, and a small step along a direction
    that A loses leads to another posture, not back. This happens for an arm with more joints than task rows,
    and at some singular configurations, such as with a point on the first axis. A singular posture without
    neighbors, such as that of an arm stretched to its reach, is isolated.

    Args:
        task: The arm and the rows that count.
        goal: Pose of the site, (7,).
        start: Joint positions, (n,), to begin at; None: `home`.
        limits: Whether to keep the model's position limits.
        tolerance: Tolerance of |e|: orientation in rad, position over L.
        starts: Number of starts.
        threads: None: one per core; the result does not depend on it.

    Raises:
        QuestionError: Goal or start do not fit the arm or are not finite.

    Example:
        >>> from pathlib import Path
        >>> from rmrc.law.task import choose
        >>> from rmrc.arm import load
        >>> task = choose(load(Path("models/planar_2link.xml")))
        >>> postures = find_postures(task, goal_pose(task, [1.0, 1.0]))
        >>> (np.degrees(postures.q).round(6) + 0.0).tolist(), postures.is_continuum
        ([[0.0, 90.0], [90.0, -90.0]], False)
    """
    arm, limit, goal = task.arm, limits_of(task.arm, limits), normalized_goal(goal)
    begin = begin_at(arm, start)
    first = np.concatenate([np.clip(begin, *limit.T)[None], random_starts(task, starts - 1, limits)])
    q, error = _reached(task, limit, goal, first, threads)
    q, hits = _distinct(task, unwound(arm, limit, q[error <= tolerance], np.zeros((1, arm.n))))
    freedom = _freedom(task, limit, goal, q, tolerance, threads)
    loose = np.flatnonzero(freedom)
    if len(loose):
        away = np.linalg.norm(_gap(task, q[loose], begin), axis=1)
        nearest = loose[np.argmin(away)]
        hits[nearest] = hits[loose].sum()
        chosen = np.append(np.flatnonzero(freedom == 0), nearest)
        q, hits, freedom = q[chosen], hits[chosen], freedom[chosen]
    order = np.lexsort(q.round(6).T[::-1])  # rounding must not decide between equal first joints
    return Postures(q[order], hits[order], freedom[order], starts)


def _reached(task: Task, limit: Array, goal: Array, first: Array, threads: int | None) -> tuple[Array, Array]:
    """Return q, (S, n), to which each of S starts leads, and |e| there, (S,)."""
    goals, none = np.tile(goal, (len(first), 1)), np.empty((0, task.arm.n))
    return search(task, limit, SHARP, STEPS["damped"], goals, first, none, threads)[:2]


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


def _freedom(
    task: Task, limit: Array, goal: Array, q: Array, tolerance: float, threads: int | None
) -> NDArray[np.int64]:
    """Return the number of directions in which each posture, (k, n), can move with the site at rest."""
    lost = [_lost_directions(task, goal, row) for row in q]
    steps = [
        (i, sign * NUDGE * direction)
        for i, directions in enumerate(lost)
        for direction in directions
        for sign in (1.0, -1.0)
    ]
    freedom = np.zeros(len(q), np.int64)
    if steps:
        owner = np.array([i for i, _ in steps])
        first = np.clip(q[owner] + task.joint_scale * [step for _, step in steps], *limit.T)
        there, error = _reached(task, limit, goal, first, threads)
        has_moved = np.linalg.norm(_gap(task, there, q[owner]), axis=1) > 0.5 * NUDGE
        for i in owner[has_moved & (error <= tolerance)]:
            freedom[i] = len(lost[i])
    return freedom


def _lost_directions(task: Task, goal: Array, q: Array) -> Array:
    """Return the null space of A = S_x L(φ) J S_q at joint positions, (d, n)."""
    J, error = np.array(task.arm.jacobian(q)), pose_error(goal, task.arm.pose(q))
    turn_rotations(error, J, task.arm.n)
    _, sigma, Vt = np.linalg.svd(task.matrix(J))
    return np.asarray(Vt[np.count_nonzero(sigma > LOST * sigma[0]) :])


def _goal(
    task: Task, to: ArrayLike | None, quat: ArrayLike | None, to_q: ArrayLike | None, pose: ArrayLike | None
) -> Array:
    """Return the pose (7,) of the one goal that was named."""
    others = {"to_q": to_q, "pose": pose, "to": to if to is not None else quat}
    names = [name for name, value in others.items() if value is not None]
    if len(names) != 1:
        rows = ", ".join(task.axes)
        raise QuestionError(
            f"give one goal: to with a value for each of {rows}, to_q or pose; "
            f"got {' and '.join(names) or 'none'}"
        )
    if pose is not None:
        return numbers("pose", pose, ("x", "y", "z", "qw", "qx", "qy", "qz"))
    if to_q is not None:
        return task.arm.pose(numbers("to_q", to_q, task.arm.joints))
    return goal_pose(task, () if to is None else to, quat)
