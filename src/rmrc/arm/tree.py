"""The tree of a model's bodies: which chain is the arm, where its hand begins, which frame is controlled.

An arm is the longest chain of joints that follow no other: rods that a mimic or another equality moves do
not count. It ends before its fingers, which are branches about as long as each other, and no longer than the
chain before them. Where a single branch has the name of an arm's end, it goes on there.

Where its user names no frame, that of the tool is controlled, and not that of a finger.

What the program assumes about a model with an incomplete file is a line; some lines have their own code.
"""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.equalities import active_equalities
from rmrc.arm.wiring import HINGE, SLIDE, joint_name, joints_above, joints_of, soft_bodies
from rmrc.support.errors import ModelError
from rmrc.support.text import listed

# Beginnings of words in names; those of three letters or fewer are whole words. Ends of arms:
_ENDS = ("attach", "ee", "eef", "effector", "endeff", "flange", "tcp", "tool")
_FINGERS = ("claw", "finger", "jaw", "knuckle", "thumb")
# Branches that are no fingers, and no arms if they are as short.
_NO_FINGERS = ("balancer", "cam", "camera", "cyl", "cylinder", "head", "lidar", "rod", "sensor", "wheel")
# Words in the names of frames to mount, hold or aim with, the most specific last.
_TELLING = (
    ("attach", "flange", "mount"),
    ("grip", "hand", "palm"),
    ("ee", "eef", "effector", "endeff", "fingertip", "tip", "tool"),
    ("grasp", "pinch", "tcp"),
)
# Words in the names of other things there: sensors, displays, parts of the gripper.
_BESIDE = (
    "axis", "base", "cali", "cam", "camera", "center", "cylinder", "focus", "force", "ft", "goal", "imu",
    "inner", "lidar", "light", "marker", "motor", "object", "outer", "pad", "pads", "sensor", "target",
    "torque", "touch", "x", "y", "z",
)  # fmt: skip
# A joint of the wrist may be called the gripper's.
_TURNS = ("pitch", "roll", "rot", "wrist", "yaw")
# Joints of the longest finger, a thumb.
_LONGEST_FINGER = 5


class Chain(NamedTuple):
    """The chain of an arm.

    Attributes:
        links: Bodies from the first that a joint moves, outward.
        fingers: Number of fingers that follow.
        equals: First bodies of other branches that are as long.
    """

    links: list[int]
    fingers: int
    equals: list[int]


