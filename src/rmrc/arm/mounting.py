"""The mounting of an arm: its base, its tool, the controlled frame, and the keyframe where it starts."""

from collections.abc import Iterable, Sequence
from itertools import count
from pathlib import Path
from typing import Literal, TypeAlias

import mujoco
import numpy as np

from rmrc.arm.compiling import compiled, in_our_words, read
from rmrc.arm.tree import default_frame, note
from rmrc.arm.urdf import assumed_masses
from rmrc.arm.wiring import find, joints_above
from rmrc.scenario.sections import ToolSection
from rmrc.support.errors import ModelError
from rmrc.support.spatial import Array, quat_multiply, rotate
from rmrc.support.text import listed

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_HIDDEN = 4  # group of sites that viewers hide
PREFIX = "tool_"  # beginning of all names in a tool's model

NamedFrame: TypeAlias = tuple[str, str | ToolSection]
"""`site`, `body` or `tool`, the key of a scenario's `arm` that names a frame, and its value."""


def mounted(
    path: Path, spec: mujoco.MjSpec | None, model: mujoco.MjModel, frame: NamedFrame | None, notes: list[str]
) -> tuple[mujoco.MjModel, str, NamedFrame | None]:
    """Give the model a fixed base and a site at the controlled frame.

    Args:
        path: Path of the model.
        spec: Its parsed and compiled specification, changed if the model is. None: the model cannot change.
        model: The model compiled from it.
        frame: The frame to control; None: that of the hand.
        notes: Assumptions are added.

    Returns:
        The compiled model; the name of the site; and the frame, None if only the default names it.

    Raises:
        ModelError: There is no such site or body, or nothing moves it.
    """
    tool = frame[1] if frame and isinstance(frame[1], ToolSection) else None
    kind, i = _place(path, model, frame, notes)
    at = getattr(model, kind)(i)
    if spec is None:
        if kind == "body":
            why = "a compiled model needs a site at the frame that is controlled"
            raise ModelError(f"{path}: {why}; name a site, or give its file or an MjSpec", "site")
        return model, at.name, ("site", at.name)
    holder = int(model.site_bodyid[i]) if kind == "site" else i
    joints, before = joints_above(model, holder), len(notes)
    _name(spec, joints, notes)
    _fix(spec, model, joints, notes)
    if tool is None and kind == "site":
        return model if len(notes) == before else compiled(path, spec), at.name, ("site", at.name)
    place = (np.array(at.pos), np.array(at.quat)) if kind == "site" else (np.zeros(3), np.eye(4)[0])
    name = _attach(
        spec, spec.bodies[holder], place, tool or ToolSection(), "tool" if tool else at.name, notes
    )
    model = compiled(path, spec)
    if tool is None:
        return model, name, ("body", at.name) if at.name else None
    if tool.site is not None:
        name = f"{PREFIX}{tool.site}"
        find(path, model, "site", name)
    elif tool.model is not None and (hand := default_frame(path, model, prefix=PREFIX))[0] == "site":
        name = model.site(hand[1]).name
        notes += hand[2]
    return model, name, ("tool", tool)


def _place(
    path: Path, model: mujoco.MjModel, frame: NamedFrame | None, notes: list[str]
) -> tuple[Literal["site", "body"], int]:
    """Return the kind and the id of the frame that is controlled, or that carries the tool."""
    key, value = frame or ("", None)
    name = value.body if isinstance(value, ToolSection) else value
    if name is not None:
        kind: Literal["site", "body"] = "site" if key == "site" else "body"
        return kind, find(path, model, kind, name, "tool.body" if key == "tool" else kind)
    kind, i, lines = default_frame(path, model, key)
    notes += lines
    return kind, i


def _name(spec: mujoco.MjSpec, joints: Sequence[int], notes: list[str]) -> None:
    """Give names to unnamed joints of an arm."""
    unnamed = [joint for i in reversed(joints) if not (joint := spec.joints[i]).name and joint.type != _FREE]
    for joint in unnamed:
        joint.name = _unused(spec.joints, f"{joint.parent.name or f'body{joint.parent.id}'}_joint")
    if unnamed:
        notes.append("joints without a name are called " + listed(f'"{each.name}"' for each in unnamed))


def _fix(spec: mujoco.MjSpec, model: mujoco.MjModel, joints: Sequence[int], notes: list[str]) -> None:
    """Fix a floating base where its keyframe has it."""
    for joint in [spec.joints[i] for i in joints if model.jnt_type[i] == _FREE]:
        address, body = int(model.jnt_qposadr[joint.id]), joint.parent
        key = starting_key(model, [i for i in joints if i != joint.id])
        pose = np.array((model.qpos0 if key is None else model.key_qpos[key])[address : address + 7])
        spec.delete(joint)
        body.set_frame(spec.worldbody.add_frame())  # else the pose would be relative to the author's frame
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        body.pos, body.quat = pose[:3], pose[3:]
        called = f'body "{body.name}"' if body.name else f"body {body.id}"
        at = "the file" if key is None else f'keyframe "{model.key(key).name}"'
        text = f"{called} has a free joint in the file; it is fixed where {at} has it"
        notes.append(note("base-fixed", text))


