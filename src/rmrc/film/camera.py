"""The position of the camera that shows everything relevant, and the pixels of points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Vertical angle of view: a long lens, which hardly magnifies near objects [rad].
ANGLE = np.radians(30.0)
# Part of the picture around all points that stays free.
MARGIN = 0.06
# Direction from the middle to the camera: almost along the normal axis for a planar arm, oblique for others.
TOWARD = {None: (0.75, -1.0, 0.55), 0: (1.0, -0.2, 0.2), 1: (0.2, -1.0, 0.2), 2: (0.0, -0.25, 1.0)}


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera, upright.

    Attributes:
        position: Position of the pinhole, (3,) [m].
        axes: Rows: to the right, up, and back, out of the picture, (3, 3).
        distance: From the pinhole to the middle of the view [m].
        aspect: Width over height of the picture.
    """

    position: Array
    axes: Array
    distance: float
    aspect: float

    def pixels(self, points: Array, width: int, height: int) -> Array:
        """Return the pixels of points (p, 3), (p, 2), from the upper left corner."""
        right, up, back = self.axes @ (np.atleast_2d(points) - self.position).T
        scale = 0.5 * height / np.tan(ANGLE / 2)
        return np.stack([0.5 * width - scale * right / back, 0.5 * height + scale * up / back], axis=1)

    def nearer(self, points: Array, factor: float) -> Array:
        """Return points on the same rays, at a part of their distances, (p, 3): their pixels are the same."""
        return self.position + factor * (points - self.position)


def fitted(points: Array, normal: int | None, aspect: float) -> Camera:
    """Return the nearest camera that sees all points.

    |x − c_x| ≤ t (c_z − z) holds for each point, with t the tangent of half the angle of view. The least c_z
    follows from the two points that bind, and c_x is in the middle of the remaining range. y is similar.

    Args:
        points: Along world axes, (p, 3) [m].
        normal: World axis without motion, along which the camera looks; None: there is none.
        aspect: Width over height of the picture.
    """
    back = np.array(TOWARD[normal])
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(back, right), back])
    seen = points @ axes.T
    tangent = (1.0 - MARGIN) * np.tan(ANGLE / 2) * np.array([aspect, 1.0])
    upper = (seen[:, :2] + tangent * seen[:, 2:]).max(axis=0)
    lower = (seen[:, :2] - tangent * seen[:, 2:]).min(axis=0)
    far = float(((upper - lower) / (2.0 * tangent)).max())
    center = np.array([*(upper + lower) / 2.0, far])
    distance = max(far - float(np.median(seen[:, 2])), 1e-3)
    return Camera(center @ axes, axes, distance, aspect)
