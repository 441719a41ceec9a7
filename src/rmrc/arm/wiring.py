"""Where an arm is found in a model: its site, the chain of joints to it, and which joints follow others."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.support.errors import ModelError, did_you_mean
from rmrc.support.legible import listed

# MuJoCo's arrays hold plain integers, which its enums do not equal.
HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
JOINT_EQUALITY = int(mujoco.mjtEq.mjEQ_JOINT)
DRIVES_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)

# A screw's slide points along its hinge to what eight digits of an axis in a file leave of 1 − cos.
PARALLEL = 1e-9


@dataclass(frozen=True)
class Travel:
    """The slide of a screw joint: an equality of the model makes it follow its hinge.

    position = offset + ratio · (position of the hinge)

    Attributes:
        name: Of the slide.
        hinge: Which joint of the arm it follows.
        ratio: [m/rad]
        offset: [m]
        pitch: Way along the hinge's axis: ± ratio, as the slide points along it or back [m/rad].
    """

    name: str
    hinge: int
    ratio: float
    offset: float
    pitch: float


@dataclass(frozen=True)
class Wiring:
    """Where the arm is found in a model that MuJoCo compiled: four kinds of index, never mixed up.

    Attributes:
        joint: Joint ids, (n,).
        qpos: Addresses in qpos, (n,).
        dof: Addresses in qvel, (n,).
        actuator: Actuator ids, (n,); -1 where the model has none.
        travel_qpos: Addresses in qpos of the slides of screw joints, in the order of `Arm.travels`.
        travel_dof: Their addresses in qvel.
        site: Site id.
        body: Id of the body that carries the site.
    """

    joint: NDArray[np.int64]
    qpos: NDArray[np.int64]
    dof: NDArray[np.int64]
    actuator: NDArray[np.int64]
    travel_qpos: NDArray[np.int64]
    travel_dof: NDArray[np.int64]
    site: int
    body: int


def wire(model: mujoco.MjModel, joints: Sequence[str], travels: Sequence[str], site: str) -> Wiring:
    """Resolve the names of joints, of the slides that follow them, and of the site."""
    ids = np.array([model.joint(name).id for name in joints])
    slides = np.array([model.joint(name).id for name in travels], np.int64)
    drives = {
        int(model.actuator_trnid[i, 0]): i
        for i in range(model.nactuator)
        if model.actuator_trntype[i] == DRIVES_JOINT
    }
    return Wiring(
        joint=ids,
        qpos=model.jnt_qposadr[ids].astype(np.int64),
        dof=model.jnt_dofadr[ids].astype(np.int64),
        actuator=np.array([drives.get(int(i), -1) for i in ids]),
        travel_qpos=model.jnt_qposadr[slides].astype(np.int64),
        travel_dof=model.jnt_dofadr[slides].astype(np.int64),
        site=model.site(site).id,
        body=int(model.site_bodyid[model.site(site).id]),
    )


def find_site(path: Path, model: mujoco.MjModel, wanted: str) -> str:
    """Return the site that is wanted.

    Raises:
        ModelError: There is none of that name.
    """
    sites: list[str] = [name for i in range(model.nsite) if (name := model.site(i).name)]
    if wanted not in sites:
        hint, known = did_you_mean(wanted, sites), listed(sites) or "none"
        raise ModelError(f'{path}: has no site "{wanted}"{hint}; its sites: {known}', "site")
    return wanted


def find_body(path: Path, model: mujoco.MjModel, wanted: str, about: str = "body") -> int:
    """Return the id of the body that is wanted.

    Args:
        path: Of the model.
        model: Compiled.
        wanted: Its name.
        about: What the error is about.

    Raises:
        ModelError: There is none of that name.
    """
    bodies: list[str] = [name for i in range(1, model.nbody) if (name := model.body(i).name)]
    if wanted not in bodies:
        hint, known = did_you_mean(wanted, bodies), listed(bodies) or "none"
        raise ModelError(f'{path}: has no body "{wanted}"{hint}; its bodies: {known}', about)
    return int(model.body(wanted).id)


def joints_above(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the joints between the world and a body, its own among them, the last first."""
    joints: list[int] = []
    while body > 0:
        first = model.body_jntadr[body]
        joints += reversed(range(first, first + model.body_jntnum[body]))
        body = int(model.body_parentid[body])
    return joints


def find_chain(path: Path, model: mujoco.MjModel, site: str) -> list[str]:
    """Return the names of the joints between the world and a site, outward."""
    chain: list[str] = []
    for i in joints_above(model, int(model.site_bodyid[model.site(site).id])):
        joint, b = model.joint(i), int(model.jnt_bodyid[i])
        body = model.body(b).name or f"body{b}"
        if joint.type[0] not in (HINGE, SLIDE):
            raise ModelError(
                f'{path}: the joint of body "{body}" on the chain to site "{site}" is a ball or free '
                "joint; only hinge and slide joints can be driven at a rate",
                "site",
            )
        if not joint.name:
            raise ModelError(f'{path}: a joint of body "{body}" has no name; give it one')
        chain.append(joint.name)
    if not chain:
        raise ModelError(f'{path}: no joint moves site "{site}"; choose a site on a moving body', "site")
    return chain[::-1]


def find_travels(path: Path, model: mujoco.MjModel, chain: Sequence[str]) -> dict[str, Travel]:
    """Return the slides of screw joints by name; `hinge` counts the joints of the chain that follow none.

    Raises:
        ModelError: A joint of the chain follows another in any other way, which no Jacobian here knows.
    """
    data = mujoco.MjData(model)
    mujoco.mj_fwdKinematics(model, data)
    leaders: dict[str, tuple[str, NDArray[np.float64]]] = {}
    for i in np.flatnonzero((model.eq_type == JOINT_EQUALITY) & (model.eq_active0 == 1)):
        follower = model.joint(int(model.eq_obj1id[i])).name
        leader = model.joint(int(model.eq_obj2id[i])).name if model.eq_obj2id[i] >= 0 else ""
        if follower in chain:
            leaders[follower] = leader, np.array(model.eq_data[i, :5])
    own = [name for name in chain if name not in leaders]
    travels = {}
    for follower, (leader, polynomial) in leaders.items():
        slide, hinge = model.joint(follower), model.joint(leader) if leader in own else None
        along = 0.0
        if hinge is not None and abs(chain.index(leader) - chain.index(follower)) == 1:
            along = float(data.xaxis[hinge.id] @ data.xaxis[slide.id])
        is_screw = hinge is not None and (hinge.type[0], slide.type[0]) == (HINGE, SLIDE)
        if not (is_screw and abs(abs(along) - 1.0) < PARALLEL and not polynomial[2:].any()):
            how = f'follows "{leader}"' if leader else "is held"
            raise ModelError(
                f'{path}: joint "{follower}" {how} by an equality; on the chain to a site that '
                "may only make a screw: a slide along the axis of the hinge beside it, polycoef a b 0 0 0"
            )
        start, ratio = polynomial[0] + model.qpos0[slide.qposadr[0]], float(polynomial[1])
        offset = float(start - ratio * model.qpos0[model.joint(leader).qposadr[0]])
        travels[follower] = Travel(
            follower, own.index(leader), ratio, offset, ratio if along > 0.0 else -ratio
        )
    return travels
