"""Saturation in the null space: the other joints take over the part of a saturated joint [Flacco15]."""

import math

from rmrc.law.compiling import Record, call, compiled
from rmrc.law.inverses import push_fading
from rmrc.law.metric import take_along, weigh_free
from rmrc.law.svd import ROUNDING, combine, decompose_afresh, project

# The free joints can no longer do the task when the smallest singular value of the remaining A is below this
# share of the largest of the whole A.
LOST = 1e-6


@compiled
def saturate(world: Record) -> float:
    """Fix joints at their bounds, the most critical first, and let the free ones do as much as they can.

    With all joints free the rates are the given ones. Where not all of the task fits, the largest share that
    fits decides. Return that share; or -1, with the rates unchanged, if no share fits.

    Args:
        world: Read: bounds, task, A, its decomposition, and qdot0, the projected rates of the null space.
            Written: `tick.qdot_cmd`.
    """
    scratch, bounds = world.scratch, world.bounds
    n, best = world.n, -1.0
    for j in range(n):
        bounds.held[j] = 0.0
    for _ in range(max(0, n - world.m) + 1):  # until fewer joints are free than the task has rows
        if not free_rates(world):
            break
        share, critical = task_share(world)
        if share > best:
            best = share
            for j in range(n):
                bounds.best[j] = share * scratch.part_a[j] + scratch.part_b[j]
        if share >= 1.0 or critical < 0:
            break
        bounds.held[critical] = 1.0
        total = scratch.part_a[critical] + scratch.part_b[critical]
        is_above = total > bounds.upper[critical]
        scratch.qdot0[critical] = bounds.upper[critical] if is_above else bounds.lower[critical]
    if best >= 0.0:
        for j in range(n):
            world.tick.qdot_cmd[j] = bounds.best[j]
    return float(best)


@compiled
def free_rates(world: Record) -> bool:
    """Write qdot(s) = s · part_a + part_b of the free joints; return whether they still span the task.

    part_a = S_q A_F^g t,   part_b = q̇_N − S_q A_F^g A S_q⁻¹ q̇_N
    """
    task, scratch, bounds, first, rest = world.task, world.scratch, world.bounds, world.first, world.rest
    n, m, k = world.n, world.m, world.k
    for r in range(m):
        missing = 0.0
        for j in range(n):
            missing += scratch.A[r, j] * scratch.qdot0[j] / task.joint_scale[j]
            rest.matrix[r, j] = scratch.A[r, j] * (1.0 - bounds.held[j])
        rest.task[r] = missing
    weigh_free(world, scratch.qdot0, 1.0)
    decompose_afresh(world, m)
    if rest.sigma[k - 1] <= LOST * first.sigma[0]:
        return False
    project(rest.u, first.task, k, m, rest.asked)
    push_fading(world, rest.u, first.task, rest.sigma, rest.asked)
    rest.damping = first.damping
    call(world.methods.gains, world, rest)
    combine(rest.gain, rest.asked, rest.v, k, n, scratch.part_a)
    project(rest.u, rest.task, k, m, rest.asked)
    combine(rest.gain, rest.asked, rest.v, k, n, scratch.part_b)
    take_along(world, scratch.part_a, 0.0)
    take_along(world, scratch.part_b, -1.0)
    for j in range(n):
        scale = task.joint_scale[j] * (1.0 - bounds.held[j])
        scratch.part_a[j] = scale * scratch.part_a[j]
        scratch.part_b[j] = scratch.qdot0[j] - scale * scratch.part_b[j]
    return True


@compiled
def task_share(world: Record) -> tuple[float, int]:
    """Return the largest share s in [0, 1] of the task with all rates within bounds, and the bounding joint.

    The result is 1 and -1 if all of the task fits, and -1 for the share if none does. Among joints that the
    whole task takes beyond their bounds, the bounding joint would be the first to leave them as s grows;
    of several, the one that goes farthest.
    """
    scratch, bounds = world.scratch, world.bounds
    least, most, smallest, farthest, critical = 0.0, 1.0, math.inf, 0.0, -1
    for j in range(world.n):
        if bounds.held[j] > 0.0:
            continue
        a, b, lower, upper = scratch.part_a[j], scratch.part_b[j], bounds.lower[j], bounds.upper[j]
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
