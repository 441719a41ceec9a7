"""Continua of postures: the connected pieces of the set of joint positions that reach a goal.

With one degree of freedom at a fixed site, the set consists of curves. Each is followed until it closes or
meets a limit (`rmrc.analysis.ik.self_motion`), so pieces are known to be separate. With more degrees of
freedom a chain of other postures connects two postures, each corrected to the goal. A chain proves a
connection, but a missing chain proves nothing, and the result says so.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.ik.self_motion import BRANCHING, LONGEST, Curve, SelfMotion
from rmrc.analysis.ik.solve import STEPS
from rmrc.law.task import Array
from rmrc.simulation.inverse_kinematics import search

# All searches end at rounding.
SHARP = 1e-13
# Two singular points within this distance are one [rad, or m over L]: each is known to 1e-6 or so.
SAME_POINT = 1e-4
# Where curves meet: the number of directions to try, and their distance.
AROUND, AWAY = 24, 0.03
# A singular value below this share of the largest is one more direction to try there.
NEARLY = 1e-3
# Largest numbers of curves, and of singular points, to follow.
MOST_CURVES, MOST_BRANCHES = 64, 16
# Points from which no curve can be followed, as where A is doubly singular all along: the others are linked.
MOST_FAILED = 32
# Number of postures that are linked with each other; the others are linked to one of them.
MOST_NODES = 600
# Links: largest length, number per piece and round, rounds, and halvings of one link.
FARTHEST, TRIED, ROUNDS, HALVINGS = 8.0, 4, 20, 12
# Number of the nearest linked ones to try for each of the others.
RETRIED = 12
# Between two postures this near, A must change by less than half of σ_r; where σ_r is 0 all along a set, that
# test means nothing, and they must be nearer.
NEAR, NEARER = LONGEST, 0.02
# Number of pieces with two or more degrees of freedom that are distinguished.
MOST_PIECES = 8


@dataclass(frozen=True, eq=False)
class Continuum:
    """A connected piece of the set.

    Attributes:
        members: Indices of the postures on it, ascending.
        freedom: Its dimension; 0 if limits leave only a point.
        decided: Whether it is known to be separate from all other pieces.
        nodes: More of its points, as scaled joint positions, (K, n).
    """

    members: NDArray[np.intp]
    freedom: int
    decided: bool
    nodes: Array


def find_continua(
    motion: SelfMotion, x: Array, freedom: NDArray[np.int64], threads: int | None = None
) -> list[Continuum]:
    """Return the connected pieces that postures belong to.

    Args:
        motion: The set.
        x: Points of it, scaled, none of them isolated, (N, n).
        freedom: Number of directions in which each can be moved, (N,).
        threads: None: one per core.
    """
    curves = _Curves(motion, x, freedom == 1)
    curves.follow()
    pieces = curves.pieces()
    left = np.setdiff1d(
        np.arange(len(x)), np.concatenate([np.empty(0, np.intp), *(p.members for p in pieces)])
    )
    if len(left):
        pieces += _linked(motion, x, freedom, left, threads)
    return pieces


@dataclass
class _Curves:
    """The curves of a set, found one after another from its points."""

    motion: SelfMotion
    x: Array
    wanted: NDArray[np.bool_]
    curves: list[Curve] = field(default_factory=list)
    members: list[NDArray[np.intp]] = field(default_factory=list)
    branches: list[Array] = field(default_factory=list)

    def follow(self) -> None:
        """Follow curves from all points that no curve covers yet, and from points where curves meet."""
        todo, failed = np.flatnonzero(self.wanted), 0
        while len(todo) and len(self.curves) < MOST_CURVES and failed < MOST_FAILED:
            first, known = todo[0], len(self.curves)
            if not self.add(self.x[first]):
                failed += 1
                point = self.motion.corrected(self.x[first])
                if point is not None and point.sigma <= BRANCHING * point.largest:
                    self.explore(point.x)
            todo = todo[1:]
            for curve in self.curves[known:]:
                todo = todo[~self.motion.covers(curve, self.x[todo])]
        for curve in self.curves:
            on = self.wanted & self.motion.covers(curve, self.x)
            self.members.append(np.flatnonzero(on))

    def add(self, start: Array) -> bool:
        """Follow the curve through a point, and those that meet it; return whether there is one."""
        curve = self.motion.curve(start)
        if curve is None:
            return False
        self.curves.append(curve)
        for end, at in zip(curve.ends, (0, -1), strict=True):
            if end == "singular":
                self.explore(curve.nodes[at])
        return True

    def explore(self, at: Array) -> None:
        """Follow all curves that leave a singular point, once."""
        if any(self.is_there(at, other) for other in self.branches) or len(self.branches) >= MOST_BRANCHES:
            return
        self.branches.append(at)
        for direction in _directions(self.motion, at):
            point = self.motion.corrected(at + AWAY * direction)
            if point is None or self.motion.beyond(point.x).any() or len(self.curves) >= MOST_CURVES:
                continue
            if not any(self.motion.covers(curve, point.x[None])[0] for curve in self.curves):
                self.add(point.x)

    def is_there(self, a: Array, b: Array) -> bool:
        """Whether two singular points are one."""
        return bool(np.linalg.norm(self.motion.gap(a, b)) <= SAME_POINT)

    def pieces(self) -> list[Continuum]:
        """Return the curves that are connected, where they meet, as pieces."""
        group = _Union(len(self.curves))
        meets: list[list[int]] = [[] for _ in self.branches]
        for i, curve in enumerate(self.curves):
            for end, at in zip(curve.ends, (0, -1), strict=True):
                for branch, others in zip(self.branches, meets, strict=True):
                    if end == "singular" and self.is_there(curve.nodes[at], branch):
                        others.append(i)
        for others in meets:
            for i in others[1:]:
                group.join(others[0], i)
        pieces, taken = [], np.zeros(len(self.x), np.bool_)
        for own in group.sets():
            some = [self.curves[i] for i in own]
            near = [b for b, others in zip(self.branches, meets, strict=True) if set(others) & set(own)]
            # Points that are at a crossing to rounding.
            met = np.array([any(self.is_there(x, b) for b in near) for x in self.x], np.bool_)
            members = np.setdiff1d(
                np.unique(
                    np.concatenate([*(self.members[i] for i in own), np.flatnonzero(met & self.wanted)])
                ),
                np.flatnonzero(taken),
            ).astype(np.intp)
            if not len(members):
                continue
            taken[members] = True
            long = sum(curve.length for curve in some) > SAME_POINT
            decided = all("open" not in curve.ends for curve in some)
            pieces.append(
                Continuum(members, int(long), decided, np.concatenate([curve.nodes for curve in some]))
            )
        return pieces


def _directions(motion: SelfMotion, at: Array) -> Iterable[Array]:
    """Return directions on a circle in the null space of A at a singular point."""
    _, A, _ = motion.linear(at)
    _, s, Vt = np.linalg.svd(A)
    null = Vt[int(np.count_nonzero(s > NEARLY * s[0])) :]
    if len(null) == 2:
        angles = 2.0 * np.pi * (np.arange(AROUND) + 0.5) / AROUND
        ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    else:
        ways = np.random.default_rng(0).normal(size=(2 * AROUND, len(null)))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return np.asarray(ways @ null)


class _Union:
    """Disjoint sets of numbers that merge."""

    def __init__(self, count: int) -> None:
        self.up = np.arange(count)

    def root(self, i: int) -> int:
        while self.up[i] != i:
            self.up[i] = self.up[self.up[i]]
            i = int(self.up[i])
        return i

    def join(self, i: int, j: int) -> None:
        a, b = sorted((self.root(i), self.root(j)))
        self.up[b] = a

    def roots(self) -> NDArray[np.intp]:
        return np.array([self.root(i) for i in range(len(self.up))], np.intp)

    def sets(self) -> list[NDArray[np.intp]]:
        roots = self.roots()
        return [np.flatnonzero(roots == root) for root in np.unique(roots)]


def _linked(
    motion: SelfMotion, x: Array, freedom: NDArray[np.int64], left: NDArray[np.intp], threads: int | None
) -> list[Continuum]:
    """Return pieces of points that chains of others connect."""
    pieces: list[tuple[NDArray[np.intp], int]] = []
    for own in np.unique(freedom[left]):
        some = left[freedom[left] == own]
        chains = _Chains(motion, x[some], max(0, motion.task.arm.n - int(own)), threads)
        pieces += [(some[members], int(own)) for members in chains.groups()]
    pieces.sort(key=lambda piece: (-len(piece[0]), piece[0][0]))
    few, rest = pieces[:MOST_PIECES], pieces[MOST_PIECES:]
    if rest:
        members = np.concatenate([few[-1][0], *(piece[0] for piece in rest)])
        few[-1] = (np.sort(members), few[-1][1])
    none = np.empty((0, motion.task.arm.n))
    return [Continuum(members, own, len(pieces) == 1, none) for members, own in few]


@dataclass
class _Chains:
    """Points of a set, and which of them chains of others connect.

    Attributes:
        motion: The set.
        x: The points, (N, n).
        rank: Rank of A on it.
        threads: None: one per core.
    """

    motion: SelfMotion
    x: Array
    rank: int
    threads: int | None

    def groups(self) -> list[NDArray[np.intp]]:
        """Return connected points: the nearest ones first, and only pairs of different pieces."""
        count = len(self.x)
        nodes = np.arange(count) if count <= MOST_NODES else np.linspace(0, count - 1, MOST_NODES).astype(int)
        union = _Union(count)
        size = np.linalg.norm(self.motion.gap(self.x[nodes][:, None], self.x[nodes][None]), axis=2)
        size[np.tril_indices(len(nodes))] = np.inf
        for _ in range(ROUNDS):
            piece = union.roots()[nodes]
            pairs = self._shortest(size, piece)
            if not len(pairs):
                break
            size[pairs[:, 0], pairs[:, 1]] = np.inf
            for (i, j), is_so in zip(nodes[pairs], self._connects(nodes[pairs]), strict=True):
                if is_so:
                    union.join(int(i), int(j))
        others = np.setdiff1d(np.arange(count), nodes)
        for nth in range(min(RETRIED, len(nodes))):
            roots = union.roots()
            alone = others[roots[others] == others]
            alone = alone[np.bincount(roots, minlength=count)[alone] == 1]
            if not len(alone):
                break
            away = np.linalg.norm(self.motion.gap(self.x[alone][:, None], self.x[nodes][None]), axis=2)
            pairs = np.stack([alone, nodes[np.argsort(away, axis=1)[:, nth]]], axis=1)
            for (i, j), is_so in zip(pairs, self._connects(pairs), strict=True):
                if is_so:
                    union.join(int(i), int(j))
        return union.sets()

    def _shortest(self, size: Array, piece: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the shortest links of each piece to others that were not tried yet, (K, 2)."""
        open_ = np.where(piece[:, None] != piece[None], size, np.inf)
        open_ = np.minimum(open_, open_.T)
        found = set()
        for own in np.unique(piece):
            rows = np.flatnonzero(piece == own)
            part = open_[rows]
            best = np.argpartition(part, min(TRIED, part.size - 1), axis=None)[:TRIED]
            for i, j in zip(*np.unravel_index(best, part.shape), strict=True):
                if part[i, j] <= FARTHEST:
                    found.add((min(int(rows[i]), int(j)), max(int(rows[i]), int(j))))
        return np.array(sorted(found), np.intp).reshape(-1, 2)

    def _connects(self, pairs: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return which pairs of points a chain connects, found by halving the distance between them."""
        connected = np.ones(len(pairs), np.bool_)
        edge: NDArray[np.intp] = np.arange(len(pairs))
        a = self.x[pairs[:, 0]]
        b = a + self.motion.gap(self.x[pairs[:, 1]], a)
        for _ in range(HALVINGS):
            open_ = connected[edge] & ~self._is_one(a, b)
            edge, a, b = edge[open_], a[open_], b[open_]
            if not len(edge):
                return connected
            half = 0.5 * (a + b)
            middle, reached = self._project(half)
            middle = half + self.motion.gap(middle, half)
            most = 0.75 * np.linalg.norm(b - a, axis=1)
            between = (np.linalg.norm(middle - a, axis=1) <= most) & (
                np.linalg.norm(middle - b, axis=1) <= most
            )
            connected[edge[~(reached & between)]] = False
            edge, a, b = np.tile(edge, 2), np.concatenate([a, middle]), np.concatenate([middle, b])
        connected[edge] = False
        return connected

    def _is_one(self, a: Array, b: Array) -> NDArray[np.bool_]:
        """Return which pairs of points are so near that the set is a graph over the segment between them."""
        apart = np.linalg.norm(b - a, axis=1)
        is_one: NDArray[np.bool_] = apart <= NEAR
        near = np.flatnonzero(is_one)
        if len(near) and self.rank:
            A, B = (self.motion.matrices(x[near], self.threads) for x in (a, b))
            s = np.linalg.svd(A, compute_uv=False)
            least = s[:, min(self.rank, s.shape[1]) - 1]
            flat = least <= NEARLY * s[:, 0]
            fine = np.linalg.norm(B - A, axis=(1, 2)) <= 0.5 * least
            is_one[near] = np.where(flat, apart[near] <= NEARER, fine)
        return is_one

    def _project(self, x: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return points of the set near given ones, within the limits, and which were reached."""
        motion, scale = self.motion, self.motion.task.joint_scale
        limit = np.stack([motion.low, motion.high], axis=1) * scale[:, None]
        first = np.clip(x * scale, *limit.T)
        goals, none = np.tile(motion.goal, (len(x), 1)), np.empty((0, motion.task.arm.n))
        q, error, _ = search(motion.task, limit, SHARP, STEPS["damped"], goals, first, none, self.threads)
        return q / scale, error <= 1e-9
