"""Rates within bounds by active sets: some joints are held at their bounds, and the others do the rest.

All methods share one step: the free joints do what the held ones and the null space leave of the task,

    y_F = drift_F + A_F^g (task − A y_given),   given: held joints at their bounds, free ones at the drift.

They differ in the inverse g, the law's own or that of the best rates, and in which joint is held or released.
"""

import math

from rmrc.law.compiling import Array, Method, Record, call, compiled
from rmrc.law.inverses import SCHEDULED, damped_gain, push_fading
from rmrc.law.metric import INERTIA, take_along, weigh_faded, weigh_free
from rmrc.law.svd import RANK_FLOOR, ROUNDING, clear, combine, copy, decompose_afresh, dot, project
from rmrc.scenario.choices import SCHEDULES

FOLLOWS_ARM = SCHEDULES.codes(lambda one: one.follows == "arm")
FOLLOWS_COMMAND = SCHEDULES.codes(lambda one: one.follows == "command")

# How often a joint may be released with the law's own inverse. Once left 2 of 3,000 random tasks of six
# joints away from their optimum; twice left none of 30,000.
LET_GO = 2
# The step limit, for each joint and one more. No program needs as many: of 8,228 random ones of up to eight
# joints, half took one step, and none more than 12.
STEPS_EACH, STEPS_MORE = 2 * LET_GO + 1, 8
# A few faces of the set of feasible task rates bound a share of the task: none of 800 random tasks met more
# than four.
FACES = 20
# The rest of a task is rounding below this share of its terms; ROUNDING where its size alone decides.
LEFT = 1e-14
# Without damping, the norm of the rates has this weight beside the task, relative to σ_1: it only decides
# among equals.
UNDAMPED = 1e-10
# The free joints can no longer do the task when the smallest singular value of the remaining A is below this
# share of the largest of the whole A.
LOST = 1e-6


# One step ---------------------------------------------------------------------------------------


@compiled
def is_beyond(rate: float, lower: float, upper: float) -> bool:
    """Return whether a rate is out of its bounds by more than rounding."""
    slack = ROUNDING * abs(rate)
    return rate > upper + slack or rate < lower - slack


@compiled
def begin_within(world: Record) -> None:
    """Begin at the nearest rates within the bounds, with joints held that are beyond.

    `held` is the side of a joint at its bound, 1 or -1, and `fade` the share of its rate that is left.
    """
    bounds, rates = world.bounds, world.tick.qdot_cmd
    for j in range(world.n):
        lower, upper = bounds.lower[j], bounds.upper[j]
        bounds.best[j] = min(max(rates[j], lower), upper)
        bounds.held[j], bounds.fade[j], bounds.releases[j] = 0.0, 1.0, 0
        if is_beyond(rates[j], lower, upper):
            bounds.held[j] = 1.0 if rates[j] > upper else -1.0
            bounds.fade[j] = min(1.0, abs(bounds.best[j] / rates[j]))


@compiled
def leave_held(world: Record) -> None:
    """Decompose A of the free joints, and project the rest of the task on its directions."""
    rest, scratch, bounds = world.rest, world.scratch, world.bounds
    for r in range(world.m):
        left = bounds.task[r]
        size = abs(left)
        for j in range(world.n):
            is_free = bounds.held[j] == 0.0
            moved = scratch.A[r, j] * (bounds.drift[j] if is_free else bounds.best[j])
            moved /= world.task.joint_scale[j]
            left -= moved
            size += abs(moved)
            rest.matrix[r, j] = scratch.A[r, j] if is_free else 0.0
        rest.task[r], bounds.magnitude[r] = left, size
    weigh_free(world)
    decompose_afresh(world, world.m)
    project(rest.u, rest.task, world.k, world.m, rest.asked)


@compiled
def move_free(world: Record, rates: Array, part: float) -> None:
    """Write the rates of the gains and the demand on the directions, and a part of the given rates."""
    rest, bounds = world.rest, world.bounds
    combine(rest.gain, rest.asked, rest.v, world.k, world.n, rates)
    take_along(world, rates, part)
    for j in range(world.n):
        if bounds.held[j] != 0.0:
            rates[j] = part * bounds.best[j]
        else:
            rates[j] = part * bounds.drift[j] + world.task.joint_scale[j] * rates[j]


