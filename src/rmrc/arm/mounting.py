"""The mounting of an arm: its base, its tool, and the controlled frame."""

from collections.abc import Collection, Hashable, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.compiling import compiled, read
from rmrc.arm.frames import default_frame
from rmrc.arm.keyframes import starting_key
from rmrc.arm.notes import Note
from rmrc.arm.wiring import HINGE, SLIDE, find_body, find_site, joints_above
from rmrc.scenario.arm import ToolSection
from rmrc.support.errors import ModelError
from rmrc.support.legible import listed
from rmrc.support.spatial import quat_multiply, rotate

Array = NDArray[np.float64]

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_HIDDEN = 4  # group of sites that viewers hide


NamedFrame: TypeAlias = tuple[Literal["site", "body", "tool"], str | ToolSection]
"""Key of a scenario's `arm` that names a frame, and its value."""


@dataclass(frozen=True)
class Asked:
    """The requests about a model, except its joints.

    Attributes:
        site: The site to control.
        body: The body whose frame to control.
        tool: The tool whose frame to control.
        base: `fixed` or `free`.
        packages: Packages of a URDF, names and folders.
    """

    site: str | None
    body: str | None
    tool: ToolSection | None
    base: str
    packages: tuple[tuple[str, Path], ...]

    @property
    def prefix(self) -> str:
        """Beginning of all names in a tool's model."""
        return "tool_" if self.tool and self.tool.model else ""

    @property
    def variant(self) -> Hashable:
        """The options that make different models of one file; for most requests none."""
        return () if (self.tool, self.packages) == (None, ()) else (self.tool, self.packages)


class Mounted(NamedTuple):
    """A model with the controlled frame.

    Attributes:
        model: Compiled.
        site: The name of a site at the frame.
        frame: Key of a scenario's `arm` that names the frame, and its value; None if only its default does.
        obvious: The note about a choice of it that hardly anybody would doubt; "" if there is none.
    """

    model: mujoco.MjModel
    site: str
    frame: NamedFrame | None
    obvious: str = ""


def mounted(
    path: Path, spec: mujoco.MjSpec | None, model: mujoco.MjModel, asked: Asked, notes: list[str]
) -> Mounted:
    """Return the model with a fixed base and a site at the controlled frame.

    Args:
        path: Path of the model.
        spec: Its parsed and compiled specification, changed if the model is. None: the model cannot change.
        model: The model compiled from it.
        asked: The requested frame and base.
        notes: Assumptions are added.

    Raises:
        ModelError: There is no such site or body, nothing moves it, or a floating base is requested.
    """
    kind, i, obvious = _place(path, model, asked, notes)
    body = i if kind == "body" else int(model.site_bodyid[i])
    if spec is None:
        _check_whole(path, model, kind, joints_above(model, body))
        return Mounted(model, model.site(i).name, ("site", model.site(i).name), obvious)
    holder = next(each for each in spec.bodies if each.id == body)  # a changed specification has no ids
    above = joints_above(model, body)
    changed = _name(spec, model, above, notes)
    changed |= _fix(path, spec, model, above, asked, notes)
    if asked.tool is None and kind == "site":
        site = model.site(i).name
        return Mounted(compiled(path, spec) if changed else model, site, ("site", site), obvious)
    position, quat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    if kind == "site":
        position, quat = np.array(model.site(i).pos), np.array(model.site(i).quat)
    if asked.tool is None:
        site = _unused(spec, holder.name or "hand")
        holder.add_site(name=site, pos=position, quat=quat, group=_HIDDEN)
        return Mounted(compiled(path, spec), site, ("body", holder.name) if holder.name else None)
    site = _attach(path, spec, holder, position, quat, asked.tool, asked.prefix, notes)
    model = compiled(path, spec)
    if asked.tool.site is not None:
        site = find_site(path, model, f"{asked.prefix}{asked.tool.site}")
        return Mounted(model, site, ("tool", asked.tool))
    frame = default_frame(model, asked.prefix) if asked.prefix else None
    if frame is not None and frame.kind == "site":
        told = f'site "{model.site(frame.id).name}" is controlled, chosen {frame.why}{_or(frame.others)}'
        notes.append(Note("frame", told))
        site = model.site(frame.id).name
    return Mounted(model, site, ("tool", asked.tool))


def _check_whole(path: Path, model: mujoco.MjModel, kind: str, joints: Sequence[int]) -> None:
    """Refuse a compiled model without parts that a specification could be given.

    Raises:
        ModelError: It has no site where one is controlled, or a joint without a name.
    """
    lacks, ways = [], []
    if kind == "body":
        lacks.append("a site at the frame that is controlled")
        ways.append("name a site")
    if any(not model.joint(i).name and model.jnt_type[i] != _FREE for i in joints):
        lacks.append("names of all joints of the arm")
    if lacks:
        ways.append("give its file or an MjSpec")
        raise ModelError(f"{path}: a compiled model needs {listed(lacks)}; {', or '.join(ways)}", "site")


def _place(path: Path, model: mujoco.MjModel, asked: Asked, notes: list[str]) -> tuple[str, int, str]:
    """Return the kind of the frame, `site` or `body`, its id, and the code of its note if that is obvious."""
    if asked.site is not None:
        return "site", model.site(find_site(path, model, asked.site)).id, ""
    if asked.body is not None:
        return "body", find_body(path, model, asked.body), ""
    if asked.tool is not None and asked.tool.body is not None:
        return "body", find_body(path, model, asked.tool.body, "tool.body"), ""
    frame = default_frame(model)
    if frame is None:
        raise ModelError(f"{path}: {_lack(model)}")
    if frame.others or frame.kind == "body":
        named = getattr(model, frame.kind)(frame.id).name
        called = f'{frame.kind} "{named}"' if named else f"{frame.kind} {frame.id}"
        does = "is controlled" if asked.tool is None else "carries the tool"
        told = Note("frame", f"{called} {does}, chosen {frame.why}{_or(frame.others)}")
        notes.append(told)
        return frame.kind, frame.id, told if frame.is_clear else ""
    return frame.kind, frame.id, ""


