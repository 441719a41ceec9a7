"""The parts of a model beside its arm: actuators and their targets, other joints, contacts."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.actuators import kind_word
from rmrc.arm.arm import Arm
from rmrc.arm.wiring import joint_name, joints_above, soft_bodies

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Actuator:
    """An actuator of the model, as its author wrote it.

    Attributes:
        name: Its own, or its number.
        kind: `position`, `velocity`, `intvelocity`, `motor`, `muscle` or `general`, by its computation.
        drives: `joint`, `tendon`, `site` or `body`, and its name.
        is_replaced: Whether it acts on the arm alone, so that a plant replaces it.
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
        kind: `hinge`, `slide`, `ball` or `free`.
        body: The body that it moves.
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
    model, replaced = arm.model, arm.others.replaced
    names = enumerate(model.actuator(i).name or f"actuator{i}" for i in range(model.nactuator))
    return tuple(Actuator(name, kind_word(model, i), _target(model, i), i in replaced) for i, name in names)


def _target(model: mujoco.MjModel, i: int) -> str:
    word = mujoco.mjtTrn(int(model.actuator_trntype[i])).name.removeprefix("mjTRN_").lower()
    word = {"jointinparent": "joint", "slidercrank": "site"}.get(word, word)
    number = int(model.actuator_trnid[i, 0])
    return f"{word} {getattr(model, word)(number).name or f'{word}{number}'}"


def other_joints(arm: Arm) -> tuple[OtherJoint, ...]:
    """Return the joints that are neither the arm's nor its followers, without those of a flex."""
    model, idle, soft, others = arm.model, arm.idle(), soft_bodies(arm.model), []
    for i in sorted(set(range(model.njnt)) - arm.others.own):
        kind = mujoco.mjtJoint(int(model.jnt_type[i])).name.removeprefix("mjJNT_").lower()
        name, body = joint_name(model, i), int(model.jnt_bodyid[i])
        others += [OtherJoint(name, kind, arm.body_names[body], name in idle)] if body not in soft else []
    return tuple(others)


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