@compiled
def resolve_free(world: Record) -> None:
    """Write into part_b the rates of the free joints by the law's own inverse.

    λ is that of the tick, or more where the remaining columns of a redundant arm are nearer to a singularity,
    or the rest of the task asks for more. For the columns each joint counts by the share of its wish that its
    bound allows, so that λ does not jump where a joint begins to be held.
    """
    methods, law, bounds, rest = world.methods, world.law, world.bounds, world.rest
    free, schedule = 0, law.inverse_damping_schedule if law.inverse_method in SCHEDULED else -1
    for j in range(world.n):
        free += bounds.held[j] == 0.0
    if schedule in FOLLOWS_ARM and world.m <= free < world.n:
        for r in range(world.m):
            for j in range(world.n):
                rest.matrix[r, j] = world.scratch.A[r, j] * bounds.fade[j]
        weigh_faded(world)
        decompose_afresh(world, world.m)
        call(methods.damping, world, rest)
        bounds.damping = max(bounds.damping, rest.damping)
    leave_held(world)
    push_fading(world, rest.u, rest.task, rest.sigma, rest.asked)
    if schedule in FOLLOWS_COMMAND:
        call(methods.damping, world, rest)
        bounds.damping = max(bounds.damping, rest.damping)
    rest.damping = bounds.damping
    call(methods.gains, world, rest)
    move_free(world, world.scratch.part_b, 1.0)


@compiled
def resolve_best(world: Record) -> None:
    """Write into part_b the best rates of the free joints, and find the slopes there.

    With r = Σ_i asked_i u_i + missing, the rest of the task, the slope of the sum of squares at a held joint
    j is −2 (a_jᵀ (missing + λ² pull) − λ² y_j), with y from the drift on: `missing` is the part that no free
    joint can do, and `pull` = Σ_i asked_i/(σ_i² + λ²) u_i. Both keep their accuracy however small λ is.
    """
    bounds, rest, m = world.bounds, world.rest, world.m
    leave_held(world)
    for r in range(m):
        bounds.missing[r], bounds.pull[r] = rest.task[r] if m > world.n else 0.0, 0.0
    for i in range(world.k):
        sigma, floor = rest.sigma[i], RANK_FLOOR * world.first.sigma[0]
        rest.gain[i] = damped_gain(sigma, floor, bounds.damping)
        of_pull, of_missing = 0.0, 0.0 if m > world.n else rest.asked[i]
        if sigma > floor:
            of_pull = rest.asked[i] / (sigma * sigma + bounds.damping * bounds.damping)
            of_missing -= rest.asked[i]
        for r in range(m):
            bounds.pull[r] += of_pull * rest.u[i, r]
            bounds.missing[r] += of_missing * rest.u[i, r]
    move_free(world, world.scratch.part_b, 1.0)


# The nearest rates ------------------------------------------------------------------------------


@compiled
def settle(world: Record, share: float) -> None:
    """Bring the rates within their bounds for a share of the task, by the law's own inverse."""
    bounds, first = world.bounds, world.first
    bounds.damping = first.damping if world.law.inverse_method in SCHEDULED else 0.0
    for r in range(world.m):
        bounds.task[r] = share * first.task[r]
    if world.methods.give_way != 0:
        call(world.methods.give_way, world)
        copy(bounds.best, world.tick.qdot_cmd, world.n)


@compiled
def best_within(world: Record, task: Array, damping: float) -> None:
    """Replace the rates by the best for a task, (m,), and a λ, within the bounds `lower` and `upper`."""
    bounds = world.bounds
    bounds.goes_on, bounds.damping = False, damping
    copy(task, bounds.task, world.m)
    call(world.methods.find_best, world)
    copy(bounds.best, world.tick.qdot_cmd, world.n)


@Method
def give_way(world: Record) -> None:
    """Write into `best` rates within the bounds that are near to the task, by the law's own inverse.

    Joints at a bound hold it, and the others make up for them. With the damped inverse the rates minimize

        ‖task − A y‖² + λ² ‖y − S_q⁻¹ drift‖²,   lower ≤ S_q y ≤ upper,   y = S_q⁻¹ qdot,

    by an active set: from rates within the bounds the method goes towards the optimum of the free joints
    alone, until a joint meets its bound and is held. Where none does, the held joint that the slope draws
    inwards most is released [Stark95]. Every step is within the bounds. The other inverses go the same way
    with their own gains.
    """
    begin_within(world)
    for _ in range(STEPS_EACH * world.n + STEPS_MORE):
        resolve_free(world)
        if not advance(world) and not release(world):
            break


