"""Inverse kinematics from joint positions to a goal pose: Newton's or damped steps within limits.

The error of a configuration is e = S_x pose_error over the rows that count. Its derivative is −A with
A = S_x L(φ) J S_q: L(φ), the inverse of the right Jacobian of SO(3) at the rotation error φ [Sola18], turns
the rotation rows of J. L(φ) is 1 at a goal where all rotation rows count, and for every planar arm. Where
only some rows count, φ need not vanish at the goal, and no method would be quadratic without L(φ).
"""

import math

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.law import svd
from rmrc.law.active_set import best_within, find_best
from rmrc.law.compiling import Array, Record, compiled
from rmrc.law.kinematics import HALF_TURN, follow_chain, geometric_jacobian, pose_error
from rmrc.law.record import copied, new_worlds
from rmrc.law.settings import link
from rmrc.law.task import Task
from rmrc.support.process import work_in_shares

# λ² starts at this share of |e|². Among 0.001 to 1, 0.03 and 0.1 need the fewest steps for six joints.
FIRST_SHARE = 0.03
# The lower bound of the share: below it, the steps are Newton's to rounding.
LEAST_SHARE = 1e-8
# With a share this large, the steps no longer move the arm.
LARGEST_SHARE = 1e12
# At a minimum, the linear model promises to remove less than this share of the squared error: rounding.
FLAT = 1e-15
# While other starts remain, a descent must reduce its error by a tenth within this many steps. Among 8, 12
# and 20, 8 needs the fewest steps in all, with the same number of starts.
PATIENCE = 8
LOSS = 0.9
# Below this angle, 1/12 + θ²/720 is the factor of L(φ) to rounding; the closed form would lose digits.
SMALL_TURN = 1e-2

# Goals that a thread takes at once: some milliseconds of work.
SHARE = 32


def unwound(arm: Arm, limit: Array, q: Array, near: Array) -> Array:
    """Return q (N, n), with each hinge moved by whole turns within limits as near as possible to `near`."""
    turns = np.array([0, -1, 1, -2, 2])[:, None, None] - np.ceil((q - near - np.pi - HALF_TURN) / math.tau)
    options = np.concatenate([q + np.where(arm.comes_round, math.tau * turns, 0.0), q[None]])
    away = np.abs(options - near)
    away[1:] += 3.0 * HALF_TURN
    away[(options < limit[:, 0]) | (options > limit[:, 1])] = np.inf
    away[-1] = np.minimum(away[-1], 1e300)  # if all else fails, q itself
    best: Array = np.take_along_axis(options, away.argmin(axis=0)[None], axis=0)[0]
    return best


def search(
    task: Task, limit: Array, tolerance: float, most: int, goals: Array, first: Array, more: Array,
    threads: int | None = None,
) -> tuple[Array, Array, NDArray[np.int64]]:  # fmt: skip
    """Find for each of N goals the first joint positions that reach it, or else the nearest ones.

    Each goal is tried from its own start and then from starts that all goals share. If none succeeds, the
    best one is followed to the end.

    Args:
        task: The arm and the rows that count.
        limit: Lower and upper limit of each joint, (n, 2); may be infinite.
        tolerance: Tolerance of |e|.
        most: Largest number of steps of one try.
        goals: Poses [p, quat w x y z], (N, 7).
        first: First start of each goal, (N, n).
        more: Further starts, (T, n).
        threads: None: one per core; the result does not depend on it.

    Returns:
        q, (N, n); |e| there, (N,); and a tally, (N, 2): steps of all tries, and the index, from 0, of the try
        that gave q.
    """
    worlds, limit = _worlds(task), np.array(limit, order="C")
    # Writable copies in order: for arrays of another type, all would be compiled again.
    goals, first, more = np.array(goals, order="C"), np.array(first, order="C"), np.array(more, order="C")
    q, error, tally = np.array(first), np.empty(len(goals)), np.zeros((len(goals), 2), np.int64)
    no_trace = np.empty((0, task.arm.n + 2))

    def reach(part: slice) -> None:
        own = copied(worlds)
        for i in range(len(goals))[part]:
            for t, start in enumerate([first[i], *more, None]):  # the last try goes on from the best
                end = np.array(q[i] if start is None else start)
                patience = most if start is None or not len(more) else PATIENCE
                squared, steps = descend(
                    own, limit, tolerance, most, patience, goals[i], end, no_trace, False
                )
                tally[i, 0] += steps
                if t == 0 or math.sqrt(squared) < error[i]:
                    q[i], error[i], tally[i, 1] = end, math.sqrt(squared), tally[i, 1] if start is None else t
                if error[i] <= tolerance:
                    break

    work_in_shares(reach, len(goals), SHARE, threads)
    return q, error, tally


def newton(
    task: Task, tolerance: float, most: int, goal: Array, first: Array, trace: Array
) -> tuple[Array, int]:
    """Return joint positions, (n,), after steps q⁺ = q + S_q A⁺ e without limits, and the number of steps.

    It is the Newton–Raphson method [Selig92, §6.3]. Where A has no inverse, the step is the smallest one that
    the linear model asks for.

    Args:
        task: The arm and the rows that count.
        tolerance: Tolerance of |e|.
        most: Largest number of steps.
        goal: Pose, (7,).
        first: Joint positions at the start, (n,).
        trace: Takes q, |e| and λ, one row per step while rows last, (R, n + 2).
    """
    nowhere, q = np.tile([-math.inf, math.inf], (task.arm.n, 1)), np.array(first)
    _, steps = descend(_worlds(task), nowhere, tolerance, most, most + 1, np.array(goal), q, trace, True)
    return q, steps


