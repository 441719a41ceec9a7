"""The start of a model's joints: its keyframes, and which of them is home if none has that name."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.notes import note

Array = NDArray[np.float64]


def starting_key(model: mujoco.MjModel, joints: Sequence[int], prefix: str = "") -> int | None:
    """Return the keyframe `home`, else the only one, else the first with joints within limits; None without.

    Args:
        model: Any model.
        joints: Ids of the joints whose limits count.
        prefix: Beginning of the names of a tool's keyframes, if one is attached.
    """
    keys = _keys(model, prefix)
    home = [i for i in keys if model.key(i).name == "home"]
    if home or len(keys) == 1:
        return (home or keys)[0]
    limited = [j for j in joints if model.jnt_limited[j]]
    lower, upper = model.jnt_range[limited].T
    starts = ((i, model.key_qpos[i][model.jnt_qposadr[limited]]) for i in keys)
    return next((i for i, q in starts if np.all((lower <= q) & (q <= upper))), None)


def keyframes(
    model: mujoco.MjModel, joints: Sequence[int], limit: Array, prefix: str, notes: list[str]
) -> tuple[dict[str, Array], int | None]:
    """Return the keyframes of a model by name, (nq,) each; `home` is among them unless it is qpos0.

    The number of the keyframe that is home comes second; None without one.

    Args:
        model: Any model.
        joints: Ids of the arm's joints, n of them.
        limit: Limit of their positions, (n, 2).
        prefix: Beginning of the names of a tool's keyframes, if one is attached.
        notes: Assumptions are added.
    """
    known = {name: np.array(model.key(i).qpos) for i in range(model.nkey) if (name := model.key(i).name)}
    key, address = starting_key(model, joints, prefix), model.jnt_qposadr[joints]
    if "home" in known:
        return known, key
    if key is not None:
        name = model.key(key).name
        called = f'"{name}"' if name else f"number {key}, which has no name,"
        why = "the only one" if len(_keys(model, prefix)) == 1 else "the first within limits"
        notes.append(note("no-home", f"there is no keyframe home; {called} replaces it, {why}"))
        return {**known, "home": np.array(model.key(key).qpos)}, key
    zero, (lower, upper) = model.qpos0[address], limit.T
    beyond = (zero < lower) | (zero > upper)
    if not beyond.any():
        return known, None
    home = np.array(model.qpos0)
    has_middle = beyond & np.isfinite(lower) & np.isfinite(upper)
    home[address] = np.clip(zero, lower, upper)
    home[address[has_middle]] = limit[has_middle].mean(axis=1)
    names = ", ".join(f'"{model.joint(joints[j]).name}"' for j in np.flatnonzero(beyond).tolist())
    told = f"0 is beyond the limits of joint {names}; home is the middle of their range"
    notes.append(note("no-home", f"there is no keyframe home, and {told}"))
    return {**known, "home": home}, None


def _keys(model: mujoco.MjModel, prefix: str) -> list[int]:
    return [i for i in range(model.nkey) if not (prefix and model.key(i).name.startswith(prefix))]
