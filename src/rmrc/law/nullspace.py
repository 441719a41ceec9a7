"""Objectives that propose joint rates qdot0, and the projector that keeps them out of the task."""

import math

from rmrc.law.gradient import sigma_gradient
from rmrc.law.jit import Array, Record, apart, compiled, dispatch, inlined
from rmrc.law.metric import INERTIA, backward, times_transposed, weigh_wish
from rmrc.law.priority import secondary  # noqa: F401 - one of the objectives
from rmrc.law.svd import dot
from rmrc.scenario.choices import OBJECTIVES

NONE = OBJECTIVES.code("none")


@inlined
def posture(world: Record, tick: Record, qdot0: Array) -> None:
    """Write gain · (posture − q) [Liegeois77]."""
    for j in range(world.n):
        qdot0[j] = world.nullspace_gain * (world.nullspace_posture[j] - world.q[j])


@inlined
def joint_limits(world: Record, tick: Record, qdot0: Array) -> None:
    """Write −gain · S_q² ∇H [Liegeois77], H = 1/(2n) Σ ((q − middle)/range)².

    A joint without limits gets no rate.
    """
    n = world.n
    for j in range(n):
        lower, upper = world.position_range[0, j], world.position_range[1, j]
        slope = 0.0
        if upper - lower < math.inf:
            slope = (world.q[j] - 0.5 * (lower + upper)) / ((upper - lower) * (upper - lower) * n)
        qdot0[j] = -world.nullspace_gain * world.joint_scale[j] * world.joint_scale[j] * slope
    if world.inverse_metric == INERTIA:
        weigh_wish(world, qdot0)


@inlined
def manipulability(world: Record, tick: Record, qdot0: Array) -> None:
    """Write gain · S_q² ∇w [Yoshikawa85], with ∇w = Σ_i (Π_{l≠i} σ_l) ∇σ_i, which needs no division by σ."""
    n, sigma = world.n, tick.sigma
    for j in range(n):
        qdot0[j] = 0.0
    for i in range(world.k):
        others = 1.0
        for p in range(world.k):
            if p != i:
                others *= sigma[p]
        if others == 0.0:
            continue
        sigma_gradient(world, i, world.work)
        for j in range(n):
            qdot0[j] += others * world.work[j]
    for j in range(n):
        qdot0[j] *= world.nullspace_gain * world.joint_scale[j] * world.joint_scale[j]
    if world.inverse_metric == INERTIA:
        weigh_wish(world, qdot0)


@inlined
def rates(world: Record, tick: Record, qdot0: Array) -> None:
    """Write the rates that the user gives."""
    for j in range(world.n):
        qdot0[j] = world.nullspace_rates[j]


# Writes qdot0, the rates that the objective would choose without a task.
wished_rates = inlined(dispatch(OBJECTIVES, like=posture, field="call_objective"))


@apart("call_null_space", nullspace_objective=OBJECTIVES.codes(lambda one: one.acts))
def move_in_null_space(world: Record, tick: Record) -> None:
    """Add to the rates the objective's rates without their part in the task."""
    wished_rates(world, tick, world.qdot0)
    add_projected(world, world.qdot0, tick.qdot_cmd)


@compiled
def add_projected(world: Record, qdot0: Array, rates: Array) -> None:
    """Add N qdot0 = S_q (I − Σ_{i<r} v_i v_iᵀ) S_q⁻¹ qdot0 to the rates, and leave it in qdot0.

    J N qdot0 = 0. r is the rank of the task almost everywhere, which was found before the run. The projector
    removes as many directions at a singularity as elsewhere: N changes continuously, and the objective does
    not get a direction that becomes singular, whatever the inverse does to it.
    """
    n, scale = world.n, world.joint_scale
    for j in range(n):
        qdot0[j] /= scale[j]
    if world.inverse_metric == INERTIA:
        times_transposed(world.root, qdot0, n)
        remove_task(world, qdot0)
        backward(world.root, qdot0, n)
    else:
        remove_task(world, qdot0)
    for j in range(n):
        qdot0[j] *= scale[j]
        rates[j] += qdot0[j]


@compiled
def remove_task(world: Record, rates: Array) -> None:
    """Remove the task's directions from scaled rates: (I − Σ_{i<r} v_i v_iᵀ) rates."""
    for i in range(world.rank):
        along = dot(world.v[i], rates, world.n)
        for j in range(world.n):
            rates[j] -= along * world.v[i, j]
