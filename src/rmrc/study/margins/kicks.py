"""A world and its twin: the same in all, but the reference of the twin is moved a little, for moments."""

import math
from dataclasses import dataclass, replace

import numpy as np

from rmrc.law.jit import Array
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.reference import POSE, Reference
from rmrc.support.spatial import exp_rotation, quat_multiply

# How far a twin's reference is moved along each axis [rad], of lengths times task.length. So little that the
# loop answers as a linear one does, and ten thousand times what rounding moves.
KICK = 1e-6


@dataclass(frozen=True)
class Kick:
    """Where a reference is moved.

    Attributes:
        first: Its first tick.
        last: One past the last.
        offset: [p; φ] by which poses are moved meanwhile, along world axes, (6,) [m, rad].
    """

    first: int
    last: int
    offset: Array


@dataclass(frozen=True, eq=False)
class Kicked(Reference):
    """A path that is moved for moments, its twists not, and behind whose end the target rests.

    Attributes:
        path_ticks: Of the path; `ticks` are those with the rest.
        kicks: When and how far it is moved.
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
    """Return a world that goes on for so many ticks at least: the target rests where its path ends."""
    path = prepared.reference
    ticks = max(path.ticks, least)
    longer = Kicked(ticks, path.period, path.pieces, path.recorded, path.ticks)
    return replace(prepared, reference=longer)


def twin_of(prepared: Prepared, starts: tuple[int, ...], size: float) -> Prepared:
    """Return the twin of a world.

    A kick lasts 1/K, in which a loop follows most of it, and goes to a corner of a box: to either side along
    each axis, those that do not count as well.

    Args:
        prepared: The world, as `resting` returned it.
        starts: First tick of each kick, on the path.
        size: How far each goes along each axis [rad]; of lengths, times `task.length`.
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
    """Return a corner of the box from −1 to 1 in six dimensions, another for each of 64 indices."""
    return np.array([1.0 - 2.0 * (index * 11 >> bit & 1) for bit in range(6)])
