"""A second task, by priority: classical, and robust where the two tasks make each other singular."""

import math

from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.law.inverses import damped_gain
from rmrc.law.kinematics import BASE, WORLD, carry, frame_turn, framed_error, turn_columns
from rmrc.law.metric import INERTIA, scale_joints, unscale_joints, weigh_columns
from rmrc.law.svd import combine, copy, decompose_afresh, dot, project

# Without damping, directions in which the second task reaches less than this share of its size are given up.
TOLERANCE = 1e-6


@compiled
def second_task(world: Record) -> float:
    """Write t_2 = S_x2 K_2 pose_error_2 of the rows that count; return the norm of their error, unscaled.

    The error is along the axes of the second task's frame. J_2 is turned into that frame.
    """
    second = world.second
    norm = second_error(world)
    if second.frame != WORLD:
        turn_columns(frame_turn(second.frame, world.task.base, second.pose), second.J, world.n)
    for i in range(second.m):
        world.rest.task[i] = second.row_scale[i] * second.feedback * second.error[second.row[i]]
    return norm


@compiled
def second_error(world: Record) -> float:
    """Write the error of the second task's site; return the norm of the rows that count, unscaled."""
    second = world.second
    error, base, total = second.error, world.task.base, 0.0
    if second.frame == BASE:  # the target moves with the base
        carry(base, second.in_base, second.pose_ref)
    framed_error(second.frame, base, second.free, second.pose, second.pose_ref, error)
    for i in range(second.m):
        total += error[second.row[i]] * error[second.row[i]]
    return math.sqrt(total)


@compiled
def scale_second(world: Record) -> float:
    """Write A_2 = S_x2 J_2 S_q of the rows that count; return its Frobenius norm."""
    rest, second, total = world.rest, world.second, 0.0
    for i in range(second.m):
        for j in range(world.n):
            scale = second.row_scale[i] * world.task.joint_scale[j]
            rest.matrix[i, j] = scale * second.J[second.row[i], j]
    if world.law.inverse_metric == INERTIA:
        weigh_columns(world.links.root, rest.matrix, second.m, world.n, rest.matrix)
    for i in range(second.m):
        total += dot(rest.matrix[i], rest.matrix[i], world.n)
    return math.sqrt(total)


@compiled
def leave_first(world: Record, values: Array) -> None:
    """Remove the first task's directions from coordinates: (I − Σ_{i<r} v_i v_iᵀ) values, (n,)."""
    first = world.first
    for i in range(world.rank):
        along = dot(first.v[i], values, world.n)
        for j in range(world.n):
            values[j] -= along * first.v[i, j]


@compiled
def decompose_remaining(world: Record) -> None:
    """Replace A_2 by A_2 P, without the first task's directions, and decompose it."""
    rest, m = world.rest, world.second.m
    for r in range(m):
        leave_first(world, rest.matrix[r])
    decompose_afresh(world, m)
    world.tick.secondary_sigma = rest.sigma[min(m, world.n) - 1]


@compiled
def solve_second(world: Record, size: float, rates: Array) -> None:
    """Write S_q V g(Σ) Uᵀ t_2 with the second task's own constant damping."""
    second, rest = world.second, world.rest
    k, n, damping = min(second.m, world.n), world.n, world.law.nullspace_secondary_damping
    for i in range(k):
        rest.gain[i] = damped_gain(rest.sigma[i], 0.0 if damping > 0.0 else TOLERANCE * size, damping)
    project(rest.u, world.rest.task, k, second.m, rest.asked)
    combine(rest.gain, rest.asked, rest.v, k, n, rates)
    scale_joints(world, rates)


@Method
def classical(world: Record) -> None:
    """Write S_q (A_2 P)* (t_2 − A_2 S_q⁻¹ qdot_1): the missing part, in the remaining space [Nakamura87]."""
    rest, shape, tick = world.rest, world.scratch.shape, world.tick
    n, m, size = world.n, world.second.m, scale_second(world)
    copy(tick.qdot_cmd, shape, n)
    unscale_joints(world, shape)
    for i in range(m):
        rest.task[i] -= dot(rest.matrix[i], shape, n)
    decompose_remaining(world)
    solve_second(world, size, world.scratch.qdot0)


@Method
def robust(world: Record) -> None:
    """Write S_q A_2* t_2: the second task alone, which needs no inverse of A_2 P [Chiaverini97]."""
    size = scale_second(world)
    decompose_afresh(world, world.second.m)
    solve_second(world, size, world.scratch.qdot0)
    decompose_remaining(world)
