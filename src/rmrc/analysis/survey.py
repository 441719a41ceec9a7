"""Many configurations of an arm at once: the pose of its site, and its singular values, on all cores.

The Jacobian and its decomposition are those of the law. The kinematics are not MuJoCo's, which take one
configuration per call.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from rmrc.law.jit import Record, long_entry, machine_code
from rmrc.law.kinematics import WORLD, chain_jacobian, follow_chain, frame_turn, turn_columns
from rmrc.law.law import scale_task
from rmrc.law.record import records
from rmrc.law.svd import LANES, put_in_lane, singular_values_of_lanes, take_from_lane
from rmrc.law.task import Array, Task

# Configurations per work item of a thread: some milliseconds.
SHARE = 4096
# Block size for callers with many more configurations: some tens of megabytes.
BLOCK = 1 << 16


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
    q = np.ascontiguousarray(q, np.float64)
    pose, sigma = np.empty((len(q), 7)), np.empty((len(q), min(len(task.rows), task.arm.n)))
    _shared(examine, task, threads, q, pose, sigma)
    return Survey(q, pose, sigma)


def jacobians(task: Task, q: Array, threads: int | None = None) -> tuple[Array, Array]:
    """Return positions of the site, (N, 3) [m], and Jacobians, (N, 6, n), at many configurations (N, n).

    Args:
        task: The arm; its rows do not matter.
        q: Joint positions, (N, n).
        threads: None: one per core; the result does not depend on it.
    """
    q = np.ascontiguousarray(q, np.float64)
    position, J = np.empty((len(q), 3)), np.empty((len(q), 6, task.arm.n))
    _shared(locate, task, threads, q, position, J)
    return position, J


def _shared(kernel: Callable[..., None], task: Task, threads: int | None, *arrays: Array) -> None:
    """Let threads work on the rows of arrays, SHARE at a time."""
    record = records(task.arm.n, [task], axes=len(task.arm.axis_names))
    compiled = machine_code(kernel, record[0], *arrays)

    def share(first: int) -> None:
        # as bytes: numpy copies a record field by field
        own = record.view(np.uint8).copy().view(record.dtype)
        compiled(own[0], *(array[first : first + SHARE] for array in arrays))

    if len(arrays[0]) <= SHARE:  # starting threads would take longer
        share(0)
        return
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        list(pool.map(share, range(0, len(arrays[0]), SHARE)))


@long_entry
def examine(world: Record, q: Array, pose: Array, sigma: Array) -> None:
    """Write pose (N, 7) and singular values (N, k) at joint positions (N, n).

    Args:
        world: A task's record; its measurement and memory are overwritten.
        q: Read.
        pose: Written.
        sigma: Written.
    """
    k, size = world.k, max(world.m, world.n)
    long, norm2, scale = np.zeros((k, size, LANES)), np.empty((k, LANES)), np.empty(LANES)
    rows, row_norm2 = np.empty((k, size)), np.empty(k)
    for first in range(0, q.shape[0], LANES):
        count = min(LANES, q.shape[0] - first)
        for w in range(count):
            follow_chain(world, q[first + w])
            for c in range(7):
                pose[first + w, c] = world.pose[c]
            chain_jacobian(world)
            if world.frame != WORLD:
                turn_columns(frame_turn(world.frame, world.frame_quat, world.pose), world.J, world.n)
            scale_task(world)
            scale[w] = put_in_lane(world.A, world.m, world.n, rows, row_norm2, long, w)
        singular_values_of_lanes(long, norm2, k, size)
        for w in range(count):
            take_from_lane(norm2, k, w, scale[w], sigma[first + w])


@long_entry
def locate(world: Record, q: Array, position: Array, J: Array) -> None:
    """Write positions (N, 3) and Jacobians (N, 6, n) at joint positions (N, n).

    Args:
        world: A task's record; its measurement is overwritten.
        q: Read.
        position: Written.
        J: Written.
    """
    for i in range(q.shape[0]):
        follow_chain(world, q[i])
        for c in range(3):
            position[i, c] = world.pose[c]
        chain_jacobian(world)
        for r in range(6):
            for j in range(world.n):
                J[i, r, j] = world.J[r, j]