def _lack(model: mujoco.MjModel) -> str:
    """Return why a model has no arm, and the way out: its hinges and slides are beyond a ball, or none is."""
    for driven in np.flatnonzero(np.isin(model.jnt_type, (HINGE, SLIDE))):
        for i in joints_above(model, int(model.jnt_bodyid[driven])):
            if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_BALL:
                b, joint = int(model.jnt_bodyid[i]), model.joint(i).name
                called = f'ball joint "{joint}"' if joint else "the ball joint"
                return (
                    f'{called} of body "{model.body(b).name or f"body{b}"}" lies before a hinge or slide '
                    "joint, and cannot be driven at a rate; replace it with three hinge joints"
                )
    return "has no hinge or slide joint that moves a body; an arm needs at least one"


def _or(others: Sequence[str]) -> str:
    """Return the end of a message that lists the other frames."""
    return f"; others: {listed(others)}; name one by site or body" if others else ""


def _name(spec: mujoco.MjSpec, model: mujoco.MjModel, joints: Sequence[int], notes: list[str]) -> bool:
    """Give names to unnamed joints of an arm; return whether there were any."""
    nameless = [i for i in joints if not model.joint(i).name and model.jnt_type[i] != _FREE]
    taken = {joint.name for joint in spec.joints}
    given = []
    for i in reversed(nameless):
        body = int(model.jnt_bodyid[i])
        wanted = f"{model.body(body).name or f'body{body}'}_joint"
        name = _numbered(wanted, taken)
        next(joint for joint in spec.joints if joint.id == i).name = name
        taken.add(name)
        given.append(f'"{name}"')
    if given:
        notes.append(f"joints without a name are called {listed(given)}")
    return bool(given)


def _fix(
    path: Path,
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    joints: Sequence[int],
    asked: Asked,
    notes: list[str],
) -> bool:
    """Fix a floating base where its keyframe has it; return whether there was one."""
    free = next((i for i in joints if model.jnt_type[i] == _FREE), None)
    if free is None:
        return False
    body = next(each for each in spec.bodies if each.id == int(model.jnt_bodyid[free]))
    called = f'body "{body.name}"' if body.name else f"body {body.id}"
    if asked.base == "free":
        raise ModelError(
            f"{path}: the base, {called}, must be fixed, got free: a free joint has no actuator, so the "
            "arm cannot hold its site; write base: fixed",
            "base",
        )
    key = starting_key(model, [i for i in joints if i != free])
    qpos, address = model.qpos0 if key is None else model.key_qpos[key], int(model.jnt_qposadr[free])
    pose = np.array(qpos[address : address + 7])
    spec.delete(next(joint for joint in spec.joints if joint.id == free))
    body.set_frame(spec.worldbody.add_frame())  # otherwise the pose would be relative to the author's frame
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.pos, body.quat = pose[:3], pose[3:]
    at = "the file" if key is None else f'keyframe "{model.key(key).name}"'
    notes.append(Note("base-fixed", f"{called} has a free joint in the file; it is fixed where {at} has it"))
    return True


def _attach(
    path: Path, spec: mujoco.MjSpec, body: mujoco.MjsBody, position: Array, quat: Array, tool: ToolSection,
    prefix: str, notes: list[str],
) -> str:  # fmt: skip
    """Attach a tool to a place of a body; return the name of the site at its frame."""
    position = position + rotate(quat, tool.position)
    quat = quat_multiply(quat, tool.rotation)
    site = _unused(spec, "tool")
    if tool.mass:
        body = body.add_body(
            name=_unused(spec, "tool"), pos=position, quat=quat, explicitinertial=True, mass=tool.mass,
            ipos=tool.center or (0.0, 0.0, 0.0), inertia=tool.inertia or (0.0, 0.0, 0.0),
        )  # fmt: skip
        position, quat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    body.add_site(name=site, pos=position, quat=quat, group=_HIDDEN)
    if tool.model is None:
        return site
    try:
        held = read(tool.model)
        for joint in [each for each in held.spec.joints if each.type == mujoco.mjtJoint.mjJNT_FREE]:
            held.spec.delete(joint)
            held.spec.compile()  # otherwise its keyframes would not be attached
        spec.attach(held.spec, frame=body.add_frame(pos=position, quat=quat), prefix=prefix)
    except ModelError as error:
        raise ModelError(str(error), "tool.model") from None
    except ValueError as error:
        told = " ".join(str(error).split())
        raise ModelError(f"{tool.model}: cannot be attached to {path}: {told}", "tool.model") from None
    notes += [f"tool: {note}" for note in held.notes]
    return site


def _unused(spec: mujoco.MjSpec, wanted: str) -> str:
    """Return a name that no site has, and no body of the tool."""
    taken = {each.name for each in spec.sites} | (
        {each.name for each in spec.bodies} if wanted == "tool" else set()
    )
    return _numbered(wanted, taken)


def _numbered(wanted: str, taken: Collection[str]) -> str:
    if wanted not in taken:
        return wanted
    return next(name for k in count(2) if (name := f"{wanted}_{k}") not in taken)
