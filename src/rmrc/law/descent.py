"""Inverse kinematics from joint positions to a goal pose, compiled: Newton's or damped steps within limits.

The error of a configuration is e = S_x pose_error over the rows that count. Its derivative is −A with
A = S_x L(φ) J S_q: L(φ), the inverse of the right Jacobian of SO(3) at the rotation error φ [Sola18], turns
the rotation rows of J. L(φ) is 1 at a goal where all rotation rows count, and for every planar arm. Where
only some rows count, φ need not vanish at the goal, and no method would be quadratic without L(φ).
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.law.jit import Array, Record, compiled, entry, inlined, machine_code
from rmrc.law.kinematics import chain_jacobian, follow_chain, pose_error
from rmrc.law.metric import backward, factor, forward
from rmrc.law.optimal import WELL, gram
from rmrc.law.record import JOINTS, Field, records
from rmrc.law.svd import RANK_FLOOR, combine, dot, project, svd_from_scratch
from rmrc.law.task import Task

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
# An angle beyond half a turn by no more than this does not wrap: rounding must not choose its sign.
HALF_TURN = 1e-5


@dataclass(frozen=True)
class Bounds:
    """The limits of joint positions: it owns this field of a world's record.

    Attributes:
        limit: Lower and upper limit of each joint, (n, 2); may be infinite.
    """

    limit: Array

    fields: ClassVar[tuple[Field, ...]] = (Field("position_limit", size=(2, JOINTS)),)

    def write(self, world: np.void) -> None:
        """Write this field of a world's record."""
        world["position_limit"][:, : len(self.limit)] = self.limit.T


def unwound(arm: Arm, limit: Array, q: Array, near: Array) -> Array:
    """Return q (N, n), with each hinge moved by whole turns within limits as near as possible to `near`."""
    turn = 2.0 * np.pi
    turns = -np.ceil((q - near - np.pi - HALF_TURN) / turn)
    best, least = q, np.where(arm.comes_round, np.inf, 0.0) * np.ones_like(q)
    for more in (0, -1, 1, -2, 2):
        option = q + (turns + more) * turn
        is_within = (option >= limit[:, 0]) & (option <= limit[:, 1])
        away = np.where(is_within, np.abs(option - near), np.inf)
        nearer = away < least - 3.0 * HALF_TURN
        best, least = np.where(nearer, option, best), np.where(nearer, away, least)
    return best


def search(
    task: Task, limit: Array, undamped: bool, tolerance: float, most: int, goals: Array, first: Array,
    more: Array, threads: int | None = None, trace: Array | None = None,
) -> tuple[Array, Array, NDArray[np.int64]]:  # fmt: skip
    """Return q (N, n), |e| (N,) and tally (N, 3) of `reach`, on all cores."""
    n = task.arm.n
    record = records(n, [task, Bounds(limit)], axes=len(task.arm.axis_names))
    # Machine code does not check the layout of its arguments.
    goals, first, more = (np.ascontiguousarray(one) for one in (goals, first, more))
    q, error, tally = np.empty((len(goals), n)), np.empty(len(goals)), np.zeros((len(goals), 3), np.int64)
    trace = np.empty((0, n + 2)) if trace is None else trace
    kernel = machine_code(
        reach, record[0], undamped, tolerance, most, goals, first, more, q, error, tally, trace
    )

    def share(begin: int, world: np.void) -> None:
        part = slice(begin, begin + SHARE)
        kernel(
            world, undamped, tolerance, most, goals[part], first[part], more, q[part], error[part],
            tally[part], trace,
        )  # fmt: skip

    if len(goals) <= SHARE:
        share(0, record[0])
    else:
        with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
            list(pool.map(lambda begin: share(begin, record.copy()[0]), range(0, len(goals), SHARE)))
    return q, error, tally


# Compiled ---------------------------------------------------------------------------------------


