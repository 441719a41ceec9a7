"""Policies near a singularity beyond the inverse itself: slow down along the path, stop, or keep out."""

import math

from rmrc.law.gradient import sigma_gradient
from rmrc.law.inverses import push_fading
from rmrc.law.jit import Array, Record, apart, compiled, dispatch, inlined
from rmrc.law.metric import backward, factor, forward, scale_gradient, scale_joints
from rmrc.law.svd import RANK_FLOOR, combine, dot, project
from rmrc.scenario.choices import POLICIES, Status

SLOWED, STOPPED, KEPT_OUT = int(Status.SLOWED), int(Status.STOPPED), int(Status.KEPT_OUT)
KEEP_OUT = POLICIES.code("keep_out")

# The pace is chosen for this share of the rate limits: the rest is for the feedback along the way.
USABLE = 0.95
# A larger pace counts as this one. It is small enough that the pace is seen to fall near a singularity, and
# that the fall from infinity at a path's start from rest does not count.
FASTEST = 8.0
# Where the path has advanced by less than this part of a tick, a difference quotient along it is noise.
ADVANCED = 1e-3
# A pace below this waits. Along the kernel it halves from tick to tick where the path leads out of reach.
WAITING = 1e-3
# The largest part of the way to a singularity in one tick; the arm would otherwise overstep it.
OF_THE_WAY = 0.5
# Below its floor, σ_min is brought back by at most this times its squared slope [rad²]: where the slope
# vanishes, as at a maximum of σ_min, any rate would follow. A slope below FLAT [1/rad] is rounding.
FARTHEST, FLAT = 0.2, 1e-9
# A bound on a singular value may give way by this much of its multiplier.
SOFT = 1e-6
# A bound is met when it is met to rounding; below this part of the others, a rate or a slope is rounding.
ROUNDING = 1e-12
# A share differs from 1 by rounding only.
ALL = 1.0 - 1e-9


@inlined
def slow(world: Record, tick: Record) -> int:
    """Choose the pace ṡ that keeps the rates within their limits; return SLOWED if it is below 1.

    The rates a + ṡ b depend linearly on the pace. The present b is known. To slow down in time for the future
    b, the pace stays below the value that could still follow if the limit kept falling as in the last tick.
    Where the path leads out of reach, waiting does not help; after some time the pace returns, as the path
    may come back.

    Args:
        world: Memory of the pace; task, and the gains' decomposition.
        tick: qdot_cmd is that of the last pace, twist_ref that of full pace; both become the new one's.
    """
    n, last = world.n, world.pace
    feedforward_rates(world, tick)
    fastest = FASTEST
    for j in range(n):
        limit, b = USABLE * world.rate_limit[j], world.part_b[j]
        a = tick.qdot_cmd[j] - last * b
        if abs(a) > limit:
            fastest = 0.0
        elif b != 0.0:
            fastest = min(fastest, (math.copysign(limit, b) - a) / b)
        # The feedback alone asks for too much: wait for it, but not forever, as no pace can change that.
    waited = world.waited + (world.period if fastest == 0.0 else -world.period)
    world.waited = max(0.0, waited)
    if world.waited > world.slow_patience:
        fastest = 1.0
    if last > ADVANCED:
        world.falling = (world.fastest - fastest) / (last * world.period) if world.path_tick > 0.0 else 0.0
    world.fastest = fastest
    pace = min(1.0, reachable(fastest, world.falling, world.slow_change))
    step = world.slow_change * world.period
    pace = max(0.0, min(max(pace, last - step), last + step))
    for j in range(n):
        tick.qdot_cmd[j] += (pace - last) * world.part_b[j]
    for i in range(world.m):
        world.task[i] += (pace - last) * world.task_B[i]
    for i in range(6):
        tick.twist_ref[i] *= pace
        world.twist_task[i] *= pace
    world.pace = tick.path_rate = pace
    return SLOWED if pace < 1.0 else 0


