"""The slice of a workspace: a planar arm's plane, a plane through a point, a half-plane about an axis."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.survey import jacobians
from rmrc.arm import Arm
from rmrc.law.task import RANK_TOLERANCE, SAMPLES, Array, Task
from rmrc.support.errors import QuestionError

NAMES = ("xy", "xz", "yz", "rz")
# An axis of the world within this distance of a direction equals it: eight digits of a file.
PARALLEL = 1e-7


@dataclass(frozen=True, eq=False)
class Slice:
    """A plane of the workspace with two coordinates, and the joints that move the site in it.

    Attributes:
        name: `xy`, `xz`, `yz`, `rz`, or `uv` for a planar arm in no plane of the world.
        labels: Names of both coordinates.
        origin: A point of the plane; for `rz` a point on the axis, (3,) [m].
        axes: Directions of the coordinates, (2, 3); for `rz` the second is that of the axis, and the first
            that in which the joints after the first move the site, nan if that is no plane.
        normal: Normal of the plane, (3,).
        cuts: Whether the arm leaves the plane, so that only some of its postures are in it.
        movers: Joints that move the site, ascending.
        basis: Directions in which the site can move at all, (m, 3): 2 for a planar arm, else 3.
    """

    name: str
    labels: tuple[str, str]
    origin: Array
    axes: Array
    normal: Array
    cuts: bool
    movers: NDArray[np.intp]
    basis: Array

    @property
    def joints(self) -> NDArray[np.intp]:
        """Joints that move the site in the slice: the movers, except the first of `rz`."""
        return self.movers[1:] if self.is_round else self.movers

    @property
    def rows(self) -> NDArray[np.intp]:
        """Rows of the position in which the site can move: all, or for a planar arm the two largest."""
        every = np.arange(3)
        return np.delete(every, np.argmax(np.abs(self.normal))) if len(self.basis) == 2 else every

    @property
    def is_round(self) -> bool:
        """Whether it is a half-plane about the first axis, which represents all of them."""
        return self.name == "rz"

    @property
    def is_surface(self) -> bool:
        """Whether two joints move the site in it, so that a few postures reach each point."""
        return len(self.joints) == 2 and not self.cuts

    def coordinates(self, position: Array) -> Array:
        """Return both coordinates, (..., 2) [m], of points (..., 3)."""
        arm = position - self.origin
        if not self.is_round:
            return np.asarray(arm @ self.axes.T)
        along = arm @ self.axes[1]
        return np.stack([np.linalg.norm(arm - along[..., None] * self.axes[1], axis=-1), along], axis=-1)

    def signed(self, position: Array) -> Array:
        """Return the coordinates of points (..., 3) that the first joint has not turned, r with a sign.

        r = |ρ| has an edge where an arm reaches over the axis, and ρ has none. If the joints after the first
        leave the plane through the axis, the result is `coordinates`.
        """
        if self.is_round and np.isfinite(self.axes[0]).all():
            return np.asarray((position - self.origin) @ self.axes.T)
        return self.coordinates(position)

    def offset(self, position: Array) -> Array:
        """Return the distance of points (..., 3) from the plane, (...) [m]; 0 if it does not cut."""
        return np.asarray((position - self.origin) @ self.normal) * self.cuts


def choose_slice(arm: Arm, plane: str | None, q: Array, through: Array | None = None) -> Slice:
    """Return the slice of an arm's workspace: for a planar arm its plane, else the requested one.

    Args:
        arm: The arm.
        plane: `xy`, `xz`, `yz`, `rz`: distance from the first axis and height along it; None to choose.
        q: Joint positions (n,): of joints that do not move the site, and of the first joint of `rz`.
        through: A point of the plane, (3,) [m]; None: the site at q.

    Raises:
        QuestionError: The site moves neither in a plane nor in space, or has no such slice.
    """
    if plane is not None and plane not in NAMES:
        raise QuestionError(f"--plane must be one of {', '.join(NAMES)}, got {plane!r}")
    _, J = jacobians(Task(arm, np.arange(3)), np.vstack([arm.sampled(SAMPLES), q]))
    linear = J[:, :3]
    size = np.linalg.norm(linear, axis=1).max(axis=0)
    joints = np.flatnonzero(size > RANK_TOLERANCE * max(size.max(), 1.0))
    spread = np.linalg.svd(np.moveaxis(linear, 1, 2).reshape(-1, 3))
    sigma, directions = spread[1], spread[2]
    dimensions = int(np.sum(sigma > RANK_TOLERANCE * max(sigma[0], 1.0)))
    each = np.linalg.svd(linear, compute_uv=False)
    rank = int(np.sum(each > RANK_TOLERANCE * max(sigma[0], 1.0), axis=1).max())
    if rank < 2 or rank != dimensions:
        where = {0: "nowhere", 1: "along a curve"}.get(rank, "on a curved surface")
        raise QuestionError(
            f'{arm.path}: site "{arm.site}" moves {where}; '
            "a workspace needs a site that moves in a plane or in space"
        )
    at = arm.pose(q)[:3] if through is None else through
    if dimensions == 2:
        return _own_plane(arm, plane, directions[2], arm.pose(q)[:3], joints)
    first = joints[0]
    turns = arm.comes_round[first] and np.count_nonzero(arm.motion[:, first]) == 1
    if plane is None:
        plane = "rz" if turns else "xz"
    if plane == "rz":
        if not turns:
            raise QuestionError(
                f'{arm.path}: --plane rz needs a first joint that turns, and "{arm.joints[first]}" does not; '
                "give xy, xz or yz"
            )
        return _about(arm, joints, q)
    keep = ["xyz".index(letter) for letter in plane]
    axes, (normal,) = np.eye(3)[keep], np.delete(np.eye(3), keep, axis=0)
    origin = normal * (normal @ at)
    return Slice(plane, (plane[0], plane[1]), origin, axes, normal, True, joints, np.eye(3))


def _own_plane(arm: Arm, plane: str | None, normal: Array, at: Array, joints: NDArray[np.intp]) -> Slice:
    world = int(np.argmax(np.abs(normal)))
    if abs(normal[world]) > 1.0 - PARALLEL:
        name = "xyz".replace("xyz"[world], "")
        axes = np.delete(np.eye(3), world, axis=0)
        normal = np.eye(3)[world]
    else:
        # As near to level as possible, and upward; seen from above, whichever normal was found.
        normal = normal * (np.sign(normal[2]) or 1.0)
        name, level = "uv", np.cross([0.0, 0.0, 1.0], normal)
        level /= np.linalg.norm(level)
        axes = np.stack([level, np.cross(normal, level)])
    if plane not in (None, name):
        raise QuestionError(
            f'{arm.path}: site "{arm.site}" moves in the plane {name}; leave out --plane, got {plane}'
        )
    origin = normal * (normal @ at)
    return Slice(name, (name[0], name[1]), origin, axes, normal, False, joints, axes)


def _about(arm: Arm, movers: NDArray[np.intp], q: Array) -> Slice:
    """Return the half-plane about the first joint's axis, with the world's heights if it is vertical."""
    task, first = Task(arm, np.arange(3)), movers[0]
    position, J = jacobians(task, q[None])
    axis = J[0, 3:, first]
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    # The point of the axis that is nearest to the world's origin: v = z × (p − o).
    lever = np.cross(J[0, :3, first], J[0, 3:, first])
    on_axis = position[0] - lever
    origin = on_axis - axis * (axis @ on_axis)
    others = arm.sampled(SAMPLES)
    others[:, : first + 1] = q[: first + 1]
    arms = np.vstack([jacobians(task, others)[0], position]) - origin
    across = arms - (arms @ axis)[:, None] * axis
    outward = np.linalg.svd(across)[2][0]
    outward = outward * np.sign(across[-1] @ outward or 1.0)
    flat = np.abs(across - (across @ outward)[:, None] * outward).max() < PARALLEL * np.abs(across).max()
    radial = outward if flat else np.full(3, np.nan)
    height = "z" if axis[2] > 1.0 - PARALLEL else "h"
    return Slice("rz", ("r", height), origin, np.stack([radial, axis]), np.zeros(3), False, movers, np.eye(3))
