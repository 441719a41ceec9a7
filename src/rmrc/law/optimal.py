"""The best rates within bounds: a small convex program, by an active set that goes on from the last tick's.

    minimize ‖task − A y‖² + λ² ‖y − S_q⁻¹ drift‖²,   lower ≤ S_q y ≤ upper

Where λ is 0, or nothing of it is felt, the second part decides among those that are as good for the first.
"""

import math

from rmrc.law.inverses import damped_gain
from rmrc.law.jit import Array, Record, apart, compiled
from rmrc.law.redistribution import ROUNDING
from rmrc.law.rest import decompose_rest
from rmrc.law.stops import first_blocked, is_beyond
from rmrc.law.svd import RANK_FLOOR, combine, dot, orthonormalize, project
from rmrc.scenario.choices import LIMITS

OPTIMAL = LIMITS.code("optimal")

# So many steps, for each joint and beyond, are more than any program takes: of 8,228 random ones of up to
# eight joints, half took one, and none more than 12.
STEPS_EACH, STEPS_MORE = 4, 8
# A share of the task is bounded by a few faces of what the rates within bounds can do: none of 800 random
# tasks met more than four.
FACES = 20
# What is left of a task is rounding below this share of what made it.
LEFT = 1e-14


@apart("call_best", limits_on_excess=(OPTIMAL,))
def best_within(world: Record, tick: Record, task: Array, share: float, damped: float) -> None:
    """Replace the rates by the best within `world.lower` and `world.upper`; who is at a bound is `held`.

    From rates within the bounds it goes towards those of the free joints alone, until a joint meets its bound
    and is held; where none does, the held joint is let go that the slope draws inwards most [Stark95]. The
    first set of held joints is that of the last tick. Each step is within the bounds and none makes it worse,
    so that a program that were cut off by the largest number of steps would still leave rates within bounds.

    Args:
        world: Bounds, A, scales, drift, and the set of the last tick.
        tick: qdot_cmd, from which those are taken that are not held.
        task: Scaled rows, (m,).
        share: Of the task, that is to be done.
        damped: λ.
    """
    n = world.n
    begin_within(world, tick.qdot_cmd)
    for _ in range(STEPS_EACH * n + STEPS_MORE):
        resolve_rest(world, tick.sigma[0], task, share, damped)
        blocked, step = first_blocked(world, world.lower, world.upper)
        for j in range(n):
            if world.held[j] == 0.0:
                world.best[j] += step * (world.part_b[j] - world.best[j])
        if blocked >= 0:
            above = world.part_b[blocked] > world.best[blocked]
            world.best[blocked] = world.upper[blocked] if above else world.lower[blocked]
            world.held[blocked] = 1.0 if above else -1.0
            continue
        freed = most_inwards(world, damped)
        if freed < 0:
            break
        world.held[freed] = 0.0
    for j in range(n):
        tick.qdot_cmd[j] = min(max(world.best[j], world.lower[j]), world.upper[j])
        world.active[j] = world.held[j]
    world.active_age = world.age


@compiled
def begin_within(world: Record, rates: Array) -> None:
    """Hold the joints that were held in the last tick, or those that are beyond; the others are near rates.

    The decomposition begins with the vectors of all joints.
    """
    n, k, goes_on = world.n, world.k, False
    for i in range(k):
        for j in range(k):
            world.u_B[i, j], world.v_B[i, j] = world.u[i, j], world.v[i, j]
    orthonormalize(world.u_B if world.m <= n else world.v_B, k)
    for j in range(n):
        goes_on |= world.active[j] != 0.0 and world.active_age >= world.age - 1
    for j in range(n):
        lower, upper, rate, side = world.lower[j], world.upper[j], rates[j], 0.0
        if goes_on:
            side = world.active[j]
        elif is_beyond(rate, lower, upper):
            side = math.copysign(1.0, rate - upper)
        bound = upper if side > 0.0 else lower
        is_held = side != 0.0 and math.isfinite(bound)
        world.held[j] = side if is_held else 0.0
        world.best[j] = bound if is_held else min(max(rate, lower), upper)