class Tree:
    """The bodies of a model, and its hinges and slides that follow no other: only those count.

    Attributes:
        model: Any model.
        counts: Which joints count, (njnt,).
        before: Number of joints that move each body, (nbody,).
        behind: The most joints on a branch that begins with each body, (nbody,).
        is_finger: Whether the robot itself is a finger: its first joint has such a name.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str = "") -> None:
        """Examine a model.

        Args:
            model: Any model.
            prefix: Beginning of names that says nothing of an arm's end: a tool's.
        """
        self.model, self._prefix, moves = model, prefix, np.isin(model.jnt_type, (HINGE, SLIDE))
        links = [i for i in active_equalities(model) if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT]
        self.counts = moves & ~np.isin(np.arange(model.njnt), model.eq_obj1id[links])
        self.before, self.behind = self._lengths(self.counts)
        self._reach = self._lengths(moves)[1]
        names = [(int(model.site_bodyid[i]), model.site(i).name) for i in range(model.nsite)]
        names += [(body, model.body(body).name) for body in range(1, model.nbody)]
        self.is_finger, self._ends = False, np.zeros(model.nbody, np.bool_)
        self._ends[[body for body, name in names if self.is_end(name)]] = True
        self._leads = self._ends.copy()  # to the end of an arm
        for body in range(model.nbody - 1, 0, -1):
            self._leads[model.body_parentid[body]] |= self._leads[body]
        first = next((body for body in self._walk(0).links if self.before[body]), 0)
        self.is_finger = self._is_finger(first)

    def _lengths(self, chosen: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return `before` and `behind` for some joints."""
        model, soft = self.model, soft_bodies(self.model)
        count = np.bincount(model.jnt_bodyid[chosen], minlength=model.nbody)
        before, behind = count.copy(), np.zeros_like(count)
        for body in range(1, model.nbody):  # children come after their parents
            before[body] += before[model.body_parentid[body]]
        for body in range(model.nbody - 1, 0, -1):
            parent = model.body_parentid[body]
            behind[body] = 0 if body in soft else count[body] + behind[body]
            behind[parent] = max(behind[parent], behind[body])
        return before, behind

    def chain(self, body: int = 0) -> Chain:
        """Return the chain of an arm from a body outward; a single finger or camera ends it by its name."""
        chain = self._walk(body)
        for is_other in (self._is_finger, self._is_beside):
            k = next((k for k, link in enumerate(chain.links) if is_other(link)), 0)
            joints = self.before[self.model.body_parentid[chain.links[k]]] if k else 0
            if joints and not self._leads[chain.links[k]] and joints >= 2 * self.behind[chain.links[k]]:
                return Chain(chain.links[:k], 1, chain.equals)
        return chain

    def _walk(self, body: int) -> Chain:
        links, equals, weld = [body] if body else [], list[int](), self.model.body_weldid
        while ahead := self._moving(body):
            longest, joints = self._longest(ahead), self.before[body]
            most = joints + self.behind[longest]
            ends = [b for b in ahead if self._leads[b] and 2 * (joints + self.behind[b]) >= most]
            if len(ends) != 1 or not body or (joints and self._ends[weld == weld[body]].any()):
                if self._is_hand(body, ahead):
                    return Chain(links, len(ahead), equals)
                ends = [longest]
            body = ends[0]
            alike = [b for b in ahead if b != body and not self._is_beside(b)]
            equals += [b for b in alike if self.behind[b] == self.behind[body] > 0]
            links.append(body)
        return Chain(links, 0, equals)

    def longest(self, body: int) -> list[int]:
        """Return the bodies of the longest chain behind a body, outward."""
        bodies = list[int]()
        while ahead := self._moving(body):
            bodies.append(body := self._longest(ahead))
        return bodies

    def _longest(self, branches: Sequence[int]) -> int:
        """Return the longest of some branches: short ones that names tell to be something else come last."""
        arms = [b for b in branches if self.behind[b] > _LONGEST_FINGER or not self._is_beside(b)]
        hands = [b for b in arms if self.behind[b] > _LONGEST_FINGER or not self._is_finger(b)]
        branches = hands or arms or branches
        return max(branches, key=lambda body: (self.behind[body], self._reach[body]))

    def _moving(self, body: int) -> list[int]:
        """Return the branches with joints that begin on a body."""
        bodies = np.arange(self.model.nbody)
        return np.flatnonzero((self.model.body_parentid == body) & (bodies > 0) & (self._reach > 0)).tolist()

    def _is_hand(self, body: int, branches: Sequence[int]) -> bool:
        """Return whether branches on a body are fingers."""
        joints, longest = self.before[body], max(self.behind[branches])
        alike = [b for b in branches if longest < 2 or 2 * self.behind[b] >= longest]
        fingers = [b for b in alike if not self._is_beside(b)]
        is_small = joints >= longest or (len(fingers) > 3 and longest <= _LONGEST_FINGER)
        return bool(joints > 0 and len(fingers) > 1 and is_small)

    # Names --------------------------------------------------------------------------------------

    def names(self, body: int) -> list[str]:
        """Return the names of a body and of its hinges and slides, the body's first."""
        joints = (self.model.joint(i) for i in joints_of(self.model, body))
        return [self.model.body(body).name, *(each.name for each in joints if each.type[0] in (HINGE, SLIDE))]

    def _is_finger(self, body: int) -> bool:
        """Return whether a body, or a joint that moves it, has the name of a finger or a gripper."""
        grips = (_has(name, ("grip",)) and not _has(name, _TURNS) for name in self.names(body)[1:])
        return self.has_finger([body]) or any(grips)

    def _is_beside(self, body: int) -> bool:
        """Return whether a body, or a joint that moves it, has a name that no finger has."""
        return any(_has(name, _NO_FINGERS) for name in self.names(body))

    def has_finger(self, bodies: Iterable[int]) -> bool:
        """Return whether the name of a body, or of a joint that moves it, has the word for a finger."""
        return any(_has(name, _FINGERS) for body in bodies for name in self.names(body))

    def rank(self, name: str) -> int:
        """Return how specific a frame's name is: 0 is unspecific, and -1 means something else than a hand."""
        ranks = [rank for rank, known in enumerate(_TELLING, start=1) if _has(name, known)]
        is_beside = _has(name, _BESIDE) or (_has(name, _FINGERS) and not self.is_finger)
        return -1 if is_beside else max(ranks, default=0)

    def is_end(self, name: str) -> bool:
        """Return whether a frame's name is that of an arm's end."""
        return self.rank(name) > 0 and _has(name.removeprefix(self._prefix), _ENDS)


