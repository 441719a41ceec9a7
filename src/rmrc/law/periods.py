"""The length of a tick outside a run, where a loop may say how long ago its last step was."""

import math

from rmrc.law.compiling import Record, compiled
from rmrc.law.record import UNCHANGED, UNLIMITED

# Bit of `input.given`: `input.dt` is the time since the last step.
TIMED = 64

# A time outside of these counts as the nearer one [s]: two steps at once are no reason to divide by nothing,
# and after a pause an arm shall not jump to where it could have been. A loop with a period of more than half
# of the longest may be as late as two periods.
SHORTEST, LONGEST, PERIODS = 1e-9, 0.1, 2.0
# The longest tick is forgotten in this time [s]: more than any pattern of periods takes, and yet a pause
# makes an arm careful for some seconds only.
REMEMBERED = 10.0


@compiled
def is_time(dt: float) -> bool:
    """Return whether a number can be the time between two steps."""
    return 0.0 < dt < math.inf


@compiled
def begin_tick(world: Record, is_late: bool) -> None:
    """Set the length of this tick: the time since the last step where it is given, or else the period.

    The time ahead is unknown. Stops are planned for ticks of twice the longest one, as then a joint stops in
    time whatever the lengths of the ticks are, up to that.

    Args:
        world: Its input and memory.
        is_late: Whether commands have been braked meanwhile, up to one period ago at most.
    """
    input_, memory, period = world.input, world.memory, world.input.period
    if not input_.given & TIMED or not is_time(input_.dt):
        set_tick(world, period)
        return
    dt = min(max(input_.dt, SHORTEST), max(LONGEST, PERIODS * period))
    dt = min(dt, period) if is_late else dt
    if dt != period or memory.longest > 0.0:
        memory.longest = max(dt, period, memory.longest * (1.0 - min(1.0, dt / REMEMBERED)))
    set_tick(world, dt)


@compiled
def set_tick(world: Record, dt: float) -> None:
    """Set the length of this tick, and express limits and memory in it: changes stay as steep as they are."""
    limits, memory = world.limits, world.memory
    limits.stretch = 2.0 * memory.longest / dt if memory.longest > 0.0 else 1.0
    if dt == world.period:
        return
    ratio, world.period = dt / world.period, dt
    for j in range(world.n):
        limits.change[j] = limits.hardest[j] * dt
        if limits.is_eased:
            limits.jerk_step[j] = min(max(limits.jerk[j] * (dt * dt), UNCHANGED), UNLIMITED)
        memory.change[j] *= ratio
        memory.course[j] *= ratio
        memory.slope[j] *= ratio