@entry
def reach(
    world: Record, undamped: bool, tolerance: float, most: int, goals: Array, first: Array, more: Array,
    q: Array, error: Array, tally: NDArray[np.int64], trace: Array,
) -> None:  # fmt: skip
    """Write for each of N goals the first joint positions that reach it, or else the nearest ones found.

    Each goal is tried from its own start and then from starts that all goals share. If none succeeds, the
    best one is followed to the end.

    Args:
        world: A task's record; positions stay within its `position_limit`.
        undamped: Whether the steps are Newton's.
        tolerance: Tolerance of |e|.
        most: Largest number of steps of one try.
        goals: Poses [p, quat w x y z], (N, 7).
        first: First start of each goal, (N, n).
        more: Further starts, (T, n).
        q: Written, (N, n).
        error: |e| there, written, (N,).
        tally: Added to, (N, 3): steps of all tries; steps of the try that gave q; index of that try, from 0.
        trace: Takes q, |e| and λ of the last goal's first try, one row per step while rows last, (R, n + 2).
    """
    none, positions, tries = trace[:0], world.best, more.shape[0] + 1
    for i in range(goals.shape[0]):
        for t in range(tries + 1):
            is_last = t == tries
            for j in range(world.n):
                positions[j] = first[i, j] if t == 0 else q[i, j] if is_last else more[t - 1, j]
            path = trace if t == 0 else none
            if undamped:
                left, steps = newton(world, goals[i], positions, tolerance, most, path)
            else:
                patience = most if is_last or tries == 1 else PATIENCE
                left, steps = descend(world, goals[i], positions, tolerance, most, patience, path)
            tally[i, 0] += steps
            if t == 0 or left < error[i]:
                error[i] = left
                tally[i, 1] = steps + (tally[i, 1] if is_last else 0)
                tally[i, 2] = tally[i, 2] if is_last else t
                for j in range(world.n):
                    q[i, j] = positions[j]
            if left <= tolerance or undamped:
                break


@inlined
def newton(
    world: Record, goal: Array, q: Array, tolerance: float, most: int, trace: Array
) -> tuple[float, int]:
    """Move joint positions q (n,) by q⁺ = q + S_q A⁺ e; return the final |e| and the number of steps.

    It is the Newton–Raphson method [Selig92, §6.3]. Where A has no inverse, the step is the smallest one that
    the linear model asks for.
    """
    error = math.sqrt(start(world, goal, q))
    write_row(world, q, error, 0.0, trace, 0)
    for step in range(most):
        if error <= tolerance:
            return error, step
        find_step(world, q, 0.0)
        trial = math.sqrt(attempt(world, goal, q))
        if not math.isfinite(trial):
            return error, step
        error = trial
        accept(world, q)
        write_row(world, q, error, 0.0, trace, step + 1)
    return error, most


@inlined
def descend(
    world: Record, goal: Array, q: Array, tolerance: float, most: int, patience: int, trace: Array
) -> tuple[float, int]:
    """Move joint positions q (n,) to a goal as far as one start leads; return the final |e| and the steps.

    λ² = μ |e|² [Chan88], [Sugihara11] keeps the convergence quadratic and the steps near a singularity
    finite. μ is divided by four where the error fell as the linear model promised, and multiplied by four
    where it did not. As in a trust region, no step that increases the error is taken [Fan03].
    """
    squared, share, row, steps, is_last = start(world, goal, q), FIRST_SHARE, 1, 0, False
    before = squared
    write_row(world, q, math.sqrt(squared), 0.0, trace, 0)
    while steps < most and share < LARGEST_SHARE and not is_last:
        # One step more than needed: by quadratic convergence it adds the last digits.
        is_last = squared <= tolerance * tolerance
        if steps % patience == patience - 1 and not is_last:
            if squared > LOSS * LOSS * before:
                break
            before = squared
        damping = math.sqrt(share * squared)
        promised = find_step(world, q, damping)
        if promised <= FLAT * squared:
            break
        trial = attempt(world, goal, q)
        steps += 1
        share = adapted(share, (squared - trial) / promised)
        if trial < squared:
            squared = trial
            accept(world, q)
            write_row(world, q, math.sqrt(squared), damping, trace, row)
            row += 1
    return math.sqrt(squared), steps