def _has(name: str, known: Sequence[str]) -> bool:
    """Return whether a word of a name begins as known: `vx300s/gripper_link1` has vx, s, gripper and link."""
    words = [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]
    return any(
        word == start or (len(start) > 3 and word.startswith(start)) for word in words for start in known
    )


class Note(str):
    """A line about an assumption.

    Attributes:
        code: The code by which `rmrc check` reports it.
        level: `note` or `warning`.
        is_obvious: Whether hardly anybody would doubt it, so that only answers that list all have it.
    """

    code = "assumed"
    level = "note"
    is_obvious = False


def note(code: str, text: str, is_obvious: bool = False, level: str = "note") -> Note:
    """Return a line with its own code.

    >>> note("frame", 'site "tool" is controlled').code
    'frame'
    """
    line = Note(text)
    line.code, line.is_obvious, line.level = code, is_obvious, level
    return line


def code_of(line: str) -> str:
    """Return the code of a line; `assumed` for those without.

    >>> code_of(note("frame", "a")), code_of("a")
    ('frame', 'assumed')
    """
    return getattr(line, "code", "assumed")


class _Frame(NamedTuple):
    """A site or a body.

    Attributes:
        kind: Which of them.
        i: Its id.
        name: Its name.
        body: Id of the body that carries it.
        depth: Number of joints that move it.
        rank: As `Tree.rank`.
    """

    kind: Literal["site", "body"]
    i: int
    name: str
    body: int
    depth: int
    rank: int

    def __str__(self) -> str:
        """Return its kind with its name, or its number."""
        return f'{self.kind} "{self.name}"' if self.name else f"{self.kind} {self.i}"


def default_frame(
    path: Path, model: mujoco.MjModel, key: str = "", prefix: str = ""
) -> tuple[Literal["site", "body"], int, list[Note]]:
    """Return the frame that is controlled, or that carries a tool: what the first of some rules finds.

    It is on the chain of `Tree`. The farthest frame with the name of an arm's end has precedence, if more
    than half of the joints move it. Then there is a site whose name tells of a hand; the only site of the
    last link that belongs to no camera or sensor; a body that moves with the last link, whose name tells or
    from which fingers branch; and the last link.

    Args:
        path: Path of the model.
        model: Any model.
        key: `tool` if the frame carries one.
        prefix: Beginning of the names of the sites and bodies to choose from.

    Returns:
        Its kind, its id, and a note about the choice unless there is no other. It is a warning if the frame
        leaves out joints of a longer chain that are not clearly those of fingers.

    Raises:
        ModelError: No joint moves anything.
    """
    tree = Tree(model, prefix)
    chain, weld = tree.chain(), model.body_weldid
    if not chain.links:
        raise ModelError(f"{path}: has no hinge or slide joint that moves a body; an arm needs at least one")
    last, frames = chain.links[-1], _frames(tree, chain.links, prefix)
    most = tree.before[last]
    named = [f for f in frames if f.rank > 0 and 2 * f.depth >= most]
    end = max((f.depth for f in named if tree.is_end(f.name)), default=0)
    hands = [f for f in named if f.depth == end or (not end and weld[f.body] == weld[last])]
    plain = [f for f in frames if f.kind == "site" and f.rank == 0 and f.depth == most and not end]
    links = {f.i: f for f in frames if f.kind == "body"}
    fingers = {*np.flatnonzero((model.body_parentid == last) & (weld != weld[last]))} - soft_bodies(model)
    rules = (
        ([f for f in named if f.kind == "site" and end in (0, f.depth)], "by its name"),
        (plain if len(plain) == 1 else [], "as the only one on the last link"),
        ([f for f in hands if f.kind == "body"], "by its name"),
        ([links[last]] if fingers else [], "as the last before the fingers"),
        ([links[_end(tree, last)]], "as the last link"),
    )
    chosen, why = next((_best(few, last), why) for few, why in rules if few)
    text = f"{chosen} {'carries the tool' if key == 'tool' else 'is controlled'}, chosen {why}"
    joints, beyond = ([], "") if prefix else _left_out(tree, chain, chosen)
    if joints:
        option = "arm.tool.body: {}" if key == "tool" else "--body {} (arm.body in a scenario)"
        text += f", and leaves out {listed(joints)} of a longer chain"
        text += f"; take all of it by {option.format(beyond)}" if beyond else ""
    equals = [str(_hand(tree, tree.chain(body).links[-1])) for body in chain.equals]
    others = [f for f in frames if f.kind == "site"]
    others += [f for f in links.values() if chosen.kind == "body" and f.name and weld[f.i] == weld[last]]
    others = [f for f in others if f != chosen]
    if chosen.kind == "site" and not (joints or equals or others):
        return chosen.kind, chosen.i, []
    text += f"; a chain as long goes to {listed(equals)}" if equals else ""
    text += f"; others: {listed(map(str, others))}" if others else ""
    text += "; name one by site or body" if others or equals else ""
    if joints:
        return chosen.kind, chosen.i, [note("frame-short", text, level="warning")]
    is_obvious = chosen.kind == "site" and not equals and all(f.rank < chosen.rank for f in others)
    return chosen.kind, chosen.i, [note("frame", text, is_obvious)]


