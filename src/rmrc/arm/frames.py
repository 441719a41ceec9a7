"""The frame of a model that is controlled where its user names none: that of the tool, and not of a finger.

What a program assumes about a model with an incomplete file is a line; some lines have their own code.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import mujoco
import numpy as np

from rmrc.arm.tree import Chain, Tree
from rmrc.arm.wiring import joint_name, joints_above, soft_bodies
from rmrc.support.errors import ModelError
from rmrc.support.text import listed


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
