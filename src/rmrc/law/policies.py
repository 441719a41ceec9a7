"""Policies near a singularity beyond the inverse itself: slow down along the path, stop, or keep out."""

import math

from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.law.inverses import push_fading
from rmrc.law.metric import backward, factor, forward, scale_gradient, scale_joints
from rmrc.law.nullspace import sigma_gradient
from rmrc.law.svd import RANK_FLOOR, ROUNDING, clear, combine, copy, dot, project
from rmrc.scenario.choices import Status

SLOWED, STOPPED, KEPT_OUT = int(Status.SLOWED), int(Status.STOPPED), int(Status.KEPT_OUT)

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
# A share differs from 1 by rounding only.
ALL = 1.0 - 1e-9


@compiled
def set_pace(world: Record, pace: float) -> None:
    """Change the rates and twists from the last pace to another one; part_b holds the rates at full pace."""
    memory, scratch, tick = world.memory, world.scratch, world.tick
    more = pace - memory.pace
    for j in range(world.n):
        tick.qdot_cmd[j] += more * scratch.part_b[j]
    for i in range(world.m):
        world.first.task[i] += more * world.rest.task[i]
    for i in range(6):
        tick.twist_ref[i] *= pace
        scratch.twist_ref[i] *= pace
    memory.pace = tick.path_rate = pace
    tick.status |= SLOWED if pace < 1.0 else 0


@Method
def slow(world: Record) -> None:
    """Choose the pace ṡ that keeps the rates within their limits.

    The rates a + ṡ b depend linearly on the pace. The present b is known. To slow down in time for the future
    b, the pace stays below the value that could still follow if the limit kept falling as in the last tick.
    Where the path leads out of reach, waiting does not help; after some time the pace returns, as the path
    may come back.

    On entry `tick.qdot_cmd` is that of the last pace, and the twists those of full pace; they become those
    of the new one.
    """
    law, memory, scratch, tick = world.law, world.memory, world.scratch, world.tick
    n, last = world.n, memory.pace
    feedforward_rates(world)
    fastest = FASTEST
    for j in range(n):
        limit, b = USABLE * world.limits.rate[j], scratch.part_b[j]
        a = tick.qdot_cmd[j] - last * b
        if abs(a) > limit:
            fastest = 0.0
        elif b != 0.0:
            fastest = min(fastest, (math.copysign(limit, b) - a) / b)
        # The feedback alone asks for too much: wait for it, but not forever, as no pace can change that.
    if patience_is_over(world, fastest == 0.0):
        fastest = 1.0
    if last > ADVANCED:
        memory.falling = (memory.fastest - fastest) / (last * world.period) if memory.path_tick > 0.0 else 0.0
    memory.fastest = fastest
    pace = min(1.0, reachable(fastest, memory.falling, law.slow_change))
    step = law.slow_change * world.period
    pace = max(0.0, min(max(pace, last - step), last + step))
    set_pace(world, pace)


@compiled
def feedforward_rates(world: Record) -> None:
    """Write into part_b the joint rates of the feed-forward alone at full pace."""
    task, scratch, first, rest = world.task, world.scratch, world.first, world.rest
    for r in range(world.m):
        rest.task[r] = task.row_scale[r] * task.feedforward * scratch.twist_ref[task.row[r]]
    project(first.u, rest.task, world.k, world.m, rest.asked)
    push_fading(world, first.u, rest.task, first.sigma, rest.asked)
    combine(first.gain, rest.asked, first.v, world.k, world.n, scratch.part_b)
    scale_joints(world, scratch.part_b)


@compiled
def patience_is_over(world: Record, waits: bool) -> bool:
    """Count the time for which the path waits; return whether it is longer than the patience."""
    memory = world.memory
    memory.waited = max(0.0, memory.waited + (world.period if waits else -world.period))
    return bool(memory.waited > world.law.slow_patience)


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


@Method
def stop(world: Record) -> None:
    """Remove the rates while they keep the arm too near a singularity.

    Rates that raise the smallest singular value lead out, and pass. From zero it can only rise. Rates that
    raise it by rounding alone, like those of a vertical first joint, do not pass.
    """
    law, memory, scratch, tick, first = world.law, world.memory, world.scratch, world.tick, world.first
    last = world.rank - 1  # a row that the arm can never move is no singularity
    sigma = first.sigma[last]
    share = 1.0
    if sigma <= law.stop_sigma or first.sigma[0] >= law.stop_condition * sigma:
        sigma_gradient(world, last, scratch.work)
        rise, rates = dot(scratch.work, tick.qdot_cmd, world.n), dot(tick.qdot_cmd, tick.qdot_cmd, world.n)
        if sigma > RANK_FLOOR * first.sigma[0] and rise <= ROUNDING * first.sigma[0] * math.sqrt(rates):
            share = 0.0
    step = law.stop_change * world.period
    share = min(max(share, memory.share - step), memory.share + step)
    memory.share = share
    for j in range(world.n):
        tick.qdot_cmd[j] *= share
        scratch.qdot0[j] *= share
    for i in range(world.m):
        first.task[i] *= share
    tick.status |= STOPPED if share < 1.0 else 0


