"""A joint at its stop holds, and the others do as much of the task as they can."""

from rmrc.law.compiling import Array, Method, Record, call, compiled
from rmrc.law.inverses import SCHEDULED, push_fading
from rmrc.law.metric import INERTIA, take_along, weigh_faded, weigh_free
from rmrc.law.svd import ROUNDING, combine, decompose_afresh, dot, project
from rmrc.scenario.choices import SCHEDULES

# How often a joint may be released. Once left 2 of 3,000 random tasks of six joints away from their optimum;
# twice left none of 30,000.
LET_GO = 2

FOLLOWS_ARM = SCHEDULES.codes(lambda one: one.follows == "arm")
FOLLOWS_COMMAND = SCHEDULES.codes(lambda one: one.follows == "command")


@compiled
def leave_to_others(world: Record, share: float, lower: Array, upper: Array) -> None:
    """Call `give_way` for a share of the task and bounds of each joint, (n,), if the world may need it."""
    methods, bounds = world.methods, world.bounds
    bounds.share = share
    for j in range(world.n):
        bounds.floor[j], bounds.ceiling[j] = lower[j], upper[j]
    if methods.give_way != 0:
        call(methods.give_way, world)


@Method
def give_way(world: Record) -> None:
    """Bring the rates within their bounds; joints at a bound hold it, and the others make up for them.

    With the damped inverse the result is the rates within the bounds that minimize

        ‖share · S_x twist_cmd − A y‖² + λ² ‖y − S_q⁻¹ drift‖²,   y = S_q⁻¹ qdot,

    by an active set: from rates within the bounds the method goes towards the optimum of the free joints
    alone, until a joint meets its bound and is held. Where none does, the held joint that the residual draws
    inwards most is released. Every step is within the bounds. The other inverses go the same way with their
    own gains. No joint is released more than LET_GO times, so the method ends.
    """
    scratch, bounds, tick = world.scratch, world.bounds, world.tick
    share, lower, upper = bounds.share, bounds.floor, bounds.ceiling
    n, damping = world.n, world.first.damping if world.law.inverse_method in SCHEDULED else 0.0
    for j in range(n):
        rate = tick.qdot_cmd[j]
        bounds.best[j] = min(max(rate, lower[j]), upper[j])
        bounds.held[j], bounds.fade[j], scratch.part_a[j] = 0.0, 1.0, 0.0
        if is_beyond(rate, lower[j], upper[j]):
            bounds.held[j] = 1.0 if rate > 0.0 else -1.0
            bounds.fade[j] = abs(bounds.best[j] / rate)
    for _ in range((2 * LET_GO + 1) * n + 1):
        damping = resolve_free(world, share, damping)
        blocked, step = first_blocked(world, lower, upper)
        for j in range(n):
            if bounds.held[j] == 0.0:
                bounds.best[j] += step * (scratch.part_b[j] - bounds.best[j])
        if blocked >= 0:
            above = scratch.part_b[blocked] > bounds.best[blocked]
            bounds.best[blocked] = upper[blocked] if above else lower[blocked]
            bounds.fade[blocked] = min(1.0, abs(bounds.best[blocked] / scratch.part_b[blocked]))
            bounds.held[blocked] = 1.0 if above else -1.0
            continue
        freed = drawn_inwards(world, share, damping)
        if freed < 0:
            break
        bounds.held[freed], bounds.fade[freed] = 0.0, 1.0
        scratch.part_a[freed] += 1.0
    for j in range(n):
        tick.qdot_cmd[j] = bounds.best[j]


@compiled
def given_back(world: Record, rates: Array, share: float, lower: Array, upper: Array) -> float:
    """Return the share of the task to do where rates for a given share take joints beyond their stops.

    The given share keeps a direction that is lost at a stop, and a joint that hardly moves may have caused
    it. The result is 1 where the joint that would move fastest stands still, and the given share where a
    joint begins to be held, so that the rates do not jump there.

    Args:
        world: Limits and scales.
        rates: Rates for that share of the task, (n,).
        share: Share of the task that fits the rate limits.
        lower: Smallest rate of each joint, (n,).
        upper: Largest rate of each joint, (n,).
    """
    task = world.task
    fastest, most = 0.0, 0.0
    for j in range(world.n):
        fastest = max(fastest, abs(rates[j]) / task.joint_scale[j])
    for j in range(world.n):
        beyond = max(rates[j] - upper[j], lower[j] - rates[j])
        if beyond > 0.0:
            most = max(most, beyond / min(world.limits.rate[j], task.joint_scale[j] * fastest))
    return float(share + (1.0 - share) * min(1.0, most))


