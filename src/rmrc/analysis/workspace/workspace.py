"""The workspace of an arm as maps: of a slice, without and with joint limits, or over two joints.

Random configurations are examined, and more near the cells at the edge until no cell is added. A cell at the
edge is reached in a part that is not known, and counts half.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.analysis.factors import Product, Rule, product
from rmrc.analysis.subject import Model, Packages, subject
from rmrc.analysis.survey import BLOCK, jacobians, survey
from rmrc.analysis.workspace import slices
from rmrc.analysis.workspace.slices import Map, Slice
from rmrc.arm import Arm
from rmrc.law.task import Array, Task, choose
from rmrc.simulation.footprint import LIBRARIES
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted
from rmrc.support.memory import excess
from rmrc.support.spatial import AXES

FULL = np.array([-np.pi, np.pi])
# Steps of the grid of two joints on which singular curves are found, and of a curve at a limit. The grid of
# a full turn is shifted by a part of a step, so that 0 and π, where arms are singular, are not its ends.
STEPS, SHIFT = 180, 0.38
# Sampling at the edge: largest number of rounds, and number of configurations near one of every cell at the
# edge, at this distance [rad or m].
ROUNDS, NEIGHBORS, NEARBY = 12, 64, (0.2, 0.05, 0.01)
# Random configurations from which singular ones are sought.
STARTS = 4000
# Search for the extents: rounds, outermost configurations for each end, children of each, the first distance
# from their parents [rad or m], and its factor from round to round.
CLIMBS, PARENTS, CHILDREN, FIRST, NEARER = 40, 20, 20, 0.3, 0.7
# Measured memory of a cell, and of a block of configurations [B].
CELL, EXAMINED = 500, 80_000_000


@dataclass(frozen=True)
class Curve:
    """A curve, or points without an order where the configurations are samples.

    Attributes:
        name: The vanishing factor of the determinant, `singular` if no factors are known; or the limit that
            is reached: `JOINT lower`, `JOINT upper`.
        q: Configurations, (k, n) [rad or m].
        points: The coordinates of the map there, (k, 2).
        within: Which of them are within the joint limits, (k,).
    """

    name: str
    q: Array
    points: Array
    within: NDArray[np.bool_]


@brief
@dataclass(frozen=True)
class Workspace:
    """The answer of `workspace`.

    Attributes:
        task: The arm, and the rows whose singular values were taken.
        home: The configuration in question, (n,) [rad or m].
        part: The slice; None: the map is over two joints.
        over: Numbers of these joints.
        free: The set that is reached without joint limits: each hinge turns fully, slides keep theirs.
        limited: The set that is reached with them. Over two joints both are the same map of their ranges.
        families: The factors of the determinant; none if they are not known.
        singular: Where the site has lost a direction, or over two joints the determinant is 0.
        limits: Curves of a surface at the limits of its joints.
    """

    task: Task
    home: Array
    part: Slice | None
    over: Sequence[int]
    free: Map
    limited: Map
    families: tuple[Rule, ...]
    singular: list[Curve]
    limits: list[Curve]

    @property
    def has_lines(self) -> bool:
        """Whether singular configurations are curves, and not samples."""
        return self.part is None or self.part.is_surface


def workspace(
    model: Model,
    plane: str | None = None,
    q: ArrayLike | None = None,
    *,
    keyframe: str | None = None,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    over: Sequence[str] | None = None,
    axes: Sequence[str] | None = None,
    task_frame: str | None = None,
    length: float | None = None,
    cells: int = 200,
    samples: int = 1_000_000,
    worst: bool = False,
    on_samples: Callable[[int], None] | None = None,
) -> Workspace:
    """Find the reachable set of the site, with and without joint limits, and its singularities.

    Over two joints it maps their ranges instead, or a turn of one that has none, with the others at rest.

    Args:
        model: An arm, an MJCF file, or a scenario.
        plane: `rz`: distance from the first axis and height; or `xy`, `xz`, `yz`: the view along the third
            axis; None: the plane of a planar arm, or else `rz` if the first joint turns, or else `xz`.
        q: Positions, (n,) [rad or m], of joints that do not move the site, or are not mapped; None: the
            keyframe.
        keyframe: Joint positions by name; None: the start of a scenario, or else `home`.
        site: The site in question; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.frames`.
        body: The body whose frame is in question, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        over: Names of two joints to map; None: a slice.
        axes: Rows of the twist whose singular values are taken; None: those of a scenario, or else the linear
            ones that can move, and over two joints all that the arm can move independently.
        task_frame: Frame of the rows: `world`, `base` or `site`; None: that of the scenario whose rows
            they are, or else `world`.
        length: Characteristic length, which makes meters and radians comparable [m]; None: that of a
            scenario, or else of the arm.
        cells: Number of cells along the longer side, or over the range of each joint.
        samples: Random configurations, with limits and as many without.
        worst: Whether to keep the worst of the postures that reach a cell instead of the best.
        on_samples: Called with the number of configurations examined since the last call.

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: The arm has no such slice or joints, slides without limits, or the cells do not fit
            into memory.

    Example:
        >>> space = workspace("models/planar_6_3.xml", cells=60)
        >>> round(space.free.area / np.pi)
        72
        >>> stretched = workspace("models/planar_2link.xml", over=["shoulder", "elbow"], cells=40)
        >>> len(stretched.singular)  # theta_2 = 0
        1
    """
    question = subject(model, q, keyframe, site, axes, length, body, packages, task_frame)
    arm, home, report = question.arm, question.q, on_samples or (lambda _: None)
    arm.require_open()
    if too_much := excess(LIBRARIES + EXAMINED + CELL * cells**2):
        raise QuestionError(f"--cells: {cells} need {too_much}; ask for fewer")
    if over is not None:
        return _over(question.task, home, [name.strip() for name in over], cells, report)
    part, task = slices.choose_slice(arm, plane, home), question.task
    if question.axes is None:
        rows = part.rows if question.frame == "world" else range(3)
        task = choose(arm, [AXES[row] for row in rows], question.length, question.frame)
    return Search(task, part, home, report).run(cells, samples, worst)


def _over(
    task: Task, home: Array, names: Sequence[str], cells: int, report: Callable[[int], None]
) -> Workspace:
    """Map the ranges of two joints."""
    arm = task.arm
    if len(set(names)) != 2 or len(names) != 2 or not set(names) <= set(arm.joints):
        raise QuestionError(
            f"--over must name two different joints of {', '.join(arm.joints)}; got {quoted(','.join(names))}"
        )
    joints = [arm.joints.index(name) for name in names]
    edges = [np.linspace(low, high, cells + 1) for low, high in _ranges(arm, joints)[1][joints]]
    result = Map(edges, arm.n, lambda seen: seen.q[:, joints])
    _look(task, slices.grid(home, joints, result.centers).reshape(-1, arm.n), [result], report)
    known, singular = product(task), []
    if len(task.rows) == arm.n:
        lines = slices.zero_curves(task, known, np.arange(arm.n), home, joints, edges)
        singular = [Curve(name, line, line[:, joints], np.ones(len(line), bool)) for name, line in lines]
    return Workspace(task, home, None, joints, result, result, known.rules if known else (), singular, [])


@dataclass
class Search:
    """The search for the workspace in a slice.

    Attributes:
        task: The arm, and the rows whose singular values are taken.
        part: The slice.
        home: Positions of the joints that do not change the coordinates, (n,).
        report: Called with the number of configurations examined since the last call.
        rng: The source of random configurations.
    """

    task: Task
    part: Slice
    home: Array
    report: Callable[[int], None]
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def run(self, cells: int, samples: int, worst: bool) -> Workspace:
        """Return the workspace."""
        task, part, arm = self.task, self.part, self.task.arm
        known = product(Task(arm, part.rows), part.movers.tolist())
        both = _ranges(arm, part.joints.tolist())
        singular = self.singular(known, *both)
        every = np.concatenate([self.home[None, :][:0], *(curve.q for curve in singular)])
        lost = [self.wrapped(every, ranges)[self.inside(every, ranges)] for ranges in both]
        starts = [np.concatenate([self.outermost(ranges), q]) for ranges, q in zip(both, lost, strict=True)]
        edges = self.edges(self.coordinates(starts[0]), cells)
        maps = [Map(edges, arm.n, lambda seen: part.coordinates(seen.pose[:, :3]), part, worst) for _ in both]
        for i, ranges in enumerate(both):
            at = self.coordinates(starts[i])
            maps[i].extents = np.stack([at.min(axis=0), at.max(axis=0)], axis=1)
            self.sample(maps[: i + 1], ranges, samples, starts[i])
        families = known.rules if known else ()
        return Workspace(
            task, self.home, part, (), maps[0], maps[1], families, singular, self.limits(both[1])
        )

    def coordinates(self, q: Array) -> Array:
        """Return the coordinates of the site at configurations, (N, 2) [m]."""
        return self.part.coordinates(jacobians(self.task, q)[0])

    def wrapped(self, q: Array, ranges: Array) -> Array:
        """Return configurations with each hinge in the turn that begins at its lower end, to rounding."""
        low = ranges[:, 0] - slices.ROUNDING
        return np.where(self.task.arm.comes_round, low + (q - low) % (2.0 * np.pi), q)

    def inside(self, q: Array, ranges: Array) -> NDArray[np.bool_]:
        """Return which configurations are within ranges, to rounding; a hinge may be off by a turn."""
        q, (low, high) = self.wrapped(q, ranges)[:, self.part.joints], ranges[self.part.joints].T
        return np.asarray(((q >= low - slices.ROUNDING) & (q <= high + slices.ROUNDING)).all(axis=1))

    def random(self, ranges: Array, count: int) -> Array:
        """Return random configurations within ranges, (count, n)."""
        q, joints = np.tile(self.home, (count, 1)), self.part.joints
        q[:, joints] = self.rng.uniform(ranges[joints, 0], ranges[joints, 1], (count, len(joints)))
        return q

    def near(self, q: Array, count: int, spread: float, ranges: Array) -> Array:
        """Return random configurations near others and within ranges, `count` for each."""
        q, joints = np.repeat(q, count, axis=0), self.part.joints
        q[:, joints] += self.rng.normal(0.0, spread, (len(q), len(joints)))
        q[:, joints] = np.clip(q[:, joints], *ranges[joints].T)
        return q

    def outermost(self, ranges: Array) -> Array:
        """Return configurations near the ends of both coordinates, (N, n), by random steps that shrink."""
        q = self.random(ranges, BLOCK)
        for turn in range(CLIMBS):
            order = np.argsort(self.coordinates(q), axis=0)
            best = q[np.concatenate([order[:PARENTS], order[-PARENTS:]]).ravel()]
            q = np.concatenate([best, self.near(best, CHILDREN, FIRST * NEARER**turn, ranges)])
        return np.asarray(best)

    def edges(self, points: Array, cells: int) -> list[Array]:
        """Return the edges of cells that cover points, (N, 2), along both coordinates.

        The outermost points are in the middle of a cell, which is then half reached.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        low[0] *= not self.part.is_round  # a half-plane begins on the axis
        edges, size = [], (high - low).max() / (cells - 1)
        for start, end, before in zip(low, high, (0.5 * (not self.part.is_round), 0.5), strict=True):
            count = max(1, round((end - start) / size))
            step = (end - start) / (count + 0.5 - before)
            edges.append(start + step * (np.arange(count + 2) - before))
        return edges

    def singular(self, known: Product | None, free: Array, limited: Array) -> list[Curve]:
        """Return where the site has lost a direction: curves of a surface, or samples."""
        task, part = Task(self.task.arm, self.part.rows), self.part
        if part.is_surface:
            shift = SHIFT * 2.0 * np.pi / STEPS * task.arm.comes_round
            edges = [np.linspace(free[i, 0], free[i, 1], STEPS + 1) - shift[i] for i in part.joints.tolist()]
            lines = slices.zero_curves(task, known, part.movers, self.home, part.joints.tolist(), edges)
        else:
            q = slices.nearest_singular(task, part, self.random(free, STARTS))
            lines = [("singular", q[self.inside(q, free)])]
        return [Curve(name, q, self.coordinates(q), self.inside(q, limited)) for name, q in lines]

    def limits(self, limited: Array) -> list[Curve]:
        """Return the images of the edges of the joints' ranges, of a surface."""
        curves, joints = [], self.part.joints
        for joint, other in zip(joints, joints[::-1], strict=True) if self.part.is_surface else ():
            for end, word in zip(limited[joint], ("lower", "upper"), strict=True):
                if not np.array_equal(limited[joint], FULL):
                    q = np.tile(self.home, (STEPS + 1, 1))
                    q[:, joint], q[:, other] = (
                        end,
                        np.linspace(limited[other, 0], limited[other, 1], STEPS + 1),
                    )
                    name = f"{self.task.arm.joints[joint]} {word}"
                    curves.append(Curve(name, q, self.coordinates(q), np.ones(len(q), bool)))
        return curves

    def sample(self, maps: Sequence[Map], ranges: Array, samples: int, more: Array) -> None:
        """Add random configurations to maps, and some near the edge of the last until no cell is added."""
        last, idle = maps[-1], 0
        _look(self.task, more, maps, self.report)
        for first in range(0, samples, BLOCK):
            _look(self.task, self.random(ranges, min(BLOCK, samples - first)), maps, self.report)
        for turn in range(ROUNDS):
            before = np.count_nonzero(last.count)
            q = self.near(last.q[last.edge], NEIGHBORS, NEARBY[turn % len(NEARBY)], ranges)
            _look(self.task, q, maps, self.report)
            idle = idle + 1 if np.count_nonzero(last.count) == before else 0
            if idle == len(NEARBY):
                break


def _look(task: Task, q: Array, maps: Iterable[Map], report: Callable[[int], None]) -> None:
    """Examine configurations, block by block, and add what is seen to maps."""
    for first in range(0, len(q), BLOCK):
        seen = survey(task, q[first : first + BLOCK])
        for some in maps:
            some.add(seen)
        report(len(seen.q))


def _ranges(arm: Arm, joints: Sequence[int]) -> tuple[Array, Array]:
    """Return lower and upper position of each joint, (n, 2), without limits and with them."""
    for joint in joints:
        if not arm.comes_round[joint] and not np.isfinite(arm.position_limit[joint]).all():
            raise QuestionError(
                f'{arm.path}: joint "{arm.joints[joint]}" slides without limits, so that the site '
                "can be anywhere; give it a range in the model"
            )
    turns, limited = arm.comes_round, arm.position_limit.copy()
    # A hinge with more than a turn, or with one end, reaches the same as a full turn.
    limited[turns & ~(limited[:, 1] - limited[:, 0] < 2.0 * np.pi)] = FULL
    return np.where(turns[:, None], FULL, limited), limited