@compiled
def feedforward_rates(world: Record, tick: Record) -> None:
    """Write into part_b the joint rates of the feed-forward alone at full pace."""
    for r in range(world.m):
        world.task_B[r] = world.row_scale[r] * world.feedforward * world.twist_task[world.row[r]]
    project(world.u, world.task_B, world.k, world.m, world.asked_B)
    push_fading(world, world.u, world.task_B, tick.sigma, world.asked_B)
    combine(tick.gain, world.asked_B, world.v, world.k, world.n, world.part_b)
    scale_joints(world, world.part_b)


@compiled
def reachable(fastest: float, falling: float, change: float) -> float:
    """Return the highest pace from which a fall by `change` per second stays below a line.

    The line starts at `fastest` and falls by `falling` per second of path time. A pace that falls steadily in
    time is a parabola over path time; where it touches the line its pace is x = change/falling.
    """
    if falling <= 0.0 or fastest * falling <= change:
        return fastest
    x = change / falling
    return math.sqrt(x * (2.0 * fastest - x))


@inlined
def stop(world: Record, tick: Record) -> int:
    """Remove the rates while they keep the arm too near a singularity; return STOPPED if any is removed.

    Rates that raise the smallest singular value lead out, and pass. From zero it can only rise. Rates that
    raise it by rounding alone, like those of a vertical first joint, do not pass.
    """
    last = world.rank - 1  # a row that the arm can never move is no singularity
    sigma = tick.sigma[last]
    share = 1.0
    if sigma <= world.stop_sigma or tick.sigma[0] >= world.stop_condition * sigma:
        sigma_gradient(world, last, world.work)
        rise, rates = dot(world.work, tick.qdot_cmd, world.n), dot(tick.qdot_cmd, tick.qdot_cmd, world.n)
        if sigma > RANK_FLOOR * tick.sigma[0] and rise <= ROUNDING * tick.sigma[0] * math.sqrt(rates):
            share = 0.0
    step = world.stop_change * world.period
    share = min(max(share, world.share - step), world.share + step)
    world.share = share
    for j in range(world.n):
        tick.qdot_cmd[j] *= share
        world.qdot0[j] *= share
    for i in range(world.m):
        world.task[i] *= share
    return STOPPED if share < 1.0 else 0


@compiled
def singularity_consistent(world: Record, tick: Record) -> int:
    """Choose rates and pace together, along the kernel of [A | −t]; return SLOWED if the pace is below 1.

    (y, ṡ) = b (Σ c_i σ_r/σ_i v_i, σ_r), c = Uᵀ t, solves A y = ṡ t for every b. Nothing in it grows where σ_r
    goes to 0; the pace does [Nenchev00]. b is the largest for which the pace is at most 1 and all
    rates are within their limits. Rates of feedback and null space remain as the inverse gives them. Where
    the path leads out of reach, it behaves like `slow`.

    Args:
        world: Memory of the pace; task, and the gains' decomposition.
        tick: qdot_cmd is that of the last pace, twist_ref that of full pace; both become the new one's.
    """
    n, last, smallest = world.n, world.pace, tick.sigma[world.rank - 1]
    feedforward_rates(world, tick)
    kernel_rates(world, tick, smallest)
    full, most = min(1.0, last + world.slow_change * world.period), kernel_bound(world, tick, smallest)
    pace = most * smallest if most < math.inf else 0.0
    if pace >= full or (most == math.inf and smallest > 0.0):
        pace, most = full, full / smallest
    elif most == math.inf:
        most = 0.0
    world.waited = max(0.0, world.waited + (world.period if pace < WAITING else -world.period))
    if world.waited > world.slow_patience:
        pace = full
        for j in range(n):
            world.part_a[j] = pace * world.part_b[j]
        most = 1.0
    for j in range(n):
        tick.qdot_cmd[j] += (pace - last) * world.part_b[j]
        world.work[j] = most * world.part_a[j] - pace * world.part_b[j]
    for i in range(world.m):
        world.task[i] += (pace - last) * world.task_B[i]
    for i in range(6):
        tick.twist_ref[i] *= pace
        world.twist_task[i] *= pace
    world.pace = tick.path_rate = pace
    take_on(world, tick)
    return SLOWED if pace < 1.0 else 0


