"""Columns that a recording leaves out, because they follow from others of the same ticks."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.results.columns import COLUMNS

# Recordings may lack these columns.
ADDED = frozenset({"qpos", "tau_gravity", "qdot_arrived", "qdot_plain", "q_believed"})

# Without a stage between them, the first equals the second to the bit; recordings of such runs lack it.
SAME = {"qdot_arrived": "qdot_cmd", "q_believed": "q"}


# A tick may have these beside others; its other columns are the same throughout a run.
OFTEN_FOLLOWING = ("gain", "manipulability", "condition", "pose_error")


def thinned(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the columns but those that follow from others of the same ticks, to the bit.

    Of `pose_error`, this keeps the last three values, as `rotation_error`.

    Args:
        columns: (T,) or (T, width) each.
    """
    rotation = columns["pose_error"][:, 3:]
    follows = _following(columns) | {"pose_error": _moved(columns, rotation)}
    found = {**columns, "rotation_error": rotation}
    for name, values in follows.items():
        if np.array_equal(values.view(np.int64), columns[name].view(np.int64)):
            del found[name]
    return found


def restored(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return all of the columns that `thinned` returned."""
    found = {**_following(columns), **columns}
    rotation = found.pop("rotation_error", None)
    return found if rotation is None else {"pose_error": _moved(columns, rotation)} | found


def _moved(columns: Mapping[str, NDArray[Any]], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the errors of poses, (T, 6), of which the rotation is known, (T, 3)."""
    return np.hstack([columns["pose_ref"][:, :3] - columns["pose"][:, :3], rotation])


def _following(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[np.float64]]:
    """Return the columns that mostly follow from `sigma` and `damping`; in the order of the law."""
    sigma, damping = columns["sigma"], columns["damping"].reshape(-1, 1)
    least = sigma[:, -1]
    product = least.copy()
    for j in range(sigma.shape[1] - 2, -1, -1):
        product *= sigma[:, j]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        gain = np.where(damping > 0.0, sigma / (sigma * sigma + damping * damping), 1.0 / sigma)
        condition = sigma[:, 0] / least
    return {"gain": gain, "manipulability": product, "condition": condition}


def completed(
    columns: Mapping[str, NDArray[np.generic]], same: Mapping[str, str] = SAME
) -> dict[str, NDArray[np.generic]]:
    """Return the columns of a recording in order, with missing ones copied from their equals."""
    found = {name: columns.get(name, columns.get(same.get(name, ""))) for name in COLUMNS}
    return {name: values for name, values in found.items() if values is not None}
