"""The search for a workspace, for arms that are a surface in their slice, and for all others.

A planar arm of two joints, or an arm of three in a half-plane about its first axis, is a surface: two joint
positions determine two coordinates, and the image of a grid is followed exactly, with its folds. Any other
arm is sampled, and the cells at the edge of the results are sampled more until no cell is added.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.factors import Product, product
from rmrc.analysis.survey import BLOCK, Survey, jacobians, survey
from rmrc.analysis.workspace.extents import OUTERMOST, find_extents
from rmrc.analysis.workspace.folds import covering, zero_curves
from rmrc.analysis.workspace.reach import Curve, Found, Reach, Workspace
from rmrc.analysis.workspace.singular_set import nearest_singular
from rmrc.analysis.workspace.slices import Slice
from rmrc.analysis.workspace.worst_points import STARTS as POSTURE_STARTS
from rmrc.analysis.workspace.worst_points import find_ends
from rmrc.arm import Arm
from rmrc.law.task import Array, Task
from rmrc.support.errors import QuestionError

# Steps of a surface's grid over a full turn, or over a slide, per cell: half a degree with 200 cells, whose
# chords deviate from its arcs by 1e-5 of their radius, a hundredth of a cell. And the least number of steps.
STEPS_A_CELL, FEWEST = 3.6, 180
# The grid of a full turn is shifted by this part of a step, so that 0 and π, where arms are singular, are
# neither its nodes nor its ends.
SHIFT = 0.381966
# Distance of a joint from its limit at which it is there [rad or m].
ROUNDING = 1e-9
# Number of random configurations from which singular ones are sought, unless these are curves on a surface.
STARTS = 4000
# The same number for each limit of each joint.
STARTS_AT_LIMIT = 600
# Sampling around the edge: largest number of rounds, and number of configurations near one of every cell at
# the edge, at this distance [rad or m].
ROUNDS, NEIGHBORS, NEARBY = 12, 64, (0.2, 0.05, 0.01)


def steps_of_grid(cells: int) -> int:
    """Return the steps of a surface's grid over a full turn."""
    return max(FEWEST, round(STEPS_A_CELL * cells))


