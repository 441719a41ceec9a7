"""A second task, by priority: classical, and robust where the two tasks make each other singular."""

import math

from rmrc.law.jit import Array, Record, compiled, dispatch, inlined
from rmrc.law.kinematics import WORLD, frame_turn, framed_error, turn_columns
from rmrc.law.metric import INERTIA, scale_joints, unscale_joints, weigh_columns
from rmrc.law.rest import decompose_rest_from_scratch
from rmrc.law.svd import combine, dot, project
from rmrc.scenario.choices import PRIORITIES

# Without damping, directions in which the second task reaches less than this share of its size are given up.
TOLERANCE = 1e-6


@compiled
def second_task(world: Record) -> float:
    """Write t_2 = S_x2 K_2 pose_error_2 of the rows that count; return the norm of their error, unscaled.

    The error is along the axes of the second task's frame. J_2 is turned into that frame.
    """
    norm = second_error(world)
    if world.frame_2 != WORLD:
        turn_columns(frame_turn(world.frame_2, world.frame_quat_2, world.pose_2), world.J_2, world.n)
    for i in range(world.m_2):
        world.task_B[i] = world.row_scale_2[i] * world.feedback_2 * world.error_2[world.row_2[i]]
    return norm


@compiled
def second_error(world: Record) -> float:
    """Write the error of the second task's site; return the norm of the rows that count, unscaled."""
    error, total = world.error_2, 0.0
    framed_error(world.frame_2, world.frame_quat_2, world.free_2, world.pose_2, world.pose_ref_2, error)
    for i in range(world.m_2):
        total += error[world.row_2[i]] * error[world.row_2[i]]
    return math.sqrt(total)


@compiled
def scale_second(world: Record) -> float:
    """Write A_2 = S_x2 J_2 S_q of the rows that count; return its Frobenius norm."""
    total = 0.0
    for i in range(world.m_2):
        for j in range(world.n):
            entry = world.row_scale_2[i] * world.J_2[world.row_2[i], j] * world.joint_scale[j]
            world.B[i, j] = entry
            total += entry * entry
    if world.inverse_metric == INERTIA:
        weigh_columns(world.root, world.B, world.m_2, world.n, world.B)
        total = 0.0
        for i in range(world.m_2):
            total += dot(world.B[i], world.B[i], world.n)
    return math.sqrt(total)


@compiled
def leave_first(world: Record) -> None:
    """Replace A_2 by A_2 P: remove the first task's directions from each row."""
    for r in range(world.m_2):
        for i in range(world.rank):
            along = dot(world.v[i], world.B[r], world.n)
            for j in range(world.n):
                world.B[r, j] -= along * world.v[i, j]


@compiled
def solve_second(world: Record, size: float, rates: Array) -> None:
    """Write S_q V g(Σ) Uᵀ t_2 with the second task's own constant damping."""
    n, damped, floor = world.n, world.nullspace_secondary_damping, TOLERANCE * size
    k = min(world.m_2, n)
    for i in range(k):
        s = world.sigma_B[i]
        undamped = 1.0 / s if s > floor else 0.0
        world.gain_B[i] = s / (s * s + damped * damped) if damped > 0.0 else undamped
    project(world.u_B, world.task_B, k, world.m_2, world.asked_B)
    combine(world.gain_B, world.asked_B, world.v_B, k, n, rates)
    scale_joints(world, rates)


@inlined
def classical(world: Record, tick: Record, size: float, qdot0: Array) -> None:
    """Write S_q (A_2 P)* (t_2 − A_2 S_q⁻¹ qdot_1): the missing part, in the remaining space [Nakamura87]."""
    n, m = world.n, world.m_2
    if world.inverse_metric == INERTIA:
        for j in range(n):
            world.shape[j] = tick.qdot_cmd[j]
        unscale_joints(world, world.shape)
        for i in range(m):
            world.task_B[i] -= dot(world.B[i], world.shape, n)
    for i in range(m if world.inverse_metric != INERTIA else 0):
        for j in range(n):
            world.task_B[i] -= world.B[i, j] * tick.qdot_cmd[j] / world.joint_scale[j]
    leave_first(world)
    decompose_rest_from_scratch(world, m, n)
    tick.secondary_sigma = world.sigma_B[min(m, n) - 1]
    solve_second(world, size, qdot0)


@inlined
def robust(world: Record, tick: Record, size: float, qdot0: Array) -> None:
    """Write S_q A_2* t_2: the second task alone, which needs no inverse of A_2 P [Chiaverini97]."""
    n, m = world.n, world.m_2
    decompose_rest_from_scratch(world, m, n)
    solve_second(world, size, qdot0)
    leave_first(world)
    decompose_rest_from_scratch(world, m, n)
    tick.secondary_sigma = world.sigma_B[min(m, n) - 1]


solve_by_priority = inlined(dispatch(PRIORITIES, like=classical))


@compiled
def secondary(world: Record, tick: Record, qdot0: Array) -> None:
    """Write the rates that a second task asks for; `add_projected` passes the part that the first allows.

    P = I − Σ v_i v_iᵀ. Where both tasks are possible but not together, A_2 P loses rank: an algorithmic
    singularity. Its smallest singular value is recorded whatever the priority.

    Args:
        world: Read: pose_2, J_2, and the decomposition of the first task.
        tick: Read: qdot_cmd, the rates of the first task. Written: secondary_error and secondary_sigma.
        qdot0: Written, (n,).
    """
    tick.secondary_error = second_task(world)
    solve_by_priority(world, tick, scale_second(world), qdot0)
