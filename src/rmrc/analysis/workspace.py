"""The workspace of an arm as maps of a slice, without and with joint limits.

Random configurations are examined, and more near the cells at the edge until no cell is added. A cell at the
edge is reached in a part that is not known, and counts half.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from contourpy import contour_generator
from numpy.typing import ArrayLike, NDArray

from rmrc.analysis.singularities import Product, Rule, product
from rmrc.analysis.slices import Slice, choose_slices
from rmrc.analysis.subject import Model, Packages, subject
from rmrc.analysis.survey import BLOCK, Survey, jacobians, survey
from rmrc.arm import Arm
from rmrc.law.task import Array, Task, choose
from rmrc.show.sheets import Sheet, as_markdown, number
from rmrc.simulation.footprint import LIBRARIES
from rmrc.support.errors import QuestionError
from rmrc.support.process import excess
from rmrc.support.spatial import AXES
from rmrc.support.text import brief

MEASURES = ("sigma_min", "manipulability")
FULL = np.array([-np.pi, np.pi])
# Steps of the grid of two joints on which singular curves are found, and of a curve at a limit. The grid of
# a full turn is shifted by a part of a step, so that 0 and π, where arms are singular, are not its ends.
STEPS, SHIFT = 180, 0.38
# The grid goes this far beyond the limits, to show curves on them [rad or m].
BESIDE = 1e-6
# Sampling at the edge: largest number of rounds, and number of configurations near one of every cell at the
# edge, at this distance [rad or m].
ROUNDS, NEIGHBORS, NEARBY = 12, 64, (0.2, 0.05, 0.01)
# Search for the extents: rounds, outermost configurations for each end, children of each, the first distance
# from their parents [rad or m], and its factor from round to round.
CLIMBS, PARENTS, CHILDREN, FIRST, NEARER = 40, 20, 20, 0.3, 0.7
# Measured memory of a cell, and of a block of configurations [B].
CELL, EXAMINED = 500, 80_000_000


class Curve(NamedTuple):
    """A curve in a slice that two joints determine.

    Attributes:
        name: The vanishing factor of the determinant, `singular` if no factors are known; or the limit that
            is reached: `JOINT lower`, `JOINT upper`.
        q: Configurations, (k, n) [rad or m].
        points: Their coordinates, (k, 2) [m].
    """

    name: str
    q: Array
    points: Array


@dataclass(eq=False)
class Reach:
    """The set that the site reaches in a slice: its boundary, and the best posture in each cell.

    Attributes:
        part: The slice.
        edges: Edges of the cells along both coordinates, (A + 1,) and (B + 1,) [m].
        extents: Smallest and largest value of both coordinates, (2, 2) [m].
        singular: Where the site has lost a direction, if two joints determine the slice.
        limits: Curves at the limits of these joints.
        n: Number of joints of the arm.
        steps: Sides of a cell, (2,) [m].
        values: Largest σ_min and w, each (A, B); nan where nothing is reached.
        q: The posture of that σ_min, (A, B, n) [rad or m]; nan where nothing is reached.
        reached: The cells that are reached, (A, B).
    """

    part: Slice
    edges: Sequence[Array]
    extents: Array
    singular: list[Curve]
    limits: list[Curve]
    n: int

    def __post_init__(self) -> None:
        """Begin with empty cells."""
        shape = tuple(len(edges) - 1 for edges in self.edges)
        self.steps = np.array([edges[1] - edges[0] for edges in self.edges])
        self.values = {measure: np.full(shape, np.nan) for measure in MEASURES}
        self.q, self.reached = np.full((*shape, self.n), np.nan), np.zeros(shape, np.bool_)

    def add(self, seen: Survey) -> None:
        """Add results to the cells of their coordinates."""
        at = self.part.coordinates(seen.pose[:, :3]) - [edges[0] for edges in self.edges]
        place = np.floor(at / self.steps).astype(np.int64)
        fits = ((place >= 0) & (place < self.reached.shape)).all(axis=1)
        cell, sigma = place[fits] @ [self.reached.shape[1], 1], seen.sigma[fits]
        for measure, value in zip(MEASURES, (sigma[:, -1], sigma.prod(axis=1)), strict=True):
            np.fmax.at(self.values[measure].reshape(-1), cell, value)
        is_best = sigma[:, -1] == self.values["sigma_min"].reshape(-1)[cell]
        self.q.reshape(-1, self.n)[cell[is_best]] = seen.q[fits][is_best]
        self.reached.reshape(-1)[cell] = True

    @property
    def edge(self) -> NDArray[np.bool_]:
        """The reached cells with a neighbor that is not, also across a corner, (A, B)."""
        padded = np.pad(self.reached, 1)
        if self.part.is_round:  # the slice goes on behind the axis
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


@brief
@dataclass(frozen=True)
class Workspace:
    """The answer of `workspace`.

    Attributes:
        task: The arm, and the rows whose singular values were taken.
        home: The configuration in question, (n,) [rad or m].
        part: The slice.
        families: The factors of the determinant; none if they are not known.
        free: The set that is reached without joint limits: each hinge turns fully, slides keep theirs.
        limited: The set that is reached with them.
        others: The same in other slices that show more of the arm.
    """

    task: Task
    home: Array
    part: Slice
    families: tuple[Rule, ...]
    free: Reach
    limited: Reach
    others: tuple[Workspace, ...] = ()

    def _repr_markdown_(self) -> str:
        """Return what a notebook shows of it."""
        sets = {"without limits": self.free, "with limits": self.limited}
        rows = [(name, number(each.area), number(each.accuracy)) for name, each in sets.items()]
        title = f"{self.task.arm.path.name}, site {self.task.arm.site}, slice {self.part.name}"
        return as_markdown(Sheet(title, ("reached", "area [m²]", "± [m²]"), rows))


def workspace(
    model: Model,
    plane: str | None = None,
    q: ArrayLike | None = None,
    *,
    keyframe: str | None = None,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    axes: Sequence[str] | None = None,
    task_frame: str | None = None,
    length: float | None = None,
    cells: int = 200,
    samples: int = 1_000_000,
    on_samples: Callable[[int], None] | None = None,
) -> Workspace:
    """Find the reachable set of the site, with and without joint limits, and its singularities.

    Args:
        model: An arm, an MJCF file, or a scenario.
        plane: `rz`: distance from the first axis and height; or `xy`, `xz`, `yz`: the view along the third
            axis; None: see `rmrc.analysis.slices.choose_slices`.
        q: Positions, (n,) [rad or m], of joints that do not change the slice; None: the keyframe.
        keyframe: Joint positions by name; None: the start of a scenario, or else `home`.
        site: The site in question; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.tree`.
        body: The body whose frame is in question, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        axes: Rows of the twist whose singular values are taken; None: those of a scenario, or else the linear
            ones that can move in the slice.
        task_frame: Frame of the rows: `world`, `base` or `site`; None: that of the scenario whose rows
            they are, or else `world`.
        length: Characteristic length, which makes meters and radians comparable [m]; None: that of a
            scenario, or else of the arm.
        cells: Number of cells along the longer side.
        samples: Random configurations, with limits and as many without.
        on_samples: Called with the number of configurations examined since the last call.

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: The arm has no such slice, slides without limits, or the cells do not fit into memory.

    Example:
        >>> space = workspace("models/planar_6_3.xml", cells=60)
        >>> round(space.free.area / np.pi)
        72
    """
    if cells < 2 or samples < 1:
        raise QuestionError(f"cells must be 2 or more, and samples 1 or more, got {cells} and {samples}")
    question = subject(model, q, keyframe, site, axes, length, body, packages, task_frame)
    arm, task, spaces = question.arm, question.task, []
    arm.require_open()
    if too_much := excess(LIBRARIES + EXAMINED + CELL * cells**2):
        raise QuestionError(f"--cells: {cells} need {too_much}; ask for fewer")
    for part in choose_slices(arm, plane, question.q):
        if question.axes is None:
            rows = part.rows if question.frame == "world" else range(3)
            task = choose(arm, [AXES[row] for row in rows], question.length, question.frame)
        spaces.append(_map(task, part, question.q, cells, samples, on_samples or (lambda _: None)))
    return replace(spaces[0], others=tuple(spaces[1:]))


def _map(
    task: Task, part: Slice, home: Array, cells: int, samples: int, report: Callable[[int], None]
) -> Workspace:
    """Return the workspace in a slice."""
    known, rng = product(Task(task.arm, part.rows), part.movers.tolist()), np.random.default_rng(0)
    free, limited = (Search(task, part, home, ranges, rng) for ranges in _ranges(task.arm, part))
    edges, reaches = None, list[Reach]()
    for search in (free, limited):
        singular, limits = (search.singular(known), search.limits()) if part.is_surface else ([], [])
        starts = np.concatenate([search.outermost(), *(curve.q for curve in (*singular, *limits))])
        at = search.coordinates(starts)
        edges = edges or _edges(part, at, cells)
        extents = np.stack([at.min(axis=0), at.max(axis=0)], axis=1)
        reaches.append(Reach(part, edges, extents, singular, limits, task.arm.n))
        for q in search.configurations(reaches[-1], samples, starts):
            for first in range(0, len(q), BLOCK):
                seen = survey(task, q[first : first + BLOCK])
                for reach in reaches:  # without limits it also goes where it goes with them
                    reach.add(seen)
                report(len(seen.q))
    return Workspace(task, home, part, known.rules if known else (), reaches[0], reaches[1])


@dataclass
class Search:
    """The search for the set that the site reaches within ranges of its joints.

    Attributes:
        task: The arm.
        part: The slice.
        home: Positions of the joints that do not change the coordinates, (n,).
        ranges: Lower and upper position of each joint, (n, 2).
        rng: The source of random configurations.
    """

    task: Task
    part: Slice
    home: Array
    ranges: Array
    rng: np.random.Generator

    @property
    def is_full(self) -> NDArray[np.bool_]:
        """Which joints of the slice turn fully, (k,)."""
        return np.asarray((self.ranges[self.part.joints] == FULL).all(axis=1))

    def coordinates(self, q: Array) -> Array:
        """Return the coordinates of the site at configurations, (N, 2) [m]."""
        return self.part.coordinates(jacobians(self.task, q)[0])

    def random(self, count: int) -> Array:
        """Return random configurations, (count, n)."""
        low, high = self.ranges[self.part.joints].T
        return self.placed(self.rng.uniform(low, high, (count, len(low))))

    def near(self, q: Array, count: int, spread: float) -> Array:
        """Return random configurations near others, `count` for each."""
        positions = np.repeat(q[:, self.part.joints], count, axis=0)
        moved = self.rng.normal(positions, spread)
        return self.placed(np.clip(moved, *self.ranges[self.part.joints].T))

    def outermost(self) -> Array:
        """Return configurations near the ends of both coordinates, (N, n), by random steps that shrink."""
        q = self.random(BLOCK)
        for turn in range(CLIMBS):
            order = np.argsort(self.coordinates(q), axis=0)
            best = q[np.concatenate([order[:PARENTS], order[-PARENTS:]]).ravel()]
            q = np.concatenate([best, self.near(best, CHILDREN, FIRST * NEARER**turn)])
        return np.asarray(best)

    def configurations(self, reach: Reach, samples: int, starts: Array) -> Iterator[Array]:
        """Yield starts, random configurations, and some near the edge until no cell is added.

        All that were yielded must be in the reach before the next ones are taken.
        """
        yield starts
        for first in range(0, samples, BLOCK):
            yield self.random(min(BLOCK, samples - first))
        idle = 0
        for turn in range(ROUNDS):
            before = np.count_nonzero(reach.reached)
            yield self.near(reach.q[reach.edge], NEIGHBORS, NEARBY[turn % len(NEARBY)])
            idle = idle + 1 if np.count_nonzero(reach.reached) == before else 0
            if idle == len(NEARBY):
                break

    def singular(self, known: Product | None) -> list[Curve]:
        """Return where a determinant is 0 over two joints, by the factors that are known."""
        shift = SHIFT * 2.0 * np.pi / STEPS * self.is_full[:, None]
        low, high = (self.ranges[self.part.joints] - shift).T
        places = np.linspace(low - BESIDE, high + BESIDE, STEPS + 1).T
        q = self.placed(np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, 2))
        J = jacobians(self.task, q)[1][..., self.part.movers]
        names = [rule.name for rule in known.rules] if known else ["singular"]
        values = known.values(J).T if known else np.linalg.det(J[:, self.part.rows])[None]
        return [
            self.curve(name, np.clip(np.asarray(line)[:, ::-1], low, high))
            for name, value in zip(names, values.reshape(-1, STEPS + 1, STEPS + 1), strict=True)
            for line in contour_generator(places[1], places[0], value).lines(0.0)
        ]

    def limits(self) -> list[Curve]:
        """Return the images of the edges of the ranges of two joints."""
        curves, joints = [], self.part.joints
        low, high = self.ranges[joints].T
        for i in np.flatnonzero(~self.is_full):
            for end, side in ((low[i], "lower"), (high[i], "upper")):
                positions = np.linspace(low, high, STEPS + 1)
                positions[:, i] = end
                curves.append(self.curve(f"{self.task.arm.joints[joints[i]]} {side}", positions))
        return curves

    def curve(self, name: str, positions: Array) -> Curve:
        """Return the curve of some positions of the joints of the slice, (k, 2)."""
        q = self.placed(positions)
        return Curve(name, q, self.coordinates(q))

    def placed(self, positions: Array) -> Array:
        """Return configurations, (N, n), with some positions of the joints of the slice, (N, k)."""
        q = np.tile(self.home, (len(positions), 1))
        q[:, self.part.joints] = positions
        return q


def _edges(part: Slice, points: Array, cells: int) -> list[Array]:
    """Return the edges of cells that cover points, (N, 2), along both coordinates.

    The outermost points are in the middle of a cell, which is then half reached.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    low[0] *= not part.is_round  # a half-plane begins on the axis
    edges, size = [], (high - low).max() / (cells - 1)
    for start, end, before in zip(low, high, (0.5 * (not part.is_round), 0.5), strict=True):
        count = max(1, round((end - start) / size))
        step = (end - start) / (count + 0.5 - before)
        edges.append(start + step * (np.arange(count + 2) - before))
    return edges


def _ranges(arm: Arm, part: Slice) -> tuple[Array, Array]:
    """Return lower and upper position of each joint, (n, 2), without limits and with them."""
    for joint in part.joints:
        if not arm.comes_round[joint] and not np.isfinite(arm.position_limit[joint]).all():
            raise QuestionError(
                f'{arm.path}: joint "{arm.joints[joint]}" slides without limits, so that the site '
                "can be anywhere; give it a range in the model"
            )
    turns, limited = arm.comes_round, arm.position_limit.copy()
    # A hinge with more than a turn, or with one end, reaches the same as a full turn.
    limited[turns & ~(limited[:, 1] - limited[:, 0] < 2.0 * np.pi)] = FULL
    return np.where(turns[:, None], FULL, limited), limited
