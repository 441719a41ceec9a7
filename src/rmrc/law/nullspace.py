"""The rest of the joints' freedom beside the task: objectives, and a second task by priority.

An objective proposes joint rates, in `scratch.qdot0`, which a projector keeps out of the task; those that
climb a singular value take its derivative from that of J, without differences. The priority of a second task
is classical, or robust where the two tasks make each other singular.
"""

import math

from rmrc.law.compiling import Array, Method, Record, call, compiled
from rmrc.law.inverses import damped_gain
from rmrc.law.kinematics import BASE, SITE, WORLD, carry, frame_turn, framed_error, turn_columns, way_to
from rmrc.law.metric import (
    INERTIA,
    add_energy_gradient,
    backward,
    scale_joints,
    unscale_joints,
    weigh_columns,
    weigh_wish,
)
from rmrc.law.svd import clear, combine, copy, decompose_afresh, dot, project


@compiled
def sigma_gradient(world: Record, i: int, gradient: Array) -> None:
    """Write ∂σ_i/∂q_j = u_iᵀ (∂A/∂q_j) v_i, (n,), by the geometric derivative of J.

    A joint turns the columns of all joints behind it, and moves the site for the columns of joints before it:

        ∂[v_l; ω_l]/∂q_j = [ω_j × v_l; ω_j × ω_l]  for j before l,  [ω_l × v_j; 0] else

    The columns of sliding joints have ω = 0, so the same terms serve them. Every joint turns the axes of the
    site: along these, −[ω_j × v_l; ω_j × ω_l] is added to all columns, so the first case becomes 0. Where
    joints follow others, j and l are axes of the chain, each of which moves by a ratio of its leader.

    Args:
        world: Read: J, the frame of its rows, the decomposition and the scales.
        i: Index of the singular value.
        gradient: Written, (n,) [1/rad or 1/m].
    """
    copy(world.first.v[i], world.scratch.shape, world.n)
    scale_joints(world, world.scratch.shape)
    is_alone = world.chain.axes == world.n
    gradient_of(world, i, world.state.J if is_alone else world.chain.columns, gradient)
    if world.law.inverse_metric == INERTIA:
        add_metric_gradient(world, i, gradient)


@compiled
def add_metric_gradient(world: Record, i: int, gradient: Array) -> None:
    """Add the change of σ_i that the change of the joint inertia causes: −σ_i ∂T/∂q at the rates of v_i."""
    shape, first = world.scratch.shape, world.first
    copy(first.v[i], shape, world.n)
    backward(world.links.root, shape, world.n)
    for j in range(world.n):
        shape[j] *= world.links.scale[j]
    add_energy_gradient(world, shape, -first.sigma[i], gradient)


@compiled
def gradient_of(world: Record, i: int, J: Array, gradient: Array) -> None:
    """Write the gradient for `sigma_gradient` from the contributions of the axes, (6, ℓ)."""
    n, turns = world.chain.axes, world.task.frame == SITE
    task, wrench = world.task, world.scratch.wrench
    clear(wrench, 6)
    for r in range(world.m):
        wrench[task.row[r]] = task.row_scale[r] * world.first.u[i, r]
    fx, fy, fz, mx, my, mz = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
    for a in range(n):
        leader = world.chain.leader[a]
        world.chain.rate[a] = world.chain.ratio[a] * world.scratch.shape[leader]
    clear(gradient, world.n)
    for j in range(n):
        ax = ay = az = bx = by = bz = 0.0
        for l in range(n):  # noqa: E741  the index of the slopes (15) of docs/theory.md
            x = world.chain.rate[l]
            ox, oy, oz = x * J[3, l], x * J[4, l], x * J[5, l]
            if l <= j:  # the axes of a chain are in this order
                bx, by, bz = bx + ox, by + oy, bz + oz
            if (l > j) != turns:
                vx, vy, vz = x * J[0, l], x * J[1, l], x * J[2, l]
                ax += vy * fz - vz * fy + oy * mz - oz * my
                ay += vz * fx - vx * fz + oz * mx - ox * mz
                az += vx * fy - vy * fx + ox * my - oy * mx
        if turns:
            ax, ay, az = -ax, -ay, -az
        gradient[world.chain.leader[j]] += world.chain.ratio[j] * (
            J[3, j] * ax + J[4, j] * ay + J[5, j] * az
            + J[0, j] * (fy * bz - fz * by) + J[1, j] * (fz * bx - fx * bz) + J[2, j] * (fx * by - fy * bx)
        )  # fmt: skip


