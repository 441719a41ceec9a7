"""The marks in the picture of an arm: wanted path, trail, target, ellipsoid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.show.palette import GREEN, HUES, RED, mix

Array = NDArray[np.float64]

# Radii of the trail, of the wanted path, and of the balls at tip and target, relative to the reach.
TRAIL, WANTED, TIP, TARGET = 0.0075, 0.0045, 0.018, 0.014
# Largest number of pieces of a line.
PIECES = 160
# Colors on white, 0xRRGGBBAA.
INK, CALM, NEAR, LOOSE = 0x3A3F47FF, HUES[0], RED, GREEN


@dataclass(frozen=True, eq=False)
class Mark:
    """An ellipsoid, or a rod with round ends.

    Attributes:
        color: 0 to 1, (4,).
        center: Center of the ellipsoid, or an end of the rod, (3,) [m].
        size: Half axes of the ellipsoid, or three times the radius of the rod, (3,) [m].
        axes: Columns: those of the ellipsoid, (3, 3).
        end: The other end of the rod, (3,) [m]; None: an ellipsoid.
        is_front: Whether it is drawn in front of the arm, in the same pixels.
    """

    color: Array
    center: Array
    size: Array
    axes: Array
    end: Array | None = None
    is_front: bool = True


def rgba(color: int, alpha: float = 1.0) -> Array:
    """Return a color 0xRRGGBBAA as four numbers from 0 to 1."""
    channels = np.array([(color >> shift) & 255 for shift in (24, 16, 8, 0)]) / 255.0
    channels[3] *= alpha
    return channels


def ball(center: Array, radius: float, color: int) -> Mark:
    """Return a ball in front of the arm."""
    return Mark(rgba(color), center, np.full(3, radius), np.eye(3))


def ellipsoid(center: Array, half: Array, axes: Array) -> Mark:
    """Return the velocity ellipsoid around the tip of the arm."""
    return Mark(rgba(LOOSE, 0.4), center, half, axes, is_front=False)


def line(points: Array, radius: float, colors: Array, is_dashed: bool = False) -> list[Mark]:
    """Return a line through points, (p, 3), with a color for each, (p, 4); dashes cover half of it, evenly.

    Points closer to each other than the radius are left out, so that rest takes no pieces.
    """
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    if way[-1] < radius:
        return []
    stops = np.linspace(0.0, way[-1], min(PIECES, max(2, int(way[-1] / radius))) // 2 * 2 + 2)
    at = np.stack([np.interp(stops, way, points[:, i]) for i in range(3)], axis=1)
    which = np.searchsorted(way, stops).clip(0, len(colors) - 1)
    size = np.full(3, radius)
    return [
        Mark(colors[which[i]], at[i], size, np.eye(3), at[i + 1])
        for i in range(0, len(stops) - 1, 2 if is_dashed else 1)
    ]


def nearing(nearness: Array) -> Array:
    """Return the colors of a trail, (p, 4): from calm, 0, to near a singularity, 1, (p,)."""
    ramp = np.array([rgba(mix(CALM, NEAR, part)) for part in np.linspace(0.0, 1.0, 33)])
    found: Array = ramp[(32 * nearness).round().astype(int)]
    return found
