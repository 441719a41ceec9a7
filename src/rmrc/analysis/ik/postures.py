"""All postures of an arm that reach a goal: how many there are, and whether they are a continuum."""

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
from rmrc.law.descent import search, unwound
from rmrc.law.task import Array, Task

# Starts of a search for all postures. One that a hundredth of them leads to is missed with probability 1e-9.
STARTS = 2000
# Two postures are one if no joint differs by more, hinges modulo whole turns [rad, or m over L]. Where two
# fuse at a singularity, each is known to the root of rounding only, 1e-7 and some.
SAME = 1e-4
# A posture is asked whether it is one of a continuum if σ_k/σ_1 is less, and if it can be moved so far.
NEARLY_SINGULAR = 1e-4
NUDGE = 0.05


@dataclass(frozen=True, eq=False)
class Postures:
    """All postures that were found for a goal.

    Attributes:
        q: Joint positions, (k, n), rising; hinges in (−π, π] where limits allow. Of each continuum there is
            one posture, of those that were met the nearest to the start.
        hits: How many starts led to each, (k,); to that of a continuum, those that led to any of it.
        freedom: In how many directions each can be moved with the site at rest, (k,); 0: it is isolated.
        decided: Whether each is known to be apart from all others, (k,); of some continua of two and more
            dimensions it is not.
        led_to: Which of them each start led to, (S,); −1: to none.
        starts: How many starts were tried, S.
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
    posture is one of a continuum if A has not rank n there, and others, not isolated either, are beside it in
    a direction that A loses: those of an arm with more joints than task rows, or of a singular configuration,
    as with a point on the first axis. A singular posture with none beside it, as that of an arm stretched to
    its reach, is isolated. Each connected piece of all postures is one continuum
    (`rmrc.analysis.ik.continua`), within limits and modulo whole turns of hinges that have them.

    Args:
        task: The arm and the rows that count.
        goal: Pose of the site, (7,).
        start: Joint positions, (n,), to begin at, and to which that of each continuum is the nearest;
            None for `home`.
        limits: Whether the model's position limits are kept to.
        tolerance: Tolerance of |e|: orientation in rad, position over L.
        starts: How many starts.
        threads: None for one on each core; the result does not depend on it.

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
    # nearest point: there the joint comes first that differs most between the entries.
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
        task, limit, False, SHARP, STEPS["damped"], goals, first, np.empty((0, task.arm.n)), threads
    )
    return q, error


def _distinct(motion: SelfMotion, q: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the different ones of joint positions (N, n), and which of them each is, (N,)."""
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
    """Return one posture of each continuum beside the isolated ones.

    Returns:
        Postures (k, n), their freedom (k,), whether each is known to be apart (k,), and to which of them each
        of the given ones belongs, (N,).
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
    """Return the nearest to the start of postures that were met, (N, n), and of others between, (K, n)."""
    task, limit = motion.task, motion.limit
    nodes = np.clip(unwound(task.arm, limit, nodes, np.zeros((1, task.arm.n))), *limit.T)
    every = np.concatenate([met, nodes])
    away = np.linalg.norm(motion.gap(every / task.joint_scale, start / task.joint_scale), axis=1)
    for i in np.argsort(away, kind="stable"):
        if i < len(met) or np.linalg.norm(motion.linear(every[i] / task.joint_scale)[0]) <= tolerance:
            break
    return np.asarray(every[i])


def _null(motion: SelfMotion, x: Array, threads: int | None) -> list[Array]:
    """Return the directions that A loses at scaled joint positions (N, n), each (d, n)."""
    _, sigma, v = np.linalg.svd(motion.matrices(x, threads))
    rank = np.count_nonzero(sigma > NEARLY_SINGULAR * sigma[:, :1], axis=1)
    return [lost[r:] for lost, r in zip(v, rank, strict=True)]


def _freedom(motion: SelfMotion, q: Array, tolerance: float, threads: int | None) -> NDArray[np.int64]:
    """Return in how many directions each posture (k, n) can be moved with the site at rest.

    Where A has as many independent rows as there are, it is what the joints have to spare, by the theorem on
    implicit functions. Elsewhere each direction that A loses is tried: those count into which postures beside
    it lie, and no more than A loses at these.
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
            # Where the set is bent, what leaves its tangent is a twentieth of a nudge or so.
            freedom[i] = min(losses[beside].min(), np.count_nonzero(spread > 0.2 * spread[0]))
    return freedom
