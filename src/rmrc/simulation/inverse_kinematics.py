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
from rmrc.law.compiling import Array, Method, Record, call, compiled
from rmrc.law.kinematics import HALF_TURN, follow_chain, geometric_jacobian, pose_error
from rmrc.law.metric import backward, factor, forward
from rmrc.law.record import ROWS, copied, new_worlds
from rmrc.law.settings import link
from rmrc.law.svd import RANK_FLOOR, begin_basis, combine, dot, project, svd
from rmrc.law.task import Task
from rmrc.support.threads import work_in_shares

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
# A Cholesky factor serves if its squared pivots are above this share of the largest entry of its matrix.
WELL = 1e-8

# Goals that a thread takes at once: some milliseconds of work.
SHARE = 32


def search_type(joints: int) -> np.dtype[np.void]:
    """Return the type of the record of a search, with room for a number of joints."""
    f, i, J, R, A = np.float64, np.int64, (joints,), (ROWS,), (ROWS, joints)
    return np.dtype(
        [
            # the tolerance of |e|, the most steps of a try, limits of joints, and the next row of the trace
            ("tolerance", f), ("most", i), ("limit", f, (2, joints)), ("row", i),
            # where a step starts, its linear model, the step, where it ends, and the errors there
            ("q", f, J), ("e", f, R), ("A", f, A), ("step", f, J),
            ("q_next", f, J), ("pose_error", f, (6,)), ("e_next", f, R),
            # the joints that a step holds, the step of the others, and a Cholesky factor
            ("held", f, J), ("step_free", f, J), ("root", f, (ROWS, ROWS)),
        ]
    )  # fmt: skip


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
    task: Task, limit: Array, tolerance: float, most: int, goals: Array, first: Array, more: Array,
    threads: int | None = None, trace: Array | None = None,
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
        trace: Takes q, |e| and λ of the last goal's first try, one row per step while rows last, (R, n + 2).

    Returns:
        q, (N, n); |e| there, (N,); and a tally, (N, 2): steps of all tries, and the index, from 0, of the try
        that gave q.
    """
    n, (worlds, searches) = task.arm.n, records(task, limit, tolerance, most)
    # Writable copies in order: for arrays of another type, all would be compiled again.
    goals, first, more = np.array(goals, order="C"), np.array(first, order="C"), np.array(more, order="C")
    q, error, tally = np.empty((len(goals), n)), np.empty(len(goals)), np.zeros((len(goals), 2), np.int64)
    trace = np.empty((0, n + 2)) if trace is None else trace

    def reach_some(part: slice) -> None:
        records = copied(worlds), searches.copy()
        reach(*records, goals[part], first[part], more, q[part], error[part], tally[part], trace)

    work_in_shares(reach_some, len(goals), SHARE, threads)
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
        trace: As for `search`.
    """
    n = task.arm.n
    (world,), (search,) = records(task, np.tile([-math.inf, math.inf], (n, 1)), tolerance, most)
    search["q_next"][:n] = first
    error, steps = math.sqrt(measure(world, search, goal)), 0
    accept(world, search, 0.0, trace)
    while steps < most and error > tolerance:
        find_step(world, search, 0.0)
        error = math.sqrt(measure(world, search, goal))
        if not math.isfinite(error):
            break
        steps += 1
        accept(world, search, 0.0, trace)
    return search["q"][:n], steps


def records(
    task: Task, limit: Array, tolerance: float, most: int
) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return the record of a task's world and that of a search, each in an array, (1,)."""
    worlds = new_worlds(1, task.arm.n, len(task.arm.axis_names))
    task.write(worlds[0])
    link(worlds, {"decompose": decompose_anew})
    searches = np.zeros(1, search_type(worlds["state"]["q"].shape[1]))
    searches["tolerance"], searches["most"] = tolerance, most
    searches["limit"][0, :, : task.arm.n] = limit.T
    return worlds, searches


# Compiled: all take the record of the task's world and that of the search. -----------------------