@dataclass
class Search:
    """The common data of the steps of one computation."""

    arm: Arm
    task: Task
    part: Slice
    home: Array
    worst: bool
    on_samples: Callable[[int], None]
    total: int = 0

    def survey(self, q: Array) -> Iterator[Survey]:
        """Yield the results at configurations, block by block."""
        for first in range(0, len(q), BLOCK):
            self.did(min(BLOCK, len(q) - first))
            yield survey(self.task, q[first : first + BLOCK])

    def did(self, count: int) -> None:
        """Count examined configurations."""
        self.total += count
        self.on_samples(count)

    def follow_surface(self, free: Array, own: Array, cells: int) -> Workspace:
        """Follow the image of two joints' ranges: `free` without and `own` with limits, (n, 2)."""
        turns = free[self.part.joints] != own[self.part.joints]
        nodes_free = [self.nodes(joint, free, cells) for joint in self.part.joints]
        nodes_own = [
            self.nodes(joint, own, cells) if limited else nodes
            for joint, nodes, limited in zip(self.part.joints, nodes_free, turns.any(axis=1), strict=True)
        ]
        at, value = self.image(nodes_free, with_determinant=True)
        origin, size, shape = self.cells([at.reshape(-1, 2)], cells)
        reaches, images_own = [], self.image(nodes_own)[0]
        for nodes, images in ((nodes_free, at), (nodes_own, images_own)):
            found = Found(self.task, shape, self.worst)
            mirror = [1.0, -1.0] if self.part.is_round and np.isfinite(self.part.axes[0]).all() else [1.0]
            for sign in mirror:
                places, where = covering(images * [sign, 1.0], origin, size, shape)
                q = np.tile(self.home, (len(places), 1))
                for joint, steps, column in zip(self.part.joints, nodes, where.T, strict=True):
                    q[:, joint] = np.interp(column, np.arange(len(steps)), steps)
                for first, block in zip(range(0, len(q), BLOCK), self.survey(q), strict=True):
                    found.add(places[first : first + BLOCK], block)
            reaches.append(found.reach(size, postures=True))
        singular = tuple(self.singular_curves(nodes_free, value, own))
        limits = tuple(self.limit_curves(nodes_own, own))
        for i, (nodes, images, ranges) in enumerate(((nodes_free, at, free), (nodes_own, images_own, own))):
            outer, step = self.outermost(nodes, images), max(float(np.diff(one).max()) for one in nodes)
            # Between nodes a step h apart a coordinate is within D h²/2 of theirs where it is extreme, with D
            # the largest distance of the site from a joint, which bounds its second derivatives.
            farthest = float(np.linalg.norm(jacobians(self.task, outer)[1][:, :3], axis=1).max())
            fine = 0.5 * farthest * step * step
            reaches[i] = self.bounded(reaches[i], ranges, i, singular, limits, outer, fine, origin)
        return self.finish(origin, size, shape, reaches, singular, limits)

    def outermost(self, nodes: list[Array], images: Array) -> Array:
        """Return the nodes of a grid whose images have extreme coordinates, (K, n)."""
        flat, chosen = images.reshape(-1, 2), []
        for axis in range(2):
            values = (flat[:, axis], -flat[:, axis], np.abs(flat[:, axis]))
            chosen += [np.argpartition(v, min(OUTERMOST, len(v) - 1))[:OUTERMOST] for v in values]
        some = np.unique(np.concatenate(chosen))
        where = np.unravel_index(some, images.shape[:2])
        q = np.tile(self.home, (len(some), 1))
        for joint, steps, index in zip(self.part.joints, nodes, where, strict=True):
            q[:, joint] = steps[index]
        return q

    def bounded(
        self, reach: Reach, ranges: Array, has_limits: int, singular: tuple[Curve, ...],
        limits: tuple[Curve, ...], more: Array, fine: float | None, origin: Array,
    ) -> Reach:  # fmt: skip
        """Return the reached set with its extents and the ends of σ_min, w and κ.

        Args:
            reach: The cells.
            ranges: Ranges of the joints, (n, 2).
            has_limits: 1 if they are the joints' own, else 0.
            singular: Singular curves.
            limits: Curves at the limits.
            more: Other configurations to climb from, (K, n).
            fine: How far these can be off, where they are dense; None for samples.
            origin: Lower corner of the cells, (2,).
        """
        part = self.part
        on = [more[:0], *(c.q[self.inside(c.q, ranges)] for c in singular)]
        on += [c.q[c.within] for c in limits if has_limits]
        curves = self.wrapped(np.concatenate(on), ranges)
        if not len(curves) + len(more):
            return reach
        if part.is_round:  # the position of the first joint does not matter
            curves[:, part.movers[0]] = self.home[part.movers[0]]
        extents = find_extents(self.task, part, ranges, np.concatenate([curves, more]), fine)
        # Extremes are on one of the curves, or at some of their ends.
        curves = np.concatenate([*(extent.q for extent in extents), curves])
        turns = self.arm.comes_round & ~(ranges[:, 1] - ranges[:, 0] < 2.0 * np.pi - ROUNDING)
        limit = np.where(turns[:, None], [-np.inf, np.inf], ranges)
        if part.is_round:
            limit[part.movers[0]] = [-np.inf, np.inf]
        edges = tuple(origin[i] + reach.size * np.arange(reach.reached.shape[i] + 1) for i in range(2))
        starts = self.random(np.random.default_rng(1), ranges, POSTURE_STARTS)
        ends, source = find_ends(
            self.task, part, limit, reach, self.worst, curves, starts, (edges[0], edges[1])
        )
        return replace(reach, extents=extents, ends=ends, source=source)

    def nodes(self, joint: int, ranges: Array, cells: int) -> Array:
        """Return the grid's positions of a joint."""
        low, high = ranges[joint]
        part = min(1.0, (high - low) / (2.0 * np.pi)) if self.arm.comes_round[joint] else 1.0
        steps = max(2, int(np.ceil(part * steps_of_grid(cells))))
        is_full = self.arm.comes_round[joint] and part == 1.0
        return np.linspace(low, high, steps + 1) - (SHIFT * (high - low) / steps if is_full else 0.0)

    def image(self, nodes: list[Array], with_determinant: bool = False) -> tuple[Array, Array]:
        """Return images of the grid's nodes, (A, B, 2), and the determinant there."""
        first, second = self.part.joints
        at, value = np.empty((len(nodes[0]), len(nodes[1]), 2)), np.empty((len(nodes[0]), len(nodes[1])))
        rows = max(1, BLOCK // len(nodes[1]))
        for begin in range(0, len(nodes[0]), rows):
            some = slice(begin, begin + rows)
            q = np.tile(self.home, (*value[some].shape, 1))
            q[..., first], q[..., second] = nodes[0][some, None], nodes[1]
            points, J = jacobians(self.task, q.reshape(-1, self.arm.n))
            at[some] = self.part.signed(points).reshape(at[some].shape)
            if with_determinant:
                own = self.part.basis @ J[:, :3][:, :, self.part.movers]
                value[some] = np.linalg.det(own).reshape(value[some].shape)
            self.did(len(points))
        return at, value

    def singular_curves(self, nodes: list[Array], value: Array, own: Array) -> Iterator[Curve]:
        """Yield the curves along which the determinant changes its sign, refined."""
        for places in zero_curves(value):
            q = np.tile(self.home, (len(places), 1))
            for joint, steps, column in zip(self.part.joints, nodes, places.T, strict=True):
                q[:, joint] = np.interp(column, np.arange(len(steps)), steps)
            q, found = nearest_singular(self.task, self.part, q, self.part.movers)
            if self.part.is_round:  # the position of the first joint does not matter
                q[:, self.part.movers[0]] = self.home[self.part.movers[0]]
            yield self.curve("singular", q[found], own)

    def limit_curves(self, nodes: list[Array], own: Array) -> Iterator[Curve]:
        """Yield the images of the edges of the joints' ranges."""
        for joint, end, word in self.ends(own):
            i = int(np.flatnonzero(self.part.joints != joint)[0])
            q = np.tile(self.home, (len(nodes[i]), 1))
            q[:, joint], q[:, self.part.joints[i]] = own[joint, end], nodes[i]
            yield self.curve(f"{self.arm.joints[joint]} {word}", q, own)

    def sampled(self, free: Array, own: Array, cells: int, samples: int) -> Workspace:
        """Examine random configurations: within `free` without and within `own` with limits, (n, 2)."""
        part, rng = self.part, np.random.default_rng(0)
        starts = self.in_slice(self.random(rng, free, STARTS), free, rng)
        if not len(starts):
            x, y, z = part.origin
            raise QuestionError(
                f"the site does not come into the slice {part.name} through ({x:g}, {y:g}, {z:g}); "
                "give another point with --through"
            )
        q, found = nearest_singular(self.task, part, starts, part.movers)
        q = self.wrapped(q, free)
        singular = self.curve("singular", q[found & self.inside(q, free)], own)
        origin, size, shape = self.cells(
            [part.coordinates(jacobians(self.task, starts)[0]), singular.points], cells
        )
        both = [Found(self.task, shape, self.worst) for _ in range(2)]
        for known, ranges in zip(both, (free, own), strict=True):
            mine = singular.q[singular.within] if ranges is own else singular.q
            self.look(known, self.wrapped(mine, ranges), origin, size)
            for first in range(0, samples, BLOCK):
                q = self.random(rng, ranges, min(BLOCK, samples - first))
                self.look(known, self.in_slice(q, ranges, rng), origin, size)
            self.grow(known, ranges, origin, size, rng)
        both[0].include(both[1])  # the set within the limits is a part of the set without
        reaches = [known.reach(size, postures=False) for known in both]
        limits = tuple(self.limit_points(own, rng))
        for i, ranges in enumerate((free, own)):
            outer = reaches[i].q[reaches[i].reached]
            reaches[i] = self.bounded(reaches[i], ranges, i, (singular,), limits, outer, None, origin)
        return self.finish(origin, size, shape, reaches, (singular,), limits)

    def limit_points(self, own: Array, rng: np.random.Generator) -> Iterator[Curve]:
        """Yield bounding points of each joint's limits: there it stays, and the others alone are singular."""
        for joint, end, word in self.ends(own):
            q = self.random(rng, own, STARTS_AT_LIMIT)
            q[:, joint] = own[joint, end]
            others = self.part.movers[self.part.movers != joint]
            q, found = nearest_singular(self.task, self.part, q, others)
            yield self.curve(f"{self.arm.joints[joint]} {word}", q[found & self.inside(q, own)], own)

    def ends(self, own: Array) -> Iterator[tuple[int, int, str]]:
        """Yield the limits of the joints: joint, 0 or 1, and its word."""
        for joint in self.part.joints:
            if not self.arm.comes_round[joint] or own[joint, 1] - own[joint, 0] < 2.0 * np.pi:
                yield from ((int(joint), end, word) for end, word in enumerate(("lower", "upper")))

    def random(self, rng: np.random.Generator, ranges: Array, count: int) -> Array:
        """Return random configurations within ranges, with joints that do not matter at rest."""
        q = np.tile(self.home, (count, 1))
        joints = self.part.joints
        q[:, joints] = rng.uniform(ranges[joints, 0], ranges[joints, 1], (count, len(joints)))
        return q

    def inside(self, q: Array, ranges: Array) -> NDArray[np.bool_]:
        """Return which configurations are within ranges, to rounding; a hinge may be off by a turn."""
        joints = self.part.joints
        low, high = ranges[joints].T
        positions = self.wrapped(q, ranges)[:, joints]
        return np.asarray(((positions >= low - ROUNDING) & (positions <= high + ROUNDING)).all(axis=1))

    def wrapped(self, q: Array, ranges: Array) -> Array:
        """Return configurations with each hinge in the turn that begins at its lower end, to rounding."""
        low = np.where(self.arm.comes_round, ranges[:, 0], 0.0)
        return np.where(self.arm.comes_round, low - ROUNDING + (q - low + ROUNDING) % (2.0 * np.pi), q)

    def in_slice(self, q: Array, ranges: Array, rng: np.random.Generator) -> Array:
        """Return the configurations, each with one joint moved to bring the site into the plane, if possible.

        With the others at rest the distance to the plane is f + a (cos δ − 1) + b sin δ for a hinge, and
        f + b δ for a slide, where b is the normal's part of the joint's column J_v, and a that of J_v × z.
        """
        part = self.part
        if not part.cuts:
            return q
        position, J = jacobians(self.task, q)
        which = part.movers[rng.integers(len(part.movers), size=len(q))]
        column = J[np.arange(len(q)), :, which]
        f, b = part.offset(position), column[:, :3] @ part.normal
        a = np.cross(column[:, :3], column[:, 3:]) @ part.normal
        # cos(δ − φ) = (a − f)/√(a² + b²), with tan φ = b/a.
        with np.errstate(divide="ignore", invalid="ignore"):
            turned = np.arctan2(b, a) + rng.choice([-1.0, 1.0], len(q)) * np.arccos((a - f) / np.hypot(a, b))
            slid = -f / b
        change = np.where(self.arm.is_slide[which], slid, turned)
        # neither circle nor line
        change[((self.arm.motion != 0.0).sum(axis=0) > 1)[which]] = np.nan
        moved = q.copy()
        moved[np.arange(len(q)), which] += change
        moved = self.wrapped(moved[np.isfinite(change)], ranges)
        return moved[self.inside(moved, ranges)]

    def look(self, known: Found, q: Array, origin: Array, size: float) -> None:
        """Examine configurations and add the results to their cells."""
        for found in self.survey(q):
            places = np.floor((self.part.coordinates(found.pose[:, :3]) - origin) / size).astype(np.int64)
            fits = ((places >= 0) & (places < known.shape)).all(axis=1)
            kept = Survey(found.q[fits], found.pose[fits], found.sigma[fits])
            known.add(places[fits, 0] * known.shape[1] + places[fits, 1], kept)

    def grow(self, known: Found, ranges: Array, origin: Array, size: float, rng: np.random.Generator) -> None:
        """Examine configurations near those at the edge of the results, until no cell is added."""
        joints, without = self.part.joints, 0
        for turn in range(ROUNDS):
            before = int(np.count_nonzero(known.count))
            reached = np.pad((known.count > 0).reshape(known.shape), 1)
            inner = reached[2:, 1:-1] & reached[:-2, 1:-1] & reached[1:-1, 2:] & reached[1:-1, :-2]
            edge = np.flatnonzero((reached[1:-1, 1:-1] & ~inner).ravel())
            q = np.repeat(known.q[edge], NEIGHBORS, axis=0)
            q[:, joints] += rng.normal(0.0, NEARBY[turn % len(NEARBY)], (len(q), len(joints)))
            q[:, joints] = np.clip(q[:, joints], ranges[joints, 0], ranges[joints, 1])
            self.look(known, self.in_slice(q, ranges, rng), origin, size)
            without = without + 1 if int(np.count_nonzero(known.count)) == before else 0
            if without == len(NEARBY):
                break

    def cells(self, points: list[Array], cells: int) -> tuple[Array, float, tuple[int, int]]:
        """Return lower corner, side and number of cells around points.

        The outermost points are in the middle of a cell, which is then half reached. On the border of two
        cells they would belong to the outer one as well, and the area would be too large by both.
        """
        every = np.concatenate(points)
        low, high = every.min(axis=0), every.max(axis=0)
        if self.part.is_round:
            far = np.abs(every[:, 0]).max()
            low[0], high[0] = 0.0, far
        size = float((high - low).max()) / (cells - 1)
        low = low - 0.5 * size
        if self.part.is_round:
            low[0] = 0.0
        shape = np.floor((high - low) / size).astype(int) + 1
        return low, size, (int(shape[0]), int(shape[1]))

    def curve(self, label: str, q: Array, own: Array) -> Curve:
        """Return a curve of configurations."""
        points = self.part.coordinates(jacobians(self.task, q)[0]) if len(q) else np.empty((0, 2))
        return Curve(label, q, points, self.inside(q, own))

    def finish(
        self, origin: Array, size: float, shape: tuple[int, int], reaches: list[Reach],
        singular: tuple[Curve, ...], limits: tuple[Curve, ...],
    ) -> Workspace:  # fmt: skip
        """Return all results."""
        a, b = (origin[i] + size * np.arange(shape[i] + 1) for i in range(2))
        known = product(Task(self.arm, self.part.rows), self.part.movers.tolist())
        if known is not None:
            singular = tuple(replace(curve, family=self.families(known, curve.q)) for curve in singular)
        links = self.part.coordinates(_links(self.arm, self.home))
        return Workspace(
            self.task,
            self.part,
            a,
            b,
            reaches[0],
            reaches[1],
            singular,
            () if known is None else known.rules,
            limits,
            self.home,
            links,
            self.worst,
            self.total,
        )

    def families(self, known: Product, q: Array) -> NDArray[np.intp]:
        """Return the number of the factor that vanishes at each of some singular configurations, (k,)."""
        return known.nearest(jacobians(self.task, q)[1][:, :, self.part.movers])


def _links(arm: Arm, q: Array) -> Array:
    """Return the origins of the bodies along the arm from the world to the site, (k, 3)."""
    poses, _ = arm.frames(arm.configuration(q)[None])
    chain, body = [], int(arm.wiring.body)
    while body > 0:
        chain.append(poses[0, body, :3])
        body = int(arm.model.body_parentid[body])
    return np.array([*chain[::-1], arm.pose(q)[:3]])
