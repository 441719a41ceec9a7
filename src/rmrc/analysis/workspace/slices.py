"""The coordinates of a workspace: slices, their cells, and the configurations that are singular in them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from rmrc.analysis.factors import Product
from rmrc.analysis.survey import Survey, jacobians, survey
from rmrc.arm import Arm
from rmrc.law.task import RANK_TOLERANCE, SAMPLES, Array, Task
from rmrc.support.errors import QuestionError

MEASURES = ("sigma_min", "manipulability", "condition")
NAMES = ("xy", "xz", "yz", "rz")
# An axis of the world within this distance of a direction equals it: eight digits of a file.
PARALLEL = 1e-7
# A configuration is singular if σ_min is below this part of the largest entry of J: Newton's method ends at
# rounding, 1e-15 of it, or slower where two curves cross.
SINGULAR, STEPS = 1e-9, 25
# Part of the sum of squares of a step's equations: directions with less, 3e-7 of it, count as rounding.
DAMPING = 1e-13
# Largest length of a step [rad or m]: second derivatives do not hold farther away.
LONGEST = 0.3
# A smaller share of a determinant is rounding, and so is a joint's distance from its limit [rad or m].
ROUNDING = 1e-9


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
        movers: Joints that move the site: for `rz` also the first, which represents all half-planes.
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


@dataclass(eq=False)
class Map:
    """Cells of two coordinates, and the best, or the worst, of the postures that were examined in each.

    Attributes:
        edges: Edges of the cells along both coordinates, (A + 1,) and (B + 1,) [m or rad].
        n: Number of joints.
        locate: Returns the coordinates of results, (N, 2).
        part: The slice; None: the map is over two joints.
        worst: Whether the worst posture counts.
        extents: Smallest and largest value of both coordinates, (2, 2) [m]; None over two joints.
        values: σ_min, w and κ, each (A, B); nan where nothing is reached.
        steps: Sides of a cell, (2,) [m or rad].
        q: The posture of that σ_min, (A, B, n) [rad or m]; nan where nothing is reached.
        count: Number of examined postures, (A, B).
    """

    edges: Sequence[Array]
    n: int
    locate: Callable[[Survey], Array]
    part: Slice | None = None
    worst: bool = False
    extents: Array | None = None

    def __post_init__(self) -> None:
        """Begin with empty cells."""
        shape, self.steps = tuple(len(e) - 1 for e in self.edges), np.array([e[1] - e[0] for e in self.edges])
        self.values = {measure: np.full(shape, np.nan) for measure in MEASURES}
        self.q, self.count = np.full((*shape, self.n), np.nan), np.zeros(shape, np.int64)

    def add(self, seen: Survey) -> None:
        """Add results to the cells of their coordinates."""
        at = np.floor((self.locate(seen) - [edges[0] for edges in self.edges]) / self.steps).astype(np.int64)
        fits = ((at >= 0) & (at < self.count.shape)).all(axis=1)
        cell, sigma = at[fits] @ [self.count.shape[1], 1], seen.sigma[fits]
        values = (sigma[:, -1], sigma.prod(axis=1), seen.condition[fits])
        for measure, value in zip(MEASURES, values, strict=True):
            better = np.fmin if (measure == "condition") != self.worst else np.fmax
            better.at(self.values[measure].reshape(-1), cell, value)
        is_best = sigma[:, -1] == self.values["sigma_min"].reshape(-1)[cell]
        self.q.reshape(-1, self.n)[cell[is_best]] = seen.q[fits][is_best]
        self.count += np.bincount(cell, minlength=self.count.size).reshape(self.count.shape)

    @property
    def reached(self) -> NDArray[np.bool_]:
        """The cells that are reached, (A, B)."""
        return self.count > 0

    @property
    def edge(self) -> NDArray[np.bool_]:
        """The reached cells with a neighbor that is not, also across a corner, (A, B)."""
        padded = np.pad(self.reached, 1)
        if self.part is not None and self.part.is_round:  # the slice goes on behind the axis
            padded[0] = padded[1]
        inner = np.lib.stride_tricks.sliding_window_view(padded, (3, 3)).all(axis=(2, 3))
        return self.reached & ~inner

    @property
    def share(self) -> Array:
        """The share of each cell that is reached, (A, B): ½ at the edge."""
        return np.asarray(self.reached - 0.5 * self.edge)

    @property
    def area(self) -> float:
        """Area of the slice [m²]."""
        return float(self.share.sum() * self.steps.prod())

    @property
    def accuracy(self) -> float:
        """Largest error of the area [m²]: a half of each cell at the edge."""
        return float(0.5 * self.edge.sum() * self.steps.prod())

    @property
    def centers(self) -> list[Array]:
        """Coordinates of the cells' centers, (A,) and (B,)."""
        return [0.5 * (edges[1:] + edges[:-1]) for edges in self.edges]

    @property
    def volume(self) -> float:
        """The volume that a slice about the first axis sweeps, 2π ∫ r dA [m³]."""
        return float(2.0 * np.pi * (self.centers[0] @ self.share).sum() * self.steps.prod())


