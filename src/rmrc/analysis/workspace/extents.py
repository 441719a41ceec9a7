"""The extents of a workspace: the extremes of a slice's coordinates, by climbs from curves and samples.

A coordinate is extreme where the site has lost its direction, on a singular curve, or where limits hold it,
on a limit curve. Newton's method therefore begins at the outermost of these curves and of the samples. It
ends at rounding, at joint positions that reach the extreme.
"""

from dataclasses import dataclass

import numpy as np

from rmrc.analysis.survey import jacobians
from rmrc.analysis.workspace.singular_set import curvature
from rmrc.analysis.workspace.slices import Slice
from rmrc.law.task import Array, Task

# Error of Newton's method for an extreme, and for the distance from the slice [m].
REACHED = 1e-9
# Number of steps of a climb, and the longest [rad or m]: second derivatives do not hold farther away.
STEPS, LONGEST = 60, 0.3
# A climb ends where the slope is below this part of the largest entry of J_v: the remaining height is its
# square over the second derivative.
FLAT = 1e-8
# A step that does not improve at this part of Newton's step is given up: nothing nearby is higher.
SHORTEST = 1e-3
# Of the outermost configurations, this many are examined, and this many distinct ones are starts of climbs.
OUTERMOST, CLIMBS = 400, 8
# Two that differ by less climb to the same extreme [rad or m].
ALIKE = 0.1


@dataclass(frozen=True, eq=False)
class Extent:
    """The smallest and the largest value of a coordinate.

    Attributes:
        low: Smallest value [m].
        high: Largest value [m].
        accuracy: Largest possible error of the reached values [m]; for samples it is the accuracy of the
            searches' ends, and some ends may have been missed.
        q: Joint positions that reach them, (2, n) [rad or m].
    """

    low: float
    high: float
    accuracy: float
    q: Array


@dataclass(frozen=True, eq=False)
class Hill:
    """A coordinate of a slice as a function of the joints that move the site there.

    Attributes:
        task: The arm.
        part: The slice.
        low: Lower limits of its joints, −inf for hinges that turn fully, (k,).
        high: Upper limits, (k,).
        axis: 0 or 1; for the distance from the axis of a half-plane, half its square is climbed.
        sign: 1.0 to climb to the largest, −1.0 to the smallest.
    """

    task: Task
    part: Slice
    low: Array
    high: Array
    axis: int
    sign: float

    @property
    def is_distance(self) -> bool:
        """Whether the coordinate is the distance from the first axis."""
        return self.part.is_round and self.axis == 0

    def height(self, q: Array) -> tuple[float, float]:
        """Return the height of a configuration, and its distance from the slice."""
        position = self.task.arm.pose(q)[:3]
        value = float(self.part.coordinates(position)[self.axis])
        return self.sign * (0.5 * value * value if self.is_distance else value), float(
            self.part.offset(position)
        )

    def at(self, q: Array) -> tuple[float, Array, Array, float, Array, Array]:
        """Return height, slope (k,), second derivatives (k, k), and the same of the offset from the slice."""
        part, joints = self.part, self.part.joints
        position, J = self.task.arm.pose(q)[:3], self.task.arm.jacobian(q)
        linear, angular = J[:3, joints], J[3:, joints]
        away = position - part.origin

        def second(u: Array) -> Array:
            return np.asarray(curvature(u[None], linear[None], angular[None])[0])

        if self.is_distance:
            across = away - (away @ part.axes[1]) * part.axes[1]
            side = linear - np.outer(part.axes[1], part.axes[1] @ linear)
            height, slope, bend = 0.5 * across @ across, across @ linear, side.T @ side + second(across)
        else:
            u = part.axes[self.axis]
            height, slope, bend = away @ u, u @ linear, second(u)
        off, tilt, twist = float(part.offset(position)), np.zeros(len(joints)), np.zeros_like(bend)
        if part.cuts:
            tilt, twist = part.normal @ linear, second(part.normal)
        return float(self.sign * height), self.sign * slope, self.sign * bend, off, tilt, twist

    def climb(self, q: Array) -> tuple[Array, bool]:
        """Return the end of a climb from a configuration (n,), and whether it is exact to rounding.

        Each step is Newton's for the Lagrangian of the height and the slice, upward along every direction of
        its second derivatives. Joints that are pushed beyond a limit are held, and the step is shortened
        until it improves.
        """
        joints, q = self.part.joints, q.copy()
        price = 1.0
        for _ in range(STEPS):
            height, slope, bend, off, tilt, twist = self.at(q)
            x = q[joints]
            inner = (x > self.low + REACHED) & (x < self.high - REACHED)
            weight = float(tilt[inner] @ tilt[inner])
            force = float(slope[inner] @ tilt[inner]) / weight if weight > 0.0 else 0.0
            slope, bend, price = slope - force * tilt, bend - force * twist, max(price, 2.0 * abs(force))
            free = (
                inner
                | ((x <= self.low + REACHED) & (slope > 0.0))
                | ((x >= self.high - REACHED) & (slope < 0.0))
            )
            step, left = _step(slope[free], bend[np.ix_(free, free)], tilt[free], off)
            size = max(float(np.abs(self.task.arm.jacobian(q)[:3]).max()), REACHED)
            if left <= FLAT * size * (size if self.is_distance else 1.0) and abs(off) <= 0.1 * REACHED:
                return q, True
            part = min(1.0, LONGEST / max(float(np.linalg.norm(step)), 1e-300))
            now = height - price * abs(off)
            while part > SHORTEST:
                trial = q.copy()
                trial[joints[free]] += part * step
                trial[joints] = np.clip(trial[joints], self.low, self.high)
                there, away = self.height(trial)
                if there - price * abs(away) > now:
                    break
                part *= 0.5
            else:
                # Nothing nearby is higher, to rounding.
                return q, bool(left <= 1e-6 * size and abs(off) <= REACHED)
            q = trial
        return q, False


