"""A joint at its stop holds, and the others do as much of the task as they can."""

from rmrc.law.inverses import SCHEDULED, damping, gains, push_fading
from rmrc.law.jit import Array, Record, apart, compiled
from rmrc.law.metric import INERTIA, take_along, weigh_faded, weigh_free
from rmrc.law.redistribution import ROUNDING
from rmrc.law.rest import MAKE_UP, decompose_rest_from_scratch
from rmrc.law.svd import combine, dot, project
from rmrc.scenario.choices import SCHEDULES

# How often a joint may be released. Once left 2 of 3,000 random tasks of six joints away from their optimum;
# twice left none of 30,000.
LET_GO = 2

FOLLOWS_ARM = SCHEDULES.codes(lambda one: one.follows == "arm")
FOLLOWS_COMMAND = SCHEDULES.codes(lambda one: one.follows == "command")


@apart("call_way", is_late=True, limits_on_excess=MAKE_UP)
def give_way(world: Record, tick: Record, share: float, lower: Array, upper: Array) -> None:
    """Bring the rates within their bounds; joints at a bound hold it, and the others make up for them.

    With the damped inverse the result is the rates within the bounds that minimize

        ‖share · S_x twist_cmd − A y‖² + λ² ‖y − S_q⁻¹ drift‖²,   y = S_q⁻¹ qdot,

    by an active set: from rates within the bounds the method goes towards the optimum of the free joints
    alone, until a joint meets its bound and is held. Where none does, the held joint that the residual draws
    inwards most is released. Every step is within the bounds. The other inverses go the same way with their
    own gains. No joint is released more than LET_GO times, so the method ends.

    Args:
        world: Task, A; drift is the wanted motion in the null space, projected.
        tick: qdot_cmd is replaced.
        share: Share of the task.
        lower: Smallest rate of each joint, (n,).
        upper: Largest rate of each joint, (n,).
    """
    n, damped = world.n, tick.damping if world.inverse_method in SCHEDULED else 0.0
    for j in range(n):
        rate = tick.qdot_cmd[j]
        world.best[j] = min(max(rate, lower[j]), upper[j])
        world.held[j], world.fade[j], world.part_a[j] = 0.0, 1.0, 0.0
        if is_beyond(rate, lower[j], upper[j]):
            world.held[j] = 1.0 if rate > 0.0 else -1.0
            world.fade[j] = abs(world.best[j] / rate)
    for _ in range((2 * LET_GO + 1) * n + 1):
        damped = resolve_free(world, share, damped)
        blocked, step = first_blocked(world, lower, upper)
        for j in range(n):
            if world.held[j] == 0.0:
                world.best[j] += step * (world.part_b[j] - world.best[j])
        if blocked >= 0:
            above = world.part_b[blocked] > world.best[blocked]
            world.best[blocked] = upper[blocked] if above else lower[blocked]
            world.fade[blocked] = min(1.0, abs(world.best[blocked] / world.part_b[blocked]))
            world.held[blocked] = 1.0 if above else -1.0
            continue
        freed = drawn_inwards(world, share, damped)
        if freed < 0:
            break
        world.held[freed], world.fade[freed] = 0.0, 1.0
        world.part_a[freed] += 1.0
    for j in range(n):
        tick.qdot_cmd[j] = world.best[j]


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
    fastest, most = 0.0, 0.0
    for j in range(world.n):
        fastest = max(fastest, abs(rates[j]) / world.joint_scale[j])
    for j in range(world.n):
        beyond = max(rates[j] - upper[j], lower[j] - rates[j])
        if beyond > 0.0:
            most = max(most, beyond / min(world.rate_limit[j], world.joint_scale[j] * fastest))
    return float(share + (1.0 - share) * min(1.0, most))


@compiled
def is_beyond(rate: float, lower: float, upper: float) -> bool:
    """Return whether a rate is out of its bounds by more than rounding."""
    slack = ROUNDING * abs(rate)
    return rate > upper + slack or rate < lower - slack


