"""A mechanism with closed loops: the motion of the site by its actuators."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.arm import Arm
from rmrc.arm.equalities import active_equalities, equality_rows
from rmrc.support.spatial import AXES

Array = NDArray[np.float64]

# A smaller share of the largest singular value is rounding.
_ROUNDING = 1e-9
# Newton's method closes loops that can be closed in a few steps; after this many it has failed.
_STEPS = 50
# The largest remaining gap then [m or rad].
_CLOSED = 1e-10


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Actuators and site of a mechanism with its loops closed, at one configuration [Selig92, exercise 6.2].

    Attributes:
        drives: Joints with an actuator of their own, m of them.
        lengths: Their positions, (m,) [rad or m].
        gap: Smallest opening of the loops, for any positions of the other joints [m or rad].
        rows: Independent motions of the site, the first f of x y z rx ry rz.
        inverse: K: rates of the actuators for a unit of each row, (m, f); None if the site does not determine
            them.
        freedom: Number of motions that remain while all actuators are locked; more than 0 is a singularity of
            the loops.
    """

    drives: tuple[str, ...]
    lengths: Array
    gap: float
    rows: tuple[str, ...]
    inverse: Array | None
    freedom: int


def find_mechanism(arm: Arm, q: Array) -> Mechanism | None:
    """Return the mechanism whose chain to the site is an arm; None if the arm alone is actuated or open.

    The other joints move so that the loops close: from the keyframe `home`, by Newton's method.

    Args:
        arm: The chain from the world to the site.
        q: Its joint positions, (n,) [rad or m].
    """
    model, own = arm.model, arm.wiring.dof
    of_joint = model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT
    driven = [int(joint) for joint in model.actuator_trnid[of_joint, 0]]
    drives = model.jnt_dofadr[driven]
    if not driven or not active_equalities(model) or set(own.tolist()) <= set(drives.tolist()):
        return None
    data = mujoco.MjData(model)
    data.qpos[:] = arm.placed(arm.configuration("home"), q)
    others = np.setdiff1d(np.arange(model.nv), own)
    rows, gap = _closed(model, data, others)
    if not np.abs(rows[:, own]).any():  # the loops are elsewhere
        return None
    _, sigma, basis = np.linalg.svd(rows)
    free = basis[np.count_nonzero(sigma > _ROUNDING * sigma[0]) :].T
    full = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, full[:3], full[3:], arm.wiring.site)
    twist, rates = full @ free, free[drives]
    moving: list[int] = []
    for row in range(6):
        if np.linalg.matrix_rank(twist[[*moving, row]], tol=_ROUNDING) > len(moving):
            moving.append(row)
    return Mechanism(
        drives=tuple(model.joint(joint).name for joint in driven),
        lengths=data.qpos[model.jnt_qposadr[driven]],
        gap=float(np.abs(gap).max()),
        rows=tuple(AXES[row] for row in moving),
        inverse=rates @ np.linalg.inv(twist[moving]) if len(moving) == free.shape[1] else None,
        freedom=int(free.shape[1] - np.linalg.matrix_rank(rates, tol=_ROUNDING)),
    )


def _closed(model: mujoco.MjModel, data: mujoco.MjData, dofs: NDArray[np.intp]) -> tuple[Array, Array]:
    """Close the loops by some joints; return the rows of the equalities there, and the remaining gaps."""
    for _ in range(_STEPS):
        rows, _, gap = equality_rows(model, data)
        if np.abs(gap).max(initial=0.0) < _CLOSED:
            break
        step = np.zeros(model.nv)
        step[dofs] = -np.linalg.pinv(rows[:, dofs], rcond=_ROUNDING) @ gap
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
    return rows, gap
