"""Loading an MJCF or URDF file as an arm."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from rmrc.arm import names, numbers, urdf
from rmrc.arm.actuators import limits
from rmrc.arm.arm import Arm
from rmrc.arm.bounds import bounded_memory
from rmrc.arm.compiling import compiled, quiet_log, read
from rmrc.arm.equalities import Follower, find_links, find_ties, followers
from rmrc.arm.keyframes import keyframes, starting_key
from rmrc.arm.mounting import Asked, mounted
from rmrc.arm.scan import check_file
from rmrc.arm.wiring import SLIDE, find_chain, joints_above
from rmrc.scenario.sections import ArmSection, ToolSection
from rmrc.support.errors import ModelError, did_you_mean
from rmrc.support.legible import listed
from rmrc.support.shipped import suggestion


def load(
    path: Path,
    site: str | None = None,
    joints: Sequence[str] | None = None,
    *,
    body: str | None = None,
    tool: ToolSection | None = None,
    base: str = "fixed",
    packages: Mapping[str, Path] | None = None,
) -> Arm:
    """Read an MJCF or URDF file and find the arm in it.

    Args:
        path: The file.
        site: Name of the site to control.
        joints: Names of the joints to actuate, all on the chain to the site; None for all of them.
        body: Name of the body whose frame to control.
        tool: The tool to attach, whose frame to control. Give one of site, body and tool, or none for the
            frame of the hand: see `rmrc.arm.frames`.
        base: `fixed`: a floating base is fixed where the first keyframe has it.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.

    Raises:
        ModelError: The file, the site, the body or a joint is missing or not usable.
    """
    if not path.is_file():
        near = did_you_mean(path.name, _siblings(path)) or suggestion(path, "models")
        raise ModelError(f"{path}: no such model file{near}")
    asked = Asked(site, body, tool, base, tuple(sorted((packages or {}).items())))
    spec, model, velocity, told = read(path, packages)
    return _found(path, spec, model, velocity, list(told), asked, joints, urdf.is_urdf(path))


def is_model(given: object) -> bool:
    """Return whether `load_model` accepts an object."""
    return isinstance(given, mujoco.MjModel | mujoco.MjSpec)


def load_model(
    given: mujoco.MjModel | mujoco.MjSpec,
    site: str | None = None,
    joints: Sequence[str] | None = None,
    *,
    body: str | None = None,
) -> Arm:
    """Find the arm in a loaded model.

    Args:
        given: The model; it is not changed. No site can be added to a compiled model: its arm needs a site,
            and names of all joints. A base that floats there is not fixed: its pose is in MuJoCo's data.
        site: As in `load`, like the others.
        joints: Names of the joints to actuate.
        body: Name of the body whose frame to control.

    Raises:
        ModelError: The site, the body or a joint is missing or not usable, or a number is not finite.
    """
    is_spec = isinstance(given, mujoco.MjSpec)
    title = given.modelname if is_spec else bytes(given.names).split(b"\0")[0].decode("utf-8", "replace")
    path = Path(title or "the model")
    spec = given.copy() if is_spec else None
    model = given if spec is None else compiled(path, spec)
    names.check(path, model)
    numbers.check(path, model)
    return _found(path, spec, model, {}, [], Asked(site, body, None, "fixed", ()), joints)


def _found(
    path: Path,
    spec: mujoco.MjSpec | None,
    model: mujoco.MjModel,
    velocity: Mapping[str, float],
    notes: list[str],
    asked: Asked,
    joints: Sequence[str] | None,
    is_urdf: bool = False,
) -> Arm:
    """Return the arm of a model: see `load`."""
    model, site, frame, obvious = mounted(path, spec, model, asked, notes)
    if joints is None:
        _refuse_balls(path, model, site)
    chain = find_chain(path, model, site)
    links = find_links(path, model, chain)
    own = [name for name in chain if name not in links]
    driven = tuple(own) if joints is None else _driven(path, model, site, own, links, joints, notes)
    if not driven:
        raise ModelError(
            f'{path}: each joint on the chain to site "{site}" follows another by an equality; choose a site '
            "that a joint moves that follows none",
            "site",
        )
    following = followers(model, chain, links, driven) if links else ()
    joint = np.array([model.joint(name).id for name in driven])
    positions, rates, torques = limits(model, driven, following, velocity)
    keys = keyframes(model, joint.tolist(), positions, asked.prefix, notes)
    if (
        spec is not None
        and is_urdf
        and (apart := urdf.keep_apart(spec, model, keys.get("home", model.qpos0)))
    ):
        notes += apart
        model = compiled(path, spec)
    arm = Arm(
        path=path,
        site=site,
        joints=driven,
        is_slide=model.jnt_type[joint] == SLIDE,
        followers=following,
        position_limit=positions,
        rate_limit=rates,
        torque_limit=torques,
        keyframes=keys,
        model=model,
        _spec=spec,
        _links={name: links[name] for name in chain if name in links and links[name].leader not in joint},
        frame=frame,
        packages=asked.packages,
        notes=tuple(notes),
        obvious=obvious,
        home=starting_key(model, joint.tolist(), asked.prefix),
    )
    return _with_ties(arm)


def _refuse_balls(path: Path, model: mujoco.MjModel, site: str) -> None:
    """Refuse a ball joint on the chain to a site, all of whose joints are asked for.

    Raises:
        ModelError: There is one.
    """
    for i in joints_above(model, int(model.site_bodyid[model.site(site).id])):
        if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_BALL:
            body = model.body(model.jnt_bodyid[i])
            raise ModelError(
                f'{path}: the joint of body "{body.name or f"body{body.id}"}" on the chain to site "{site}" '
                "is a ball joint; only hinge and slide joints can be driven at a rate: list those in joints",
                "joints",
            )


def load_asked(section: ArmSection) -> Arm:
    """Return the arm of a scenario's section, not stretched.

    Raises:
        ModelError: See `load`.
    """
    return load(
        section.model, section.site, section.joints, body=section.body, tool=section.tool, base=section.base,
        packages=section.packages,
    )  # fmt: skip


def _with_ties(arm: Arm) -> Arm:
    """Return the arm with its `ties`: equalities of its model that no Jacobian here includes."""
    ties = find_ties(arm.model, arm.configuration("home"), arm.motion, arm.others.locked | arm.others.held)
    if not ties:
        return arm
    verbs = ("tie", "are") if len(ties) > 1 else ("ties", "is")
    note = f"{listed(ties)} {verbs[0]} the arm, and {verbs[1]} ignored in its kinematics"
    return replace(arm, ties=ties, notes=(*arm.notes, note))


def _driven(
    path: Path, model: mujoco.MjModel, site: str, own: Sequence[str], links: Mapping[str, Follower],
    joints: Sequence[str], notes: list[str],
) -> tuple[str, ...]:  # fmt: skip
    """Return the joints to actuate, outward."""
    for name in joints:
        if name in links:
            leader = model.joint(links[name].leader).name if links[name].leader >= 0 else ""
            way = f"drive {'that one' if leader in own else 'another'}"
            how = f'follows "{leader}"' if leader else "is held"
            raise ModelError(f'{path}: joint "{name}" {how} by an equality; {way}', "joints")
        if name not in own:
            raise ModelError(
                f'{path}: no hinge or slide joint "{name}" on the chain to site "{site}"'
                f"{did_you_mean(name, own)}; the chain: {', '.join(own)}",
                "joints",
            )
        if joints.count(name) > 1:
            raise ModelError(f'{path}: joints must be listed once each, got "{name}" more often', "joints")
    outward = tuple(name for name in own if name in joints)
    if outward != tuple(joints):
        notes.append(f"list joints, and values for them, from the base outward: {', '.join(outward)}")
    return outward


def files(path: Path, packages: Mapping[str, Path] | None = None) -> list[Path]:
    """Return a model's file and every file that it depends on: included files, meshes, textures.

    Args:
        path: The file, absolute.
        packages: Folders of a URDF's packages, by their names.

    Returns:
        Those that exist; only the file itself if it cannot be read as a model, which `load` then reports.
    """
    quiet_log()
    try:
        check_file(path)
        if urdf.is_urdf(path):
            return sorted({path, *urdf.files(path, packages or {})})
        with bounded_memory():
            found = set(mujoco.mju_getXMLDependencies(str(path)))
            # it looks for height fields beside the model, where the compiler does not
            spec = mujoco.MjSpec.from_file(str(path))
        found |= {os.path.normpath(path.parent / spec.meshdir / field.file) for field in spec.hfields}
    except (ValueError, RuntimeError, MemoryError, OSError, mujoco.FatalError):
        found = set()
    return sorted(file for file in {path, *map(Path, found)} if file.is_file())


def _siblings(path: Path) -> list[str]:
    files = path.parent.iterdir() if path.parent.is_dir() else ()
    return [file.name for file in files if file.suffix in (".xml", ".urdf")]
