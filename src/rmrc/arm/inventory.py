"""The parts of a model beside its arm: actuators and their targets, other joints, and contacts."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.arm import Arm
from rmrc.arm.wiring import HINGE, SLIDE, flex_bodies, flex_name, joint_name, soft_bodies

# MuJoCo's arrays hold plain integers, which its enums do not equal.
_KINDS = {HINGE: "hinge", SLIDE: "slide", int(mujoco.mjtJoint.mjJNT_BALL): "ball"}
_DRIVEN = {
    int(mujoco.mjtTrn.mjTRN_JOINT): ("joint", mujoco.mjtObj.mjOBJ_JOINT),
    int(mujoco.mjtTrn.mjTRN_JOINTINPARENT): ("joint", mujoco.mjtObj.mjOBJ_JOINT),
    int(mujoco.mjtTrn.mjTRN_TENDON): ("tendon", mujoco.mjtObj.mjOBJ_TENDON),
    int(mujoco.mjtTrn.mjTRN_SITE): ("site", mujoco.mjtObj.mjOBJ_SITE),
    int(mujoco.mjtTrn.mjTRN_BODY): ("body", mujoco.mjtObj.mjOBJ_BODY),
}
_INTEGRATOR, _MUSCLE = int(mujoco.mjtDyn.mjDYN_INTEGRATOR), int(mujoco.mjtDyn.mjDYN_MUSCLE)
_AFFINE, _FIXED = int(mujoco.mjtBias.mjBIAS_AFFINE), int(mujoco.mjtGain.mjGAIN_FIXED)
_NO_BIAS, _NO_DYNAMICS = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtDyn.mjDYN_NONE)


@dataclass(frozen=True)
class Actuator:
    """An actuator of the model, as its author wrote it.

    Attributes:
        name: Its own, or its number.
        kind: `position`, `velocity`, `intvelocity`, `motor`, `muscle` or `general`, by its computation.
        drives: `joint`, `tendon`, `site` or `body`, and its name.
        is_replaced: Whether it acts on a joint of the arm alone, so that a plant replaces it.
    """

    name: str
    kind: str
    drives: str
    is_replaced: bool


@dataclass(frozen=True)
class OtherJoint:
    """A joint of the model that is not actuated.

    Attributes:
        name: Its own, or its number.
        kind: `hinge`, `slide`, `ball`, `free` or `flex`.
        body: The body that it moves; for a flex the last one.
        moves_site: Whether it is between the world and the site.
    """

    name: str
    kind: str
    body: str
    moves_site: bool


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


def actuators(arm: Arm) -> tuple[Actuator, ...]:
    """Return all actuators of the author's model, in its order."""
    model = arm.model
    return tuple(
        Actuator(model.actuator(i).name or f"actuator{i}", _actuator_kind(model, i), *_driven(arm, i))
        for i in range(model.nactuator)
    )


def other_joints(arm: Arm) -> tuple[OtherJoint, ...]:
    """Return the joints of the model that are neither the arm's nor its followers; a flex is one."""
    model, idle, soft = arm.model, arm.idle, soft_bodies(arm.model)
    own = {*arm.joints, *(one.name for one in arm.followers)}
    flexes = (
        OtherJoint(flex_name(model, i), "flex", _body(model, max(flex_bodies(model, i))), False)
        for i in range(model.nflex)
    )
    joints = (
        OtherJoint(
            name,
            _KINDS.get(int(model.jnt_type[i]), "free"),
            _body(model, int(model.jnt_bodyid[i])),
            name in idle,
        )
        for i in range(model.njnt)
        if (name := joint_name(model, i)) not in own and int(model.jnt_bodyid[i]) not in soft
    )
    return (*joints, *flexes)


def contacts(arm: Arm, qpos: NDArray[np.float64]) -> tuple[Contact, ...]:
    """Return the contacts at any of some configurations of the model, (N, nq), the deepest first.

    These are MuJoCo's contacts of negative distance, the deepest of each pair. Like MuJoCo, they leave out
    pairs that the model excludes, bodies that are welded together, and parent and child.
    """
    model, data, above = arm.model, mujoco.MjData(arm.model), _joints_above(arm)
    arm.place_mocap(data)
    depths: dict[tuple[int, int], float] = {}
    for configuration in qpos:
        data.qpos[:] = configuration
        mujoco.mj_fwdKinematics(model, data)
        mujoco.mj_collision(model, data)
        for contact in data.contact[: data.ncon]:
            pair = int(contact.geom[0]), int(contact.geom[1])
            if contact.dist < 0.0 and min(pair) >= 0:
                depths[pair] = max(depths.get(pair, 0.0), -float(contact.dist))
    found = []
    for pair, depth in depths.items():
        first, second = (int(model.geom_bodyid[geom]) for geom in pair)
        one, other = (model.geom(geom).name or f"geom{geom}" for geom in pair)
        bodies = _body(model, first), _body(model, second)
        found.append(Contact((one, other), bodies, depth, above[first] != above[second]))
    return tuple(sorted(found, key=lambda contact: (-contact.depth, contact.geoms)))


def _joints_above(arm: Arm) -> list[int]:
    """Return how many joints of the arm move each body, (nbody,)."""
    model, own = arm.model, set(arm.wiring.joint.tolist())
    above = [0] * model.nbody
    for body in range(1, model.nbody):
        first = int(model.body_jntadr[body])
        joints = range(first, first + int(model.body_jntnum[body]))
        above[body] = above[int(model.body_parentid[body])] + len(own.intersection(joints))
    return above


def _body(model: mujoco.MjModel, body: int) -> str:
    return model.body(body).name or f"body{body}"


def _driven(arm: Arm, i: int) -> tuple[str, bool]:
    model = arm.model
    what, kind = _DRIVEN.get(int(model.actuator_trntype[i]), ("site", mujoco.mjtObj.mjOBJ_SITE))
    number = int(model.actuator_trnid[i, 0])
    name = mujoco.mj_id2name(model, int(kind), number) or f"{what}{number}"
    return f"{what} {name}", what == "joint" and name in arm.joints


def _actuator_kind(model: mujoco.MjModel, i: int) -> str:
    """Return the kind of an actuator by its computation, whichever element of MJCF it was written as."""
    dynamics, bias = int(model.actuator_dyntype[i]), int(model.actuator_biastype[i])
    stiffness, damping = -model.actuator_biasprm[i, 1], -model.actuator_biasprm[i, 2]
    if dynamics == _MUSCLE:
        return "muscle"
    if int(model.actuator_gaintype[i]) == _FIXED and bias == _AFFINE:
        if stiffness > 0.0:
            return "intvelocity" if dynamics == _INTEGRATOR else "position"
        if damping > 0.0 and dynamics == _NO_DYNAMICS:
            return "velocity"
    is_motor = bias == _NO_BIAS and int(model.actuator_gaintype[i]) == _FIXED and dynamics == _NO_DYNAMICS
    return "motor" if is_motor else "general"
