"""Objectives that wish for joint rates qdot0, and the projector that keeps them out of the task."""

from rmrc.control.compiled import Array, Record, compiled
from rmrc.control.records import Objective
from rmrc.control.smallmat import RANK_FLOOR, dot

NONE, POSTURE = int(Objective.NONE), int(Objective.POSTURE)


@compiled
def wished_rates(world: Record, qdot0: Array) -> None:
    """Write qdot0, the rates that the objective would choose if there were no task.

    posture   qdot0 = gain · (posture − q): the gradient of ½‖posture − q‖², uphill  [Liegeois77]
    """
    for j in range(world.n):
        qdot0[j] = 0.0
        if world.objective == POSTURE:
            qdot0[j] = world.objective_gain * (world.posture[j] - world.q[j])


@compiled
def add_projected(world: Record, sigma: Array, qdot0: Array, rates: Array) -> None:
    """Add S_q (I − Σ v_i v_iᵀ) S_q⁻¹ qdot0 to the rates, so that J N qdot0 = 0.

    Every right vector is removed whose σ is not zero to rounding, however small it is and whatever the
    inverse does to it: near a singularity the projector depends continuously on q, and a direction that
    dies is not handed to the objective. Task rows that an arm can never move, such as z of a planar arm,
    have σ = 0 throughout and take nothing away.
    """
    n, scale = world.n, world.joint_scale
    for j in range(n):
        qdot0[j] /= scale[j]
    for i in range(world.k):
        if sigma[i] > RANK_FLOOR * sigma[0]:
            along = dot(world.v[i], qdot0, n)
            for j in range(n):
                qdot0[j] -= along * world.v[i, j]
    for j in range(n):
        rates[j] += scale[j] * qdot0[j]
