"""Objectives that propose joint rates, in `scratch.qdot0`, and the projector beside the task."""

import math

from rmrc.law.compiling import Method, Record, call
from rmrc.law.gradient import sigma_gradient
from rmrc.law.kinematics import way_to
from rmrc.law.metric import INERTIA, scale_joints, unscale_joints, weigh_wish
from rmrc.law.priority import leave_first, second_task
from rmrc.law.svd import clear, copy


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