def _attach(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, place: tuple[Array, Array], tool: ToolSection, wanted: str,
    notes: list[str],
) -> str:  # fmt: skip
    """Attach a tool to a position and orientation on a body; return the name of the site at its frame."""
    position, quat = place
    frame = {"pos": position + rotate(quat, tool.position), "quat": quat_multiply(quat, tool.rotation)}
    name = _unused([*spec.sites, *(spec.bodies if tool.mass else ())], wanted or "hand")
    if tool.mass:
        inertia = {
            "mass": tool.mass,
            "ipos": tool.center or np.zeros(3),
            "inertia": tool.inertia or np.zeros(3),
        }
        body, frame = body.add_body(**frame, name=name, explicitinertial=True, **inertia), {}
    body.add_site(**frame, name=name, group=_HIDDEN)
    if tool.model is None:
        return name
    try:
        held = read(tool.model)
        with in_our_words(tool.model):
            # its keyframes say nothing of the arm
            for each in [*held.spec.keys, *(joint for joint in held.spec.joints if joint.type == _FREE)]:
                held.spec.delete(each)
            spec.attach(held.spec, frame=body.add_frame(**frame), prefix=PREFIX)
    except ModelError as error:
        raise ModelError(str(error), "tool.model") from None
    bodies = np.ones(held.model.nbody, np.bool_)
    masses = assumed_masses(held.robot, held.model, bodies) if held.robot else []
    notes += [f"tool: {line}" for line in (*held.notes, *masses)]
    return name


def _unused(elements: Iterable[mujoco.MjsElement], wanted: str) -> str:
    """Return a name that no element has: the wanted one, or it with a number."""
    taken = {element.name for element in elements}
    names = (f"{wanted}_{k}" if k > 1 else wanted for k in count(1))
    return next(name for name in names if name not in taken)


# Keyframes --------------------------------------------------------------------------------------


def starting_key(model: mujoco.MjModel, joints: Sequence[int]) -> int | None:
    """Return the keyframe `home`, else the only one, else the first with joints within limits; None without.

    Args:
        model: Any model.
        joints: Ids of the joints whose limits count.
    """
    keys = range(model.nkey)
    home = keys if len(keys) == 1 else [i for i in keys if model.key(i).name == "home"]
    if home:
        return home[0]
    limited = [j for j in joints if model.jnt_limited[j]]
    lower, upper = model.jnt_range[limited].T
    starts = ((i, model.key_qpos[i, model.jnt_qposadr[limited]]) for i in keys)
    return next((i for i, q in starts if np.all((lower <= q) & (q <= upper))), None)


def keyframes(
    model: mujoco.MjModel, joints: Sequence[int], limit: Array, notes: list[str]
) -> tuple[dict[str, Array], int | None]:
    """Return the keyframes of a model by name, (nq,) each; `home` is among them unless it is qpos0.

    The number of the keyframe that is home comes second; None without one.

    Args:
        model: Any model.
        joints: Ids of the arm's joints, n of them.
        limit: Limit of their positions, (n, 2).
        notes: Assumptions are added.
    """
    keys = {name: np.array(model.key_qpos[i]) for i in range(model.nkey) if (name := model.key(i).name)}
    key, address = starting_key(model, joints), model.jnt_qposadr[joints]
    if "home" in keys:
        return keys, key
    if key is not None:
        called = f'"{model.key(key).name}"' if model.key(key).name else f"number {key}, which has no name,"
        why = "the only one" if model.nkey == 1 else "the first within limits"
        notes.append(note("no-home", f"there is no keyframe home; {called} replaces it, {why}"))
        return {**keys, "home": np.array(model.key_qpos[key])}, key
    home, (lower, upper) = np.array(model.qpos0), limit.T
    zero = home[address]
    beyond = (zero < lower) | (zero > upper)
    if not beyond.any():
        return keys, None
    with np.errstate(invalid="ignore"):  # of a range without ends
        middle = limit.mean(axis=1)
    home[address] = np.where(beyond & np.isfinite(middle), middle, np.clip(zero, lower, upper))
    names = ", ".join(f'"{model.joint(joints[j]).name}"' for j in np.flatnonzero(beyond).tolist())
    where = f"0 is beyond the limits of joint {names}; home is the middle of their range"
    notes.append(note("no-home", f"there is no keyframe home, and {where}"))
    return {**keys, "home": home}, None