@compiled
def kernel_rates(world: Record, tick: Record, smallest: float) -> None:
    """Write into part_a the rates of the kernel, whose pace is σ_r."""
    project(world.u, world.task_B, world.k, world.m, world.asked_B)
    for i in range(world.k):
        share = smallest / tick.sigma[i] if tick.sigma[i] > smallest else 1.0
        world.gain_B[i] = share if i < world.rank else 0.0
    combine(world.gain_B, world.asked_B, world.v, world.k, world.n, world.part_a)
    scale_joints(world, world.part_a)


@compiled
def kernel_bound(world: Record, tick: Record, smallest: float) -> float:
    """Return how many times the kernel's rates fit into the limits beside the other rates; may be infinite.

    It is at most the number that covers a part of the way to the singularity in this tick. A joint whose rate
    is rounding adds nothing to the kernel, and does not bound it: beyond its limit, it would hold the path.
    """
    sigma_gradient(world, world.rank - 1, world.work)
    falls = -world.period * dot(world.work, world.part_a, world.n)
    most = OF_THE_WAY * smallest / falls if falls > 0.0 else math.inf
    least = ROUNDING * math.sqrt(dot(world.part_a, world.part_a, world.n))
    for j in range(world.n):
        rate, beside = world.part_a[j], tick.qdot_cmd[j] - world.pace * world.part_b[j]
        room = USABLE * world.rate_limit[j] - math.copysign(beside, beside * rate)
        if abs(rate) > least:
            most = min(most, max(0.0, room) / abs(rate))
    return float(most)


@compiled
def take_on(world: Record, tick: Record) -> None:
    """Add the rates in `work` so that limits know them: to the wish, and to the task."""
    for j in range(world.n):
        tick.qdot_cmd[j] += world.work[j]
        world.qdot0[j] += world.work[j]
    for i in range(world.m):
        for j in range(world.n):
            world.task[i] += world.A[i, j] * world.work[j] / world.joint_scale[j]


@compiled
def keep_out(world: Record, tick: Record) -> int:
    """Change the rates as little as keeps σ_i from falling to its floor too fast; return KEPT_OUT if any.

    The change z = S_q⁻¹ Δqdot minimizes ‖A z‖² + σ_floor² ‖z‖² subject to ∇σ_i · qdot ≥ −α (σ_i − σ_floor),
    i ≤ r: a control barrier function [Ames19]. Its multipliers p ≥ 0 minimize ½ pᵀ G p − pᵀ need, with
    G = B Bᵀ of the gradients B in coordinates in which the change has norm ‖z‖.
    """
    n, z, is_asked = world.n, world.work, False
    for i in range(world.rank):
        find_barrier(world, tick, i)
        is_asked |= world.need[i] > 0.0
    if not is_asked:
        return 0
    push_back(world)
    for j in range(n):
        z[j] = 0.0
    for i in range(world.rank):
        for j in range(n):
            z[j] += world.push[i] * world.barrier[i, j]
        world.least[i] -= 2.0 * SOFT * world.push[i] * dot(world.barrier[i], world.barrier[i], n)
    value_task(world, tick.sigma, z)
    scale_joints(world, z)
    take_on(world, tick)
    return KEPT_OUT


@compiled
def find_barrier(world: Record, tick: Record, i: int) -> None:
    """Write the slope of σ_i, also in the form for `push_back`, its least rate, and the rates' shortfall."""
    n, z, floor = world.n, world.work, world.keep_out_sigma
    sigma_gradient(world, i, z)
    for j in range(n):
        world.slopes[i, j] = z[j]
    scale_gradient(world, z)
    square, least = dot(z, z, n), world.keep_out_approach * (floor - tick.sigma[i])
    if square <= FLAT * FLAT:
        for j in range(n):
            world.slopes[i, j] = z[j] = 0.0
    if least > 0.0:
        least = min(least, world.keep_out_approach * FARTHEST * square)
    value_task(world, tick.sigma, z)
    for j in range(n):
        world.barrier[i, j] = z[j]
    world.least[i], world.push[i] = least, 0.0
    world.need[i] = least - dot(world.slopes[i], tick.qdot_cmd, n) if square > FLAT * FLAT else 0.0


