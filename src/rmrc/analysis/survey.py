"""Many configurations of an arm at once: the pose of its site, and its singular values, on all cores.

The kinematics are those of the law, compiled, and not MuJoCo's, which take one configuration per call.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rmrc.law.compiling import Record, compiled
from rmrc.law.kinematics import WORLD, follow_chain, frame_turn, geometric_jacobian, turn_columns
from rmrc.law.law import scale_task
from rmrc.law.record import copied, new_worlds
from rmrc.law.task import Array, Task
from rmrc.support.threads import work_in_shares

# Configurations per work item of a thread: some milliseconds.
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

    @property
    def manipulability(self) -> Array:
        """Manipulability w = ∏ σ, (N,) [Yoshikawa85]."""
        w: Array = np.prod(self.sigma, axis=1)
        return w

    @property
    def condition(self) -> Array:
        """κ = σ_1/σ_k, (N,), infinite where σ_k = 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.sigma[:, -1] > 0.0, self.sigma[:, 0] / self.sigma[:, -1], np.inf)


def survey(task: Task, q: Array, threads: int | None = None) -> Survey:
    """Find pose and singular values at many configurations.

    Args:
        task: The arm and the rows that count.
        q: Joint positions, (N, n).
        threads: None: one per core; the result does not depend on it.
    """
    pose, sigma = np.empty((len(q), 7)), np.empty((len(q), min(len(task.rows), task.arm.n)))
    q = _each(examine, task, threads, q, pose, sigma)
    return Survey(q, pose, -np.sort(-sigma, axis=1))


def jacobians(task: Task, q: Array, threads: int | None = None) -> tuple[Array, Array]:
    """Return positions of the site, (N, 3) [m], and Jacobians, (N, 6, n), at many configurations (N, n).

    Args:
        task: The arm; its rows do not matter.
        q: Joint positions, (N, n).
        threads: None: one per core; the result does not depend on it.
    """
    pose, J = np.empty((len(q), 7)), np.empty((len(q), 6, task.arm.n))
    _each(locate, task, threads, q, pose, J)
    return pose[:, :3], J


def _each(function: Callable[..., None], task: Task, threads: int | None, q: Array, *results: Array) -> Array:
    """Let threads call a compiled function for joint positions and rows of results; return the positions."""
    worlds = new_worlds(1, task.arm.n, len(task.arm.axis_names))
    task.write(worlds[0])
    # A writable copy in order: for an array of another type, the function would be compiled again.
    q = np.array(q, np.float64, order="C")

    def examine_some(part: slice) -> None:
        function(copied(worlds), q[part], *(result[part] for result in results))

    work_in_shares(examine_some, len(q), SHARE, threads)
    return q


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
        for c in range(7):
            pose[i, c] = world.state.pose[c]
        for r in range(6):
            for j in range(world.n):
                J[i, r, j] = world.state.J[r, j]


@compiled
def examine(worlds: Record, q: Array, pose: Array, sigma: Array) -> None:
    """Write poses (N, 7) and singular values, unsorted, (N, k), at joint positions (N, n).

    Args:
        worlds: A task's record, (1,).
        q: Read.
        pose: Written.
        sigma: Written.
    """
    world, count = worlds[0], len(q)
    rows, angle = np.zeros((world.k, max(world.m, world.n), SIDE_BY_SIDE)), np.empty((3, SIDE_BY_SIDE))
    for first in range(0, count, SIDE_BY_SIDE):
        for w in range(min(SIDE_BY_SIDE, count - first)):
            write_matrix(world, q[first + w], rows[:, :, w])
            for c in range(7):
                pose[first + w, c] = world.state.pose[c]
        orthogonalize(rows, angle)
        for w in range(min(SIDE_BY_SIDE, count - first)):
            for p in range(world.k):
                sigma[first + w, p] = math.sqrt((rows[p, :, w] ** 2).sum())


@compiled
def write_matrix(world: Record, q: Array, rows: Array) -> None:
    """Write A or Aᵀ, (k, max(m, n)), at joint positions (n,)."""
    task, state = world.task, world.state
    follow_chain(world, q)
    geometric_jacobian(world)
    if task.frame != WORLD:
        turn_columns(frame_turn(task.frame, task.base, state.pose), state.J, world.n)
    scale_task(world)
    for i in range(world.m):
        for j in range(world.n):
            if world.m <= world.n:
                rows[i, j] = world.scratch.A[i, j]
            else:
                rows[j, i] = world.scratch.A[i, j]


@compiled
def orthogonalize(rows: Array, angle: Array) -> None:
    """Rotate the rows of some matrices, (k, size, SIDE_BY_SIDE), until they are orthogonal [Hestenes58].

    Their lengths are then the singular values. All matrices go through the same steps.

    Args:
        rows: Overwritten.
        angle: Overwritten, (3, SIDE_BY_SIDE).
    """
    k, size, _ = rows.shape
    for _ in range(SWEEPS_MAX):
        largest = 0.0
        for p in range(k - 1):
            for q in range(p + 1, k):
                find_rotations(rows[p], rows[q], size, angle[0], angle[1], angle[2])
                rotate(rows[p], rows[q], size, angle[0], angle[1])
                largest = max(largest, angle[2].max())
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
