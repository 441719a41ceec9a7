"""The frame of a model that is controlled where its user names none: that of the hand, not of a finger.

What a program assumes about a model with an incomplete file is a line; some lines have their own code.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.wiring import HINGE, SLIDE, joints_of, soft_bodies
from rmrc.support.errors import ModelError
from rmrc.support.legible import listed

Counts = NDArray[np.int64]

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


class Note(str):
    """A line about an assumption.

    Attributes:
        code: The code by which `rmrc check` reports it.
        is_obvious: Whether hardly anybody would doubt it, so that only answers that list all have it.
    """

    code = "assumed"
    is_obvious = False


def note(code: str, text: str, is_obvious: bool = False) -> Note:
    """Return a line with its own code.

    >>> note("frame", 'site "tool" is controlled').code
    'frame'
    """
    line = Note(text)
    line.code, line.is_obvious = code, is_obvious
    return line


def code_of(line: str) -> str:
    """Return the code of a line; `assumed` for those without.

    >>> code_of(note("frame", "a")), code_of("a")
    ('frame', 'assumed')
    """
    return getattr(line, "code", "assumed")


def default_frame(
    path: Path, model: mujoco.MjModel, does: str = "is controlled", prefix: str = ""
) -> tuple[Literal["site", "body"], int, list[Note]]:
    """Return the frame of a model's hand: what the first of some rules finds.

    It is a site whose name says so, on the links beyond the first half of the arm's joints, the farthest of
    them. Otherwise it is the only site beside the fingers that belongs to no camera or sensor; otherwise a
    body that moves with the last link, whose name says so or from which fingers branch; otherwise the last
    link.

    Args:
        path: Path of the model.
        model: Any model.
        does: What the note says of the frame.
        prefix: Beginning of the names of the sites and bodies to choose from.

    Returns:
        Its kind, its id, and a note about the choice unless there is no other.

    Raises:
        ModelError: No joint moves anything.
    """
    counts = np.bincount(model.jnt_bodyid[np.isin(model.jnt_type, (HINGE, SLIDE))], minlength=model.nbody)
    links = _trunk(model, counts)
    if not links:
        raise ModelError(f"{path}: has no hinge or slide joint that moves a body; an arm needs at least one")
    last, weld, before = links[-1], model.body_weldid, counts.copy()
    for body in range(1, model.nbody):
        before[body] += before[model.body_parentid[body]]
    moving = set(weld[links].tolist()) - {0}
    names = {i: model.site(i).name for i in range(model.nsite) if weld[model.site_bodyid[i]] in moving}
    sites = {i: name for i, name in names.items() if name and name.startswith(prefix)}
    bodies = {int(b): model.body(b).name for b in np.flatnonzero(weld == weld[last])}
    # how good each is: the farthest, most specific site, and a body that exists to be named
    grade = {i: (before[model.site_bodyid[i]], _rank(name), i) for i, name in sites.items()}
    grades = {b: (_rank(name), "frame" in _words(name), b == last, b) for b, name in bodies.items()}
    named = [i for i, (depth, rank, _) in grade.items() if rank > 0 and 2 * depth >= before[last]]
    plain = [i for i, (depth, rank, _) in grade.items() if rank == 0 and depth == before[last]]
    hands = [b for b, name in bodies.items() if grades[b][0] > 0 and name.startswith(prefix)]
    fingers = {*np.flatnonzero((model.body_parentid == last) & (weld != weld[last]))} - soft_bodies(model)
    rules: tuple[tuple[Literal["site", "body"], list[int], str], ...] = (
        ("site", sorted(named, key=grade.__getitem__), "by its name"),
        ("site", plain if len(plain) == 1 else [], "as the only one on the last link"),
        ("body", sorted(hands, key=grades.__getitem__), "by its name"),
        ("body", [last] if fingers else [], "as the last before the fingers"),
        ("body", [_end(model, last)], "as the last link"),
    )
    kind, (*_, chosen), why = next(rule for rule in rules if rule[1])
    others = [f'site "{name}"' for i, name in sites.items() if (kind, chosen) != ("site", i)]
    if kind == "body":
        others += [f'body "{name}"' for b, name in bodies.items() if b != chosen and name]
    elif not others:
        return kind, chosen, []
    is_clear = kind == "site" and all(grade[i][1] < grade[chosen][1] for i in sites if i != chosen)
    name = getattr(model, kind)(chosen).name
    text = f"{kind} " + (f'"{name}"' if name else str(chosen)) + f" {does}, chosen {why}"
    text += f"; others: {listed(others)}; name one by site or body" if others else ""
    return kind, chosen, [note("frame", text, is_clear)]


def _trunk(model: mujoco.MjModel, counts: Counts) -> list[int]:
    """Return the bodies from the first that a joint moves to the one before the fingers, outward.

    Args:
        model: The model.
        counts: The number of hinges and slides of each body, (nbody,).
    """
    depth, soft = counts.copy(), soft_bodies(model)  # the most joints on one branch that begins with a body
    for body in range(model.nbody - 1, 0, -1):  # children come after their parents
        branches = depth[model.body_parentid == body]
        depth[body] = 0 if body in soft else counts[body] + max(branches, default=0)
    depth[0] = 0
    for into_fingers in (False, True):
        links, body, joints = list[int](), 0, 0
        while True:
            ahead = np.flatnonzero((model.body_parentid == body) & (depth > 0)).tolist()
            ways = [b for b in ahead if into_fingers or not _is_finger(model, b)]
            # branches belong to a hand if they are no longer than the chain before them, or as many and as
            # short as fingers
            longest = max(depth[ahead], default=0)
            is_hand = joints >= longest or (len(ahead) > 3 and longest <= _LONGEST_FINGER)
            if not ways or (joints > 0 and len(ahead) > 1 and is_hand):
                break
            body = max(ways, key=depth.__getitem__)
            joints += int(counts[body])
            links.append(body)
        if joints:
            return links
    return []


def _end(model: mujoco.MjModel, body: int) -> int:
    """Return the end of a series of bodies that are fixed to a link, as flanges are in URDF."""
    parent = model.body_parentid
    while len(fixed := np.flatnonzero(parent == body)) == 1 and _rank(model.body(fixed[0]).name) >= 0:
        body = int(fixed[0])
    return body


def _is_finger(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a body, or a joint that moves it, has the name of a finger or a gripper."""
    own = (model.joint(i) for i in joints_of(model, body))
    joints = [_words(joint.name) for joint in own if joint.type[0] in (HINGE, SLIDE)]
    if any(_has(words, _FINGERS) for words in (_words(model.body(body).name), *joints)):
        return True
    return any(_has(words, ("grip",)) and not _has(words, _TURNS) for words in joints)


def _rank(name: str) -> int:
    """Return how specific a name is: 0 is unspecific, and -1 means something else than a hand."""
    words = _words(name)
    ranks = [rank for rank, known in enumerate(_TELLING, start=1) if _has(words, known)]
    return -1 if _has(words, _BESIDE) else max(ranks, default=0)


def _has(words: Sequence[str], known: Sequence[str]) -> bool:
    pairs = ((word, start) for word in words for start in known)
    return any(word == start or (len(start) > 3 and word.startswith(start)) for word, start in pairs)


def _words(name: str) -> list[str]:
    """Return the words of a name, in lower case: `vx300s/gripper_link1` has vx, s, gripper and link."""
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]
