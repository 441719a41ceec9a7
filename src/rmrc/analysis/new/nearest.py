"""The singular configuration nearest to a given one, by descents of σ_min within the limits."""

from dataclasses import dataclass

import numpy as np

from rmrc.analysis.new.scaling import Scales
from rmrc.analysis.survey import survey
from rmrc.law.task import Array, Task

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
class Nearest:
    """Result of the search.

    Attributes:
        q: Joint positions, (n,) [rad or m].
        sigma: Singular values there, descending, (k,).
        is_singular: Whether the smallest is 0 to rounding; otherwise it is the smallest that was found.
        twist: The lost direction, S_x⁻¹ u of norm 1 in units of L, (6,) [m, rad].
        wrench: S_x u, (6,) [N, N·m].
    """

    q: Array
    sigma: Array
    is_singular: bool
    twist: Array
    wrench: Array


def nearest_singularity(scales: Scales, start: Array) -> Nearest:
    """Return the nearest singular configuration that is found, or the one with the smallest σ_min.

    Args:
        scales: Scales of the arm.
        start: Joint positions, (n,).
    """
    task, unit = scales.task, scales.task.joint_scale
    q = descend(scales, _beginnings(scales, start))
    sigma = survey(task, q).sigma
    far = np.linalg.norm((q - start) / unit, axis=1)
    singular = sigma[:, -1] <= SINGULAR * sigma[:, 0]
    # of those that are equally near, and of the least values, the first: rounding must not choose
    order = np.round(far, 3) if singular.any() else np.round(sigma[:, -1] / sigma[:, 0], 3)
    best = int(np.argmin(np.where(singular | ~singular.any(), order, np.inf)))
    u = np.linalg.svd(task.matrix(task.arm.jacobian(q[best])))[0][:, min(len(task.rows), task.arm.n) - 1]
    u = u * np.sign(u[np.argmax(np.abs(u) > 0.9 * np.abs(u).max())])
    twist, wrench = np.zeros(6), np.zeros(6)
    twist[task.rows], wrench[task.rows] = u / task.row_scale, u * task.row_scale
    return Nearest(q[best], sigma[best], bool(singular[best]), twist, wrench)


def descend(scales: Scales, q: Array) -> Array:
    """Return configurations (N, n) after Newton's steps towards σ_min = 0, within the limits.

    σ_min is not smooth where it is 0, but has the slope of |x| beside it: a step of σ/|∇σ|² ∇σ ends there.
    """
    task, unit = scales.task, scales.task.joint_scale
    q = np.clip(q, scales.lower, scales.upper)
    for _ in range(STEPS):
        sigma = survey(task, q).sigma
        left = np.flatnonzero(sigma[:, -1] > 0.1 * SINGULAR * sigma[:, 0])
        if not len(left):
            break
        least = sigma[left, -1]
        slope = _slope(task, q[left], np.clip(SHARE * least, FINEST, SHORTEST))
        # a joint at its limit that would move beyond it stays
        held = ((q[left] <= scales.lower) & (slope > 0.0)) | ((q[left] >= scales.upper) & (slope < 0.0))
        slope[held] = 0.0
        steep = np.sum(slope**2, axis=1)
        step = -least[:, None] * slope / np.maximum(steep, 1e-300)[:, None]
        size = np.linalg.norm(step, axis=1)
        step *= (np.minimum(1.0, LONGEST / np.maximum(size, 1e-300)) * (steep > 0.0))[:, None]
        q[left] = np.clip(q[left] + step * unit, scales.lower, scales.upper)
    return q


def ascend(scales: Scales, start: Array, least: float) -> Array:
    """Return the first configuration uphill from a start with at least this σ_min, or the best."""
    task, unit = scales.task, scales.task.joint_scale
    # away from a singular start, where no direction is uphill
    q = np.clip(
        start + 1e-3 * unit * np.random.default_rng(0).standard_normal(len(start)), scales.lower, scales.upper
    )
    best, largest = q, -1.0
    for _ in range(4 * STEPS):
        sigma = float(survey(task, q[None]).sigma[0, -1])
        if sigma > largest:
            best, largest = q, sigma
        if sigma >= least:
            break
        slope = _slope(task, q[None], np.array([SHORTEST]))[0]
        slope[((q >= scales.upper) & (slope > 0.0)) | ((q <= scales.lower) & (slope < 0.0))] = 0.0
        size = float(np.linalg.norm(slope))
        if size == 0.0:
            break
        q = np.clip(q + 0.25 * LONGEST * slope / size * unit, scales.lower, scales.upper)
    return best


def _slope(task: Task, q: Array, step: Array) -> Array:
    """Return ∂σ_min/∂q in units of the scaled joints, (N, n), by central differences of steps (N,)."""
    count, n = q.shape
    way = step[:, None, None] * np.eye(n) * task.joint_scale
    both = np.concatenate([q[:, None] + way, q[:, None] - way]).reshape(-1, n)
    sigma = survey(task, both).sigma[:, -1].reshape(2, count, n)
    return np.asarray((sigma[0] - sigma[1]) / (2.0 * step[:, None]))


def _beginnings(scales: Scales, start: Array) -> Array:
    """Return the starts of descents: the start, each joint alone over its range, and around, (N, n)."""
    task, n = scales.task, len(start)
    lower = np.where(np.isfinite(scales.lower), scales.lower, start - np.pi * task.joint_scale)
    upper = np.where(np.isfinite(scales.upper), scales.upper, start + np.pi * task.joint_scale)
    alone = np.repeat(start[None], SCANNED * n, axis=0)
    for j in range(n):
        alone[SCANNED * j : SCANNED * (j + 1), j] = np.linspace(lower[j], upper[j], SCANNED)
    least = survey(task, alone).sigma[:, -1].reshape(n, SCANNED)
    # only the valleys: both neighbors are higher, or missing
    edge = np.full((n, 1), np.inf)
    low = (least <= np.hstack([edge, least[:, :-1]])) & (least <= np.hstack([least[:, 1:], edge]))
    rng = np.random.default_rng(0)
    away = rng.standard_normal((DRAWN, n))
    away *= AROUND * rng.random((DRAWN, 1)) / np.linalg.norm(away, axis=1, keepdims=True)
    return np.concatenate([start[None], alone[low.ravel()], start + away * task.joint_scale])