def _worlds(task: Task) -> NDArray[np.void]:
    """Return the record of a task's world, in an array, (1,)."""
    worlds = new_worlds(1, task.arm.n, len(task.arm.axis_names))
    task.write(worlds[0])
    link(worlds, {"decompose": svd.decompose, "complete": svd.complete, "find_best": find_best})
    return worlds


# Compiled ---------------------------------------------------------------------------------------


@compiled
def descend(
    worlds: Record, limit: Array, tolerance: float, most: int, patience: int, goal: Array, q: Array,
    trace: Array, is_newton: bool,
) -> tuple[float, int]:  # fmt: skip
    """Go from q to a goal as far as this start leads; return the final |e|² and the steps.

    λ² = μ |e|² [Chan88], [Sugihara11] keeps the convergence quadratic and the steps near a singularity
    finite. μ is divided by four where the error fell as the linear model promised, and multiplied by four
    where it did not. As in a trust region, no step that increases the error is taken [Fan03]. Newton's method
    takes all steps, with λ = 0.
    """
    world = worlds[0]  # numba takes an array of records faster than a record
    squared = before = measure(world, goal, q)
    share, steps, row, is_last, following = FIRST_SHARE, 0, 0, False, q.copy()
    linearize(world, q, 0.0, trace[:1])
    while steps < most and share < LARGEST_SHARE and not is_last:
        # One step more than needed: by quadratic convergence it adds the last digits.
        is_last = squared <= tolerance * tolerance
        if is_last and is_newton:
            break
        if steps % patience == patience - 1 and not is_last:
            if squared > LOSS * LOSS * before:
                break
            before = squared
        damping = 0.0 if is_newton else math.sqrt(share * squared)
        promised = find_step(world, limit, damping, q, following)
        squared_next = measure(world, goal, following)
        if not math.isfinite(squared_next) or (promised <= FLAT * squared and not is_newton):
            break
        steps += 1
        if not is_newton:
            fell = (squared - squared_next) / promised
            share *= 0.25 if fell > 0.75 else 1.0 if fell > 0.25 else 4.0 if fell > 0.0 else 16.0
            share = max(share, LEAST_SHARE)
        if squared_next < squared or is_newton:
            squared, row = squared_next, row + 1
            q[:] = following
            linearize(world, q, damping, trace[row : row + 1])
    return squared, steps


@compiled
def measure(world: Record, goal: Array, q: Array) -> float:
    """Return |e|² at joint positions; leave the whole error in `tick.pose_error`."""
    task, error, squared = world.task, world.tick.pose_error, 0.0
    follow_chain(world, q)
    pose_error(world.state.pose, goal, error)
    for i in range(world.m):
        squared += (task.row_scale[i] * error[task.row[i]]) ** 2
    return squared


@compiled
def linearize(world: Record, q: Array, damping: float, trace: Array) -> None:
    """Write e and A = S_x L(φ) J S_q where q was measured last, and a row of the trace if there is one."""
    task, J, A, error, size2 = world.task, world.state.J, world.scratch.A, world.tick.pose_error, 0.0
    e = world.first.task
    geometric_jacobian(world)
    turn_rotations(error, J, world.n)
    for i in range(world.m):
        e[i] = task.row_scale[i] * error[task.row[i]]
        for j in range(world.n):
            A[i, j] = task.row_scale[i] * J[task.row[i], j] * task.joint_scale[j]
            size2 += A[i, j] * A[i, j]
    world.first.sigma[0] = math.sqrt(size2)  # below a share of it, a singular value is rounding
    for row in trace:
        row[: world.n] = q
        row[world.n], row[world.n + 1] = math.sqrt(svd.dot(e, e, world.m)), damping


@compiled
def turn_rotations(pose_error: Array, J: Array, n: int) -> None:
    """Replace the rotation rows of J, (6, n), by L(φ) times them, with φ of the error, (6,).

    L(φ) w = w + φ × w/2 + s φ × (φ × w) with s = (1 − θ/2 cot θ/2)/θ² and θ = |φ|.
    """
    x, y, z = pose_error[3], pose_error[4], pose_error[5]
    turn2 = x * x + y * y + z * z
    half = 0.5 * math.sqrt(turn2)
    s = 1.0 / 12.0 + turn2 / 720.0
    if half >= SMALL_TURN:
        s = (1.0 - half * math.cos(half) / math.sin(half)) / turn2
    for j in range(n):
        wx, wy, wz = J[3, j], J[4, j], J[5, j]
        cx, cy, cz = y * wz - z * wy, z * wx - x * wz, x * wy - y * wx
        J[3, j] = wx + 0.5 * cx + s * (y * cz - z * cy)
        J[4, j] = wy + 0.5 * cy + s * (z * cx - x * cz)
        J[5, j] = wz + 0.5 * cz + s * (x * cy - y * cx)


@compiled
def find_step(world: Record, limit: Array, damping: float, q: Array, following: Array) -> float:
    """Write the joint positions after a step from q; return by how much |e|² falls in the linear model.

    The step z minimizes |e − A z|² + λ² |z|² within the limits [Levenberg44]; with λ = 0, the smallest one.
    """
    bounds, step, e, left2 = world.bounds, world.tick.qdot_cmd, world.first.task, 0.0
    for j in range(world.n):
        bounds.lower[j], bounds.upper[j], step[j] = limit[j, 0] - q[j], limit[j, 1] - q[j], 0.0
    best_within(world, e, damping)
    for j in range(world.n):
        following[j] = min(max(q[j] + step[j], limit[j, 0]), limit[j, 1])
        step[j] /= world.task.joint_scale[j]
    for i in range(world.m):
        left2 += (e[i] - svd.dot(world.scratch.A[i], step, world.n)) ** 2
    return svd.dot(e, e, world.m) - left2