@Method
def find_best(world: Record) -> None:
    """Write the rates into `best` that minimize the same; of equal ones those nearest to the drift.

    The joints that the last search has held are held at first if this one goes on from there.
    """
    if not world.bounds.goes_on:
        begin_within(world)
    for _ in range(STEPS_EACH * world.n + STEPS_MORE):
        resolve_best(world)
        if not advance(world) and not release_best(world):
            break


@compiled
def advance(world: Record) -> bool:
    """Go from `best` to part_b, or until a free joint meets its bound and is held; return whether one does.

    Of several that meet it at once, the one is held that would go farthest.
    """
    bounds, part_b = world.bounds, world.scratch.part_b
    blocked, step, farthest = -1, 1.0, 0.0
    for j in range(world.n):
        rate, now, lower, upper = part_b[j], bounds.best[j], bounds.lower[j], bounds.upper[j]
        if bounds.held[j] != 0.0 or not is_beyond(rate, lower, upper):
            continue
        bound = upper if rate > upper else lower
        part = min(1.0, max(0.0, (bound - now) / (rate - now)))
        beyond = abs(rate - bound) / world.task.joint_scale[j]
        if part < step or blocked < 0 or (part == step and beyond > farthest):
            blocked, step, farthest = j, part, beyond
    for j in range(world.n):
        rate = bounds.best[j] + step * (part_b[j] - bounds.best[j])
        bounds.best[j] = min(max(rate, bounds.lower[j]), bounds.upper[j])
    if blocked >= 0:
        above = part_b[blocked] > bounds.upper[blocked]
        bounds.held[blocked] = 1.0 if above else -1.0
        bounds.best[blocked] = bounds.upper[blocked] if above else bounds.lower[blocked]
        bounds.fade[blocked] = min(1.0, abs(bounds.best[blocked] / part_b[blocked]))
    return blocked >= 0


@compiled
def release(world: Record) -> bool:
    """Release the held joint that the residual of the law's own inverse draws inwards most, if any."""
    rest, task, scratch, bounds = world.rest, world.task, world.scratch, world.bounds
    n, chosen, most, square = world.n, -1, 0.0, bounds.damping * bounds.damping
    for j in range(n):
        scratch.shape[j] = (bounds.best[j] - bounds.drift[j]) / task.joint_scale[j]
    for r in range(world.m):
        rest.task[r] = bounds.task[r]
        for j in range(n):
            rest.task[r] -= scratch.A[r, j] * bounds.best[j] / task.joint_scale[j]
    for j in range(n):
        if bounds.held[j] == 0.0 or bounds.releases[j] >= LET_GO:
            continue
        pull, size, moved = 0.0, 0.0, scratch.shape[j]
        for r in range(world.m):
            pull += scratch.A[r, j] * rest.task[r]
            size += abs(scratch.A[r, j] * bounds.task[r])
        if world.law.inverse_metric == INERTIA:
            moved = dot(world.links.metric[j], scratch.shape, n)
        inwards = -(pull - square * moved) * bounds.held[j]
        if inwards > most and inwards > ROUNDING * size:
            chosen, most = j, inwards
    if chosen >= 0:
        bounds.held[chosen], bounds.fade[chosen] = 0.0, 1.0
        bounds.releases[chosen] += 1
    return chosen >= 0


@compiled
def release_best(world: Record) -> bool:
    """Release the held joint that the slope of `resolve_best` draws inwards most, if any.

    Where `missing` is not zero, its slope is by far the steeper.
    """
    bounds, A, noise = world.bounds, world.scratch.A, LEFT if world.bounds.damping > 0.0 else ROUNDING
    chosen, most, damping = -1, 0.0, max(bounds.damping, UNDAMPED * world.first.sigma[0])
    for j in range(world.n):
        missing, size, pull, of_pull = 0.0, 0.0, 0.0, 0.0
        for r in range(world.m):
            missing += A[r, j] * bounds.missing[r]
            size += abs(A[r, j]) * bounds.magnitude[r]
            pull += A[r, j] * bounds.pull[r]
            of_pull += abs(A[r, j] * bounds.pull[r])
        moved = (bounds.best[j] - bounds.drift[j]) / world.task.joint_scale[j]
        inwards, slack = pull - moved, ROUNDING * (of_pull + abs(moved))
        if abs(missing) > noise * size:
            inwards += missing / (damping * damping)
            slack += noise * size / (damping * damping)
        inwards *= -bounds.held[j]
        if inwards > max(most, slack) and bounds.lower[j] < bounds.upper[j]:
            chosen, most = j, inwards
    if chosen >= 0:
        bounds.held[chosen] = 0.0
    return chosen >= 0