@compiled
def adapted(share: float, ratio: float) -> float:
    """Return the next μ for the ratio of a step's actual reduction to the promised one."""
    if ratio > 0.75:
        return max(0.25 * share, LEAST_SHARE)
    if ratio > 0.25:
        return share
    return share * (4.0 if ratio > 0.0 else 16.0)


@compiled
def start(world: Record, goal: Array, q: Array) -> float:
    """Return |e|² at joint positions q, and make the linear model there."""
    squared = measure(world, goal, q)
    linearize(world)
    return squared


@compiled
def attempt(world: Record, goal: Array, q: Array) -> float:
    """Return |e|² after the step, whose end stays in the world's `work`."""
    for j in range(world.n):
        # Rounding must not lead beyond a limit.
        least, largest = world.position_limit[0, j], world.position_limit[1, j]
        world.work[j] = min(max(q[j] + world.part_a[j], least), largest)
    return measure(world, goal, world.work)


@compiled
def accept(world: Record, q: Array) -> None:
    """Move to the end of the last attempt, and make the linear model there."""
    for j in range(world.n):
        q[j] = world.work[j]
    linearize(world)


@compiled
def write_row(world: Record, q: Array, error: float, damping: float, trace: Array, row: int) -> None:
    """Write q, |e| and λ into a row of the trace if that row exists."""
    if row < trace.shape[0]:
        for j in range(world.n):
            trace[row, j] = q[j]
        trace[row, world.n], trace[row, world.n + 1] = error, damping


@compiled
def measure(world: Record, goal: Array, q: Array) -> float:
    """Return |e|² at joint positions q; leave e in the world's `asked`, the whole error in `error_2`."""
    follow_chain(world, q)
    pose_error(world.pose, goal, world.error_2)
    for i in range(world.m):
        world.asked[i] = world.row_scale[i] * world.error_2[world.row[i]]
    return dot(world.asked, world.asked, world.m)


@compiled
def linearize(world: Record) -> None:
    """Keep e, and write A = S_x L(φ) J S_q at the configuration measured last."""
    J, error = world.J, world.error_2
    chain_jacobian(world)
    fx, fy, fz = error[3], error[4], error[5]
    turn2 = fx * fx + fy * fy + fz * fz
    half = 0.5 * math.sqrt(turn2)
    if half < SMALL_TURN:
        factor = 1.0 / 12.0 + turn2 / 720.0
    else:
        factor = (1.0 - half * math.cos(half) / math.sin(half)) / turn2
    for j in range(world.n):
        wx, wy, wz = J[3, j], J[4, j], J[5, j]
        cx, cy, cz = fy * wz - fz * wy, fz * wx - fx * wz, fx * wy - fy * wx
        J[3, j] = wx + 0.5 * cx + factor * (fy * cz - fz * cy)
        J[4, j] = wy + 0.5 * cy + factor * (fz * cx - fx * cz)
        J[5, j] = wz + 0.5 * cz + factor * (fx * cy - fy * cx)
    for i in range(world.m):
        world.task[i] = world.asked[i]
        for j in range(world.n):
            world.A[i, j] = world.row_scale[i] * J[world.row[i], j] * world.joint_scale[j]


