"""Whether the site stands still while its reference moves on."""

from rmrc.law.jit import Record, compiled
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
def stuck(world: Record, tick: Record, status: int) -> int:
    """Return STUCK once the site has stood still for a while although its reference was moving.

    It lasts until the site moves, the reference rests, or the arm waits by command.

    Args:
        world: Task, J, the twist of the reference, and how long the site has stood still.
        tick: The rates sent.
        status: All other bits of this tick.
    """
    if (status == 0 and world.m <= world.n) or status & WAITS:  # it obeys fully, or waits
        world.still = 0.0
        return 0
    wanted, asked, done = 0.0, 0.0, 0.0
    for i in range(world.m):
        row, scale, moved = world.row[i], world.row_scale[i], 0.0
        for j in range(world.n):
            moved += world.J[row, j] * tick.qdot_cmd[j]
        wants, moved = scale * world.twist_task[row], scale * moved
        wanted += wants * wants
        asked += world.task[i] * world.task[i]
        done += moved * moved
    moves = wanted > SLOWEST * SLOWEST
    wished = wanted if moves else asked
    if wished <= SLOWEST * SLOWEST or done > max(SHARE * SHARE * wished, CREEPS * CREEPS):
        world.still = 0.0
    elif moves:
        world.still += world.period
    return STUCK if world.still > PATIENCE else 0
