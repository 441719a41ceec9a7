"""Neighbors of the front that are expected to add the most to it.

From the runs of a structure, a Gaussian process over its cube predicts the results of its neighbors
[Rasmussen06]. Those come first that add the most to the area that the front dominates [Emmerich06].
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.tuning.front import area, gains
from rmrc.tuning.space import Setting, Space, Structure
from rmrc.tuning.verdict import Trial

_Array = NDArray[np.float64]

# Number of neighbors of a structure to choose from; they count as better than expected by this many standard
# deviations; those that add less than this share to the area of the front are not run.
_GUESSES, _HOPE, _GAIN = 300, 0.5, 5e-3
# Largest step of a neighbor in the unit cube, whose sides are two or three decades; the smallest is a
# thirtieth.
_FARTHEST = 0.3
# Lengths along an edge of the cube over which results change, and the share of noise in their variance, for
# example where another world becomes the worst.
_LENGTHS, _NOISE = (0.1, 0.2, 0.4, 0.8, 1.6), 1e-3
# Largest number of settings to learn from, the last ones: the time grows with the cube of their number.
_MOST = 80


def neighbors(
    space: Space,
    tried: Sequence[Trial],
    parents: Sequence[Trial],
    reference: tuple[float, float],
    most: int,
    random: np.random.Generator,
) -> list[Setting]:
    """Return new settings beside some, the most promising first.

    Args:
        space: The possible settings.
        tried: All settings with a run.
        parents: Settings to refine, with those of the front among them.
        reference: Logarithms of the peak rate and the error beyond which nothing counts.
        most: Their largest number.
        random: Random numbers.
    """
    reached = np.array([trial.worst.point.logs for trial in parents])
    least = _GAIN * area([trial.worst.point for trial in parents], reference)
    before = {trial.setting for trial in tried}
    settings, expected, unknown = list[Setting](), [np.empty((0, 2))], list[Setting]()
    for structure in dict.fromkeys(trial.setting.structure for trial in parents):
        beside = [space.point(trial.setting) for trial in parents if trial.setting.structure == structure]
        new = [it for it in _around(space, structure, np.array(beside), random) if it not in before]
        known = [trial for trial in tried if trial.setting.structure == structure]
        if structure not in space.structures or not new:
            continue
        at, points = (
            np.array([space.point(it) for it in some]) for some in (new, [it.setting for it in known])
        )
        keeps = np.array([trial.worst.excess <= 0.0 for trial in known])
        # a run that ended at a broken limit could not become worse
        tells = np.array([trial.worst.excess <= 0.0 or not trial.worst.ended for trial in known])
        if tells.sum() <= 2 * len(structure.keys):  # too few for a prediction
            unknown.append(new[0])
            continue
        chosen = keeps[np.linalg.norm(at[:, None] - points, axis=2).argmin(axis=1)]
        values = np.array([trial.worst.point.logs for trial in known])
        settings += [it for it, is_chosen in zip(new, chosen, strict=True) if is_chosen]
        expected.append(_predicted(points[tells], values[tells], at[chosen]))
    figures, picked = np.vstack(expected), list[int]()
    while settings and len(picked) < most - min(len(unknown), most // 4):
        gained = gains(reached, figures, reference)
        i = int(gained.argmax())
        if not picked and figures[:, 1].min() < reached[:, 1].min() - _GAIN:  # the least error comes first
            i = int(figures[:, 1].argmin())
        elif gained[i] <= least:
            break
        picked.append(i)
        reached = np.vstack([reached, figures[i]])
    guessed = [unknown[i] for i in random.permutation(len(unknown))[: most // 4]]
    return [*guessed, *(settings[i] for i in picked)]


def _around(space: Space, structure: Structure, points: _Array, random: np.random.Generator) -> list[Setting]:
    """Return settings beside points of a structure's cube and between them."""
    first, second = random.integers(len(points), size=(2, _GUESSES))
    share = np.where(random.random(_GUESSES) < 0.5, 0.0, random.uniform(-0.5, 1.5, _GUESSES))[:, None]
    size = _FARTHEST * 10.0 ** random.uniform(-1.5, 0.0, (_GUESSES, 1))
    off = size * random.standard_normal((_GUESSES, points.shape[1]))
    every = points[first] + share * (points[second] - points[first]) + off
    return list(dict.fromkeys(space.at(structure, point) for point in every))


def _predicted(points: _Array, values: _Array, at: _Array) -> _Array:
    """Return optimistic values at other points of a cube, (k, 2), with the likeliest Matérn kernel."""
    points, values = points[-_MOST:], values[-_MOST:]
    mean, scale = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-9)
    values, lengths = (values - mean) / scale, np.full(points.shape[1], 0.4)

    def learn(lengths: _Array) -> tuple[float, Any, Any]:
        root = np.linalg.cholesky(_kernel(points, points, lengths) + _NOISE * np.eye(len(points)))
        white = np.linalg.solve(root, values)
        return float(-0.5 * np.sum(white**2) - 2.0 * np.log(np.diag(root)).sum()), root, white

    for edge in (*range(len(lengths)), *range(len(lengths))):
        options = [np.where(np.arange(len(lengths)) == edge, length, lengths) for length in _LENGTHS]
        lengths = max(options, key=lambda option: learn(option)[0])
    _, root, white = learn(lengths)
    shares = np.linalg.solve(root, _kernel(points, at, lengths))
    spread = np.sqrt(np.maximum(1.0 - np.sum(shares**2, axis=0), 0.0))
    return np.asarray(mean + scale * (shares.T @ white - _HOPE * spread[:, None]))


def _kernel(points: _Array, others: _Array, lengths: _Array) -> _Array:
    apart = (points[:, None] - others) / lengths
    distance = math.sqrt(5.0) * np.linalg.norm(apart, axis=2)
    return np.asarray((1.0 + distance + distance**2 / 3.0) * np.exp(-distance))