def _frames(tree: Tree, links: Sequence[int], prefix: str = "") -> list[_Frame]:
    """Return the frames that move with links: sites with a name, and all bodies."""
    model, weld = tree.model, tree.model.body_weldid
    moving = np.isin(weld, weld[links]) & (weld > 0)
    frames = []
    for i, body in enumerate(model.site_bodyid.tolist()):
        if moving[body] and (name := model.site(i).name) and name.startswith(prefix):
            frames.append(_Frame("site", i, name, body, int(tree.before[body]), tree.rank(name)))
    for body in np.flatnonzero(moving).tolist():
        rank = tree.rank(name) if (name := model.body(body).name).startswith(prefix) else 0
        frames.append(_Frame("body", body, name, body, int(tree.before[body]), rank))
    return frames


def _best(frames: Sequence[_Frame], last: int) -> _Frame:
    """Return the farthest, most specific site, or a body that exists to be named."""

    def grade(f: _Frame) -> tuple[int, int, bool, bool, int]:
        is_body = f.kind == "body"
        return f.depth, f.rank, is_body and "frame" in f.name.lower(), is_body and f.i == last, f.i

    return max(frames, key=grade)


def _end(tree: Tree, body: int) -> int:
    """Return the end of a series of bodies that are fixed to a link, as flanges are in URDF."""
    model, weld = tree.model, tree.model.body_weldid
    ahead = np.flatnonzero(model.body_parentid == body).tolist()
    while len(ahead) == 1 and weld[ahead[0]] == weld[body] and tree.rank(model.body(ahead[0]).name) >= 0:
        body = ahead[0]
        ahead = np.flatnonzero(model.body_parentid == body).tolist()
    return body


def _left_out(tree: Tree, chain: Chain, chosen: _Frame) -> tuple[list[str], str]:
    """Return the joints of a longer chain that a frame leaves out, and the body that takes all.

    Fingers are no part of a chain if the frame has the name of a hand, or if several have names of fingers.
    A single one has a single joint.
    """
    model, last, goal, most = tree.model, chain.links[-1], chosen.body, chosen.depth
    if most < tree.before[last]:
        goal = last
    elif chain.fingers and (path := tree.longest(last)):
        most, are_several = int(tree.before[path[-1]]), chain.fingers > 1
        is_hand = chosen.rank > 0 and (are_several or most - chosen.depth == 1)
        goal = goal if is_hand or (are_several and tree.has_finger(path)) else path[-1]
    if goal == chosen.body and most < tree.behind[0]:
        goal = tree.longest(0)[-1]
    above = joints_above(model, chosen.body)
    beyond = [i for i in joints_above(model, goal) if tree.counts[i] and i not in above]
    return [joint_name(model, i) for i in reversed(beyond)], _hand(tree, goal).name


def _hand(tree: Tree, link: int) -> _Frame:
    """Return the body that has the end of a link: the one whose name tells, or the last."""
    bodies = {frame.i: frame for frame in _frames(tree, [link]) if frame.kind == "body"}
    told = [body for body in bodies.values() if body.rank > 0]
    return _best(told, link) if told else bodies[_end(tree, link)]
