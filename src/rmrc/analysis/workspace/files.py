"""A workspace as arrays in a file, for other programs."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.analysis.workspace.joint_map import JointMap
from rmrc.analysis.workspace.reach import Workspace
from rmrc.support.files import written_whole

# The meaning of the arrays of a file, in order: (key, meaning).
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
    "singular_family": "factor of det J that vanishes at each, such as elbow; empty: not known, (K,)",
    "singular_within": "whether each is within the joint limits, (K,)",
    "limit_q": "configurations at a joint limit, (L, n) [rad or m]",
    "limit_points": "where they put the site in the slice, (L, 2) [m]",
    "limit_label": "which limit, (L,)",
    "home": "the configuration that the arm is drawn at, (n,) [rad or m]",
}


def save(found: Workspace | JointMap, path: Path) -> None:
    """Write all results as arrays, atomically; `meaning` describes each.

    Args:
        found: The result of `workspace` or `joint_map`.
        path: An `.npz` file.
    """
    arrays, meaning, about = _joint_map(found) if isinstance(found, JointMap) else _workspace(found)
    texts: dict[str, Any] = {"meaning": json.dumps(meaning), "about": json.dumps(about)}
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **{name: arrays[name] for name in meaning}, **texts)


def _workspace(found: Workspace) -> tuple[dict[str, Any], dict[str, str], dict[str, Any]]:
    """Return the arrays, their meanings, and their subject."""
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
    arrays["singular_family"] = np.concatenate([np.empty(0, "<U1"), *map(found.names, found.singular)])
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
        "task_frame": found.task.frame, "length": found.task.length,
        "posture": "worst" if found.worst else "best",
    }  # fmt: skip
    return arrays, ARRAYS, about


def _joint_map(found: JointMap) -> tuple[dict[str, Any], dict[str, str], dict[str, Any]]:
    """Return the arrays, their meanings, and their subject."""
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
        "singular_family": ARRAYS["singular_family"],
    }
    about = {
        "model": arm.path.name, "site": arm.site, "joints": arm.joints,
        "over": [arm.joints[joint] for joint in found.joints],
        "axes": found.task.axes, "task_frame": found.task.frame, "length": found.task.length,
    }  # fmt: skip
    arrays: dict[str, Any] = {"first": found.first, "second": found.second, "q": found.q, **found.values}
    arrays["singular"] = np.concatenate([np.empty((0, 2)), *found.singular])
    sizes = [len(curve) for curve in found.singular]
    arrays["singular_curve"] = np.repeat(np.arange(len(sizes)), sizes)
    names = [found.families[i].name for i in found.family] or [""] * len(sizes)
    arrays["singular_family"] = np.repeat(np.array(names, str), sizes)
    return arrays, meaning, about