def _step(slope: Array, bend: Array, tilt: Array, off: float) -> tuple[Array, float]:
    """Return Newton's step of the free joints back to the slice and upward, and the remaining slope."""
    if not len(slope):
        return np.zeros(0), 0.0
    weight = float(tilt @ tilt)
    along = np.eye(len(slope))
    back = np.zeros(len(slope))
    if weight > 0.0:
        back = -off / weight * tilt
        along = np.linalg.svd(tilt[None])[2][1:].T
    rest = along.T @ (slope + bend @ back)
    values, vectors = np.linalg.eigh(along.T @ bend @ along)
    if not len(values):
        return back, 0.0
    firm = np.maximum(np.abs(values), max(1e-9 * float(np.abs(values).max()), 1e-12))
    upward = vectors @ ((vectors.T @ rest) / firm)
    return back + along @ upward, float(np.linalg.norm(along.T @ slope))


def find_extents(
    task: Task, part: Slice, ranges: Array, q: Array, fine: float | None
) -> tuple[Extent, Extent]:
    """Return the extents of both coordinates of a slice.

    Args:
        task: The arm.
        part: The slice.
        ranges: Lower and upper position of each joint, (n, 2); a full turn has no bounds.
        q: Configurations in the slice within them, curves and samples, (N, n).
        fine: Largest distance of the outermost ones from the extreme, if they are dense; each within it is a
            start of a climb. None for samples, of which the outermost are.
    """
    joints = part.joints
    turns = task.arm.comes_round[joints] & ~(ranges[joints, 1] - ranges[joints, 0] < 2.0 * np.pi - REACHED)
    low, high = (np.where(turns, end, ranges[joints, i]) for i, end in enumerate((-np.inf, np.inf)))
    position = jacobians(task, q)[0]
    points = part.coordinates(position)
    found = []
    for axis in range(2):
        ends, reached, off = [], [], 0.0
        for sign in (-1.0, 1.0):
            hill = Hill(task, part, low, high, axis, sign)
            side = part.signed(position)[:, 0]
            if hill.is_distance and sign < 0.0 and side.min() <= 0.0 <= side.max():
                # A connected joint space with points on both sides of the axis also has some on it.
                value, at, accuracy = 0.0, q[np.argmin(points[:, 0])], 0.0
            else:
                value, at, accuracy = _highest(hill, q, sign * points[:, axis], fine)
            ends.append(sign * value if abs(value) > REACHED else 0.0)
            reached.append(at)
            off = max(off, accuracy)
        found.append(Extent(ends[0], ends[1], off, np.array(reached)))
    return found[0], found[1]


def _highest(hill: Hill, q: Array, height: Array, fine: float | None) -> tuple[float, Array, float]:
    """Return the largest height, its configuration, and its possible error."""
    joints = hill.part.joints
    best, at, accuracy = float(height.max()), q[np.argmax(height)], fine or REACHED
    order = np.argsort(-height, kind="stable")
    order = order[height[order] >= best - fine] if fine is not None else order[:OUTERMOST]
    climbed: list[Array] = []
    is_whole = len(order) <= 20 * OUTERMOST
    for i in order[: 20 * OUTERMOST]:
        if any(np.abs(q[i, joints] - other[joints]).max() < ALIKE for other in climbed):
            continue
        if len(climbed) == CLIMBS:
            is_whole = False
            break
        climbed.append(q[i])
    converged = True
    for start in climbed:
        end, is_fine = hill.climb(start)
        converged &= is_fine
        point = hill.part.coordinates(hill.task.arm.pose(end)[:3])
        if (
            hill.sign * point[hill.axis] > best
            and abs(hill.part.offset(hill.task.arm.pose(end)[:3])) <= REACHED
        ):
            best, at = float(hill.sign * point[hill.axis]), end
    return best, at, REACHED if converged and (is_whole or fine is None) else accuracy
