"""The mounting of an arm: its base, its tool, and the controlled frame."""

from collections.abc import Iterable, Sequence
from itertools import count
from pathlib import Path
from typing import Literal, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.compiling import compiled, in_our_words, read
from rmrc.arm.frames import default_frame
from rmrc.arm.keyframes import starting_key
from rmrc.arm.notes import note
from rmrc.arm.wiring import find, joints_above
from rmrc.scenario.arm import ToolSection
from rmrc.support.errors import ModelError
from rmrc.support.legible import listed
from rmrc.support.spatial import quat_multiply, rotate

Array = NDArray[np.float64]

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_HIDDEN = 4  # group of sites that viewers hide
PREFIX = "tool_"  # beginning of all names in a tool's model


NamedFrame: TypeAlias = tuple[Literal["site", "body", "tool"], str | ToolSection]
"""Key of a scenario's `arm` that names a frame, and its value."""


def mounted(
    path: Path, spec: mujoco.MjSpec | None, model: mujoco.MjModel, site: str | None, body: str | None,
    tool: ToolSection | None, base: str, notes: list[str],
) -> tuple[mujoco.MjModel, str, NamedFrame | None]:  # fmt: skip
    """Give the model a fixed base and a site at the controlled frame.

    Args:
        path: Path of the model.
        spec: Its parsed and compiled specification, changed if the model is. None: the model cannot change.
        model: The model compiled from it.
        site: The site to control.
        body: The body whose frame to control.
        tool: The tool whose frame to control.
        base: `fixed` or `free`.
        notes: Assumptions are added.

    Returns:
        The compiled model; the name of the site; and the key of a scenario's `arm` that names the frame with
        its value, None if only its default does.

    Raises:
        ModelError: There is no such site or body, nothing moves it, or a floating base is requested.
    """
    kind, i = _place(path, model, site, body, tool, notes)
    at, is_site = getattr(model, kind)(i), kind == "site"
    holder = int(model.site_bodyid[i]) if is_site else i
    if spec is None:
        if not is_site:
            why = "a compiled model needs a site at the frame that is controlled"
            raise ModelError(f"{path}: {why}; name a site, or give its file or an MjSpec", "site")
        return model, at.name, ("site", at.name)
    joints, before = joints_above(model, holder), len(notes)
    _name(spec, joints, notes)
    _fix(path, spec, model, joints, base, notes)
    if tool is None and is_site:
        return model if len(notes) == before else compiled(path, spec), at.name, ("site", at.name)
    position, quat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    if is_site:
        position, quat = np.array(at.pos), np.array(at.quat)
    wanted = at.name if tool is None else "tool"
    name = _attach(spec, spec.bodies[holder], position, quat, tool or ToolSection(), wanted, notes)
    model = compiled(path, spec)
    if tool is None:
        return model, name, ("body", at.name) if at.name else None
    if tool.site is not None:
        name = f"{PREFIX}{tool.site}"
        find(path, model, "site", name)
    elif tool.model is not None:
        kind, i, told = default_frame(path, model, prefix=PREFIX)
        if kind == "site":
            name = model.site(i).name
            notes += told
    return model, name, ("tool", tool)


def _place(
    path: Path, model: mujoco.MjModel, site: str | None, body: str | None, tool: ToolSection | None,
    notes: list[str],
) -> tuple[Literal["site", "body"], int]:  # fmt: skip
    """Return the kind and the id of the frame that is controlled, or that carries the tool."""
    if site is not None:
        return "site", find(path, model, "site", site)
    if body is not None:
        return "body", find(path, model, "body", body)
    if tool is not None and tool.body is not None:
        return "body", find(path, model, "body", tool.body, "tool.body")
    kind, i, told = default_frame(path, model, "is controlled" if tool is None else "carries the tool")
    notes += told
    return kind, i


def _name(spec: mujoco.MjSpec, joints: Sequence[int], notes: list[str]) -> None:
    """Give names to unnamed joints of an arm."""
    names = []
    for joint in (spec.joints[i] for i in reversed(joints)):
        if not joint.name and joint.type != _FREE:
            joint.name = _unused(spec.joints, f"{joint.parent.name or f'body{joint.parent.id}'}_joint")
            names.append(f'"{joint.name}"')
    if names:
        notes.append(f"joints without a name are called {listed(names)}")


def _fix(
    path: Path, spec: mujoco.MjSpec, model: mujoco.MjModel, joints: Sequence[int], base: str,
    notes: list[str],
) -> None:  # fmt: skip
    """Fix a floating base where its keyframe has it."""
    free = next((i for i in joints if model.jnt_type[i] == _FREE), None)
    if free is None:
        return
    joint, address = spec.joints[free], int(model.jnt_qposadr[free])
    body = joint.parent
    called = f'body "{body.name}"' if body.name else f"body {body.id}"
    if base == "free":
        why = f"the base, {called}, has a free joint without an actuator, so that it cannot hold the site"
        raise ModelError(f"{path}: {why}; write base: fixed", "base")
    key = starting_key(model, [i for i in joints if i != free])
    pose = np.array((model.qpos0 if key is None else model.key_qpos[key])[address : address + 7])
    spec.delete(joint)
    body.set_frame(spec.worldbody.add_frame())  # otherwise the pose would be relative to the author's frame
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.pos, body.quat = pose[:3], pose[3:]
    at = "the file" if key is None else f'keyframe "{model.key(key).name}"'
    notes.append(note("base-fixed", f"{called} has a free joint in the file; it is fixed where {at} has it"))


def _attach(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, position: Array, quat: Array, tool: ToolSection, wanted: str,
    notes: list[str],
) -> str:  # fmt: skip
    """Attach a tool to a place of a body; return the name of the site at its frame."""
    place = {"pos": position + rotate(quat, tool.position), "quat": quat_multiply(quat, tool.rotation)}
    name = _unused([*spec.sites, *(spec.bodies if tool.mass else ())], wanted or "hand")
    if tool.mass:
        body = body.add_body(
            **place, name=name, explicitinertial=True, mass=tool.mass, ipos=tool.center or (0.0, 0.0, 0.0),
            inertia=tool.inertia or (0.0, 0.0, 0.0),
        )  # fmt: skip
        place = {}
    body.add_site(**place, name=name, group=_HIDDEN)
    if tool.model is None:
        return name
    try:
        held = read(tool.model)
        with in_our_words(tool.model):
            for joint in [each for each in held.spec.joints if each.type == _FREE]:
                held.spec.delete(joint)
                held.spec.compile()  # otherwise its keyframes would not be attached
            spec.attach(held.spec, frame=body.add_frame(**place), prefix=PREFIX)
    except ModelError as error:
        raise ModelError(str(error), "tool.model") from None
    notes += [f"tool: {line}" for line in held.notes]
    return name


def _unused(elements: Iterable[mujoco.MjsElement], wanted: str) -> str:
    """Return a name that no element has: the wanted one, or it with a number."""
    taken = {element.name for element in elements}
    numbered = (f"{wanted}_{k}" for k in count(2))
    return wanted if wanted not in taken else next(name for name in numbered if name not in taken)