@compiled
def value_task(world: Record, sigma: Array, z: Array) -> None:
    """Multiply coordinates by (AᵀA + σ_floor² 1)^-½, (n,): motions that hardly move the task cost less."""
    floor = world.keep_out_sigma
    project(world.v, z, world.k, world.n, world.asked_B)
    for j in range(world.n):
        z[j] /= floor
    for i in range(world.k):
        less = world.asked_B[i] * (1.0 / math.hypot(sigma[i], floor) - 1.0 / floor)
        for j in range(world.n):
            z[j] += less * world.v[i, j]


@compiled
def push_back(world: Record) -> None:
    """Write the multipliers of the bounds on σ_i by an active set [Lawson95], solving for the active ones.

    Bounds may give way by SOFT of their multiplier. Contradictory bounds then have a solution too, the one
    with the least squares of violation.
    """
    k, G, acts, push = world.rank, world.u_B, world.gain_B, world.push
    for i in range(k):
        acts[i] = 0.0
        for j in range(k):
            G[i, j] = dot(world.barrier[i], world.barrier[j], world.n)
        G[i, i] *= 1.0 + SOFT
    for _ in range(3 * k):
        chosen, most = -1, 0.0
        for i in range(k):
            short = world.need[i] - dot(G[i], push, k)
            if acts[i] == 0.0 and G[i, i] > 0.0 and short > most + ROUNDING * abs(world.need[i]):
                chosen, most = i, short
        if chosen < 0:
            break
        acts[chosen] = 1.0
        while not solve_acting(world):
            pass


@compiled
def solve_acting(world: Record) -> bool:
    """Move the multipliers to the solution of the active bounds, or to the point where the first becomes 0.

    Return whether none becomes 0.
    """
    k, root, acts, push, wanted = world.rank, world.v_B, world.gain_B, world.push, world.sigma_B
    for i in range(k):
        wanted[i] = acts[i] * world.need[i]
        for j in range(i + 1):
            root[i, j] = acts[i] * world.u_B[i, j] * acts[j]
        root[i, i] += 1.0 - acts[i]
    factor(root, k)
    forward(root, wanted, k)
    backward(root, wanted, k)
    step, last = 1.0, -1
    for i in range(k):
        if wanted[i] < 0.0 and push[i] <= step * (push[i] - wanted[i]):
            step, last = push[i] / (push[i] - wanted[i]), i
    for i in range(k):
        push[i] += step * (wanted[i] - push[i])
    if last >= 0:
        acts[last] = push[last] = 0.0
    return last < 0


@apart("call_hold_off", at_singularity=(KEEP_OUT,))
def hold_off(world: Record, tick: Record) -> int:
    """Reduce the limited rates as much as `keep_out` needs; return KEPT_OUT if they change.

    A common factor below 1 keeps rates within rate and position limits, and lets each σ_i fall more slowly.
    An acceleration limit allows a part of the reduction, a jerk limit none.
    """
    n, share, part = world.n, 1.0, 1.0
    if world.is_eased:
        return 0
    for i in range(world.rank):
        falls, least = dot(world.slopes[i], tick.qdot_cmd, n), min(world.least[i], 0.0)  # rest is allowed
        if falls < least:
            share = min(share, least / falls)
    if share > ALL:
        return 0
    for j in range(n):
        less, most = (1.0 - share) * abs(tick.qdot_cmd[j]), world.change_limit[j]
        change = tick.qdot_cmd[j] - world.qdot_cmd_last[j]
        room = most + math.copysign(change, change * tick.qdot_cmd[j])
        if less > room:
            part = min(part, max(0.0, room) / less)
    for j in range(n):
        tick.qdot_cmd[j] *= 1.0 - part * (1.0 - share)
    return KEPT_OUT if part > 0.0 else 0


# The policy near a singularity; it returns the bits of the status.
near_singularity = inlined(dispatch(POLICIES, like=slow, field="call_policy"))