@compiled
def find_step(world: Record, q: Array, damping: float) -> float:
    """Write a step into the world's `part_a`, and return by how much |e|² falls in the linear model.

    The step minimizes |e − A z|² + λ² |z|² over the free joints [Levenberg44]. Joints at a limit that the
    gradient pushes beyond it are held. Joints that the step would take beyond a limit go there and are held
    next, until the remaining step stays within the limits: an active set method.
    """
    hold_pushed(world, q)
    for _ in range(world.n + 1):
        solve_free(world, damping)
        if go_to_limits(world, q):
            break
    left2 = 0.0
    for i in range(world.m):
        left = world.task[i] - dot(world.A[i], world.part_a, world.n)
        left2 += left * left
    for j in range(world.n):
        world.part_a[j] *= world.joint_scale[j]
    return dot(world.task, world.task, world.m) - left2


@compiled
def hold_pushed(world: Record, q: Array) -> None:
    """Begin a step at zero; hold the joints that are at a limit and would go beyond it."""
    limit = world.position_limit
    for j in range(world.n):
        downhill = 0.0
        for i in range(world.m):
            downhill += world.A[i, j] * world.task[i]
        at_lower, at_upper = q[j] <= limit[0, j], q[j] >= limit[1, j]
        is_pushed = (at_lower and downhill <= 0.0) or (at_upper and downhill >= 0.0)
        world.part_a[j], world.held[j] = 0.0, 1.0 if is_pushed else 0.0


@inlined
def solve_free(world: Record, damping: float) -> None:
    """Write the damped step of the free joints into the world's `part_b`, given the held joints."""
    for i in range(world.m):
        world.task_B[i] = world.task[i]
        for j in range(world.n):
            world.task_B[i] -= world.A[i, j] * world.part_a[j] * world.held[j]
            world.B[i, j] = world.A[i, j] * (1.0 - world.held[j])
    if damping > 0.0 and solve_by_factor(world, damping):
        return
    svd_from_scratch(world.B, world.m, world.n, world.u_B, world.sigma_B, world.v_B)
    for i in range(world.k):
        sigma = world.sigma_B[i]
        is_rounding = sigma <= RANK_FLOOR * world.sigma_B[0]
        world.gain_B[i] = 0.0 if is_rounding else sigma / (sigma * sigma + damping * damping)
    project(world.u_B, world.task_B, world.k, world.m, world.asked_B)
    combine(world.gain_B, world.asked_B, world.v_B, world.k, world.n, world.part_b)


@compiled
def solve_by_factor(world: Record, damping: float) -> bool:
    """Write the damped step of the free joints by a Cholesky factor; return whether the factor serves.

    The factor is that of the smaller of A Aᵀ + λ² and AᵀA + λ². A step has a relative error of at most about
    1e-8, which the next step corrects.
    """
    n, m, root, free = world.n, world.m, world.root_B, 0
    for j in range(n):
        free += world.held[j] == 0.0
    is_wide = free >= m
    size = m if is_wide else n
    largest = gram(world, size, is_wide, damping)
    for j in range(0 if is_wide else n):
        if world.held[j] != 0.0:
            root[j, j] = largest
    factor(root, size)
    for i in range(size):
        if not root[i, i] * root[i, i] > WELL * largest:
            return False
    step = world.part_b
    if is_wide:
        forward(root, world.task_B, m)
        backward(root, world.task_B, m)
    for j in range(n):
        step[j] = 0.0
        for i in range(m):
            step[j] += world.B[i, j] * world.task_B[i]
    if not is_wide:
        forward(root, step, n)
        backward(root, step, n)
    return True


@compiled
def go_to_limits(world: Record, q: Array) -> bool:
    """Add the step of the free joints as far as limits allow; return whether all of it was added."""
    is_all = True
    for j in range(world.n):
        if world.held[j] == 0.0:
            there = q[j] + world.joint_scale[j] * world.part_b[j]
            within = min(max(there, world.position_limit[0, j]), world.position_limit[1, j])
            world.part_a[j] = world.part_b[j]
            if within != there:
                world.part_a[j] = (within - q[j]) / world.joint_scale[j]
                world.held[j], is_all = 1.0, False
    return is_all
