"""All postures of an arm that reach a goal: their number, and whether they are a continuum."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.analysis.ik.continua import SHARP, find_continua
from rmrc.analysis.ik.self_motion import SelfMotion
from rmrc.analysis.ik.solve import (
    STEPS,
    TOLERANCE,
    Solution,
    checked_goals,
    checked_starts,
    kept_limit,
    random_starts,
    solve_ik,
)
from rmrc.law.task import Array, Task
from rmrc.simulation.inverse_kinematics import search, unwound

# Starts of a search for all postures. A posture that a hundredth of them reaches is missed with probability
# 1e-9.
STARTS = 2000
# Two postures are one if no joint differs by more, hinges modulo whole turns [rad, or m over L]. Where two
# merge at a singularity, each is known only to the root of rounding, about 1e-7.
SAME = 1e-4
# A posture is tested for a continuum if σ_k/σ_1 is smaller, by moving it this far.
NEARLY_SINGULAR = 1e-4
NUDGE = 0.05


@dataclass(frozen=True, eq=False)
class Postures:
    """All postures that were found for a goal.

    Attributes:
        q: Joint positions, (k, n), ascending; hinges in (−π, π] where limits allow. Each continuum has one
            posture, the nearest to the start of those found.
        hits: Number of starts that led to each, (k,); for a continuum, to any of its postures.
        freedom: Number of directions in which each can move with the site at rest, (k,); 0: it is isolated.
        decided: Whether each is known to be separate from all others, (k,); for some continua of two and more
            dimensions it is not.
        led_to: Index of the posture to which each start led, (S,); −1: none.
        starts: Number of starts, S.
        nearest: The nearest configuration that was found, if there is no posture.
    """

    q: Array
    hits: NDArray[np.int64]
    freedom: NDArray[np.int64]
    decided: NDArray[np.bool_]
    led_to: NDArray[np.int64]
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
    posture belongs to a continuum if the rank of A is below n there, and other postures that are not isolated
    either are beside it along the null space of A. This happens for an arm with more joints than task rows,
    and at some singular configurations, such as with a point on the first axis. A singular posture without
    neighbors, such as that of an arm stretched to its reach, is isolated. Each connected piece of all
    postures is one continuum (`rmrc.analysis.ik.continua`), within limits and modulo whole turns of unlimited
    hinges.

    Args:
        task: The arm and the rows that count.
        goal: Pose of the site, (7,).
        start: Joint positions, (n,), to begin at, and from which the posture of each continuum is the
            nearest;
            None: `home`.
        limits: Whether to keep the model's position limits.
        tolerance: Tolerance of |e|: orientation in rad, position over L.
        starts: Number of starts.
        threads: None: one per core; the result does not depend on it.

    Returns:
        The postures, or the nearest configuration if none was found.

    Raises:
        QuestionError: Goal or start do not fit the arm or are not finite.

    Example:
        >>> from pathlib import Path
        >>> from rmrc.analysis.ik.solve import goal_pose
        >>> from rmrc.law.task import choose
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
    led_to = np.full(starts, -1, np.int64)
    if not reached.any():
        nearest = solve_ik(task, goals[0], start[0], limits=limits, tolerance=tolerance)
        none = np.zeros(0, np.int64)
        return Postures(np.zeros((0, arm.n)), none, none, none.astype(bool), led_to, starts, nearest)
    motion = SelfMotion(task, goals[0], limit)
    found, which = _distinct(motion, unwound(arm, limit, q[reached], np.zeros((1, arm.n))))
    freedom = _freedom(motion, found, tolerance, threads)
    shown, freedom, decided, entry = _gathered(motion, found, freedom, start[0], tolerance, threads)
    # Rounding must not decide between equal first joints. On a continuum the search ends anywhere near the
    # nearest point: there the joint that differs most between the entries comes first.
    keys = shown.round(6).T
    order = np.lexsort(
        (keys[np.argsort(-np.ptp(keys, axis=1), kind="stable")] if freedom.any() else keys)[::-1]
    )
    led_to[reached] = np.argsort(order)[entry[which]]
    hits = np.bincount(led_to[reached], minlength=len(shown))
    return Postures(shown[order], hits, freedom[order], decided[order], led_to, starts, None)


def _sharpest(
    task: Task, limit: Array, goal: Array, first: Array, threads: int | None
) -> tuple[Array, Array]:
    """Return q (S, n) and |e| (S,) of one goal from each of S starts, to rounding."""
    goals = np.tile(goal, (len(first), 1))
    q, error, _ = search(
        task, limit, SHARP, STEPS["damped"], goals, first, np.empty((0, task.arm.n)), threads
    )
    return q, error


def _distinct(motion: SelfMotion, q: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the distinct ones of joint positions (N, n), and the index of each among them, (N,)."""
    distinct: list[Array] = []
    which = np.full(len(q), -1)
    left = np.arange(len(q))
    while len(left):
        gap = motion.gap(q[left] / motion.task.joint_scale, q[left[0]] / motion.task.joint_scale)
        same = (np.abs(gap) <= SAME).all(axis=1)
        which[left[same]] = len(distinct)
        distinct.append(q[left[0]])
        left = left[~same]
    return np.array(distinct), which


