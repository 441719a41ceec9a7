"""A workspace for others: as arrays in a file, and as a summary for machines."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.analysis.workspace.joint_map import JointMap
from rmrc.analysis.workspace.reach import MEASURES, Reach, Workspace
from rmrc.support.files import written_whole

# What the arrays of a file mean, in order: (key, meaning).
ARRAYS = {
    "a": "edges of the cells along the first coordinate of the slice, (A + 1,) [m]",
    "b": "edges of the cells along the second coordinate, (B + 1,) [m]",
    "free_reached": "cells that are reached without joint limits, (A, B)",
    "free_postures": "postures that reach the middle of a cell; -1: not counted, (A, B)",
    "free_sigma_min": "smallest singular value of the kept posture; nan where none, (A, B)",
    "free_manipulability": "product of the singular values, (A, B)",
    "free_condition": "sigma_1/sigma_min, (A, B)",
    "free_extents": "least and largest value of both coordinates, (2, 2) [m]; nan if nothing is reached",
    "free_q": "a posture in each cell, that of free_sigma_min, (A, B, n) [rad or m]",
    "limited_reached": "the same with the joint limits of the model",
    "limited_postures": "the same with limits",
    "limited_sigma_min": "the same with limits",
    "limited_manipulability": "the same with limits",
    "limited_condition": "the same with limits",
    "limited_extents": "the same with limits",
    "limited_q": "the same with limits",
    "singular_q": "singular configurations, (K, n) [rad or m]",
    "singular_points": "where they put the site in the slice, (K, 2) [m]",
    "singular_curve": "number of the curve that each belongs to, (K,)",
    "singular_within": "whether each is within the joint limits, (K,)",
    "limit_q": "configurations at a joint limit, (L, n) [rad or m]",
    "limit_points": "where they put the site in the slice, (L, 2) [m]",
    "limit_label": "which limit, (L,)",
    "home": "the configuration that the arm is drawn at, (n,) [rad or m]",
}


def save(found: Workspace, path: Path) -> None:
    """Write everything that was found as arrays, whole or not at all; `meaning` says what each is.

    Args:
        found: What to write.
        path: An `.npz` file.
    """
    arm, part = found.task.arm, found.part
    arrays: dict[str, Any] = {"a": found.a, "b": found.b, "home": found.home}
    for word, reach in (("free", found.free), ("limited", found.limited)):
        arrays |= {f"{word}_reached": reach.reached, f"{word}_postures": reach.postures, f"{word}_q": reach.q}
        extents = [(extent.low, extent.high) for extent in reach.extents]
        arrays[f"{word}_extents"] = np.array(extents or np.full((2, 2), np.nan))
        arrays |= {f"{word}_{measure}": value for measure, value in reach.values.items()}
    for word, curves in (("singular", found.singular), ("limit", found.limits)):
        arrays[f"{word}_q"] = np.concatenate([np.empty((0, arm.n)), *(curve.q for curve in curves)])
        arrays[f"{word}_points"] = np.concatenate([np.empty((0, 2)), *(curve.points for curve in curves)])
    sizes = [len(curve.q) for curve in found.singular]
    arrays["singular_curve"] = np.repeat(np.arange(len(sizes)), sizes)
    arrays["singular_within"] = np.concatenate(
        [np.empty(0, bool), *(curve.within for curve in found.singular)]
    )
    arrays["limit_label"] = np.repeat(
        [c.label for c in found.limits] or [""], [len(c.q) for c in found.limits] or [0]
    )
    about = {
        "model": arm.path.name, "site": arm.site, "joints": arm.joints, "slice": part.name,
        "labels": part.labels,
        "origin": part.origin.tolist(), "normal": part.normal.tolist(), "axes": found.task.axes,
        "length": found.task.length, "posture": "worst" if found.worst else "best",
    }  # fmt: skip
    texts: dict[str, Any] = {"meaning": json.dumps(ARRAYS), "about": json.dumps(about)}
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **{name: arrays[name] for name in ARRAYS}, **texts)


def save_joint_map(found: JointMap, path: Path) -> None:
    """Write a map over two joints as arrays, whole or not at all; `meaning` says what each is.

    Args:
        found: What to write.
        path: An `.npz` file.
    """
    arm = found.task.arm
    meaning = {
        "first": "positions of the first joint, (A,) [rad or m]",
        "second": "positions of the second joint, (B,) [rad or m]",
        "q": "positions of all joints; those of the two do not matter, (n,) [rad or m]",
        "sigma_min": "smallest singular value, (A, B)",
        "manipulability": "product of the singular values, (A, B)",
        "condition": "sigma_1/sigma_min, (A, B)",
        "singular": "positions of both joints where det J = 0, (K, 2) [rad or m]; only of a square task",
        "singular_curve": "number of the curve that each belongs to, (K,)",
    }
    about = {
        "model": arm.path.name, "site": arm.site, "joints": arm.joints,
        "over": [arm.joints[joint] for joint in found.joints],
        "axes": found.task.axes, "length": found.task.length,
    }  # fmt: skip
    arrays: dict[str, Any] = {"first": found.first, "second": found.second, "q": found.q, **found.values}
    arrays["singular"] = np.concatenate([np.empty((0, 2)), *found.singular])
    arrays["singular_curve"] = np.repeat(np.arange(len(found.singular)), [len(c) for c in found.singular])
    texts: dict[str, Any] = {"meaning": json.dumps(meaning), "about": json.dumps(about)}
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **{name: arrays[name] for name in meaning}, **texts)


def summary(found: Workspace) -> dict[str, Any]:
    """Return the numbers of a workspace, ready for strict JSON.

    Args:
        found: What to tell of.

    Returns:
        Slice and cells; of both reachable sets area (and volume, of a slice about an axis), how far they can
        be off, extents with their accuracy, the extremes of σ_min, w and κ, and in `worst_from` where the
        worse of both was found: on `singular` curves, on those of `limits`, or in the middles of `cells`,
        as the better always are; counts of singular configurations. Of samples an extent is reached to its
        accuracy, but is only the largest that was found: `extent_is_at_least`.
    """
    arm, part = found.task.arm, found.part
    return {
        "model": arm.path.name, "site": arm.site, "joints": list(arm.joints), "slice": part.name,
        "labels": list(part.labels), "origin": part.origin.tolist(), "axes": list(found.task.axes),
        "length": found.task.length, "method": "sheet" if part.is_surface else "samples",
        "posture": "worst" if found.worst else "best", "configurations": found.samples,
        "cell": found.free.size,
        "cells": list(found.free.reached.shape), "without_limits": _of(found, found.free),
        "with_limits": _of(found, found.limited),
        "singular": {
            "curves": len(found.singular) if part.is_surface else None,
            "configurations": sum(len(curve.q) for curve in found.singular),
            "within_limits": sum(int(curve.within.sum()) for curve in found.singular),
        },
        "limit_curves": [curve.label for curve in found.limits],
    }  # fmt: skip


def _of(found: Workspace, reach: Reach) -> dict[str, Any]:
    facts: dict[str, Any] = {"area": reach.area, "area_accuracy": reach.accuracy}
    if found.part.is_round:
        facts["volume_if_first_joint_turns_fully"] = found.volume(reach)
    accuracy = max((extent.accuracy for extent in reach.extents), default=None)
    for label, extent in zip(found.part.labels, reach.extents or (None, None), strict=True):
        facts[label] = None if extent is None else [extent.low, extent.high]
    facts["extent_accuracy"], facts["extent_is_at_least"] = accuracy, not found.part.is_surface
    for measure in MEASURES:
        ends = reach.ends.get(measure)
        facts[measure] = None if ends is None else [end if np.isfinite(end) else None for end in ends]
    facts["worst_from"] = {measure: reach.source[measure] for measure in MEASURES if measure in reach.source}
    counted = reach.postures[reach.postures > 0]
    facts["postures"] = sorted({int(count) for count in np.unique(counted)}) or None
    return facts


def joint_summary(found: JointMap) -> dict[str, Any]:
    """Return the numbers of a map over two joints, ready for strict JSON; an infinite κ is None.

    The ends of σ_min, w and κ are searched between the positions of the map, to 1e-9 and less.
    """
    arm = found.task.arm
    facts: dict[str, Any] = {
        "model": arm.path.name, "site": arm.site, "over": [arm.joints[joint] for joint in found.joints],
        "q": found.q.tolist(), "axes": list(found.task.axes), "length": found.task.length,
        "cells": [len(found.first) - 1, len(found.second) - 1],
        "configurations": found.values["sigma_min"].size,
        # det J is of as many rows as joints
        "singular_curves": len(found.singular) if len(found.task.rows) == arm.n else None,
    }  # fmt: skip
    return facts | {
        measure: [end if np.isfinite(end) else None for end in found.ends[measure]] for measure in MEASURES
    }
