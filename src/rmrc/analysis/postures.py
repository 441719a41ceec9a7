"""All postures of an arm that reach a goal: how many there are, and whether they are a continuum."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.analysis.inverse_kinematics import (
    STEPS,
    TOLERANCE,
    Solution,
    checked_goals,
    checked_starts,
    kept_limit,
    random_starts,
    search,
    solve_ik,
    unwound,
)
from rmrc.analysis.task import Array, Task

# Starts of a search for all postures. One that a hundredth of them leads to is missed with probability 1e-9.
STARTS = 2000
# Two postures are one if no joint differs by more, hinges modulo whole turns [rad, or m over L]. Where two
# fuse at a singularity, each is known to the root of rounding only, 1e-7 and some.
SAME = 1e-4
# All postures are searched to rounding, so that `SAME` suffices.
SHARP = 1e-13
# A posture is asked whether it is one of a continuum if σ_k/σ_1 is less, and if it can be moved so far.
NEARLY_SINGULAR = 1e-4
NUDGE = 0.05


@dataclass(frozen=True, eq=False)
class Postures:
    """All postures that were found for a goal.

    Attributes:
        q: Joint positions, (k, n), rising; hinges in (−π, π] where limits allow. Of all continua there is one
            posture, the nearest to the start.
        hits: How many starts led to each, (k,). To the one of all continua, those that led to any.
        freedom: In how many directions each can be moved with the site at rest, (k,); 0: it is isolated.
        starts: How many starts were tried.
        nearest: The nearest configuration that was found, if there is no posture.
    """

    q: Array
    hits: NDArray[np.int64]
    freedom: NDArray[np.int64]
    starts: int
    nearest: Solution | None

    @property
    def is_continuum(self) -> bool:
        """Whether there are infinitely many."""
        return bool(self.freedom.any())


def find_postures(
    task: Task, goal: ArrayLike, start: ArrayLike | None = None, *, limits: bool = True,
    tolerance: float = TOLERANCE, starts: int = STARTS, threads: int | None = None,
) -> Postures:  # fmt: skip
    """Find all postures that bring the site to a goal, as far as many starts lead to them.

    Two are the same if no joint differs by more than 1e-4 [rad, or m over L], hinges modulo whole turns. A
    posture is one of a continuum if A has not rank n there, and others, not isolated either, are beside it in
    a direction that A loses: those of an arm with more joints than task rows, or of a singular configuration,
    as with a point on the first axis. A singular posture with none beside it, as that of an arm stretched to
    its reach, is isolated.

    Args:
        task: The arm and the rows that count.
        goal: Pose of the site, (7,).
        start: Joint positions, (n,), to begin at and to which one of a continuum is nearest; None for `home`.
        limits: Whether the model's position limits are kept to.
        tolerance: Of |e|: orientation in rad, position over L.
        starts: How many starts.
        threads: None for one on each core; the result does not depend on it.

    Returns:
        The postures, or the nearest configuration if none was found.

    Raises:
        QuestionError: Goal or start do not fit the arm or are not finite.

    Example:
        >>> from pathlib import Path
        >>> from rmrc.analysis.inverse_kinematics import goal_pose
        >>> from rmrc.analysis.task import choose
        >>> from rmrc.arm import load
        >>> task = choose(load(Path("models/planar_2link.xml")))
        >>> found = find_postures(task, goal_pose(task, [1.0, 1.0]))
        >>> (np.degrees(found.q).round(6) + 0.0).tolist(), found.is_continuum
        ([[0.0, 90.0], [90.0, -90.0]], False)
    """
    arm, limit = task.arm, kept_limit(task.arm, limits)
    goals, start = checked_goals(goal, 1), checked_starts(arm, start, 1)
    first = np.concatenate([np.clip(start, *limit.T), random_starts(task, starts - 1, limits)])
    q, error = _sharpest(task, limit, goals[0], first, threads)
    reached = error <= tolerance
    if not reached.any():
        nearest = solve_ik(task, goals[0], start[0], limits=limits, tolerance=tolerance)
        none = np.zeros(0, np.int64)
        return Postures(np.zeros((0, arm.n)), none, none, starts, nearest)
    found, hits = _distinct(task, unwound(arm, limit, q[reached], np.zeros((1, arm.n))))
    freedom = _freedom(task, limit, goals[0], found, tolerance, threads)
    loose = np.flatnonzero(freedom)
    if len(loose):
        away = np.linalg.norm(_difference(task, found[loose], start), axis=1)
        one = loose[np.argmin(away)]
        hits[one] = hits[loose].sum()
        keep = np.append(np.flatnonzero(freedom == 0), one)
        found, hits, freedom = found[keep], hits[keep], freedom[keep]
    # Rounding must not decide between equal first joints.
    order = np.lexsort(found.round(6).T[::-1])
    return Postures(found[order], hits[order], freedom[order], starts, None)


def _sharpest(
    task: Task, limit: Array, goal: Array, first: Array, threads: int | None
) -> tuple[Array, Array]:
    """Return q (S, n) and |e| (S,) of one goal from each of S starts, to rounding."""
    goals = np.tile(goal, (len(first), 1))
    q, error, _ = search(
        task, limit, False, SHARP, STEPS["damped"], goals, first, np.empty((0, task.arm.n)), threads
    )
    return q, error


def _difference(task: Task, a: Array, b: Array) -> Array:
    """Return a − b, scaled by S_q, hinges to the nearest turn."""
    gap = a - b
    gap = np.where(task.arm.comes_round, gap - 2.0 * np.pi * np.round(gap / (2.0 * np.pi)), gap)
    return gap / task.joint_scale


def _distinct(task: Task, q: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the different ones of joint positions (N, n), and how often each is there."""
    distinct: list[Array] = []
    hits: list[int] = []
    while len(q):
        same = (np.abs(_difference(task, q, q[0])) <= SAME).all(axis=1)
        distinct.append(q[0])
        hits.append(int(np.count_nonzero(same)))
        q = q[~same]
    return np.array(distinct), np.array(hits)


def _nulls(task: Task, q: Array) -> Sequence[Array]:
    """Return the joint directions, scaled, that A loses at q, each (n,)."""
    _, sigma, v = np.linalg.svd(task.matrix(task.arm.jacobian(q)))
    rank = int(np.count_nonzero(sigma > NEARLY_SINGULAR * sigma[0]))
    return list(v[rank:])


def _freedom(
    task: Task, limit: Array, goal: Array, q: Array, tolerance: float, threads: int | None
) -> NDArray[np.int64]:
    """Return in how many directions each posture (k, n) can be moved with the site at rest."""
    nudges = [
        (i, d, sign * direction)
        for i, positions in enumerate(q)
        for d, direction in enumerate(_nulls(task, positions))
        for sign in (NUDGE, -NUDGE)
    ]
    free: list[set[int]] = [set() for _ in q]
    if nudges:
        first = np.array([q[i] + task.joint_scale * nudge for i, _, nudge in nudges])
        there, error = _sharpest(task, limit, goal, np.clip(first, *limit.T), threads)
        for (i, d, _), positions, left in zip(nudges, there, error, strict=True):
            moved = np.linalg.norm(_difference(task, positions, q[i])) > 0.5 * NUDGE
            if moved and left <= tolerance and len(_nulls(task, positions)):
                free[i].add(d)
    return np.array([len(directions) for directions in free], np.int64)