@Method
def singularity_consistent(world: Record) -> None:
    """Choose rates and pace together, along the kernel of [A | −t].

    (y, ṡ) = b (Σ c_i σ_r/σ_i v_i, σ_r), c = Uᵀ t, solves A y = ṡ t for every b. Nothing in it grows where σ_r
    goes to 0; the pace does [Nenchev00]. b is the largest for which the pace is at most 1 and all
    rates are within their limits. Rates of feedback and null space remain as the inverse gives them. Where
    the path leads out of reach, it behaves like `slow`.

    On entry `tick.qdot_cmd` is that of the last pace, and the twists those of full pace; they become those
    of the new one.
    """
    first, law, memory, scratch = world.first, world.law, world.memory, world.scratch
    n, last, smallest = world.n, memory.pace, first.sigma[world.rank - 1]
    feedforward_rates(world)
    kernel_rates(world, smallest)
    full, most = min(1.0, last + law.slow_change * world.period), kernel_bound(world, smallest)
    pace = most * smallest if most < math.inf else 0.0
    if pace >= full or (most == math.inf and smallest > 0.0):
        pace, most = full, full / smallest
    elif most == math.inf:
        most = 0.0
    is_over = patience_is_over(world, pace < WAITING)
    pace = full if is_over else pace
    for j in range(n):
        scratch.work[j] = 0.0 if is_over else most * scratch.part_a[j] - pace * scratch.part_b[j]
    set_pace(world, pace)
    take_on(world)


@compiled
def kernel_rates(world: Record, smallest: float) -> None:
    """Write into part_a the rates of the kernel, whose pace is σ_r."""
    scratch, first, rest = world.scratch, world.first, world.rest
    project(first.u, rest.task, world.k, world.m, rest.asked)
    for i in range(world.k):
        share = smallest / first.sigma[i] if first.sigma[i] > smallest else 1.0
        rest.gain[i] = share if i < world.rank else 0.0
    combine(rest.gain, rest.asked, first.v, world.k, world.n, scratch.part_a)
    scale_joints(world, scratch.part_a)


@compiled
def kernel_bound(world: Record, smallest: float) -> float:
    """Return how many times the kernel's rates fit into the limits beside the other rates; may be infinite.

    It is at most the number that covers a part of the way to the singularity in this tick. A joint whose rate
    is rounding adds nothing to the kernel, and does not bound it: beyond its limit, it would hold the path.
    """
    scratch = world.scratch
    sigma_gradient(world, world.rank - 1, scratch.work)
    falls = -world.period * dot(scratch.work, scratch.part_a, world.n)
    most = OF_THE_WAY * smallest / falls if falls > 0.0 else math.inf
    least = ROUNDING * math.sqrt(dot(scratch.part_a, scratch.part_a, world.n))
    for j in range(world.n):
        rate, beside = scratch.part_a[j], world.tick.qdot_cmd[j] - world.memory.pace * scratch.part_b[j]
        room = USABLE * world.limits.rate[j] - math.copysign(beside, beside * rate)
        if abs(rate) > least:
            most = min(most, max(0.0, room) / abs(rate))
    return float(most)


@compiled
def take_on(world: Record) -> None:
    """Add the rates in `work` so that limits know them: to the wish, and to the task."""
    scratch = world.scratch
    for j in range(world.n):
        world.tick.qdot_cmd[j] += scratch.work[j]
        scratch.qdot0[j] += scratch.work[j]
    for i in range(world.m):
        for j in range(world.n):
            world.first.task[i] += scratch.A[i, j] * scratch.work[j] / world.task.joint_scale[j]


@Method
def keep_out(world: Record) -> None:
    """Change the rates as little as keeps σ_i from falling to its floor too fast.

    The change z = S_q⁻¹ Δqdot minimizes ‖A z‖² + σ_floor² ‖z‖² subject to ∇σ_i · qdot ≥ −α (σ_i − σ_floor),
    i ≤ r: a control barrier function [Ames19]. Its multipliers p ≥ 0 minimize ½ pᵀ G p − pᵀ need, with
    G = B Bᵀ of the gradients B in coordinates in which the change has norm ‖z‖.
    """
    barrier = world.barrier
    n, z, is_asked = world.n, world.scratch.work, False
    for i in range(world.rank):
        find_barrier(world, i)
        is_asked |= barrier.need[i] > 0.0
    if not is_asked:
        return
    push_back(world)
    clear(z, n)
    for i in range(world.rank):
        for j in range(n):
            z[j] += barrier.push[i] * barrier.row[i, j]
        barrier.least[i] -= 2.0 * SOFT * barrier.push[i] * dot(barrier.row[i], barrier.row[i], n)
    value_task(world, world.first.sigma, z)
    scale_joints(world, z)
    take_on(world)
    world.tick.status |= KEPT_OUT


