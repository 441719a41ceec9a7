"""The wiring of a batch: ids and columns by which its worlds find their numbers in MuJoCo's arrays."""

from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Wiring
from rmrc.law.jit import Array
from rmrc.law.record import CHAIN, JOINTS, Field
from rmrc.plants.plant import Plant
from rmrc.plants.resistance import RESISTANCE, write_resistance

WIRING = (
    Field("joint", np.int64, (CHAIN,)),
    Field("dof", np.int64, (JOINTS,)),
    Field("force", np.int64, (JOINTS,)),
    Field("site", np.int64),
    Field("body", np.int64),
    # columns of the state row
    Field("qpos_column", np.int64, (JOINTS,)),
    Field("qvel_column", np.int64, (JOINTS,)),
    Field("ctrl_column", np.int64, (JOINTS,)),
    Field("wrench_column", np.int64),
    # joints that follow others, both halves of a screw apart: index, ratio, and columns
    Field("followers", np.int64),
    Field("follows", np.int64, (CHAIN,)),
    Field("follower_ratio", size=(CHAIN,)),
    Field("follower_column", np.int64, (CHAIN,)),
    Field("follower_dof", np.int64, (CHAIN,)),
    # from the center of mass of the body that carries the site to the site, in the site's frame
    Field("lever", size=(3,)),
    *RESISTANCE,
    # addresses in this process of machine code that not all worlds need
    *(Field(f"call_{name}", np.int64) for name in ("sensed", "sent", "second", "course", "sense", "obey")),
)


def write_wiring(
    worlds: NDArray[np.void],
    model: mujoco.MjModel,
    wiring: Wiring,
    plants: Sequence[Plant],
    place: Callable[[str], int],
) -> None:
    """Write these fields of the records of a batch.

    Args:
        worlds: The records, (w,).
        model: The model that the worlds share.
        wiring: Wiring of the arm in it.
        plants: The plant of each world, all of one arm except for its stretched lengths.
        place: Returns the offset of a component in a state row, by its name in mjtState.
    """
    arm = plants[0].arm
    n = arm.n
    has_drives = (wiring.actuator >= 0).all()  # the ideal plant needs none
    worlds["joint"][:, : len(wiring.axis)], worlds["dof"][:, :n] = wiring.axis, wiring.dof
    worlds["force"][:, :n] = model.actuator_outadr[wiring.actuator] if has_drives else -1
    worlds["site"], worlds["body"] = wiring.site, wiring.body
    worlds["qpos_column"][:, :n] = place("QPOS") + wiring.qpos
    worlds["qvel_column"][:, :n] = place("QVEL") + wiring.dof
    controls = model.actuator_ctrladr[wiring.actuator] if has_drives else -1
    worlds["ctrl_column"][:, :n] = place("CTRL") + controls
    worlds["wrench_column"] = place("XFRC_APPLIED") + 6 * wiring.body
    followers = worlds["followers"] = len(arm.followers)
    worlds["follows"][:, :followers] = [one.leader for one in arm.followers]
    worlds["follower_ratio"][:, :followers] = [one.ratio for one in arm.followers]
    worlds["follower_column"][:, :followers] = place("QPOS") + wiring.follower_qpos
    worlds["follower_dof"][:, :followers] = wiring.follower_dof
    carrier = model.body(wiring.body).name
    stretch = np.array([plant.stretch.get(carrier, 1.0) for plant in plants])
    worlds["lever"] = _lever(model, wiring) * stretch[:, None]
    compensates = np.array([plant.compensates for plant in plants])
    write_resistance(worlds, model, wiring, arm, compensates)


def column(model: mujoco.MjModel, component: str) -> int:
    """Return the offset of a component in a state row: components are stored in the order of their bits."""
    bit = int(getattr(mujoco.mjtState, f"mjSTATE_{component}"))
    return int(mujoco.mj_stateSize(model, int(mujoco.mjtState.mjSTATE_INTEGRATION) & (bit - 1)))


def _lever(model: mujoco.MjModel, wiring: Wiring) -> Array:
    """Return the vector from the body's center of mass to the site, in the site's frame, (3,) [m]."""
    inverse = np.empty(4)
    mujoco.mju_negQuat(inverse, model.site_quat[wiring.site])
    lever = np.empty(3)
    offset = model.site_pos[wiring.site] - model.body_ipos[wiring.body]
    mujoco.mju_rotVecQuat(lever, offset, inverse)
    return lever