# The largest share ------------------------------------------------------------------------------


@compiled
def largest_share(world: Record) -> float:
    """Replace the rates by the smallest that do the largest share of the same task, within the bounds.

    Return that share, in [0, 1]. Return -1, with the rates unchanged, if the bounds allow none of the task,
    as acceleration bounds may. The missing part of too large a share is the normal of a face of the set of
    feasible task rates, and the share on that face is the next one. It is never too small, and the largest
    after a few faces.
    """
    bounds, m, share = world.bounds, world.m, 1.0
    for r in range(m):
        bounds.direction[r] = 0.0
        for j in range(world.n):
            moved = world.scratch.A[r, j] * world.tick.qdot_cmd[j] / world.task.joint_scale[j]
            bounds.direction[r] += moved
    bounds.goes_on, bounds.damping = False, 0.0
    for _ in range(FACES):
        for r in range(m):
            bounds.task[r] = share * bounds.direction[r]
        call(world.methods.find_best, world)
        missing2, size2 = dot(bounds.missing, bounds.missing, m), dot(bounds.magnitude, bounds.magnitude, m)
        if missing2 <= ROUNDING * ROUNDING * size2:
            copy(bounds.best, world.tick.qdot_cmd, world.n)
            return share
        along = dot(bounds.missing, bounds.direction, m)
        share = share - missing2 / along if along > 0.0 else -1.0
        if share < -ROUNDING:
            break
        share, bounds.goes_on = max(0.0, share), True
    return -1.0


@compiled
def saturate(world: Record) -> float:
    """Hold joints at their bounds, the most critical first, and let the others do as much as they can.

    With all joints free the rates are the given ones. Where not all of the task fits, the largest share that
    fits decides. Return that share; or -1, with the rates unchanged, if no share fits [Flacco15].
    """
    scratch, bounds, rates = world.scratch, world.bounds, world.tick.qdot_cmd
    n, best = world.n, -1.0
    clear(bounds.held, n)
    clear(bounds.task, world.m)
    for _ in range(max(0, n - world.m) + 1):  # until fewer joints are free than the task has rows
        if not share_rates(world):
            break
        share, critical = task_share(world)
        if share > best:
            best = share
            for j in range(n):
                rates[j] = share * scratch.part_a[j] + scratch.part_b[j]
        if share >= 1.0 or critical < 0:
            break
        above = scratch.part_a[critical] + scratch.part_b[critical] > bounds.upper[critical]
        bounds.held[critical] = 1.0 if above else -1.0
        bounds.best[critical] = bounds.upper[critical] if above else bounds.lower[critical]
    for j in range(n):
        if best < 0.0 or rates[j] != bounds.best[j]:
            bounds.held[j] = 0.0
    return float(best)


@compiled
def share_rates(world: Record) -> bool:
    """Write qdot(s) = s · part_a + part_b of a share s; return whether the free joints still span the task.

    part_a = S_q A_F^g t,   part_b = q̇_N − S_q A_F^g A S_q⁻¹ q̇_N
    """
    scratch, first, rest = world.scratch, world.first, world.rest
    leave_held(world)
    if rest.sigma[world.k - 1] <= LOST * first.sigma[0]:
        return False
    project(rest.u, first.task, world.k, world.m, rest.asked)
    push_fading(world, rest.u, first.task, rest.sigma, rest.asked)
    rest.damping = first.damping
    call(world.methods.gains, world, rest)
    move_free(world, scratch.part_a, 0.0)
    project(rest.u, rest.task, world.k, world.m, rest.asked)
    move_free(world, scratch.part_b, 1.0)
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
        if bounds.held[j] != 0.0:
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