@compiled
def find_barrier(world: Record, i: int) -> None:
    """Write the slope of σ_i, also in the form for `push_back`, its least rate, and the rates' shortfall."""
    law, barrier, first = world.law, world.barrier, world.first
    n, z, floor = world.n, world.scratch.work, law.keep_out_sigma
    sigma_gradient(world, i, z)
    copy(z, barrier.slope[i], n)
    scale_gradient(world, z)
    square, least = dot(z, z, n), law.keep_out_approach * (floor - first.sigma[i])
    if square <= FLAT * FLAT:
        clear(barrier.slope[i], n)
        clear(z, n)
    if least > 0.0:
        least = min(least, law.keep_out_approach * FARTHEST * square)
    value_task(world, first.sigma, z)
    copy(z, barrier.row[i], n)
    barrier.least[i], barrier.push[i] = least, 0.0
    barrier.need[i] = least - dot(barrier.slope[i], world.tick.qdot_cmd, n) if square > FLAT * FLAT else 0.0


@compiled
def value_task(world: Record, sigma: Array, z: Array) -> None:
    """Multiply coordinates by (AᵀA + σ_floor² 1)^-½, (n,): motions that hardly move the task cost less."""
    first, rest = world.first, world.rest
    floor = world.law.keep_out_sigma
    project(first.v, z, world.k, world.n, rest.asked)
    for j in range(world.n):
        z[j] /= floor
    for i in range(world.k):
        less = rest.asked[i] * (1.0 / math.hypot(sigma[i], floor) - 1.0 / floor)
        for j in range(world.n):
            z[j] += less * first.v[i, j]


@compiled
def push_back(world: Record) -> None:
    """Write the multipliers of the bounds on σ_i: those of the set of active bounds that fulfills all.

    Active bounds have multipliers >= 0, and the others need no push. Bounds may give way by SOFT of their
    multiplier, so that there is exactly one such set, and the least squares of violation where they
    contradict each other. The smallest singular values are tried first: mostly their bounds act.
    """
    barrier, k = world.barrier, world.rank
    for i in range(k):
        for j in range(k):
            barrier.gram[i, j] = dot(barrier.row[i], barrier.row[j], world.n)
        barrier.gram[i, i] *= 1.0 + SOFT
    for code in range(1, 1 << k):
        for i in range(k):
            barrier.acts[i] = (code >> (k - 1 - i)) & 1
        solve_acting(world)
        is_right = True
        for i in range(k):
            short = barrier.need[i] - dot(barrier.gram[i], barrier.push, k)
            is_met = barrier.gram[i, i] == 0.0 or short <= ROUNDING * abs(barrier.need[i])
            is_right = is_right and (barrier.push[i] >= 0.0 if barrier.acts[i] else is_met)
        if is_right:
            break


@compiled
def solve_acting(world: Record) -> None:
    """Write the multipliers that fulfill the active bounds exactly, and 0 for the others."""
    barrier, k, acts = world.barrier, world.rank, world.barrier.acts
    for i in range(k):
        barrier.push[i] = acts[i] * barrier.need[i]
        for j in range(i + 1):
            barrier.root[i, j] = acts[i] * barrier.gram[i, j] * acts[j]
        barrier.root[i, i] += 1.0 - acts[i]
    factor(barrier.root, k)
    forward(barrier.root, barrier.push, k)
    backward(barrier.root, barrier.push, k)


@Method
def hold_off(world: Record) -> None:
    """Reduce the limited rates as much as `keep_out` needs.

    A common factor below 1 keeps rates within rate and position limits, and lets each σ_i fall more slowly.
    An acceleration limit allows a part of the reduction, a jerk limit none.
    """
    limits, barrier, tick = world.limits, world.barrier, world.tick
    n, share, part = world.n, 1.0, 1.0
    if limits.is_eased:
        return
    for i in range(world.rank):
        falls, least = dot(barrier.slope[i], tick.qdot_cmd, n), min(barrier.least[i], 0.0)  # rest is allowed
        if falls < least:
            share = min(share, least / falls)
    if share > ALL:
        return
    for j in range(n):
        less, most = (1.0 - share) * abs(tick.qdot_cmd[j]), limits.change[j]
        change = tick.qdot_cmd[j] - world.memory.qdot_cmd[j]
        room = most + math.copysign(change, change * tick.qdot_cmd[j])
        if less > room:
            part = min(part, max(0.0, room) / less)
    for j in range(n):
        tick.qdot_cmd[j] *= 1.0 - part * (1.0 - share)
    tick.status |= KEPT_OUT if part > 0.0 else 0