@compiled
def resolve_rest(world: Record, largest: float, task: Array, share: float, damped: float) -> None:
    """Write into part_b the rates of the free joints that are best without bounds, and the slopes there.

    With what the held joints leave of the task, r = Σ_i asked_i u_i + missing, and A of the free ones, the
    slope of the first part at joint j is −2 a_jᵀ (missing + λ² w), with w = Σ_i asked_i/(σ_i² + λ²) u_i:
    `missing` is what no free joint can do, and `pull` is w. So both keep their accuracy however small λ is.
    """
    n, m, k = world.n, world.m, world.k
    for r in range(m):
        wanted = share * task[r]
        size = abs(wanted)
        for j in range(n):
            is_free = world.held[j] == 0.0
            given = world.A[r, j] * (world.drift[j] if is_free else world.best[j]) / world.joint_scale[j]
            wanted -= given
            size += abs(given)
            world.B[r, j] = world.A[r, j] if is_free else 0.0
        world.task_B[r], world.magnitude[r] = wanted, size
    decompose_rest(world, m, n)
    project(world.u_B, world.task_B, k, m, world.asked_B)
    for r in range(m):
        world.missing[r], world.pull[r] = world.task_B[r] if m > n else 0.0, 0.0
    for i in range(k):
        sigma, floor = world.sigma_B[i], RANK_FLOOR * largest
        world.gain_B[i] = damped_gain(sigma, floor, damped)
        of_pull, of_missing = 0.0, 0.0 if m > n else world.asked_B[i]
        if sigma > floor:
            of_pull = world.asked_B[i] / (sigma * sigma + damped * damped)
            of_missing -= world.asked_B[i]
        for r in range(m):
            world.pull[r] += of_pull * world.u_B[i, r]
            world.missing[r] += of_missing * world.u_B[i, r]
    combine(world.gain_B, world.asked_B, world.v_B, k, n, world.part_b)
    for j in range(n):
        if world.held[j] == 0.0:
            world.part_b[j] = world.drift[j] + world.joint_scale[j] * world.part_b[j]


@compiled
def most_inwards(world: Record, damped: float) -> int:
    """Return the held joint that the slope draws inwards most, or -1.

    Where what is missing decides, that is by far the steeper: λ² times the other part is added to it, which
    for λ = 0 comes after it.
    """
    chosen, most, by_missing = -1, 0.0, False
    for j in range(world.n):
        side = world.held[j]
        if side == 0.0 or world.lower[j] >= world.upper[j]:
            continue
        missing, size, pull, of_pull = 0.0, 0.0, 0.0, 0.0
        for r in range(world.m):
            a = world.A[r, j]
            missing += a * world.missing[r]
            size += abs(a) * world.magnitude[r]
            pull += a * world.pull[r]
            of_pull += abs(a * world.pull[r])
        moved = (world.best[j] - world.drift[j]) / world.joint_scale[j]
        pull, of_pull = pull - moved, of_pull + abs(moved)
        if abs(missing) <= LEFT * size:
            missing = 0.0
        decides = missing != 0.0 and damped == 0.0
        inwards = -side * (missing if decides else pull)
        if damped > 0.0:
            inwards -= side * missing / (damped * damped)
        if inwards <= ROUNDING * (size if decides else of_pull) or (by_missing and not decides):
            continue
        if inwards > most or (decides and not by_missing):
            chosen, most, by_missing = j, inwards, decides
    return chosen


@compiled
def largest_share(world: Record, tick: Record) -> float:
    """Replace the rates by the least that do the largest share of what they do, within the bounds.

    Return that share, in [0, 1]; -1 if the bounds let none of it be done, as those of acceleration may, and
    the rates are as they came in. What is missing from too large a share is the normal of a face of what the
    rates within bounds can do, and the share on that face is the next: never too small, and the largest after
    a few faces.
    """
    n, m, share = world.n, world.m, 1.0
    for r in range(m):
        world.direction[r] = 0.0
        for j in range(n):
            world.direction[r] += world.A[r, j] * tick.qdot_cmd[j] / world.joint_scale[j]
    for j in range(n):
        world.wish[j] = tick.qdot_cmd[j]
    for _ in range(FACES):
        best_within(world, tick, world.direction, share, 0.0)
        missing2, size2 = 0.0, 0.0
        for r in range(m):
            missing2 += world.missing[r] * world.missing[r]
            size2 += world.magnitude[r] * world.magnitude[r]
        if missing2 <= ROUNDING * ROUNDING * size2:
            return share
        along = dot(world.missing, world.direction, m)
        share = share - missing2 / along if along > 0.0 else -1.0
        if share < 0.0:
            break
    for j in range(n):
        tick.qdot_cmd[j] = world.wish[j]
    return -1.0
