"""The frame of a model that is controlled where its user names none: that of the hand, not of a finger."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from rmrc.arm.wiring import HINGE, SLIDE, joints_above, joints_of, soft_bodies

# Beginnings of words in names of frames to mount, hold or aim with, the most specific last; those of three
# letters or fewer are whole words.
_TELLING = (
    ("attach", "flange", "mount"),
    ("grip", "hand", "palm"),
    ("ee", "eef", "effector", "endeff", "tip", "tool"),
    ("grasp", "pinch", "tcp"),
)
# Words in the names of other things there: sensors, displays, parts of the gripper.
_BESIDE = (
    "axis", "base", "cali", "cam", "camera", "center", "claw", "cylinder", "finger", "focus", "force", "ft",
    "goal", "imu", "inner", "jaw", "knuckle", "lidar", "light", "marker", "motor", "object", "outer", "pad",
    "pads", "sensor", "target", "thumb", "torque", "touch", "x", "y", "z",
)  # fmt: skip
_FINGERS = ("claw", "finger", "jaw", "knuckle", "thumb")
# Joints of the longest finger, a thumb.
_LONGEST_FINGER = 5
# A joint of the wrist may be called the gripper's.
_TURNS = ("pitch", "roll", "rot", "wrist", "yaw")


@dataclass(frozen=True)
class Frame:
    """A frame of a model that may be controlled.

    Attributes:
        kind: `site` or `body`.
        id: Its id in the model.
        why: The reason for it, in words.
        others: Other candidates: names of sites and bodies, as messages have them.
        is_clear: Whether its name is more specific than those of all other sites.
    """

    kind: str
    id: int
    why: str
    others: tuple[str, ...]
    is_clear: bool


def default_frame(model: mujoco.MjModel, prefix: str = "") -> Frame | None:
    """Return the frame of a model's hand; None where no joint moves anything.

    It is a site whose name says so, on the links beyond the first half of the arm's joints, the farthest of
    them. Otherwise it is the only site beside the fingers that belongs to no camera or sensor; otherwise a
    body that moves with the last link, whose name says so or from which fingers branch; otherwise the last
    link.

    Args:
        model: Any model.
        prefix: Beginning of the names of the sites and bodies to choose from.
    """
    links = _trunk(model)
    if not links:
        return None
    last = links[-1]
    joints = len(_joints(model, last))
    welded = {int(model.body_weldid[b]) for b in links} - {0}
    sites = [
        i
        for i in range(model.nsite)
        if int(model.body_weldid[model.site_bodyid[i]]) in welded and model.site(i).name.startswith(prefix)
        if model.site(i).name
    ]
    depth = {i: len(_joints(model, int(model.site_bodyid[i]))) for i in sites}
    telling = [
        i
        for i in sites
        if (rank := _rank(model.site(i).name)) == len(_TELLING) or (rank > 0 and 2 * depth[i] >= joints)
    ]
    beside = [i for i in sites if depth[i] == joints and _rank(model.site(i).name) == 0]
    bodies = [b for b in range(model.nbody) if model.body_weldid[b] == model.body_weldid[last]]
    named = [b for b in bodies if _rank(model.body(b).name) > 0 and model.body(b).name.startswith(prefix)]
    if telling:
        found = "site", max(telling, key=lambda i: (depth[i], _rank(model.site(i).name), i)), "by its name"
    elif len(beside) == 1:
        found = "site", beside[0], "as the only one on the last link"
    elif named:
        found = "body", max(named, key=lambda b: (*_telling(model.body(b).name), b == last, b)), "by its name"
    else:
        branches = np.flatnonzero(
            (model.body_parentid == last) & (model.body_weldid != model.body_weldid[last])
        )
        branches = np.setdiff1d(branches, list(soft_bodies(model)))
        found = (
            ("body", last, "as the last before the fingers")
            if len(branches)
            else ("body", _end(model, last), "as the last link")
        )
    kind, chosen, why = found
    others = [f'site "{model.site(i).name}"' for i in sites if (kind, chosen) != ("site", i)]
    if kind == "body":
        others += [f'body "{name}"' for b in bodies if b != chosen and (name := model.body(b).name)]
    ranks = [_rank(model.site(i).name) for i in sites if i != chosen]
    is_clear = kind == "site" and _rank(model.site(chosen).name) > max(ranks, default=-1)
    return Frame(kind, chosen, why, tuple(others), is_clear)


def _trunk(model: mujoco.MjModel) -> list[int]:
    """Return the bodies from the first that a joint moves to the one before the fingers, outward."""
    children = _children(model, soft_bodies(model))
    depth = _depths(model, children)
    for into_fingers in (False, True):
        links: list[int] = []
        body, joints = 0, 0
        while True:
            ahead = [b for b in children[body] if depth[b] > 0]
            ways = [b for b in ahead if into_fingers or not _is_finger(model, b)]
            # branches belong to a hand if they are no longer than the chain before them, or as many and as
            # short as fingers
            longest = max((depth[b] for b in ahead), default=0)
            is_hand = joints >= longest or (len(ahead) > 3 and longest <= _LONGEST_FINGER)
            if not ways or (joints > 0 and len(ahead) > 1 and is_hand):
                break
            body = max(ways, key=lambda b: depth[b])
            joints += len(_own(model, body))
            links.append(body)
        if joints:
            return links
    return []


def _children(model: mujoco.MjModel, but: frozenset[int]) -> list[list[int]]:
    children: list[list[int]] = [[] for _ in range(model.nbody)]
    for body in (one for one in range(1, model.nbody) if one not in but):
        children[int(model.body_parentid[body])].append(body)
    return children


def _depths(model: mujoco.MjModel, children: Sequence[Sequence[int]]) -> list[int]:
    """Return the most hinges and slides on one branch that begins with a body; 0 beyond a ball."""
    depth = [0] * model.nbody
    for body in range(model.nbody - 1, 0, -1):  # children come after their parents
        first = int(model.body_jntadr[body])
        kinds = model.jnt_type[first : first + int(model.body_jntnum[body])]
        if not (kinds == mujoco.mjtJoint.mjJNT_BALL).any():
            depth[body] = max((depth[b] for b in children[body]), default=0) + len(_own(model, body))
    return depth


def _end(model: mujoco.MjModel, body: int) -> int:
    """Return the end of a series of bodies that are fixed to a link, as flanges are in URDF."""
    while (
        len(fixed := np.flatnonzero(model.body_parentid == body)) == 1
        and _rank(model.body(fixed[0]).name) >= 0
    ):
        body = int(fixed[0])
    return body


def _own(model: mujoco.MjModel, body: int) -> list[int]:
    return [i for i in joints_of(model, body) if model.jnt_type[i] in (HINGE, SLIDE)]


def _joints(model: mujoco.MjModel, body: int) -> list[int]:
    return [i for i in joints_above(model, body) if model.jnt_type[i] in (HINGE, SLIDE)]


def _is_finger(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a body, or a joint that moves it, has the name of a finger or a gripper."""
    joints = [_words(model.joint(i).name) for i in _own(model, body)]
    if any(_has(words, _FINGERS) for words in (_words(model.body(body).name), *joints)):
        return True
    return any(_has(words, ("grip",)) and not _has(words, _TURNS) for words in joints)


def _rank(name: str) -> int:
    """Return how specific a name is: 0 is unspecific, and -1 means something else than a hand."""
    words = _words(name)
    if _has(words, _BESIDE):
        return -1
    return max((rank for rank, known in enumerate(_TELLING, start=1) if _has(words, known)), default=0)


def _telling(name: str) -> tuple[int, bool]:
    """Return how specific a name is, and whether it is that of a frame, which exists to be named."""
    return _rank(name), "frame" in _words(name)


def _has(words: Sequence[str], known: Sequence[str]) -> bool:
    return any(word == one or (len(one) > 3 and word.startswith(one)) for word in words for one in known)


def _words(name: str) -> list[str]:
    """Return the words of a name, in lower case: `vx300s/gripper_link1` has vx, s, gripper and link."""
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]
