"""Lost and nearly lost task directions of a Jacobian, and joint motions that do not move the task."""

from dataclasses import dataclass

import numpy as np

from rmrc.analysis.inspect import words as in_words
from rmrc.law.law import SINGULAR_BELOW
from rmrc.law.task import RANK_TOLERANCE, Array, Task

# A singular value of this share of the largest is rounding: the direction is lost, not nearly lost.
LOST = RANK_TOLERANCE
# A direction whose singular value is this share of the largest is nearly lost: the law's SINGULAR.
SLOW = SINGULAR_BELOW
# Squares of cosines that differ by less are the same to rounding.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Lost:
    """A task direction that cannot move: u of A with σ = 0.

    Attributes:
        twist: S_x⁻¹ u, [v; ω] along world axes, 0 in the rows that do not count, (6,) [m, rad].
        wrench: S_x u, the wrench with Jᵀ F = 0, likewise, (6,) [N, N·m].
        words: The impossible motion.
    """

    twist: Array
    wrench: Array
    words: str


@dataclass(frozen=True, eq=False)
class Slow:
    """A task direction that moves a hundred times slower than the best one, or slower still.

    Attributes:
        sigma: Singular value of A.
        twist: Motion of the task by the joint motion, S_x⁻¹ σ u, along world axes, (6,) [m, rad].
        motion: Joint motion S_q v, of norm 1 with slides in units of L, (n,) [rad or m].
        words: The slow motion, and its joints.
    """

    sigma: float
    twist: Array
    motion: Array
    words: str


@dataclass(frozen=True, eq=False)
class Motion:
    """A joint motion that does not move the task, to first order: v of A with σ = 0.

    Attributes:
        motion: S_q v, of norm 1 with slides in units of L, (n,) [rad or m].
        twist: Other motion of the site, [v; ω] along world axes, (6,) [m, rad].
        words: Its joints, and the other motion.
    """

    motion: Array
    twist: Array
    words: str


def rank_of(sigma: Array) -> int:
    """Return the number of singular values above rounding relative to the largest."""
    return int(np.count_nonzero(sigma > LOST * sigma[0])) if sigma[0] > 0.0 else 0


def examine(
    task: Task, J: Array, pose: Array, R_world_frame: Array, frame: str
) -> tuple[Array, tuple[Lost, ...], tuple[Slow, ...], tuple[Motion, ...]]:
    """Return the singular values, lost and nearly lost directions, and motions that do not move the task.

    All come from one decomposition: LAPACK's values with and without vectors differ by rounding.

    Where several directions are lost, or several motions do not move the task, the ones with the fewest rows
    or joints are returned.

    Args:
        task: The rows that count.
        J: Rows [v; ω] of the site along world axes, (6, n).
        pose: Pose of the site, (7,).
        R_world_frame: Rotation of the frame of the words, (3, 3).
        frame: Its name.

    Returns:
        Singular values of A, descending, (k,), and the three lists.
    """
    arm = task.arm
    named = f"{in_words.listed(task.axes)} of the site"
    named += "" if task.frame == "world" else f" along the axes of the {task.frame}"
    u, sigma, vt = (np.asarray(part, np.float64) for part in np.linalg.svd(task.matrix(task.turned(J, pose))))
    rank = rank_of(sigma)
    of_frame = "" if frame == "world" else f" (axes of the {frame})"

    def seen(twist: Array) -> Array:
        return np.concatenate([R_world_frame.T @ twist[:3], R_world_frame.T @ twist[3:]])

    def embedded(rows: Array) -> Array:
        whole = np.zeros(6)
        whole[task.rows] = rows
        return task.view.back(whole, pose)

    lost = []
    for direction in _simple(u[:, rank:]):
        twist, wrench = embedded(direction / task.row_scale), embedded(direction * task.row_scale)
        lost.append(Lost(twist, wrench, in_words.lost(seen(twist), seen(wrench)) + of_frame))
    slow = []
    for i in np.flatnonzero(sigma[:rank] <= SLOW * sigma[0]):
        sign = np.sign(u[np.argmax(np.abs(u[:, i])), i])
        twist, motion = embedded(sign * sigma[i] * u[:, i] / task.row_scale), sign * task.joint_scale * vt[i]
        words = in_words.nearly_lost(seen(twist), motion, arm.joints, arm.units) + of_frame
        slow.append(Slow(float(sigma[i]), twist, motion, words))
    standing = []
    for still in _simple(vt[rank:].T):
        first = in_words.main_joints(still)[0]
        motion = task.joint_scale * still * np.sign(still[first])
        twist = J @ motion
        words = in_words.standing_still(motion, seen(twist), named, arm.joints, arm.units)
        words += of_frame if np.linalg.norm(twist) > in_words.STANDS_STILL else ""
        standing.append(Motion(motion, twist, words))
    return sigma, tuple(lost), tuple(slow), tuple(standing)


def _simple(basis: Array) -> list[Array]:
    """Return unit vectors that span the same space as a basis, with as many zeros as possible.

    As many coordinates are chosen as there are vectors: in turn, the one whose axis is nearest to the rest of
    the space. Each vector has one of them, and the coordinates that were not chosen.
    """
    left, chosen = basis @ basis.T, []
    for _ in range(basis.shape[1]):
        nearness = np.diag(left)
        # The first of those that are equally near: rounding must not choose.
        chosen.append(int(np.argmax(nearness >= nearness.max() - SAME)))
        vector = left[:, chosen[-1]] / np.sqrt(nearness[chosen[-1]])
        left = left - np.outer(vector, vector)
    vectors = basis @ np.linalg.inv(basis[sorted(chosen)])
    return list((vectors / np.linalg.norm(vectors, axis=0)).T)