@compiled
def resolve_free(world: Record, share: float, damped: float) -> float:
    """Write into part_b the rates of the free joints, given those of the held ones.

    Return λ: that of the tick, or more where the remaining columns of a redundant arm are nearer to a
    singularity. There each joint counts by the share of its wish that its bound allows, so that λ does not
    jump where a joint begins to be held.
    """
    n, m, k, free = world.n, world.m, world.k, 0
    for j in range(n):
        free += world.held[j] == 0.0
    is_scheduled, schedule = world.inverse_method in SCHEDULED, world.inverse_damping_schedule
    if is_scheduled and schedule in FOLLOWS_ARM and m <= free < n:
        for r in range(m):
            for j in range(n):
                world.B[r, j] = world.A[r, j] * world.fade[j]
        weigh_faded(world)
        decompose_rest_from_scratch(world, m, n)
        damped = max(damped, damping(world, world.asked_B, world.sigma_B))
    for r in range(m):
        left = share * world.task[r]
        for j in range(n):
            is_free = world.held[j] == 0.0
            given = world.drift[j] if is_free else world.best[j]
            left -= world.A[r, j] * given / world.joint_scale[j]
            world.B[r, j] = world.A[r, j] if is_free else 0.0
        world.task_B[r] = left
    weigh_free(world, world.best, -1.0)
    decompose_rest_from_scratch(world, m, n)
    project(world.u_B, world.task_B, k, m, world.asked_B)
    push_fading(world, world.u_B, world.task_B, world.sigma_B, world.asked_B)
    if is_scheduled and schedule in FOLLOWS_COMMAND:
        damped = max(damped, damping(world, world.asked_B, world.sigma_B))
    gains(world, world.asked_B, world.sigma_B, world.v_B, damped, world.gain_B)
    combine(world.gain_B, world.asked_B, world.v_B, k, n, world.part_b)
    take_along(world, world.part_b, 1.0)
    for j in range(n):
        if world.held[j] == 0.0:
            world.part_b[j] = world.drift[j] + world.joint_scale[j] * world.part_b[j]
    return damped


@compiled
def first_blocked(world: Record, lower: Array, upper: Array) -> tuple[int, float]:
    """Return the free joint that first meets its bound on the way from `best` to `part_b`, and at which part.

    The result is -1 and 1 if none does; of several, the one that would go farthest.
    """
    blocked, step, farthest = -1, 1.0, 0.0
    for j in range(world.n):
        rate, now = world.part_b[j], world.best[j]
        if world.held[j] != 0.0 or not is_beyond(rate, lower[j], upper[j]):
            continue
        bound = upper[j] if rate > upper[j] else lower[j]
        part = min(1.0, max(0.0, (bound - now) / (rate - now)))
        beyond = abs(rate - bound) / world.joint_scale[j]
        if part < step or blocked < 0 or (part == step and beyond > farthest):
            blocked, step, farthest = j, part, beyond
    return blocked, step


@compiled
def drawn_inwards(world: Record, share: float, damped: float) -> int:
    """Return the held joint that the residual draws inwards most, or -1; part_a counts releases."""
    n, m, chosen, most = world.n, world.m, -1, 0.0
    for r in range(m):
        left = share * world.task[r]
        for j in range(n):
            left -= world.A[r, j] * world.best[j] / world.joint_scale[j]
        world.task_B[r] = left
    is_weighed = world.inverse_metric == INERTIA
    for j in range(n if is_weighed else 0):
        world.shape[j] = (world.best[j] - world.drift[j]) / world.joint_scale[j]
    for j in range(n):
        if world.held[j] == 0.0 or world.part_a[j] >= LET_GO:
            continue
        pull, size = 0.0, 0.0
        for r in range(m):
            pull += world.A[r, j] * world.task_B[r]
            size += abs(world.A[r, j] * share * world.task[r])
        if is_weighed:
            pull -= damped * damped * dot(world.metric[j], world.shape, n)
        else:
            pull -= damped * damped * (world.best[j] - world.drift[j]) / world.joint_scale[j]
        inwards = -pull * world.held[j]
        if inwards > most and inwards > ROUNDING * size:
            chosen, most = j, inwards
    return chosen
