"""The set of joint positions that keep a site at its goal, and the curves of which it consists.

A curve is followed by steps along the null space of A, each corrected to the goal by Newton's steps across
it. Near a point, the set M = {q: e(q) = 0} is the graph of a function over its tangent, with no other piece
of M beside it, as long as |A⁺ ΔA| < 1 for the change ΔA of A, with A⁺ of the r = n − 1 directions across the
tangent: this is the implicit function theorem for A⁺ e. A step with more than a quarter of that is halved, so
that none jumps to a piece that passes nearby.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.survey import jacobians, survey
from rmrc.law.task import Array, Task
from rmrc.simulation.inverse_kinematics import SMALL_TURN
from rmrc.support.spatial import pose_error, skew

End = Literal["closed", "limit", "singular", "open"]

# The longest step [rad, or m over L], and the shortest before a curve is given up.
LONGEST, SHORTEST = 0.1, 1e-9
# The largest |A⁺ ΔA| of a step; from a third of it on, the next step is no longer.
CHANGE, EASY = 0.25, 0.08
# Below this share of σ_1, σ_r counts as 0: the curve meets others, or ends, within 1e-6 or so.
BRANCHING = 1e-6
# The largest |e| of a point of M. Newton's steps end at rounding, 1e-15; a curve that leaves M exceeds it by
# far.
ON_SET = 1e-10
# A step is rounding if it is below this part of |x|; for e it is a hundredth of it, which A⁺ makes larger.
ROUNDING = 1e-12
# Newton's steps from a tangent to M: quadratic from 1e-2, so that four suffice.
CORRECTIONS = 6
# The distance of a joint from its limit that is rounding [rad, or m over L].
AT_LIMIT = 1e-9
# Steps in one direction: 80 rad, or m over L, where nothing ends the curve. A loop is about 10 long.
MOST_STEPS = 800


@dataclass(frozen=True, eq=False)
class Point:
    """A point of the set, in scaled joint positions x = S_q⁻¹ q.

    Attributes:
        x: Its coordinates, (n,).
        A: S_x L(φ) J S_q there, (m, n).
        inverse: Uᵀ e/σ over its r largest singular values is `inverse` @ e, (r, m).
        tangent: Unit vector of the smallest singular value of A, (n,).
        sigma: σ_r of A, the smallest across the tangent; infinite if there is none.
        largest: σ_1.
        turn: The rotation vector of the error; only some of its rows vanish where not all count, (3,).
    """

    x: Array
    A: Array
    inverse: Array
    tangent: Array
    sigma: float
    largest: float
    turn: Array


@dataclass(frozen=True, eq=False)
class Curve:
    """A one-dimensional piece of the set, without gaps.

    Attributes:
        nodes: Scaled joint positions along it, (k, n), hinges without jumps.
        ends: Types of its ends: `closed` on itself, at a `limit`, at a `singular` point, or `open`: not
            followed further.
    """

    nodes: Array
    ends: tuple[End, End]

    @property
    def length(self) -> float:
        """Length of the polygon of its nodes [rad, or m over L]."""
        return float(np.linalg.norm(np.diff(self.nodes, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """All joint positions within limits that keep the site at a goal.

    Attributes:
        task: The arm and the rows that count.
        goal: Pose of the site, (7,).
        limit: Position limits, (n, 2).
    """

    task: Task
    goal: Array
    limit: Array
    turns: NDArray[np.bool_] = field(init=False)
    low: Array = field(init=False)
    high: Array = field(init=False)

    def __post_init__(self) -> None:  # noqa: D105
        # A hinge with a whole turn or more reaches each of its directions: limits do not bound it.
        turns = self.task.arm.comes_round & ~(self.limit[:, 1] - self.limit[:, 0] < 2.0 * np.pi)
        low, high = (self.limit / self.task.joint_scale[:, None]).T
        object.__setattr__(self, "turns", turns)
        object.__setattr__(self, "low", np.where(turns, -np.inf, low))
        object.__setattr__(self, "high", np.where(turns, np.inf, high))

    def gap(self, a: Array, b: Array) -> Array:
        """Return a − b of scaled positions; unlimited hinges go the shorter way round."""
        gap = a - b
        return np.where(self.turns, gap - 2.0 * np.pi * np.round(gap / (2.0 * np.pi)), gap)

    def beyond(self, x: Array) -> NDArray[np.bool_]:
        """Return which joints are beyond a limit, (..., n)."""
        return np.asarray((x < self.low - AT_LIMIT) | (x > self.high + AT_LIMIT))

    def linear(self, x: Array, near: Array | None = None) -> tuple[Array, Array, Array]:
        """Return e (m,), the remaining error, A (m, n) = −∂e/∂x, and the rotation vector of the error.

        Args:
            x: Scaled joint positions, (n,).
            near: A rotation vector (3,); of the two vectors of the same rotation, the one nearer to this is
                used, so that e does not jump at half a turn. None: the shorter one.
        """
        task, q = self.task, x * self.task.joint_scale
        error = pose_error(self.goal, task.arm.pose(q))
        J = task.arm.jacobian(q)
        if 3 > np.count_nonzero(task.rows >= 3) > 0:
            angle = float(np.linalg.norm(error[3:]))
            if near is not None and angle > 0.5 * np.pi:
                other = error[3:] * (1.0 - 2.0 * np.pi / angle)
                if np.linalg.norm(other - near) < np.linalg.norm(error[3:] - near):
                    error[3:] = other
            J = J.copy()
            J[3:] = _inverse_right_jacobian(error[3:]) @ J[3:]
        return task.row_scale * error[task.rows], task.matrix(J), error[3:]

    def matrices(self, x: Array, threads: int | None = None) -> Array:
        """Return A at many scaled joint positions (N, n), as in `linear` without `near`, (N, m, n).

        Args:
            x: Scaled joint positions, (N, n).
            threads: None: one per core.
        """
        task, q = self.task, x * self.task.joint_scale
        J = jacobians(task, q, threads)[1]
        if 3 > np.count_nonzero(task.rows >= 3) > 0:
            turn = pose_error(self.goal, survey(task, q, threads).pose)[:, 3:]
            J[:, 3:] = _inverse_right_jacobian(turn) @ J[:, 3:]
        return task.matrix(J)

    def corrected(self, x: Array, near: Array | None = None) -> Point | None:
        """Return the point of the set that Newton's steps across the tangent reach; None if they fail.

        A has rank r = n − 1 along a curve even if the curve is singular all along, so only its r largest
        singular values are used; the rest of e must vanish with them.

        Args:
            x: Scaled joint positions, (n,).
            near: As in `linear`.
        """
        r = self.task.arm.n - 1
        for _ in range(CORRECTIONS):
            e, A, turn = self.linear(x, near)
            U, s, Vt = np.linalg.svd(A)
            if len(s) < r or (r and s[r - 1] <= 0.0):
                return None
            inverse = U[:, :r].T / s[:r, None]
            step = Vt[:r].T @ (inverse @ e)
            if np.linalg.norm(step) <= ROUNDING * (1.0 + np.linalg.norm(x) + 0.01 * np.linalg.norm(inverse)):
                if np.linalg.norm(e) > ON_SET:
                    return None
                return Point(x, A, inverse, Vt[-1], float(s[r - 1]) if r else np.inf, float(s[0]), turn)
            if np.linalg.norm(step) > LONGEST:
                return None
            x = x + step
        return None

    def curve(self, start: Array) -> Curve | None:
        """Follow the set from one of its points both ways; None if it is no curve there.

        Args:
            start: Scaled joint positions, (n,).
        """
        begin = self.corrected(start)
        if begin is None or begin.sigma <= BRANCHING * begin.largest:
            return None
        ahead, end = self._follow(begin, begin.tangent)
        if end == "closed":
            return Curve(np.array(ahead), ("closed", "closed"))
        behind, other = self._follow(begin, -begin.tangent)
        return Curve(np.array([*behind[:0:-1], *ahead]), (other, end))

    def covers(self, curve: Curve, x: Array) -> NDArray[np.bool_]:
        """Return which points of the set, (N, n), are on a curve.

        A point that is nearer to a piece of the curve than the length of that piece is on it, as M is a graph
        there.
        """
        on = np.zeros(len(x), np.bool_)
        if len(curve.nodes) == 1:
            return np.asarray((np.abs(self.gap(x, curve.nodes[0])) <= 1e-6).all(axis=1))
        for a, b in zip(curve.nodes[:-1], curve.nodes[1:], strict=True):
            left = np.flatnonzero(~on)
            if not len(left):
                break
            way = b - a
            length = float(np.linalg.norm(way))
            if length == 0.0:
                continue
            from_a = self.gap(x[left], a)
            along = from_a @ way / length
            across = np.linalg.norm(from_a - along[:, None] * way / length, axis=1)
            # The tolerance at both ends: rounding, and the accuracy of a singular point.
            slack = 1e-6 + 1e-3 * length
            on[left] = (along >= -slack) & (along <= length + slack) & (across <= 0.3 * length + 1e-6)
        return on

    def _follow(self, begin: Point, direction: Array) -> tuple[list[Array], End]:
        """Return the nodes from a point on, and the type of their end."""
        nodes, here, way, step = [begin.x], begin, direction, LONGEST / 4.0
        for _ in range(MOST_STEPS):
            if here.sigma <= BRANCHING * here.largest:
                return nodes, "singular"
            there, step = self._next(here, way, step)
            if there is None:
                return nodes, "open"
            wall = self._wall(here, way, there)
            if wall is not None:
                return [*nodes, wall], "limit"
            if len(nodes) > 2 and self._passes(here.x, there.x, begin.x):
                # The last node is the first one, shifted by whole turns.
                return [*nodes, here.x + self.gap(begin.x, here.x)], "closed"
            nodes.append(there.x)
            way = there.tangent * (1.0 if there.tangent @ way > 0.0 else -1.0)
            here = there
        return nodes, "open"

    def _next(self, here: Point, way: Array, step: float) -> tuple[Point | None, float]:
        """Return the next point, and how long the step after it may be."""
        while step >= SHORTEST:
            there = self.corrected(here.x + step * way, here.turn)
            if there is not None:
                change = np.linalg.norm(here.inverse @ (there.A - here.A))
                if change <= CHANGE and (there.x - here.x) @ way > 0.5 * step:
                    easy = change <= EASY
                    if np.linalg.norm(there.turn) > np.pi:
                        there = self.corrected(there.x) or there
                    return there, min(LONGEST, step * (1.5 if easy else 1.0))
            step *= 0.5
        return None, step

    def _wall(self, here: Point, way: Array, there: Point) -> Array | None:
        """Return the point between two at which a limit is met, or None.

        A joint can leave its range and return within a step only if its rate changes its sign; the farthest
        point of that motion is checked.
        """
        reach = float((there.x - here.x) @ way)
        if self.beyond(there.x).any():
            return self._last_within(here, way, reach)
        back = there.tangent * (1.0 if there.tangent @ way > 0.0 else -1.0)
        near = np.minimum(here.x - self.low, self.high - here.x) <= reach
        for joint in np.flatnonzero(near & (way * back < 0.0)):
            low, high = 0.0, reach
            for _ in range(30):
                middle = 0.5 * (low + high)
                point = self.corrected(here.x + middle * way)
                if point is None:
                    break
                slope = point.tangent[joint] * (1.0 if point.tangent @ way > 0.0 else -1.0)
                low, high = (middle, high) if slope * way[joint] > 0.0 else (low, middle)
                if self.beyond(point.x).any():
                    return self._last_within(here, way, middle)
        return None

    def _last_within(self, here: Point, way: Array, reach: float) -> Array:
        """Return the last point within the limits on a step that leads beyond one."""
        low, high, last = 0.0, reach, here.x
        while high - low > 1e-11:
            middle = 0.5 * (low + high)
            point = self.corrected(here.x + middle * way)
            if point is None or self.beyond(point.x).any():
                high = middle
            else:
                low, last = middle, point.x
        return last

    def _passes(self, a: Array, b: Array, x: Array) -> bool:
        """Return whether the step from a to b passes a point of the set."""
        way, from_a = b - a, self.gap(x, a)
        length = float(np.linalg.norm(way))
        along = float(from_a @ way) / length
        across = float(np.linalg.norm(from_a - along * way / length))
        return 0.0 < along <= length * (1.0 + 1e-9) and across <= 0.3 * length


def _inverse_right_jacobian(turn: Array) -> Array:
    """Return L(φ) (..., 3, 3): the rate of an error's rotation vector φ is −L(φ) ω [Sola18]."""
    angle, cross = np.linalg.norm(turn, axis=-1), skew(turn)
    half = np.maximum(0.5 * angle, SMALL_TURN)
    factor = np.where(
        0.5 * angle < SMALL_TURN,
        1.0 / 12.0 + angle * angle / 720.0,
        (1.0 - half / np.tan(half)) / (4.0 * half * half),
    )
    return np.asarray(np.eye(3) + 0.5 * cross + factor[..., None, None] * (cross @ cross))
