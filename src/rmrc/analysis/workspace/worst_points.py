"""The points of a workspace where an arm moves worst: on its singular curves, or at limits.

Cells have the postures of their middles, and no middle lies on a curve. At points of curves, a search finds
the postures that reach them, so that the best of them counts.
"""

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.ik.solve import STEPS
from rmrc.analysis.survey import Survey, survey
from rmrc.analysis.workspace.reach import MEASURES, Measure, Reach
from rmrc.analysis.workspace.slices import Slice
from rmrc.law.task import Array, Task
from rmrc.simulation.inverse_kinematics import search

# Number of examined points of curves, those with the worst postures first, and starts of searches for others.
POINTS, STARTS = 32, 40
# Distance above which two points are distinct, in cells.
APART = 1.0
# Where two postures merge, a search knows them to the root of rounding, and σ_min is some 1e-7 of σ_1; below
# this share all postures of a point are singular.
FUSED = 1e-5
# Below this share of σ_1, σ_min of a singular configuration is rounding, the end of Newton's method for it.
SINGULAR = 1e-8

Ends = dict[Measure, tuple[float, float]]


def find_ends(
    task: Task, part: Slice, limit: Array, reach: Reach, worst: bool, q: Array, random: Array,
    edges: tuple[Array, Array],
) -> tuple[Ends, dict[Measure, str]]:  # fmt: skip
    """Return smallest and largest σ_min, w and κ of the reached set, and the sources of the worse ends.

    Args:
        task: The arm, and the rows whose singular values are taken.
        part: The slice.
        limit: Position limits to keep, infinite where there are none, (n, 2).
        reach: The cells.
        worst: Whether the worst posture of each point counts instead of the best.
        q: Configurations on singular and limit curves that are reached, (K, n).
        random: Joint positions to search from, (S, n).
        edges: Edges of the cells along both coordinates.

    Returns:
        The ends by measure; and `singular`, `limits` or `cells` by measure.
    """
    own = survey(task, q)
    values = _values(own)
    ends: Ends = {}
    for measure in MEASURES:
        known = reach.values[measure][~np.isnan(reach.values[measure])]
        # A workspace can be so narrow that it has the middle of no cell.
        known = known if len(known) else values[measure]
        if len(known):
            ends[measure] = (float(known.min()), float(known.max()))
    source: dict[Measure, str] = dict.fromkeys(ends, "cells" if reach.reached.any() else "limits")
    if not ends or not len(q):
        return ends, source
    for i in _spread(part, own, values, ends, APART * reach.size):
        best = {measure: float(values[measure][i]) for measure in values}
        label = "singular" if best["sigma_min"] == 0.0 else "limits"
        if not worst:
            best = _best(task, part, limit, own, i, reach, random, edges, best)
        for measure, (least, most) in ends.items():
            if best[measure] >= most if measure == "condition" else best[measure] <= least:
                pair = (least, best[measure]) if measure == "condition" else (best[measure], most)
                ends[measure], source[measure] = pair, label
    return ends, source


def _values(found: Survey) -> dict[Measure, Array]:
    """Return σ_min, w and κ, each (N,), without rounding where σ_min is 0."""
    zero = found.sigma[:, -1] <= SINGULAR * found.sigma[:, 0]
    return {
        "sigma_min": np.where(zero, 0.0, found.sigma[:, -1]),
        "manipulability": np.where(zero, 0.0, found.manipulability),
        "condition": np.where(zero, np.inf, found.condition),
    }


def _spread(part: Slice, own: Survey, values: dict[Measure, Array], ends: Ends, apart: float) -> list[int]:
    """Return configurations that are worse than all cells, all at different points, outermost first."""
    worse = (values["sigma_min"] <= ends["sigma_min"][0]) | (
        values["manipulability"] <= ends["manipulability"][0]
    )
    worse |= values["condition"] >= ends["condition"][1]
    points = part.coordinates(own.pose[:, :3])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    away = np.linalg.norm(points - middle, axis=1)
    order = np.lexsort((-away, values["sigma_min"].round(6)))
    left, chosen = order[worse[order]], list[int]()
    while len(left) and len(chosen) < POINTS:
        first, rest = left[0], left[1:]
        chosen.append(int(first))
        left = rest[np.linalg.norm(points[rest] - points[first], axis=1) >= apart]
    return chosen


def _best(
    task: Task, part: Slice, limit: Array, own: Survey, i: int, reach: Reach, random: Array,
    edges: tuple[Array, Array], values: dict[Measure, float],
) -> dict[Measure, float]:  # fmt: skip
    """Return the best σ_min, w and κ of the postures that reach the point of a configuration."""
    starts = np.concatenate([_around(part, own.pose[i, :3], reach, edges), random, own.q[i : i + 1]])
    first = np.clip(starts, *limit.T)
    goals = np.tile(own.pose[i], (len(first), 1))
    place = Task(task.arm, np.arange(3), task.length)
    none = np.empty((0, task.arm.n))
    q, error, _ = search(place, limit, 1e-12, STEPS["damped"], goals, first, none)
    found = survey(task, q[error <= 1e-9])
    fused = found.sigma[:, -1] <= FUSED * found.sigma[:, 0]
    if fused.all():
        return values
    better = Survey(found.q[~fused], found.pose[~fused], found.sigma[~fused])
    return {
        "sigma_min": max(values["sigma_min"], float(better.sigma[:, -1].max())),
        "manipulability": max(values["manipulability"], float(better.manipulability.max())),
        "condition": min(values["condition"], float(better.condition.min())),
    }


def _around(part: Slice, point: Array, reach: Reach, edges: tuple[Array, Array]) -> Array:
    """Return the postures of the cells about a point, (K, n)."""
    at = part.coordinates(point)
    cell = [int(np.searchsorted(edge, value)) - 1 for edge, value in zip(edges, at, strict=True)]
    near: list[NDArray[np.float64]] = [
        reach.q[a, b]
        for a in range(max(cell[0] - 1, 0), min(cell[0] + 2, reach.q.shape[0]))
        for b in range(max(cell[1] - 1, 0), min(cell[1] + 2, reach.q.shape[1]))
        if reach.reached[a, b]
    ]
    return np.array(near).reshape(-1, reach.q.shape[2])
