"""Numbers of a scenario from the arm alone: rate limits, damping, speed, and the nearest singularity.

L, ε and λ are those of a law where nobody gives them, see `rmrc.arm.geometry`; ε is at most half of the
σ_min at the start. The speed s is 0.8 ε r: joint rates are at most s/ε, so that the feedback has a fifth of
the rate limits r to itself.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.survey import survey
from rmrc.arm import Arm
from rmrc.arm.geometry import damping_below, tidy
from rmrc.law.task import Array, Task, choose
from rmrc.support.errors import QuestionError
from rmrc.support.text import quoted

# Rate of a hinge whose model gives none [rad/s]: the order of magnitude for arms as large as a person's.
ASSUMED_RATE = 2.0
# σ_min at the start over ε, so that the law does not damp there.
CLEAR = 2.0
# Distance to keep from limits, as a share of the range.
MARGIN = 0.02
# Steps of a descent, each at most this long [rad]: over longer ones the slope of σ_min is not constant.
STEPS, LONGEST = 60, 0.2
# A configuration is singular if σ_min is this share of the largest σ.
SINGULAR = 1e-6
# Starts of descents: this many positions of each joint alone, and this many random ones around.
SCANNED, DRAWN = 36, 128
# Largest distance of the random ones [rad].
AROUND = 1.0
# Step of a difference as a share of σ_min, and its bounds [rad]: rounding is 1e-16 of σ₁ over it.
SHARE, SHORTEST, FINEST = 0.01, 1e-6, 1e-9


@dataclass(frozen=True, eq=False)
class Scales:
    """The scales of an arm.

    Attributes:
        task: Rows that the arm can move independently, with its length.
        rate: Limits, (n,) [rad/s or m/s].
        is_assumed: Which of them the model does not give, (n,).
        lower: Positions that are clear of the limits, (n,); -inf without one.
        upper: Likewise; inf without one.
    """

    task: Task
    rate: Array
    is_assumed: NDArray[np.bool_]
    lower: Array
    upper: Array

    @cached_property
    def below(self) -> float:
        """ε; 0 if the joints do not move the site."""
        return damping_below(self.task.usual_sigma)

    @property
    def size(self) -> float:
        """The length of its motions [m]: L, or the rms distance of the site where L is only a unit."""
        is_linear = self.task.rows[-1] < 3
        return self.task.arm.proportions.distance if is_linear else self.task.length

    @property
    def slowest(self) -> float:
        """Smallest rate limit, sliding joints over L [rad/s]."""
        return float((self.rate / self.task.joint_scale).min())

    def sigma_at(self, q: Array) -> float:
        """Return σ_min at joint positions (n,)."""
        return float(survey(self.task, q[None]).sigma[0, -1])

    def listed(self, q: Array) -> str:
        """Return joint positions (n,) in words."""
        parts = zip(self.task.arm.joints, q, self.task.arm.units, strict=True)
        return ", ".join(f"{name} {0.0 if abs(at) < 5e-4 else at:.3g} {unit}" for name, at, unit in parts)


def scales(arm: Arm, length: float | None = None) -> Scales:
    """Return the scales of an arm.

    Args:
        arm: The arm; its site and joints are those of the scenario.
        length: Characteristic length [m]; None: that of the arm.

    Raises:
        QuestionError: Its joints do not move its site.
    """
    task, own = choose(arm, length=length), arm.rate_limit
    assumed = np.where(arm.is_slide, tidy(ASSUMED_RATE * task.length), ASSUMED_RATE)
    lower, upper = arm.position_limit.T
    within = np.where(np.isfinite(upper - lower), MARGIN * (upper - lower), 0.0)
    suits = Scales(task, np.where(np.isfinite(own), own, assumed), ~np.isfinite(own),
                   lower + within, upper - within)  # fmt: skip
    if not suits.below > 0.0:
        raise QuestionError(
            f"{arm.path}: its joints do not move {quoted(arm.site)}; choose another with --site or --body"
        )
    return suits


# The nearest singularity ------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Nearest:
    """The nearest singularity.

    Attributes:
        q: Joint positions, (n,) [rad or m].
        is_singular: Whether σ_min is 0 to rounding; otherwise it is the smallest that was found.
        twist: The lost direction, S_x⁻¹ u of norm 1 in units of L, (6,) [m, rad].
        wrench: S_x u, (6,) [N, N·m].
    """

    q: Array
    is_singular: bool
    twist: Array
    wrench: Array


def nearest_singularity(scales: Scales, start: Array) -> Nearest:
    """Return the nearest singular configuration that is found, or the one with the smallest σ_min.

    Args:
        scales: Scales of the arm.
        start: Joint positions, (n,).
    """
    task = scales.task
    q = _descend(scales, np.concatenate([start[None], _valleys(scales, start), _around(scales, start)]))
    sigma = survey(task, q).sigma
    far = np.linalg.norm((q - start) / task.joint_scale, axis=1)
    singular = sigma[:, -1] <= SINGULAR * sigma[:, 0]
    # of those that are equally near, and of the least values, the first: rounding must not choose
    order = np.round(far, 3) if singular.any() else np.round(sigma[:, -1] / sigma[:, 0], 3)
    best = int(np.argmin(np.where(singular | ~singular.any(), order, np.inf)))
    u = np.linalg.svd(task.matrix(task.arm.jacobian(q[best])))[0][:, min(len(task.rows), task.arm.n) - 1]
    u = u * np.sign(u[np.argmax(np.abs(u) > 0.9 * np.abs(u).max())])
    whole = np.zeros((2, 6))
    whole[:, task.rows] = u / task.row_scale, u * task.row_scale
    return Nearest(q[best], bool(singular[best]), *whole)


def clear_of_singularities(scales: Scales, start: Array) -> Array:
    """Return the nearest of some positions around a start with σ_min of 2 ε, or the one with most, (n,)."""
    q = np.clip(_around(scales, start), scales.lower, scales.upper)
    sigma = survey(scales.task, q).sigma[:, -1]
    far = np.linalg.norm((q - start) / scales.task.joint_scale, axis=1)
    is_clear = sigma >= CLEAR * scales.below
    return np.asarray(q[np.argmin(np.where(is_clear, far, np.inf)) if is_clear.any() else np.argmax(sigma)])


def _descend(scales: Scales, q: Array) -> Array:
    """Return configurations (N, n) after Newton's steps towards σ_min = 0, within the limits.

    σ_min is not smooth where it is 0, but has the slope of |x| beside it: a step of σ/|∇σ|² ∇σ ends there.
    """
    task = scales.task
    q = np.clip(q, scales.lower, scales.upper)
    for _ in range(STEPS):
        sigma = survey(task, q).sigma
        others = np.flatnonzero(sigma[:, -1] > 0.1 * SINGULAR * sigma[:, 0])
        if not len(others):
            break
        least, at = sigma[others, -1], q[others]
        slope = _slope(task, at, np.clip(SHARE * least, FINEST, SHORTEST))
        # a joint at its limit that would move beyond it stays
        slope[((at <= scales.lower) & (slope > 0.0)) | ((at >= scales.upper) & (slope < 0.0))] = 0.0
        steep = np.linalg.norm(slope, axis=1, keepdims=True)
        far = np.minimum(LONGEST, least[:, None] / np.maximum(steep, 1e-300)) * (steep > 0.0)
        step = -far * slope / np.maximum(steep, 1e-300)
        q[others] = np.clip(at + step * task.joint_scale, scales.lower, scales.upper)
    return q


def _slope(task: Task, q: Array, step: Array) -> Array:
    """Return ∂σ_min/∂q in units of the scaled joints, (N, n), by central differences of steps (N,)."""
    count, n = q.shape
    way = step[:, None, None] * np.eye(n) * task.joint_scale
    both = np.concatenate([q[:, None] + way, q[:, None] - way]).reshape(-1, n)
    sigma = survey(task, both).sigma[:, -1].reshape(2, count, n)
    return np.asarray((sigma[0] - sigma[1]) / (2.0 * step[:, None]))


def _valleys(scales: Scales, start: Array) -> Array:
    """Return where σ_min is least while one joint moves alone over its range, (N, n)."""
    task, n = scales.task, len(start)
    lower = np.where(np.isfinite(scales.lower), scales.lower, start - np.pi * task.joint_scale)
    upper = np.where(np.isfinite(scales.upper), scales.upper, start + np.pi * task.joint_scale)
    alone, joints = np.tile(start, (n, SCANNED, 1)), np.arange(n)
    alone[joints, :, joints] = np.linspace(lower, upper, SCANNED, axis=1)
    alone = alone.reshape(-1, n)
    # both neighbors are higher, or missing
    least = np.pad(
        survey(task, alone).sigma[:, -1].reshape(n, SCANNED), ((0, 0), (1, 1)), constant_values=np.inf
    )
    low = (least[:, 1:-1] <= least[:, :-2]) & (least[:, 1:-1] <= least[:, 2:])
    return np.asarray(alone[low.ravel()])


def _around(scales: Scales, start: Array) -> Array:
    """Return the same random positions around a start at every call, (N, n)."""
    rng = np.random.default_rng(0)
    away = rng.standard_normal((DRAWN, len(start)))
    away *= AROUND * rng.random((DRAWN, 1)) / np.linalg.norm(away, axis=1, keepdims=True)
    return start + away * scales.task.joint_scale
