"""A world and its twin, which differs only by a small, brief displacement of the reference."""

import math
from dataclasses import replace

import numpy as np

from rmrc.law.task import Array
from rmrc.simulation.prepare import Prepared

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
    lengths = size * np.array([prepared.task.length] * 3 + [1.0] * 3)
    for i, first in enumerate(starts):
        path = path.displaced(first, min(first + ticks, path.ticks - 1), lengths * _corner(i))
    return replace(prepared, reference=path)


def _corner(index: int) -> Array:
    """Return a corner of the box from −1 to 1 in six dimensions, a different one for each of 64 indices."""
    return np.array([1.0 - 2.0 * (index * 11 >> bit & 1) for bit in range(6)])
