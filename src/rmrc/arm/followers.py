"""Which joints follow others: linear equalities of the model make them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.wiring import HINGE, SLIDE, joint_name
from rmrc.support.errors import ModelError

# MuJoCo's arrays hold plain integers, which its enums do not equal.
_JOINT_EQUALITY = int(mujoco.mjtEq.mjEQ_JOINT)
_NO_EQUALITIES = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)

# A screw's slide is parallel to its hinge up to the 1 − cos that eight digits of an axis in a file leave.
PARALLEL = 1e-9


@dataclass(frozen=True)
class Follower:
    """A joint that follows one of the arm's.

    position = offset + ratio · (position of its leader)

    Attributes:
        name: Name of the joint.
        leader: The joint of the arm that it follows.
        ratio: Its motion for each rad or m of its leader [m or rad].
        offset: [m or rad]
        pitch: Pitch of the screw formed with its leader, an adjacent hinge on the same axis: ± ratio, by the
            direction in which it slides along that axis [m/rad]; 0 where it forms none.
    """

    name: str
    leader: int
    ratio: float
    offset: float
    pitch: float = 0.0

    @property
    def is_screw(self) -> bool:
        """Whether it is the slide of a screw joint."""
        return self.pitch != 0.0


@dataclass(frozen=True)
class Link:
    """How a joint follows another by an equality: position = offset + ratio · (position of the leader).

    Attributes:
        leader: Id of the joint that it finally follows, which follows none; -1 if it is held still.
        ratio: [m or rad per m or rad]
        offset: [m or rad]
    """

    leader: int
    ratio: float
    offset: float


def active_equalities(model: mujoco.MjModel) -> list[int]:
    """Return the equalities that are active from the start."""
    if model.opt.disableflags & _NO_EQUALITIES:
        return []
    return [int(i) for i in np.flatnonzero(model.eq_active0)]


def find_links(path: Path, model: mujoco.MjModel, chain: Sequence[str]) -> dict[str, Link]:
    """Return the link of each follower, by its name, through other joints to one that follows none.

    Followers on the chain come first, outward. Other followers are left out if their link is invalid.

    Raises:
        ModelError: A joint of the chain follows another by a polynomial, two of them, or in a circle.
    """
    rules: dict[int, list[tuple[int, NDArray[np.float64]]]] = {}
    for i in active_equalities(model):
        if model.eq_type[i] == _JOINT_EQUALITY:
            rule = int(model.eq_obj2id[i]), np.array(model.eq_data[i, :5])
            rules.setdefault(int(model.eq_obj1id[i]), []).append(rule)
    links = {}
    elsewhere = [name for joint in rules if (name := model.joint(joint).name) and name not in chain]
    for name in (*chain, *elsewhere):
        joint = model.joint(name).id
        try:
            if joint in rules:
                links[name] = _followed(path, model, joint, rules)
        except ModelError:
            if name in chain:
                raise
    return links


def _followed(
    path: Path,
    model: mujoco.MjModel,
    joint: int,
    rules: Mapping[int, Sequence[tuple[int, NDArray[np.float64]]]],
) -> Link:
    """Return the final link of a joint."""
    at, ratio, offset, passed = joint, 1.0, 0.0, {joint}
    while at in rules:
        (leader, polynomial), more = rules[at][0], rules[at][1:]
        says = f'{path}: joint "{_name(model, at)}" follows "{_name(model, leader)}"'
        if more:
            raise ModelError(f'{says} and "{_name(model, more[0][0])}" by equalities; remove one of them')
        if polynomial[2:].any():
            given = " ".join(f"{value:g}" for value in polynomial)
            raise ModelError(
                f"{says} by an equality that is not linear; on the chain to a site polycoef must be "
                f"a b 0 0 0, got {given}"
            )
        offset += ratio * (float(polynomial[0]) + _zero(model, at))
        ratio *= float(polynomial[1]) if leader >= 0 else 0.0
        if leader in passed:
            raise ModelError(f"{says} by equalities in a circle; remove one of them")
        offset -= ratio * _zero(model, leader)
        at = leader
        passed.add(at)
    return Link(at, ratio, offset)


def _zero(model: mujoco.MjModel, joint: int) -> float:
    return float(model.qpos0[model.jnt_qposadr[joint]]) if joint >= 0 else 0.0


def _name(model: mujoco.MjModel, joint: int) -> str:
    return joint_name(model, joint) if joint >= 0 else "nothing"


def followers(
    model: mujoco.MjModel, chain: Sequence[str], links: Mapping[str, Link], driven: Sequence[str]
) -> tuple[Follower, ...]:
    """Return the joints that follow actuated ones, on the chain or not.

    Args:
        model: The author's model.
        chain: Names of its joints, outward.
        links: The links of the followers.
        driven: Names of the joints of the arm.
    """
    data = mujoco.MjData(model)
    mujoco.mj_fwdKinematics(model, data)
    number = {model.joint(name).id: i for i, name in enumerate(driven)}
    found, has_slide = [], set[int]()
    for name, link in links.items():
        if link.leader not in number:
            continue
        joint, pitch = model.joint(name).id, 0.0
        kinds = int(model.jnt_type[link.leader]), int(model.jnt_type[joint])
        along = float(data.xaxis[link.leader] @ data.xaxis[joint])
        ends = model.joint(link.leader).name, name
        beside = name in chain and abs(chain.index(ends[0]) - chain.index(ends[1])) == 1
        if kinds == (HINGE, SLIDE) and beside and abs(abs(along) - 1.0) < PARALLEL:
            pitch = link.ratio if along > 0.0 else -link.ratio
        if link.leader in has_slide:
            pitch = 0.0
        has_slide |= {link.leader} if pitch else set()
        found.append(Follower(name, number[link.leader], link.ratio, link.offset, pitch))
    return tuple(found)
