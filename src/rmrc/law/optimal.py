"""The best rates within bounds: a small convex program, by an active set that starts from the last tick's.

    minimize ‖task − A y‖² + λ² ‖y − S_q⁻¹ drift‖²,   lower ≤ S_q y ≤ upper

Where λ is 0, or so small that it has no effect, the second part decides among equal minima of the first.
"""

import math

from rmrc.law.inverses import damped_gain
from rmrc.law.jit import Array, Record, apart, compiled
from rmrc.law.metric import backward, factor, forward
from rmrc.law.redistribution import ROUNDING
from rmrc.law.rest import decompose_rest_from_scratch
from rmrc.law.stops import first_blocked, is_beyond
from rmrc.law.svd import RANK_FLOOR, combine, dot, project
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
# A Cholesky factor serves if its squared pivots, and λ² if positive, are above this share of the largest
# entry: a step of refinement then leaves rounding.
WELL = 1e-8


@apart("call_best", limits_on_excess=(OPTIMAL, LIMITS.code("sns")))
def best_within(world: Record, tick: Record, task: Array, share: float, damped: float) -> None:
    """Replace the rates by the best within `world.lower` and `world.upper`; joints at a bound are `held`.

    From rates within the bounds the method goes towards the optimum of the free joints alone, until a joint
    meets its bound and is held. Where none does, the held joint that the slope draws inwards most is released
    [Stark95]. The first set of held joints is that of the last tick. Each step is within the bounds and none
    makes the result worse. A program that reached the step limit would still leave rates within bounds.

    Args:
        world: Bounds, A, scales, drift, and the set of the last tick.
        tick: qdot_cmd: the initial rates of the free joints, and the result.
        task: Scaled rows, (m,).
        share: Share of the task to do.
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
    """Hold the joints that the last tick held or that are beyond a bound; others stay near their rates."""
    n, goes_on = world.n, False
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
    """Write into part_b the best rates of the free joints without bounds, and find the slopes there.

    With r, the task without the contribution of the held joints, and A of the free joints, the slope of the
    sum at a held joint j is −2 (a_jᵀ (missing + λ² pull) − λ² y_j), with y from the drift on. `missing` is
    the part that no free joint can do, and `pull` the factor of λ². Both keep their accuracy however small λ
    is.
    """
    n, m = world.n, world.m
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
    if not resolve_by_factor(world, damped):
        resolve_by_decomposition(world, largest, damped)
    for j in range(n):
        if world.held[j] == 0.0:
            world.part_b[j] = world.drift[j] + world.joint_scale[j] * world.part_b[j]


@compiled
def resolve_by_factor(world: Record, damped: float) -> bool:
    """Solve for the free joints by a Cholesky factor, a tenth of the work; return whether it serves.

    The factor is that of the smaller of A Aᵀ + λ² and AᵀA + λ², with A of the free joints.
    """
    n, m, root, free = world.n, world.m, world.root_B, 0
    for j in range(n):
        free += world.held[j] == 0.0
    is_wide = free >= m
    size = m if is_wide else n
    largest = gram(world, size, is_wide, damped)
    if 0.0 < damped * damped < WELL * largest:
        return False
    for i in range(0 if is_wide else n):
        if world.held[i] != 0.0:
            root[i, i] = largest if largest > 0.0 else 1.0
    factor(root, size)
    for i in range(size):
        if not root[i, i] * root[i, i] > WELL * largest:
            return False
    if is_wide:
        solve_wide(world, damped)
    else:
        solve_tall(world, damped)
    return True


@compiled
def gram(world: Record, size: int, is_wide: bool, damped: float) -> float:
    """Write the lower half of A Aᵀ + λ² or AᵀA + λ² into `root_B`; return the largest entry."""
    largest = 0.0
    for i in range(size):
        for c in range(i + 1):
            total = dot(world.B[i], world.B[c], world.n) if is_wide else 0.0
            for r in range(0 if is_wide else world.m):
                total += world.B[r, i] * world.B[r, c]
            world.root_B[i, c] = total
        world.root_B[i, i] += damped * damped
        largest = max(largest, world.root_B[i, i])
    return largest


@compiled
def solve_wide(world: Record, damped: float) -> None:
    """Write y = Aᵀ w, (A Aᵀ + λ²) w = r, for at least as many free joints as rows: nothing is missing.

    Where w is large and y is not, y is summed from the steps of w: a new product Aᵀ w would round.
    """
    n, m, w, y, rest = world.n, world.m, world.pull, world.part_b, world.missing
    for j in range(n):
        y[j] = 0.0
    for r in range(m):
        w[r], rest[r] = 0.0, world.task_B[r]
    for _ in range(2):
        forward(world.root_B, rest, m)
        backward(world.root_B, rest, m)
        for r in range(m):
            w[r] += rest[r]
            for j in range(n):
                y[j] += world.B[r, j] * rest[r]
        for r in range(m):
            rest[r] = world.task_B[r] - dot(world.B[r], y, n) - damped * damped * w[r]
    for r in range(m):
        rest[r] = 0.0


@compiled
def solve_tall(world: Record, damped: float) -> None:
    """Write y, (AᵀA + λ²) y = Aᵀ r, for fewer free joints than rows, and the missing part of r."""
    n, m, y, rest = world.n, world.m, world.part_b, world.shape
    for j in range(n):
        y[j] = 0.0
    for _ in range(2):
        for r in range(m):
            world.missing[r] = world.task_B[r] - dot(world.B[r], y, n)
        for j in range(n):
            rest[j] = -damped * damped * y[j]
            for r in range(m):
                rest[j] += world.B[r, j] * world.missing[r]
        forward(world.root_B, rest, n)
        backward(world.root_B, rest, n)
        for j in range(n):
            y[j] += rest[j]
    for j in range(n):
        rest[j] = y[j]
    forward(world.root_B, rest, n)
    backward(world.root_B, rest, n)
    for r in range(m):
        world.missing[r] = world.task_B[r] - dot(world.B[r], y, n)
        # with damping `missing` holds all of it
        world.pull[r] = 0.0 if damped > 0.0 else dot(world.B[r], rest, n)


@compiled
def resolve_by_decomposition(world: Record, largest: float, damped: float) -> None:
    """Solve for the free joints by their singular vectors, also where these lose the rank of the task.

    With r = Σ_i asked_i u_i + missing, w = Σ_i asked_i/(σ_i² + λ²) u_i is `pull`.
    """
    n, m, k = world.n, world.m, world.k
    decompose_rest_from_scratch(world, m, n)
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


@compiled
def most_inwards(world: Record, damped: float) -> int:
    """Return the held joint that the slope draws inwards most, or -1.

    Where `missing` is not zero, its slope is by far the steeper. With λ > 0 it is divided by λ² and added to
    the other part; with λ = 0 it alone decides, and the other part comes after it.
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
        inwards, slack = -side * (missing if decides else pull), ROUNDING * (size if decides else of_pull)
        if damped > 0.0:
            inwards -= side * missing / (damped * damped)
            slack += LEFT * size / (damped * damped) if missing != 0.0 else 0.0
        if inwards <= slack or (by_missing and not decides):
            continue
        if inwards > most or (decides and not by_missing):
            chosen, most, by_missing = j, inwards, decides
    return chosen


@compiled
def largest_share(world: Record, tick: Record) -> float:
    """Replace the rates by the smallest that do the largest share of the same task, within the bounds.

    Return that share, in [0, 1]. Return -1, with the rates unchanged, if the bounds allow none of the task,
    as acceleration bounds may. The missing part of too large a share is the normal of a face of the set of
    feasible task rates, and the share on that face is the next one. It is never too small, and the largest
    after a few faces.
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
        if share < -ROUNDING:
            break
        share = max(0.0, share)
    for j in range(n):
        tick.qdot_cmd[j] = world.wish[j]
    return -1.0