@compiled
def reach(
    worlds: Record, searches: Record, goals: Array, first: Array, more: Array, q: Array, error: Array,
    tally: NDArray[np.int64], trace: Array,
) -> None:  # fmt: skip
    """Write what `search` returns. The records come in arrays, which numba takes faster."""
    world, search = worlds[0], searches[0]
    n, tries = world.n, more.shape[0] + 1
    for i in range(goals.shape[0]):
        for t in range(tries + 1):
            is_last, path = t == tries, trace if t == 0 else trace[:0]
            for j in range(n):
                search.q_next[j] = first[i, j] if t == 0 else q[i, j] if is_last else more[t - 1, j]
            patience = search.most if is_last or tries == 1 else PATIENCE
            squared, steps = descend(world, search, goals[i], patience, path)
            tally[i, 0] += steps
            if t == 0 or math.sqrt(squared) < error[i]:
                error[i], tally[i, 1] = math.sqrt(squared), tally[i, 1] if is_last else t
                for j in range(n):
                    q[i, j] = search.q[j]
            if error[i] <= search.tolerance:
                break


@compiled
def descend(world: Record, search: Record, goal: Array, patience: int, trace: Array) -> tuple[float, int]:
    """Go from `q_next` to a goal as far as one start leads; return the final |e|² and the steps.

    λ² = μ |e|² [Chan88], [Sugihara11] keeps the convergence quadratic and the steps near a singularity
    finite. μ is divided by four where the error fell as the linear model promised, and multiplied by four
    where it did not. As in a trust region, no step that increases the error is taken [Fan03].
    """
    squared = before = measure(world, search, goal)
    share, steps, is_last = FIRST_SHARE, 0, False
    search.row = 0
    accept(world, search, 0.0, trace)
    while steps < search.most and share < LARGEST_SHARE and not is_last:
        # One step more than needed: by quadratic convergence it adds the last digits.
        is_last = squared <= search.tolerance * search.tolerance
        if steps % patience == patience - 1 and not is_last:
            if squared > LOSS * LOSS * before:
                break
            before = squared
        damping = math.sqrt(share * squared)
        promised = find_step(world, search, damping)
        if promised <= FLAT * squared:
            break
        squared_next = measure(world, search, goal)
        steps += 1
        share = adapted(share, (squared - squared_next) / promised)
        if squared_next < squared:
            squared = squared_next
            accept(world, search, damping, trace)
    return squared, steps


@compiled
def adapted(share: float, ratio: float) -> float:
    """Return the next μ for the ratio of a step's actual reduction to the promised one."""
    if ratio > 0.75:
        return max(0.25 * share, LEAST_SHARE)
    if ratio > 0.25:
        return share
    return share * (4.0 if ratio > 0.0 else 16.0)


@compiled
def measure(world: Record, search: Record, goal: Array) -> float:
    """Return |e|² at `q_next`; leave e and the whole error there."""
    task = world.task
    follow_chain(world, search.q_next)
    pose_error(world.state.pose, goal, search.pose_error)
    for i in range(world.m):
        search.e_next[i] = task.row_scale[i] * search.pose_error[task.row[i]]
    return dot(search.e_next, search.e_next, world.m)


@compiled
def accept(world: Record, search: Record, damping: float, trace: Array) -> None:
    """Move to `q_next`, measured last: keep e, and write A = S_x L(φ) J S_q and the next row of the trace."""
    n, row, task, J = world.n, search.row, world.task, world.state.J
    geometric_jacobian(world)
    turn_rotations(search.pose_error, J, n)
    for j in range(n):
        search.q[j] = search.q_next[j]
    for i in range(world.m):
        search.e[i] = search.e_next[i]
        for j in range(n):
            search.A[i, j] = task.row_scale[i] * J[task.row[i], j] * task.joint_scale[j]
    if row < trace.shape[0]:
        trace[row, n], trace[row, n + 1] = math.sqrt(dot(search.e, search.e, world.m)), damping
        for j in range(n):
            trace[row, j] = search.q[j]
        search.row += 1


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
def find_step(world: Record, search: Record, damping: float) -> float:
    """Write a step and its end, `q_next`; return by how much |e|² falls in the linear model.

    The step minimizes |e − A z|² + λ² |z|² over the free joints [Levenberg44]. Joints at a limit that the
    gradient pushes beyond it are held. Joints that the step would take beyond a limit go there and are held
    next, until the remaining step stays within the limits: an active set method.
    """
    hold_pushed(world, search)
    for _ in range(world.n + 1):
        solve_free(world, search, damping)
        if go_to_limits(world, search):
            break
    missing2 = 0.0
    for i in range(world.m):
        missing = search.e[i] - dot(search.A[i], search.step, world.n)
        missing2 += missing * missing
    return dot(search.e, search.e, world.m) - missing2


