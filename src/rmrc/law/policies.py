"""What happens near a singularity beyond the inverse itself: slow down along the path, or stop and wait."""

import math

from rmrc.law.gradient import sigma_gradient
from rmrc.law.jit import Record, compiled, dispatch, inlined
from rmrc.law.kinematics import scale_joints
from rmrc.law.svd import RANK_FLOOR, combine, dot, project
from rmrc.scenario.choices import POLICIES, Status

SLOWED, STOPPED = int(Status.SLOWED), int(Status.STOPPED)

# The pace is chosen for this share of the rate limits: the rest is for what feedback adds on the way.
USABLE = 0.95
# A pace above it counts as this: early enough to be seen falling near a singularity, while the fall from
# infinity where a path sets out from rest is not taken for one.
FASTEST = 8.0
# Where the path has advanced by less than this part of a tick, a difference quotient along it is noise.
ADVANCED = 1e-3


@inlined
def slow(world: Record, tick: Record) -> int:
    """Choose the pace ṡ that keeps the rates within their limits; return SLOWED if it is below 1.

    The rates a + ṡ b depend linearly on the pace. What b is now is known; to fall in time for what it will
    be, the pace keeps below what it could still follow if the limit went on falling as in the last tick.
    Where the path leads out of reach, waiting does not help; after some time it goes on, as it may come back.

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
    # What the feedback alone asks for is too much: wait for it, but not for ever, as no pace mends that.
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
    """Write into part_b what the feed-forward alone asks of the joints at full pace."""
    for r in range(world.m):
        world.task_B[r] = world.row_scale[r] * world.feedforward * world.twist_task[world.row[r]]
    project(world.u, world.task_B, world.k, world.m, world.asked_B)
    combine(tick.gain, world.asked_B, world.v, world.k, world.n, world.part_b)
    scale_joints(world, world.part_b)


@compiled
def reachable(fastest: float, falling: float, change: float) -> float:
    """Return the highest pace from which a fall by `change` a second stays below a line.

    The line starts at `fastest` and falls by `falling` a second of path time. A pace that falls steadily in
    time is a parabola over path time; where it touches the line its pace is x = change/falling.
    """
    if falling <= 0.0 or fastest * falling <= change:
        return fastest
    x = change / falling
    return math.sqrt(x * (2.0 * fastest - x))


@inlined
def stop(world: Record, tick: Record) -> int:
    """Take the rates away while they keep the arm too near a singularity; return STOPPED if any is gone.

    Rates that raise the smallest singular value lead out, and are let pass. From zero it can only rise.
    """
    last = world.rank - 1  # a row that the arm can never move is no singularity
    sigma = tick.sigma[last]
    share = 1.0
    if sigma <= world.stop_sigma or tick.sigma[0] >= world.stop_condition * sigma:
        sigma_gradient(world, last, world.work)
        if sigma > RANK_FLOOR * tick.sigma[0] and dot(world.work, tick.qdot_cmd, world.n) <= 0.0:
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


# What is done near a singularity; it returns the bits of the status.
near_singularity = inlined(dispatch(POLICIES, like=slow))