def choose_slice(arm: Arm, plane: str | None, q: Array) -> Slice:
    """Return the slice of an arm's workspace: for a planar arm its plane, else the requested one.

    Args:
        arm: The arm.
        plane: `xy`, `xz`, `yz`, `rz`: distance from the first axis and height along it; None to choose.
        q: Joint positions (n,): of joints that do not move the site, and of the first joint of `rz`.

    Raises:
        QuestionError: The site moves neither in a plane nor in space, or has no such slice.
    """
    if plane not in (None, *NAMES):
        raise QuestionError(f"--plane must be one of {', '.join(NAMES)}, got {plane!r}")
    position, J = jacobians(Task(arm, np.arange(3)), np.vstack([arm.sampled(SAMPLES), q]))
    linear, at, site = J[:, :3], position[-1], f'{arm.path}: site "{arm.site}"'
    size = np.linalg.norm(linear, axis=1).max(axis=0)
    movers = np.flatnonzero(size > RANK_TOLERANCE * max(size.max(), 1.0))
    _, sigma, directions = np.linalg.svd(np.moveaxis(linear, 1, 2).reshape(-1, 3))
    smallest = RANK_TOLERANCE * max(sigma[0], 1.0)
    rank = int(np.sum(np.linalg.svd(linear, compute_uv=False) > smallest, axis=1).max())
    if rank < 2 or rank != np.sum(sigma > smallest):
        where = {0: "nowhere", 1: "along a curve"}.get(rank, "on a curved surface")
        raise QuestionError(
            f"{site} moves {where}; a workspace needs a site that moves in a plane or in space"
        )
    if rank == 2:
        part = _plane(directions[2], at, movers)
        if plane not in (None, part.name):
            raise QuestionError(f"{site} moves in the plane {part.name}; leave out --plane, got {plane}")
        return part
    first = movers[0]
    turns = arm.comes_round[first] and np.count_nonzero(arm.motion[:, first]) == 1
    if plane == "rz" and not turns:
        what = f'needs a first joint that turns, and "{arm.joints[first]}" does not; give xy, xz or yz'
        raise QuestionError(f"{arm.path}: --plane rz {what}")
    if plane is None:
        plane = "rz" if turns else "xz"
    if plane != "rz":
        (hidden,) = {"x", "y", "z"} - {*plane}
        return _plane(np.eye(3)["xyz".index(hidden)], at, movers)
    axis = J[-1, 3:, first]
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    # The point of the axis that is nearest to the world's origin: v = z × (p − o).
    on_axis = at - np.cross(J[-1, :3, first], J[-1, 3:, first])
    labels = ("r", "z" if axis[2] > 1.0 - PARALLEL else "h")
    origin = on_axis - axis * (axis @ on_axis)
    return Slice("rz", labels, origin, np.stack([np.zeros(3), axis]), np.arange(3), movers[1:], movers)


def _plane(normal: Array, at: Array, movers: NDArray[np.intp]) -> Slice:
    """Return the plane through a point; its second axis points along the world's, or up."""
    nearest = np.argmin(np.abs(normal))
    first = np.eye(3)[nearest] - normal[nearest] * normal
    axes = np.stack([first / np.linalg.norm(first), np.cross(normal, first / np.linalg.norm(first))])
    largest = np.argmax(np.abs(axes), axis=1)
    axes[1] *= np.sign(axes[1, largest[1]])
    name = "uv"
    if np.abs(axes - np.eye(3)[largest]).max() < PARALLEL:
        axes, name = np.eye(3)[largest], "".join("xyz"[i] for i in largest)
    rows = np.delete(np.arange(3), np.argmax(np.abs(normal)))
    return Slice(name, (name[0], name[1]), normal * (normal @ at), axes, rows, movers, movers)