@compiled
def hold_pushed(world: Record, search: Record) -> None:
    """Begin a step at zero; hold the joints that are at a limit and would go beyond it."""
    for j in range(world.n):
        downhill = dot(search.A[:, j], search.e, world.m)
        at_lower, at_upper = search.q[j] <= search.limit[0, j], search.q[j] >= search.limit[1, j]
        is_pushed = (at_lower and downhill <= 0.0) or (at_upper and downhill >= 0.0)
        search.step[j], search.q_next[j], search.held[j] = 0.0, search.q[j], 1.0 if is_pushed else 0.0


@compiled
def solve_free(world: Record, search: Record, damping: float) -> None:
    """Write the damped step of the free joints; e and A without the held joints are the `rest`."""
    m, n, k, rest = world.m, world.n, world.k, world.rest
    for i in range(m):
        rest.task[i] = search.e[i]
        for j in range(n):
            rest.task[i] -= search.A[i, j] * search.step[j] * search.held[j]
            rest.matrix[i, j] = search.A[i, j] * (1.0 - search.held[j])
    if damping > 0.0 and solve_by_factor(world, search, damping):
        return
    call(world.methods.decompose, world, rest)
    project(rest.u, rest.task, k, m, rest.asked)
    for i in range(k):
        sigma, is_rounding = rest.sigma[i], rest.sigma[i] <= RANK_FLOOR * rest.sigma[0]
        rest.gain[i] = 0.0 if is_rounding else sigma / (sigma * sigma + damping * damping)
    combine(rest.gain, rest.asked, rest.v, k, n, search.step_free)


@Method
def decompose_anew(world: Record, spectrum: Record) -> None:
    """Decompose the matrix of a spectrum, (m, n). Behind an address, it is compiled but once."""
    m, n, spectrum.age = world.m, world.n, 0
    begin_basis(spectrum.u if m <= n else spectrum.v, world.k, spectrum.age)
    svd(spectrum.matrix, m, n, spectrum.u, spectrum.sigma, spectrum.v)


@compiled
def solve_by_factor(world: Record, search: Record, damping: float) -> bool:
    """Write the damped step Aᵀ (A Aᵀ + λ²)⁻¹ e of the free joints; return whether a Cholesky factor serves.

    It is several times as fast as the singular values. A step has a relative error of at most about 1e-8,
    which the next step corrects.
    """
    m, n, A, e, root, largest = world.m, world.n, world.rest.matrix, world.rest.task, search.root, 0.0
    for i in range(m):
        for r in range(i + 1):
            root[i, r] = dot(A[i], A[r], n)
        root[i, i] += damping * damping
        largest = max(largest, root[i, i])
    factor(root, m)
    for i in range(m):
        if not root[i, i] * root[i, i] > WELL * largest:
            return False
    forward(root, e, m)
    backward(root, e, m)
    for j in range(n):
        search.step_free[j] = dot(A[:, j], e, m)
    return True


@compiled
def go_to_limits(world: Record, search: Record) -> bool:
    """Add the step of the free joints as far as limits allow; return whether all of it was added."""
    lower, upper, is_all = search.limit[0], search.limit[1], True
    for j in range(world.n):
        if search.held[j] == 0.0:
            scale = world.task.joint_scale[j]
            q = search.q[j] + scale * search.step_free[j]
            search.q_next[j], search.step[j] = min(max(q, lower[j]), upper[j]), search.step_free[j]
            if search.q_next[j] != q:
                search.step[j] = (search.q_next[j] - search.q[j]) / scale
                search.held[j], is_all = 1.0, False
    return is_all
