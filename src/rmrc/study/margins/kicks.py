"""A world and its twin, which differs only by a small, brief displacement of the reference."""

import math
from dataclasses import dataclass, replace

import numpy as np

from rmrc.law.jit import Array
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.reference import POSE, Reference
from rmrc.support.spatial import exp_rotation, quat_multiply

# Displacement of a twin's reference along each axis [rad], for lengths times task.length. It is so small that
# the response of the loop is linear, and ten thousand times the effect of rounding.
KICK = 1e-6


@dataclass(frozen=True)
class Kick:
    """A displacement of a reference.

    Attributes:
        first: Its first tick.
        last: One past the last.
        offset: [p; φ] added to poses meanwhile, along world axes, (6,) [m, rad].
    """

    first: int
    last: int
    offset: Array


@dataclass(frozen=True, eq=False)
class Kicked(Reference):
    """A path with brief displacements of its poses, not of its twists, and with a rest at its end.

    Attributes:
        path_ticks: Ticks of the path; `ticks` includes the rest after it.
        kicks: Times and sizes of the displacements.
    """

    path_ticks: int = 0
    kicks: tuple[Kick, ...] = ()

    def write(self, out: Array) -> None:
        """Write `samples`, (T, 13)."""
        super().write(out[: self.path_ticks])
        out[self.path_ticks :] = out[self.path_ticks - 1]
        out[self.path_ticks :, POSE:] = 0.0
        for kick in self.kicks:
            rows = out[kick.first : kick.last]
            rows[:, :3] += kick.offset[:3]
            rows[:, 3:POSE] = quat_multiply(exp_rotation(kick.offset[3:]), rows[:, 3:POSE])


def resting(prepared: Prepared, least: int) -> Prepared:
    """Return a world of at least this many ticks, with the target at rest after the end of its path."""
    path = prepared.reference
    ticks = max(path.ticks, least)
    longer = Kicked(ticks, path.period, path.pieces, path.recorded, path.ticks)
    return replace(prepared, reference=longer)


def twin_of(prepared: Prepared, starts: tuple[int, ...], size: float) -> Prepared:
    """Return the twin of a world.

    A kick lasts 1/K, in which a loop follows most of it, and goes to a corner of a box: to either side along
    each axis, including axes outside the task.

    Args:
        prepared: The world returned by `resting`.
        starts: First tick of each kick, on the path.
        size: Displacement along each axis [rad]; for lengths, times `task.length`.
    """
    scenario, path = prepared.scenario, prepared.reference
    assert isinstance(path, Kicked)
    ticks = max(1, math.floor(1.0 / (scenario.control.feedback * path.period)))
    lengths = size * np.array([scenario.task.length] * 3 + [1.0] * 3)
    kicks = tuple(
        Kick(first, min(first + ticks, path.ticks - 1), lengths * _corner(i))
        for i, first in enumerate(starts)
    )
    return replace(prepared, reference=replace(path, kicks=kicks))


def _corner(index: int) -> Array:
    """Return a corner of the box from −1 to 1 in six dimensions, a different one for each of 64 indices."""
    return np.array([1.0 - 2.0 * (index * 11 >> bit & 1) for bit in range(6)])
