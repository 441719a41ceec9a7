"""The two halves of a tick around a law that Python calls: the sensors, and the plant.

Both take the arguments of `rmrc.plants.lockstep.tick`, so that they share the machine code of its parts.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.law.jit import Array, Record, entry, machine_code
from rmrc.plants.kinds import obey, sense
from rmrc.plants.lockstep import bad_command, bad_joint, read_joints, read_loads, send


@entry
def sense_half(
    worlds: Record,
    ticks: Record,
    reference: Array,  # noqa: ARG001 - as `tick`
    state: Array,
    warning: NDArray[np.int32],
    site_xpos: Array,
    site_xquat: Array,
    xanchor: Array,  # noqa: ARG001 - as `tick`
    xaxis: Array,  # noqa: ARG001 - as `tick`
    force: Array,
    qfrc_gravcomp: Array,  # noqa: ARG001 - as `tick`
    t: int,
) -> int:
    """Read the sensors at tick t; return the number of worlds whose state is finite.

    `world.q` and `world.qdot` are the readings, `out.q` and `out.qdot` the truth.
    """
    fine, row = 0, t % ticks.shape[1]
    for w in range(worlds.shape[0]):
        world, out = worlds[w], ticks[w, row]
        sense(world, out, state[w], force[w])
        read_joints(world, out, ticks, w, t, site_xpos[w], site_xquat[w])
        if bad_joint(world, warning[w]) == -2:
            fine += 1
    return fine


@entry
def obey_half(
    worlds: Record,
    ticks: Record,
    reference: Array,  # noqa: ARG001 - as `tick`
    state: Array,
    warning: NDArray[np.int32],  # noqa: ARG001 - as `tick`
    site_xpos: Array,  # noqa: ARG001 - as `tick`
    site_xquat: Array,  # noqa: ARG001 - as `tick`
    xanchor: Array,  # noqa: ARG001 - as `tick`
    xaxis: Array,  # noqa: ARG001 - as `tick`
    force: Array,  # noqa: ARG001 - as `tick`
    qfrc_gravcomp: Array,
    t: int,
) -> int:
    """Send `out.qdot_cmd` of tick t to the plants; return the number of worlds whose command is finite."""
    fine, row = 0, t % ticks.shape[1]
    for w in range(worlds.shape[0]):
        world, out = worlds[w], ticks[w, row]
        out.status |= read_loads(world, out, qfrc_gravcomp[w])
        if bad_command(world, out) < 0:
            fine += 1
            send(world, out, ticks, w, t)
            obey(world, out, state[w])
    return fine


def halves(*arrays: Any) -> tuple[Callable[[int], int], Callable[[int], int]]:
    """Return both halves of a tick, each a function of its number, for arguments of `tick` without it."""
    sense, obeyed = (machine_code(one, *arrays, 0) for one in (sense_half, obey_half))
    return partial(sense, *arrays), partial(obeyed, *arrays)
