"""A world and its twin, which differs only by a small, brief displacement of the reference."""

import math
from dataclasses import replace

import numpy as np

from rmrc.law.task import Array
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.reference import Reference
from rmrc.support.spatial import exp_rotation, quat_multiply

# Displacement of a twin's reference along each axis [rad], for lengths times task.length. It is so small that
# the response of the loop is linear, and ten thousand times the effect of rounding.
KICK = 1e-6


def resting(prepared: Prepared, least: int) -> Prepared:
    """Return a world of at least this many ticks, with the target at rest after the end of its path."""
    path = prepared.reference
    return replace(prepared, reference=replace(path, ticks=max(path.ticks, least)))


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
    ticks = max(1, math.floor(1.0 / (scenario.control.feedback * path.period)))
    lengths = size * np.array([scenario.task.length] * 3 + [1.0] * 3)
    for i, first in enumerate(starts):
        path = displaced(path, first, min(first + ticks, path.ticks - 1), lengths * _corner(i))
    return replace(prepared, reference=path)


def displaced(path: Reference, first: int, last: int, offset: Array) -> Reference:
    """Return a path whose poses, but not twists, are displaced for some ticks.

    Args:
        path: The path.
        first: The first tick.
        last: One past the last.
        offset: [p; φ] added to the poses, along world axes, (6,) [m, rad].
    """
    begin, end, pieces = path.period * first, path.period * last, path.pieces
    for time in (begin, end):  # two pieces in the place of the one there
        before = int(np.searchsorted(pieces["since"], time, "right")) - 1
        pieces = np.insert(pieces, before + 1, pieces[before])
        pieces["since"][before + 1] = time
    inside = (begin <= pieces["since"]) & (pieces["since"] < end)
    displacement = pieces["displacement"]
    displacement[inside, :3] += offset[:3]
    displacement[inside, 3:] = quat_multiply(exp_rotation(offset[3:]), displacement[inside, 3:])
    return replace(path, pieces=pieces)


def _corner(index: int) -> Array:
    """Return a corner of the box from −1 to 1 in six dimensions, a different one for each of 64 indices."""
    return np.array([1.0 - 2.0 * (index * 11 >> bit & 1) for bit in range(6)])
