"""All joint positions that bring the site of an arm to a goal, as far as many starts lead to them."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rmrc.law.task import Array, Task
from rmrc.simulation.inverse_kinematics import search, turn_rotations, unwound
from rmrc.support.spatial import pose_error

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