@Method
def posture(world: Record) -> None:
    """Write gain · (posture − q) [Liegeois77]; a joint without range takes the shorter way round."""
    law, qdot0 = world.law, world.scratch.qdot0
    for j in range(world.n):
        qdot0[j] = law.nullspace_gain * way_to(world, j, law.nullspace_posture[j])


@Method
def joint_limits(world: Record) -> None:
    """Write −gain · S_q² ∇H [Liegeois77], H = 1/(2n) Σ ((q − middle)/range)².

    A joint without limits gets no rate.
    """
    task, law, limits, qdot0, n = world.task, world.law, world.limits, world.scratch.qdot0, world.n
    for j in range(n):
        lower, upper = limits.range[0, j], limits.range[1, j]
        slope = 0.0
        if upper - lower < math.inf:
            slope = (world.state.q[j] - 0.5 * (lower + upper)) / ((upper - lower) * (upper - lower) * n)
        qdot0[j] = -law.nullspace_gain * task.joint_scale[j] * task.joint_scale[j] * slope
    if law.inverse_metric == INERTIA:
        weigh_wish(world, qdot0)


@Method
def manipulability(world: Record) -> None:
    """Write gain · S_q² ∇w [Yoshikawa85], with ∇w = Σ_i (Π_{l≠i} σ_l) ∇σ_i, which needs no division by σ."""
    task, law, scratch = world.task, world.law, world.scratch
    n, sigma, qdot0 = world.n, world.first.sigma, scratch.qdot0
    clear(qdot0, n)
    for i in range(world.k):
        others = 1.0
        for p in range(world.k):
            if p != i:
                others *= sigma[p]
        if others == 0.0:
            continue
        sigma_gradient(world, i, scratch.work)
        for j in range(n):
            qdot0[j] += others * scratch.work[j]
    for j in range(n):
        qdot0[j] *= law.nullspace_gain * task.joint_scale[j] * task.joint_scale[j]
    if law.inverse_metric == INERTIA:
        weigh_wish(world, qdot0)


@Method
def rates(world: Record) -> None:
    """Write the rates that the user gives."""
    copy(world.law.nullspace_rates, world.scratch.qdot0, world.n)


@Method
def move_in_null_space(world: Record) -> None:
    """Add N qdot0 = S_q (I − Σ_{i<r} v_i v_iᵀ) S_q⁻¹ qdot0 of the objective to the rates; leave it in qdot0.

    J N qdot0 = 0. r is the rank of the task almost everywhere, which was found before the run. The projector
    removes as many directions at a singularity as elsewhere: N changes continuously, and the objective does
    not get a direction that becomes singular, whatever the inverse does to it.
    """
    qdot0 = world.scratch.qdot0
    call(world.methods.objective, world)
    unscale_joints(world, qdot0)
    leave_first(world, qdot0)
    scale_joints(world, qdot0)
    for j in range(world.n):
        world.tick.qdot_cmd[j] += qdot0[j]


@Method
def secondary(world: Record) -> None:
    """Write the rates that a second task asks for, of which the first one allows a part.

    P = I − Σ v_i v_iᵀ. Where both tasks are possible but not together, A_2 P loses rank: an algorithmic
    singularity. Its smallest singular value is recorded whatever the priority.
    """
    world.tick.secondary_error = second_task(world)
    call(world.methods.priority, world)


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