@compiled
def is_beyond(rate: float, lower: float, upper: float) -> bool:
    """Return whether a rate is out of its bounds by more than rounding."""
    slack = ROUNDING * abs(rate)
    return rate > upper + slack or rate < lower - slack


@compiled
def resolve_free(world: Record, share: float, damping: float) -> float:
    """Write into part_b the rates of the free joints, given those of the held ones.

    Return λ: that of the tick, or more where the remaining columns of a redundant arm are nearer to a
    singularity, or the rest of the task asks for more. For the columns each joint counts by the share of its
    wish that its bound allows, so that λ does not jump where a joint begins to be held.
    """
    methods, task, law = world.methods, world.task, world.law
    scratch, bounds, rest = world.scratch, world.bounds, world.rest
    n, m, k, free = world.n, world.m, world.k, 0
    for j in range(n):
        free += bounds.held[j] == 0.0
    is_scheduled, schedule = law.inverse_method in SCHEDULED, law.inverse_damping_schedule
    if is_scheduled and schedule in FOLLOWS_ARM and m <= free < n:
        for r in range(m):
            for j in range(n):
                rest.matrix[r, j] = scratch.A[r, j] * bounds.fade[j]
        weigh_faded(world)
        decompose_afresh(world, m)
        call(methods.damping, world, rest)
        damping = max(damping, rest.damping)
    for r in range(m):
        left = share * world.first.task[r]
        for j in range(n):
            is_free = bounds.held[j] == 0.0
            given = bounds.drift[j] if is_free else bounds.best[j]
            left -= scratch.A[r, j] * given / task.joint_scale[j]
            rest.matrix[r, j] = scratch.A[r, j] if is_free else 0.0
        rest.task[r] = left
    weigh_free(world, bounds.best, -1.0)
    decompose_afresh(world, m)
    project(rest.u, rest.task, k, m, rest.asked)
    push_fading(world, rest.u, rest.task, rest.sigma, rest.asked)
    if is_scheduled and schedule in FOLLOWS_COMMAND:
        call(methods.damping, world, rest)
        damping = max(damping, rest.damping)
    rest.damping = damping
    call(methods.gains, world, rest)
    combine(rest.gain, rest.asked, rest.v, k, n, scratch.part_b)
    take_along(world, scratch.part_b, 1.0)
    for j in range(n):
        if bounds.held[j] == 0.0:
            scratch.part_b[j] = bounds.drift[j] + task.joint_scale[j] * scratch.part_b[j]
    return damping


@compiled
def first_blocked(world: Record, lower: Array, upper: Array) -> tuple[int, float]:
    """Return the free joint that first meets its bound on the way from `best` to `part_b`, and at which part.

    The result is -1 and 1 if none does; of several, the one that would go farthest.
    """
    bounds = world.bounds
    blocked, step, farthest = -1, 1.0, 0.0
    for j in range(world.n):
        rate, now = world.scratch.part_b[j], bounds.best[j]
        if bounds.held[j] != 0.0 or not is_beyond(rate, lower[j], upper[j]):
            continue
        bound = upper[j] if rate > upper[j] else lower[j]
        part = min(1.0, max(0.0, (bound - now) / (rate - now)))
        beyond = abs(rate - bound) / world.task.joint_scale[j]
        if part < step or blocked < 0 or (part == step and beyond > farthest):
            blocked, step, farthest = j, part, beyond
    return blocked, step


@compiled
def drawn_inwards(world: Record, share: float, damping: float) -> int:
    """Return the held joint that the residual draws inwards most, or -1; part_a counts releases."""
    first, rest, task, scratch, bounds = world.first, world.rest, world.task, world.scratch, world.bounds
    n, m, chosen, most = world.n, world.m, -1, 0.0
    for r in range(m):
        left = share * first.task[r]
        for j in range(n):
            left -= scratch.A[r, j] * bounds.best[j] / task.joint_scale[j]
        rest.task[r] = left
    is_weighed = world.law.inverse_metric == INERTIA
    for j in range(n if is_weighed else 0):
        scratch.shape[j] = (bounds.best[j] - bounds.drift[j]) / task.joint_scale[j]
    for j in range(n):
        if bounds.held[j] == 0.0 or scratch.part_a[j] >= LET_GO:
            continue
        pull, size = 0.0, 0.0
        for r in range(m):
            pull += scratch.A[r, j] * rest.task[r]
            size += abs(scratch.A[r, j] * share * first.task[r])
        if is_weighed:
            pull -= damping * damping * dot(world.links.metric[j], scratch.shape, n)
        else:
            pull -= damping * damping * (bounds.best[j] - bounds.drift[j]) / task.joint_scale[j]
        inwards = -pull * bounds.held[j]
        if inwards > most and inwards > ROUNDING * size:
            chosen, most = j, inwards
    return chosen
