"""The slices of a workspace: the half-plane about the first axis, or a plane."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.survey import jacobians
from rmrc.arm import Arm
from rmrc.law.task import RANK_TOLERANCE, SAMPLES, Array, Task
from rmrc.support.errors import QuestionError

# An axis of the world within this distance of a direction equals it: eight digits of a file.
PARALLEL = 1e-7


@dataclass(frozen=True, eq=False)
class Slice:
    """Two coordinates of the site, and the joints that change them.

    Attributes:
        name: `rz`, the half-plane about the first axis; `xy`, `xz` or `yz`, the plane of a planar arm or the
            view of a spatial one along the third axis; or `uv` for a planar arm in no plane of the world.
        labels: Names of both coordinates.
        origin: A point of the plane; for `rz` a point on the axis, (3,) [m].
        axes: Directions of the coordinates, (2, 3); for `rz` the second is that of the axis.
        rows: Rows of J_v that must be independent: for `rz` all, else those of the plane.
        joints: Joints that change the coordinates, ascending.
        movers: For `rz` also the first joint, which represents all half-planes.
    """

    name: str
    labels: tuple[str, str]
    origin: Array
    axes: Array
    rows: NDArray[np.intp]
    joints: NDArray[np.intp]
    movers: NDArray[np.intp]

    @property
    def is_round(self) -> bool:
        """Whether it is a half-plane about the first axis."""
        return self.name == "rz"

    @property
    def is_surface(self) -> bool:
        """Whether two joints determine both coordinates, so that the site loses a direction on curves."""
        return len(self.joints) == 2

    def coordinates(self, position: Array) -> Array:
        """Return both coordinates, (..., 2) [m], of points (..., 3)."""
        away = position - self.origin
        if not self.is_round:
            return np.asarray(away @ self.axes.T)
        height = away @ self.axes[1]
        return np.stack([np.linalg.norm(away - height[..., None] * self.axes[1], axis=-1), height], axis=-1)


def choose_slices(arm: Arm, plane: str | None, q: Array) -> list[Slice]:
    """Return the slices that show an arm's workspace, or the requested one.

    A planar arm has its plane. A spatial one has `rz` if its first joint turns, or else `xz`; and each plane
    of the world whose coordinates some moving joint leaves alone, such as `xy` of a SCARA.

    Args:
        arm: The arm.
        plane: `xy`, `xz`, `yz`, `rz`: distance from the first axis and height along it; None to choose.
        q: Joint positions (n,): of joints that do not move the site, and of the first joint of `rz`.

    Raises:
        QuestionError: The site moves neither in a plane nor in space, or has no such slice.
    """
    position, J = jacobians(Task(arm, np.arange(3)), np.vstack([arm.sampled(SAMPLES), q]))
    linear, at, site = J[:, :3], position[-1], f'{arm.path}: site "{arm.site}"'
    _, sigma, directions = np.linalg.svd(np.moveaxis(linear, 1, 2).reshape(-1, 3))
    smallest = RANK_TOLERANCE * max(sigma[0], 1.0)
    rank = int(np.sum(np.linalg.svd(linear, compute_uv=False) > smallest, axis=1).max())
    if rank < 2 or rank != np.sum(sigma > smallest):
        raise QuestionError(f"{site} moves on a curve or a curved surface, not in a plane or in space")
    movers = _movers(linear)
    first, views = movers[0], [_plane(directions[2], at, linear)]
    if rank == 3:
        views = [_plane(normal, at, linear) for normal in np.eye(3)[[1, 2, 0]]]
    if rank == 3 and arm.comes_round[first] and np.count_nonzero(arm.motion[:, first]) == 1:
        axis = J[-1, 3:, first]
        axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
        # The point of the axis that is nearest to the world's origin: v = z × (p − o).
        on_axis = at - np.cross(J[-1, :3, first], J[-1, 3:, first])
        labels = ("r", "z" if axis[2] > 1.0 - PARALLEL else "h")
        origin, axes = on_axis - axis * (axis @ on_axis), np.stack([np.zeros(3), axis])
        views.insert(0, Slice("rz", labels, origin, axes, np.arange(3), movers[1:], movers))
    names = [part.name for part in views]
    if plane is not None and plane not in names:
        raise QuestionError(f"{site} has no slice {plane}; choose from {', '.join(names)}")
    if plane is not None:
        return [views[names.index(plane)]]
    return views[:1] + [part for part in views[1:] if len(part.joints) < len(movers)]


def _plane(normal: Array, at: Array, linear: Array) -> Slice:
    """Return the plane through a point; its second axis points along the world's, or up."""
    nearest = np.argmin(np.abs(normal))
    first = np.eye(3)[nearest] - normal[nearest] * normal
    axes = np.stack([first / np.linalg.norm(first), np.cross(normal, first / np.linalg.norm(first))])
    largest = np.argmax(np.abs(axes), axis=1)
    axes[1] *= np.sign(axes[1, largest[1]])
    name = "uv"
    if np.abs(axes - np.eye(3)[largest]).max() < PARALLEL:
        axes, name = np.eye(3)[largest], "".join("xyz"[i] for i in largest)
    rows, joints = np.delete(np.arange(3), np.argmax(np.abs(normal))), _movers(axes @ linear)
    return Slice(name, (name[0], name[1]), normal * (normal @ at), axes, rows, joints, joints)


def _movers(linear: Array) -> NDArray[np.intp]:
    """Return the joints that move a point, whose linear velocities at some configurations are (N, k, n)."""
    size = np.abs(linear).max(axis=(0, 1))
    return np.flatnonzero(size > RANK_TOLERANCE * max(size.max(), 1.0))
