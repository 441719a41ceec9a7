"""Many configurations of an arm at once: the pose of its site, and its singular values, on all cores.

The kinematics are those of the law, compiled, and not MuJoCo's, which take one configuration per call.
"""

import math
from dataclasses import dataclass

import numpy as np

from rmrc.law.compiling import Record, compiled
from rmrc.law.kinematics import follow_chain, geometric_jacobian
from rmrc.law.record import copied, new_worlds
from rmrc.law.task import Array, Task
from rmrc.support.process import work_in_shares

# Configurations per work item of a thread: a millisecond.
SHARE = 4096
# Block size for callers with many more configurations: some tens of megabytes.
BLOCK = 1 << 16
# Matrices that are rotated in step: the compiler lets the processor take several at once.
SIDE_BY_SIDE = 64
# Rotations below this leave others of their square, which move a singular value by that squared.
SMALL = 1e-4
# Convergence is quadratic, so that four or five sweeps are enough; more means that the input is not finite.
SWEEPS_MAX = 30
# It makes the rotation of two rows of zeros zero, and no other.
TINY = 1e-300


@dataclass(frozen=True)
class Survey:
    """Data of N configurations.

    Attributes:
        q: Joint positions, (N, n).
        pose: Pose of the site, [p, quat w x y z], (N, 7).
        sigma: Singular values of A = S_x J S_q, descending, (N, k).
    """

    q: Array
    pose: Array
    sigma: Array


def survey(task: Task, q: Array, threads: int | None = None) -> Survey:
    """Find pose and singular values at many configurations.

    Args:
        task: The arm and the rows that count.
        q: Joint positions, (N, n).
        threads: None: one per core; the result does not depend on it.
    """
    q, pose, J = _located(task, q, threads)
    sigma = np.empty((len(q), min(len(task.rows), task.arm.n)))

    def decompose(part: slice) -> None:
        sigma[part] = singular_values(task.matrix(task.turned(J[part], pose[part])))

    work_in_shares(decompose, len(q), SHARE, threads)
    return Survey(q, pose, sigma)


def jacobians(task: Task, q: Array, threads: int | None = None) -> tuple[Array, Array]:
    """Return positions of the site, (N, 3) [m], and Jacobians, (N, 6, n), at many configurations (N, n).

    Args:
        task: The arm; its rows do not matter.
        q: Joint positions, (N, n).
        threads: None: one per core; the result does not depend on it.
    """
    _, pose, J = _located(task, q, threads)
    return pose[:, :3], J


def _located(task: Task, q: Array, threads: int | None) -> tuple[Array, Array, Array]:
    """Return joint positions, poses and Jacobians along world axes, found by threads."""
    worlds = new_worlds(1, task.arm.n, len(task.arm.axis_names))
    task.write(worlds[0])
    # A writable copy in order: for an array of another type, the function would be compiled again.
    q = np.array(q, np.float64, order="C")
    pose, J = np.empty((len(q), 7)), np.empty((len(q), 6, task.arm.n))
    work_in_shares(lambda part: locate(copied(worlds), q[part], pose[part], J[part]), len(q), SHARE, threads)
    return q, pose, J


def singular_values(A: Array) -> Array:
    """Return singular values, (N, k), falling, of matrices, (N, m, n), SIDE_BY_SIDE of them at a time."""
    A = A if A.shape[1] <= A.shape[2] else A.swapaxes(1, 2)
    count, k, size = A.shape
    blocks = -(-count // SIDE_BY_SIDE)
    whole = np.zeros((blocks * SIDE_BY_SIDE, k, size))
    whole[:count] = A
    rows = np.ascontiguousarray(whole.reshape(blocks, SIDE_BY_SIDE, k, size).transpose(0, 2, 3, 1))
    for block in rows:
        orthogonalize(block)
    sigma = np.sqrt((rows**2).sum(axis=2)).transpose(0, 2, 1).reshape(-1, k)
    return -np.sort(-sigma[:count], axis=1)


# Compiled ---------------------------------------------------------------------------------------


@compiled
def locate(worlds: Record, q: Array, pose: Array, J: Array) -> None:
    """Write poses (N, 7) and Jacobians (N, 6, n) at joint positions (N, n).

    Args:
        worlds: A task's record, (1,): numba takes an array faster than a record.
        q: Read.
        pose: Written.
        J: Written.
    """
    world = worlds[0]
    for i in range(len(q)):
        follow_chain(world, q[i])
        geometric_jacobian(world)
        pose[i], J[i] = world.state.pose, world.state.J[:6, : world.n]


@compiled
def orthogonalize(rows: Array) -> None:
    """Rotate the rows of some matrices, (k, size, SIDE_BY_SIDE), until they are orthogonal [Hestenes58].

    Their lengths are then the singular values. All matrices go through the same steps.

    Args:
        rows: Overwritten.
    """
    k, size, count = rows.shape
    c, s, tangent = np.empty(count), np.empty(count), np.empty(count)
    for _ in range(SWEEPS_MAX):
        largest = 0.0
        for p in range(k - 1):
            for q in range(p + 1, k):
                find_rotations(rows[p], rows[q], size, c, s, tangent)
                rotate(rows[p], rows[q], size, c, s)
                largest = max(largest, tangent.max())
        if largest <= SMALL:
            break


@compiled
def find_rotations(a: Array, b: Array, size: int, c: Array, s: Array, tangent: Array) -> None:
    """Write cosine, sine and |tangent| of the rotations that make pairs of rows, (size, …), orthogonal."""
    for w in range(SIDE_BY_SIDE):
        c[w] = s[w] = 0.0
    for j in range(size):
        for w in range(SIDE_BY_SIDE):
            c[w] += b[j, w] * b[j, w] - a[j, w] * a[j, w]
            s[w] += 2.0 * a[j, w] * b[j, w]
    for w in range(SIDE_BY_SIDE):
        t = s[w] / (c[w] + math.copysign(math.sqrt(c[w] * c[w] + s[w] * s[w]) + TINY, c[w]))
        c[w] = 1.0 / math.sqrt(1.0 + t * t)
        s[w], tangent[w] = c[w] * t, abs(t)


@compiled
def rotate(a: Array, b: Array, size: int, c: Array, s: Array) -> None:
    """Rotate pairs of rows, (size, …), by angles with cosines c and sines s."""
    for j in range(size):
        for w in range(SIDE_BY_SIDE):
            x, y = a[j, w], b[j, w]
            a[j, w] = c[w] * x - s[w] * y
            b[j, w] = s[w] * x + c[w] * y
