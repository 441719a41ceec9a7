"""The start of a model's joints: its keyframes, and which of them is home if none has that name."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.notes import Note

Array = NDArray[np.float64]


def starting_key(model: mujoco.MjModel, joints: Sequence[int], prefix: str = "") -> int | None:
    """Return the keyframe `home`, else the only one, else the first with joints within limits; None without.

    Args:
        model: Any model.
        joints: Ids of the joints whose limits count.
        prefix: Beginning of the names of a tool's keyframes, if one is attached.
    """
    keys = _own(model, prefix)
    home = [i for i in keys if model.key(i).name == "home"]
    if home or len(keys) == 1:
        return (home or keys)[0]
    limited = [j for j in joints if model.jnt_limited[j]]
    lower, upper = model.jnt_range[limited].T
    address = model.jnt_qposadr[limited]
    return next(
        (i for i in keys if np.all((lower <= (q := model.key_qpos[i][address])) & (q <= upper))), None
    )


def keyframes(
    model: mujoco.MjModel,
    joints: Sequence[int],
    limit: Array,
    prefix: str,
    notes: list[str],
) -> dict[str, Array]:
    """Return the keyframes of a model by name, (nq,) each; `home` is among them unless it is qpos0.

    Args:
        model: Any model.
        joints: Ids of the arm's joints, n of them.
        limit: Limit of their positions, (n, 2).
        prefix: Beginning of the names of a tool's keyframes, if one is attached.
        notes: Assumptions are added.
    """
    found = {name: np.array(model.key(i).qpos) for i in range(model.nkey) if (name := model.key(i).name)}
    if "home" in found:
        return found
    key = starting_key(model, joints, prefix)
    if key is not None:
        called = f'"{name}"' if (name := model.key(key).name) else f"number {key}, which has no name,"
        why = "the only one" if len(_own(model, prefix)) == 1 else "the first within limits"
        notes.append(Note("no-home", f"there is no keyframe home; {called} replaces it, {why}"))
        return {**found, "home": np.array(model.key(key).qpos)}
    address, home = model.jnt_qposadr[joints], np.array(model.qpos0)
    beyond = np.flatnonzero((home[address] < limit[:, 0]) | (home[address] > limit[:, 1])).tolist()
    if not beyond:
        return found
    for j in beyond:
        ends = limit[j]
        home[address[j]] = ends.mean() if np.isfinite(ends).all() else np.clip(home[address[j]], *ends)
    names = ", ".join(f'"{model.joint(joints[j]).name}"' for j in beyond)
    told = (
        f"there is no keyframe home, and 0 is beyond the limits of joint {names}; home is the middle of "
        "their range"
    )
    notes.append(Note("no-home", told))
    return {**found, "home": home}


def _own(model: mujoco.MjModel, prefix: str) -> list[int]:
    return [i for i in range(model.nkey) if not (prefix and model.key(i).name.startswith(prefix))]
