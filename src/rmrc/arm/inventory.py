"""The parts of a model beside its arm: other joints, contacts, masses from shapes, closed loops."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.adapting import is_behind
from rmrc.arm.arm import Arm
from rmrc.arm.equalities import active_equalities, equality_rows
from rmrc.arm.wiring import DRIVES_JOINT, joint_name, joints_above, soft_bodies
from rmrc.support.spatial import AXES, Array

# Density of a shape without one [kg/m³].
WATER = 1000.0
# A smaller share of the largest singular value is rounding.
_ROUNDING = 1e-9
# Newton's method closes loops that can be closed in a few steps; after this many it has failed.
_STEPS = 50
# The largest remaining gap then [m or rad].
_CLOSED = 1e-10


@dataclass(frozen=True)
class Contact:
    """Two geoms that overlap.

    Attributes:
        geoms: Their names, or numbers.
        bodies: Their bodies.
        depth: Depth of the overlap [m].
        is_moved: Whether a joint of the arm moves one of the two and not the other.
    """

    geoms: tuple[str, str]
    bodies: tuple[str, str]
    depth: float
    is_moved: bool


def other_joints(arm: Arm) -> tuple[str, ...]:
    """Return the joints that are neither the arm's nor its followers, without those of a flex."""
    model, soft = arm.model, soft_bodies(arm.model)
    others = sorted(set(range(model.njnt)) - arm.others.own)
    return tuple(joint_name(model, i) for i in others if int(model.jnt_bodyid[i]) not in soft)


def contacts(arm: Arm, qpos: Array) -> tuple[Contact, ...]:
    """Return the contacts at any of some configurations of the model, (N, nq), the deepest first.

    These are MuJoCo's contacts of negative distance, the deepest of each pair. Like MuJoCo, they leave out
    pairs that the model excludes, bodies that are welded together, and parent and child.
    """
    model, own = arm.model, set(arm.wiring.joint.tolist())
    depths: dict[tuple[int, int], float] = {}
    for configuration in qpos:
        data = arm.data_at(configuration)
        mujoco.mj_collision(model, data)
        for contact in data.contact[: data.ncon]:
            pair = int(contact.geom[0]), int(contact.geom[1])
            if contact.dist < 0.0 and min(pair) >= 0:
                depths[pair] = max(depths.get(pair, 0.0), -float(contact.dist))
    found = []
    for pair, depth in depths.items():
        bodies = model.geom_bodyid[list(pair)].tolist()
        first, second = (own.intersection(joints_above(model, body)) for body in bodies)
        geoms, names = [model.geom(i).name or f"geom{i}" for i in pair], [arm.body_names[b] for b in bodies]
        found.append(Contact((geoms[0], geoms[1]), (names[0], names[1]), depth, first != second))
    return tuple(sorted(found, key=lambda contact: (-contact.depth, contact.geoms)))


def shape_masses(arm: Arm) -> dict[str, float]:
    """Return the masses [kg] that the file lacks, by body: MuJoCo computes them from shapes of 1000 kg/m³."""
    model, root = arm.model, int(arm.model.jnt_bodyid[arm.wiring.joint[0]])
    bodies = () if arm._spec is None else arm._spec.bodies[1:]
    return {
        arm.body_names[body.id]: float(model.body_mass[body.id])
        for body in bodies
        if is_behind(model, root)[body.id] and not body.explicitinertial and model.body_mass[body.id] > 0.0
        and any(np.isnan(geom.mass) and geom.density == WATER for geom in body.geoms)
    }  # fmt: skip


# Closed loops -----------------------------------------------------------------------------------


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
    of_joint = model.actuator_trntype == DRIVES_JOINT
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
