"""Whether the site stands still while its reference moves on."""

from rmrc.law.compiling import Record, compiled
from rmrc.law.record import POSE
from rmrc.law.sight import is_held
from rmrc.scenario.choices import Status

STUCK, WAITS = int(Status.STUCK), int(Status.STOPPED | Status.KEPT_OUT)

# The site stands still below this share of the speed that it should have, in scaled rows. A limit or damping
# that slows an arm down leaves it more, except in moments in which a rate changes its sign.
SHARE = 0.02
# Below this speed the reference is at rest, and asks for nothing [1/s]: 1 mm/s for a length of 1 m.
SLOWEST = 1e-3
# Below this speed the site stands still in any case.
CREEPS = 0.1 * SLOWEST
# The site may stand still for this long before it is called stuck [s]: longer than a turn of direction or the
# start of a lagging feedback takes, shorter than the times that matter on a path.
PATIENCE = 0.2


@compiled
def watch_standstill(world: Record) -> None:
    """Add STUCK to the status once the site has stood still for a while although its reference was moving.

    It lasts until the site moves, the reference rests, or the arm waits by command. A pose that is given to
    `Controller` asks for motion until the site is there.
    """
    tick, first = world.tick, world.first
    task, memory, scratch, status = world.task, world.memory, world.scratch, tick.status
    status |= world.input.saturated
    if (status == 0 and world.m <= world.n) or status & WAITS:  # it obeys fully, or waits
        memory.still = 0.0
        return
    wanted, asked, done = 0.0, 0.0, 0.0
    for i in range(world.m):
        row, scale, moved = task.row[i], task.row_scale[i], 0.0
        for j in range(world.n):
            rate = tick.qdot_cmd[j]
            moved += world.state.J[row, j] * (world.state.qdot[j] if is_held(world, j, rate) else rate)
        wants, moved = scale * scratch.twist_ref[row], scale * moved
        wanted += wants * wants
        asked += first.task[i] * first.task[i]
        done += moved * moved
    moves = wanted > SLOWEST * SLOWEST
    wished, share = (wanted if moves else asked), SHARE
    if not moves and world.input.given & POSE:  # a set-point, whose speed depends on the distance alone
        moves, share = True, 0.0
    if wished <= SLOWEST * SLOWEST or done > max(share * share * wished, CREEPS * CREEPS):
        memory.still = 0.0
    elif moves:
        memory.still += world.period
    if memory.still > PATIENCE:
        tick.status |= STUCK
