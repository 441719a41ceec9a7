"""The best rates within bounds: a small convex program, by an active set that starts from the last tick's.

    minimize ‖task − A y‖² + λ² ‖y − S_q⁻¹ drift‖²,   lower ≤ S_q y ≤ upper

Where λ is 0, or so small that it has no effect, the second part decides among equal minima of the first.
"""

import math

from rmrc.law.compiling import Array, Record, compiled
from rmrc.law.inverses import damped_gain
from rmrc.law.stops import first_blocked, is_beyond
from rmrc.law.svd import RANK_FLOOR, ROUNDING, combine, decompose_afresh, dot, project
from rmrc.scenario.choices import LIMITS

OPTIMAL = LIMITS.code("optimal")

# The step limit, for each joint and one more. No program needs as many: of 8,228 random ones of up to eight
# joints, half took one step, and none more than 12.
STEPS_EACH, STEPS_MORE = 4, 8
# A few faces of the set of feasible task rates bound a share of the task: none of 800 random tasks met more
# than four.
FACES = 20
# The rest of a task is rounding below this share of its terms.
LEFT = 1e-14


@compiled
def best_within(world: Record, task: Array, share: float, damping: float) -> None:
    """Replace the rates by the best within the bounds `lower` and `upper`; joints at a bound are `held`.

    From rates within the bounds the method goes towards the optimum of the free joints alone, until a joint
    meets its bound and is held. Where none does, the held joint that the slope draws inwards most is released
    [Stark95]. The first set of held joints is that of the last tick. Each step is within the bounds and none
    makes the result worse. A program that reached the step limit would still leave rates within bounds.

    Args:
        world: Bounds, A, scales, drift, and the set of the last tick.
        task: Scaled rows, (m,).
        share: Share of the task to do.
        damping: λ.
    """
    memory, scratch, bounds, tick, n = world.memory, world.scratch, world.bounds, world.tick, world.n
    begin_within(world, tick.qdot_cmd)
    for _ in range(STEPS_EACH * n + STEPS_MORE):
        resolve_rest(world, task, share, damping)
        blocked, step = first_blocked(world, bounds.lower, bounds.upper)
        for j in range(n):
            if bounds.held[j] == 0.0:
                bounds.best[j] += step * (scratch.part_b[j] - bounds.best[j])
        if blocked >= 0:
            above = scratch.part_b[blocked] > bounds.best[blocked]
            bounds.best[blocked] = bounds.upper[blocked] if above else bounds.lower[blocked]
            bounds.held[blocked] = 1.0 if above else -1.0
            continue
        freed = most_inwards(world, damping)
        if freed < 0:
            break
        bounds.held[freed] = 0.0
    for j in range(n):
        tick.qdot_cmd[j] = min(max(bounds.best[j], bounds.lower[j]), bounds.upper[j])
        memory.active[j] = bounds.held[j]
    memory.active_age = world.first.age


@compiled
def begin_within(world: Record, rates: Array) -> None:
    """Hold the joints that the last tick held or that are beyond a bound; others stay near their rates."""
    memory, bounds = world.memory, world.bounds
    n, goes_on = world.n, False
    for j in range(n):
        goes_on |= memory.active[j] != 0.0 and memory.active_age >= world.first.age - 1
    for j in range(n):
        lower, upper, rate, side = bounds.lower[j], bounds.upper[j], rates[j], 0.0
        if goes_on:
            side = memory.active[j]
        elif is_beyond(rate, lower, upper):
            side = math.copysign(1.0, rate - upper)
        bound = upper if side > 0.0 else lower
        is_held = side != 0.0 and math.isfinite(bound)
        bounds.held[j] = side if is_held else 0.0
        bounds.best[j] = bound if is_held else min(max(rate, lower), upper)


@compiled
def resolve_rest(world: Record, task: Array, share: float, damping: float) -> None:
    """Write into part_b the best rates of the free joints without bounds, and find the slopes there.

    With r, the task without the contribution of the held joints, and A of the free joints, the slope of the
    sum at a held joint j is −2 (a_jᵀ (missing + λ² pull) − λ² y_j), with y from the drift on. `missing` is
    the part that no free joint can do, and `pull` the factor of λ². Both keep their accuracy however small λ
    is.
    """
    rest, scratch, bounds, n, m = world.rest, world.scratch, world.bounds, world.n, world.m
    for r in range(m):
        wanted = share * task[r]
        size = abs(wanted)
        for j in range(n):
            is_free = bounds.held[j] == 0.0
            rate = bounds.drift[j] if is_free else bounds.best[j]
            given = scratch.A[r, j] * rate / world.task.joint_scale[j]
            wanted -= given
            size += abs(given)
            rest.matrix[r, j] = scratch.A[r, j] if is_free else 0.0
        rest.task[r], bounds.magnitude[r] = wanted, size
    solve_free(world, damping)
    for j in range(n):
        if bounds.held[j] == 0.0:
            scratch.part_b[j] = bounds.drift[j] + world.task.joint_scale[j] * scratch.part_b[j]