def nearest_singular(task: Task, part: Slice, q: Array) -> Array:
    """Return singular configurations, (K, n), near to others, (N, n), from which they are found.

    J_v(q)ᵀ u = 0 for a unit vector u, the lost direction, is a smooth system of equations for q and u even if
    J_v is not square. Its derivative by q is the `curvature`; each step is the shortest solution of the
    linearized system.
    """
    q, joints, basis = q.copy(), part.movers, np.eye(3)[part.rows]
    m, k = len(basis), len(joints)
    for _ in range(STEPS):
        J = jacobians(task, q)[1]
        linear, angular = J[:, :3][:, :, joints], J[:, 3:][:, :, joints]
        moving = linear[:, part.rows]
        u = np.linalg.svd(moving)[0][:, :, -1]
        lost = np.einsum("nmk,nm->nk", moving, u)
        system = np.zeros((len(q), k + 1, k + m))
        system[:, :k, :k] = curvature(u @ basis, linear, angular)
        system[:, :k, k:], system[:, k, k:] = np.swapaxes(moving, 1, 2), u
        wanted = -np.append(lost, np.zeros((len(q), 1)), axis=1)[..., None]
        # Solutions lie on curves and some equations are dependent: damping leaves those directions alone.
        square = system @ np.swapaxes(system, 1, 2)
        square += DAMPING * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(k + 1)
        step = (np.swapaxes(system, 1, 2) @ np.linalg.solve(square, wanted))[:, :k, 0]
        size = np.linalg.norm(step, axis=1, keepdims=True)
        q[:, joints] += step * np.minimum(1.0, LONGEST / np.maximum(size, 1e-300))
    return np.asarray(q[np.linalg.norm(lost, axis=1) < SINGULAR * np.abs(linear).max(axis=(1, 2))])


def curvature(u: Array, linear: Array, angular: Array) -> Array:
    """Return the second derivatives of the site's position along some directions, u · ∂²p/∂q_i∂q_j.

    It is u · (z_i × J_v,j) for i before j or j itself, as a joint turns all columns behind it.

    Args:
        u: Directions, (N, 3).
        linear: J_v, the joints in their order along the chain, (N, 3, k).
        angular: Their axes z, 0 of slides, (N, 3, k).

    Returns:
        Symmetric, (N, k, k).
    """
    turned = np.einsum("nci,ncj->nij", np.cross(u[:, :, None], angular, axis=1), linear)
    return np.asarray(np.triu(turned) + np.swapaxes(np.triu(turned, 1), 1, 2))


def zero_curves(
    task: Task, known: Product | None, columns: NDArray[np.intp], home: Array, joints: Sequence[int],
    edges: Sequence[Array],
) -> list[tuple[str, Array]]:  # fmt: skip
    """Return where a determinant is 0 over two joints: the vanishing factor, and configurations, (k, n).

    Args:
        task: The arm, and the rows of the determinant.
        known: Its factors; None: none are known.
        columns: The joints of the determinant.
        home: Positions of the other joints, (n,).
        joints: The two joints.
        edges: Rising positions of both. One more on each side shows curves on the border.
    """
    steps = [np.array([2.0 * e[0] - e[1], *e, 2.0 * e[-1] - e[-2]]) for e in edges]
    q = grid(home, joints, steps)
    flat = q.reshape(-1, len(home))
    J = jacobians(task, flat)[1]
    if known is None:
        value = np.linalg.det(task.turned(J, survey(task, flat).pose)[:, task.rows][..., columns])[:, None]
        value, names = value / np.abs(value).max(), ["singular"]
    else:
        value, names = known.values(J[..., columns]) / known.largest, [rule.name for rule in known.rules]
    value = np.where(np.abs(value) <= ROUNDING, 0.0, value).reshape(*q.shape[:2], -1)
    low, high = np.array([[e[0] - ROUNDING, e[-1] + ROUNDING] for e in edges]).T
    curves = []
    for i, name in enumerate(names):
        for line in contour_generator(z=value[..., i]).lines(0.0):
            along = np.tile(home, (len(line), 1))
            for joint, some, place in zip(joints, steps, np.asarray(line).T[::-1], strict=True):
                along[:, joint] = np.interp(place, np.arange(len(some)), some)
            inside = ((along[:, joints] >= low) & (along[:, joints] <= high)).all(axis=1)
            if np.count_nonzero(inside) > 1:
                curves.append((name, along[inside]))
    return curves


def grid(home: Array, joints: Sequence[int], positions: Sequence[Array]) -> Array:
    """Return all configurations with these positions of two joints, (A, B, n)."""
    q = np.tile(home, (len(positions[0]), len(positions[1]), 1))
    q[..., joints[0]], q[..., joints[1]] = positions[0][:, None], positions[1]
    return q
