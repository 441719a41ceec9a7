"""Saturation in the null space: the other joints take over the part of a saturated joint [Flacco15]."""

import math

from rmrc.law.inverses import gains, push_fading
from rmrc.law.jit import Record, compiled, inlined
from rmrc.law.metric import take_along, weigh_free
from rmrc.law.rest import decompose_rest_from_scratch
from rmrc.law.svd import combine, project

# The relative excess of a bound that is more than rounding.
ROUNDING = 1e-12
# The free joints can no longer do the task when the smallest singular value of the remaining A is below this
# share of the largest of the whole A.
LOST = 1e-6


@inlined
def saturate(world: Record, tick: Record) -> float:
    """Fix joints at their bounds, the most critical first, and let the free ones do as much as they can.

    With all joints free the rates are the given ones. Where not all of the task fits, the largest share that
    fits decides. Return that share; or -1, with the rates unchanged, if no share fits.

    Args:
        world: Bounds, task, A, its decomposition; qdot0 holds the projected rates of the null space.
        tick: qdot_cmd is replaced.
    """
    n, best = world.n, -1.0
    for j in range(n):
        world.held[j] = 0.0
    for _ in range(max(0, n - world.m) + 1):  # until fewer joints are free than the task has rows
        if not free_rates(world, tick):
            break
        share, critical = task_share(world)
        if share > best:
            best = share
            for j in range(n):
                world.best[j] = share * world.part_a[j] + world.part_b[j]
        if share >= 1.0 or critical < 0:
            break
        world.held[critical] = 1.0
        total = world.part_a[critical] + world.part_b[critical]
        is_above = total > world.upper[critical]
        world.qdot0[critical] = world.upper[critical] if is_above else world.lower[critical]
    if best >= 0.0:
        for j in range(n):
            tick.qdot_cmd[j] = world.best[j]
    return float(best)


@inlined
def free_rates(world: Record, tick: Record) -> bool:
    """Write qdot(s) = s · part_a + part_b of the free joints; return whether they still span the task.

    part_a = S_q A_F^g t,   part_b = q̇_N − S_q A_F^g A S_q⁻¹ q̇_N
    """
    n, m, k = world.n, world.m, world.k
    for r in range(m):
        missing = 0.0
        for j in range(n):
            missing += world.A[r, j] * world.qdot0[j] / world.joint_scale[j]
            world.B[r, j] = world.A[r, j] * (1.0 - world.held[j])
        world.task_B[r] = missing
    weigh_free(world, world.qdot0, 1.0)
    decompose_rest_from_scratch(world, m, n)
    if world.sigma_B[k - 1] <= LOST * tick.sigma[0]:
        return False
    project(world.u_B, world.task, k, m, world.asked_B)
    push_fading(world, world.u_B, world.task, world.sigma_B, world.asked_B)
    gains(world, world.asked_B, world.sigma_B, world.v_B, tick.damping, world.gain_B)
    combine(world.gain_B, world.asked_B, world.v_B, k, n, world.part_a)
    project(world.u_B, world.task_B, k, m, world.asked_B)
    combine(world.gain_B, world.asked_B, world.v_B, k, n, world.part_b)
    take_along(world, world.part_a, 0.0)
    take_along(world, world.part_b, -1.0)
    for j in range(n):
        scale = world.joint_scale[j] * (1.0 - world.held[j])
        world.part_a[j] = scale * world.part_a[j]
        world.part_b[j] = world.qdot0[j] - scale * world.part_b[j]
    return True


@compiled
def task_share(world: Record) -> tuple[float, int]:
    """Return the largest share s in [0, 1] of the task with all rates within bounds, and the bounding joint.

    The result is 1 and -1 if all of the task fits, and -1 for the share if none does. Among joints that the
    whole task takes beyond their bounds, the bounding joint would be the first to leave them as s grows;
    of several, the one that goes farthest.
    """
    least, most, smallest, farthest, critical = 0.0, 1.0, math.inf, 0.0, -1
    for j in range(world.n):
        if world.held[j] > 0.0:
            continue
        a, b, lower, upper = world.part_a[j], world.part_b[j], world.lower[j], world.upper[j]
        first, last = shares(a, b, lower, upper)
        least, most = max(least, first), min(most, last)
        beyond = max(lower - (a + b), a + b - upper)
        if beyond > ROUNDING * max(1.0, abs(a) + abs(b)) and (
            critical < 0 or last < smallest or (last == smallest and beyond > farthest)
        ):
            smallest, farthest, critical = last, beyond, j
    if critical < 0:
        return 1.0, -1
    return (most if least <= most else -1.0), critical


@compiled
def shares(a: float, b: float, lower: float, upper: float) -> tuple[float, float]:
    """Return the smallest and largest s with lower <= s a + b <= upper; if they are out of order, none."""
    if abs(a) <= ROUNDING * max(1.0, abs(b)):  # the task does not move this joint
        return (-math.inf, math.inf) if lower <= b <= upper else (math.inf, -math.inf)
    first, last = (lower - b) / a, (upper - b) / a
    return (first, last) if first <= last else (last, first)