@compiled
def solve_free(world: Record, damping: float) -> None:
    """Solve for the free joints by their singular vectors, also where these lose the rank of the task.

    With r = Σ_i asked_i u_i + missing, w = Σ_i asked_i/(σ_i² + λ²) u_i is `pull`.
    """
    scratch, bounds, rest, n, m, k = world.scratch, world.bounds, world.rest, world.n, world.m, world.k
    decompose_afresh(world, m)
    project(rest.u, rest.task, k, m, rest.asked)
    for r in range(m):
        bounds.missing[r], bounds.pull[r] = rest.task[r] if m > n else 0.0, 0.0
    for i in range(k):
        sigma, floor = rest.sigma[i], RANK_FLOOR * world.first.sigma[0]
        rest.gain[i] = damped_gain(sigma, floor, damping)
        of_pull, of_missing = 0.0, 0.0 if m > n else rest.asked[i]
        if sigma > floor:
            of_pull = rest.asked[i] / (sigma * sigma + damping * damping)
            of_missing -= rest.asked[i]
        for r in range(m):
            bounds.pull[r] += of_pull * rest.u[i, r]
            bounds.missing[r] += of_missing * rest.u[i, r]
    combine(rest.gain, rest.asked, rest.v, k, n, scratch.part_b)


@compiled
def most_inwards(world: Record, damping: float) -> int:
    """Return the held joint that the slope draws inwards most, or -1.

    Where `missing` is not zero, its slope is by far the steeper. With λ > 0 it is divided by λ² and added to
    the other part; with λ = 0 it alone decides, and the other part comes after it.
    """
    bounds = world.bounds
    chosen, most, by_missing = -1, 0.0, False
    for j in range(world.n):
        side = bounds.held[j]
        if side == 0.0 or bounds.lower[j] >= bounds.upper[j]:
            continue
        missing, size, pull, of_pull = 0.0, 0.0, 0.0, 0.0
        for r in range(world.m):
            a = world.scratch.A[r, j]
            missing += a * bounds.missing[r]
            size += abs(a) * bounds.magnitude[r]
            pull += a * bounds.pull[r]
            of_pull += abs(a * bounds.pull[r])
        moved = (bounds.best[j] - bounds.drift[j]) / world.task.joint_scale[j]
        pull, of_pull = pull - moved, of_pull + abs(moved)
        if abs(missing) <= LEFT * size:
            missing = 0.0
        decides = missing != 0.0 and damping == 0.0
        inwards, slack = -side * (missing if decides else pull), ROUNDING * (size if decides else of_pull)
        if damping > 0.0:
            inwards -= side * missing / (damping * damping)
            slack += LEFT * size / (damping * damping) if missing != 0.0 else 0.0
        if inwards <= slack or (by_missing and not decides):
            continue
        if inwards > most or (decides and not by_missing):
            chosen, most, by_missing = j, inwards, decides
    return chosen


@compiled
def largest_share(world: Record) -> float:
    """Replace the rates by the smallest that do the largest share of the same task, within the bounds.

    Return that share, in [0, 1]. Return -1, with the rates unchanged, if the bounds allow none of the task,
    as acceleration bounds may. The missing part of too large a share is the normal of a face of the set of
    feasible task rates, and the share on that face is the next one. It is never too small, and the largest
    after a few faces.
    """
    bounds, tick = world.bounds, world.tick
    n, m, share = world.n, world.m, 1.0
    for r in range(m):
        bounds.direction[r] = 0.0
        for j in range(n):
            bounds.direction[r] += world.scratch.A[r, j] * tick.qdot_cmd[j] / world.task.joint_scale[j]
    for j in range(n):
        bounds.wish[j] = tick.qdot_cmd[j]
    for _ in range(FACES):
        best_within(world, bounds.direction, share, 0.0)
        missing2, size2 = 0.0, 0.0
        for r in range(m):
            missing2 += bounds.missing[r] * bounds.missing[r]
            size2 += bounds.magnitude[r] * bounds.magnitude[r]
        if missing2 <= ROUNDING * ROUNDING * size2:
            return share
        along = dot(bounds.missing, bounds.direction, m)
        share = share - missing2 / along if along > 0.0 else -1.0
        if share < -ROUNDING:
            break
        share = max(0.0, share)
    for j in range(n):
        tick.qdot_cmd[j] = bounds.wish[j]
    return -1.0