def _gathered(
    motion: SelfMotion, q: Array, freedom: NDArray[np.int64], start: Array, tolerance: float,
    threads: int | None,
) -> tuple[Array, NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:  # fmt: skip
    """Return one posture of each continuum, and the isolated ones.

    Returns:
        Postures (k, n), their freedom (k,), whether each is known to be separate (k,), and the index of the
        posture to which each given one belongs, (N,).
    """
    scale = motion.task.joint_scale
    alone, loose = np.flatnonzero(freedom == 0), np.flatnonzero(freedom)
    pieces = find_continua(motion, q[loose] / scale, freedom[loose], threads) if len(loose) else []
    shown, entry = [q[i] for i in alone], np.full(len(q), -1)
    entry[alone] = np.arange(len(alone))
    for piece in pieces:
        entry[loose[piece.members]] = len(shown)
        shown.append(_nearest(motion, q[loose[piece.members]], piece.nodes * scale, start, tolerance))
    return (
        np.array(shown),
        np.array([*(0 for _ in alone), *(piece.freedom for piece in pieces)], np.int64),
        np.array([*(True for _ in alone), *(piece.decided for piece in pieces)], np.bool_),
        entry,
    )


def _nearest(motion: SelfMotion, met: Array, nodes: Array, start: Array, tolerance: float) -> Array:
    """Return the posture nearest to the start, among those found, (N, n), and nodes between, (K, n)."""
    task, limit = motion.task, motion.limit
    nodes = np.clip(unwound(task.arm, limit, nodes, np.zeros((1, task.arm.n))), *limit.T)
    every = np.concatenate([met, nodes])
    away = np.linalg.norm(motion.gap(every / task.joint_scale, start / task.joint_scale), axis=1)
    for i in np.argsort(away, kind="stable"):
        if i < len(met) or np.linalg.norm(motion.linear(every[i] / task.joint_scale)[0]) <= tolerance:
            break
    return np.asarray(every[i])


def _null(motion: SelfMotion, x: Array, threads: int | None) -> list[Array]:
    """Return the null space of A at scaled joint positions (N, n), each (d, n)."""
    _, sigma, v = np.linalg.svd(motion.matrices(x, threads))
    rank = np.count_nonzero(sigma > NEARLY_SINGULAR * sigma[:, :1], axis=1)
    return [lost[r:] for lost, r in zip(v, rank, strict=True)]


def _freedom(motion: SelfMotion, q: Array, tolerance: float, threads: int | None) -> NDArray[np.int64]:
    """Return the number of directions in which each posture (k, n) can move with the site at rest.

    Where the rows of A are independent, it is the number of redundant joints, by the implicit function
    theorem. Elsewhere each direction of the null space of A is tried: those with neighboring postures count,
    up to the dimension of the null space at these neighbors.
    """
    task, x = motion.task, q / motion.task.joint_scale
    spare = task.arm.n - len(task.rows)
    null = _null(motion, x, threads)
    freedom = np.array([spare if len(lost) == spare else 0 for lost in null], np.int64)
    nudges = [
        (i, sign * direction)
        for i, lost in enumerate(null)
        if len(lost) > max(spare, 0)
        for direction in lost
        for sign in (NUDGE, -NUDGE)
    ]
    if nudges:
        first = np.array([q[i] + task.joint_scale * nudge for i, nudge in nudges])
        limit = np.stack([motion.low, motion.high], axis=1) * task.joint_scale[:, None]
        there, error = _sharpest(task, limit, motion.goal, np.clip(first, *limit.T), threads)
        owner = np.array([i for i, _ in nudges])
        moved = motion.gap(there / task.joint_scale, x[owner])
        far = (np.linalg.norm(moved, axis=1) > 0.5 * NUDGE) & (error <= tolerance)
        losses = np.array([len(lost) for lost in _null(motion, there / task.joint_scale, threads)])
        for i in np.unique(owner[far]):
            beside = np.flatnonzero((owner == i) & far)
            spread = np.linalg.svd(moved[beside], compute_uv=False)
            # Where the set is curved, the deviation from its tangent is about a twentieth of a nudge.
            freedom[i] = min(losses[beside].min(), np.count_nonzero(spread > 0.2 * spread[0]))
    return freedom
