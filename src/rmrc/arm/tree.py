"""The tree of a model's bodies: which of its chains is the arm, and where its hand begins.

An arm is the longest chain of joints that follow no other: rods that a mimic or another equality moves do
not count. It ends before its fingers, which are branches about as long as each other, and no longer than the
chain before them. Where a single branch has the name of an arm's end, it goes on there.
"""

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.equalities import active_equalities
from rmrc.arm.wiring import HINGE, SLIDE, joints_of, soft_bodies

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
