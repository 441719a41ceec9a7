"""Loading an MJCF or URDF file as an arm."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import mujoco

from rmrc.arm import urdf
from rmrc.arm.actuators import limits
from rmrc.arm.adapting import is_behind
from rmrc.arm.arm import Arm
from rmrc.arm.compiling import Read, compiled, in_our_words, opened, read
from rmrc.arm.equalities import Follower, find_links, find_ties, followers
from rmrc.arm.mounting import NamedFrame, keyframes, mounted
from rmrc.arm.wiring import HINGE, SLIDE, joints_above
from rmrc.scenario.sections import ArmSection, ToolSection
from rmrc.support.errors import ModelError, did_you_mean
from rmrc.support.shipped import suggestion
from rmrc.support.text import listed


def load(
    path: Path, site: str | None = None, joints: Sequence[str] | None = None, *, body: str | None = None,
    tool: ToolSection | None = None, packages: Mapping[str, Path] | None = None,
) -> Arm:  # fmt: skip
    """Read an MJCF or URDF file and find the arm in it.

    Args:
        path: The file.
        site: Name of the site to control.
        joints: Names of the joints to actuate, all on the chain to the site; None for all of them.
        body: Name of the body whose frame to control.
        tool: The tool to attach, whose frame to control. Give one of site, body and tool, or none for the
            frame of the hand: see `rmrc.arm.tree`.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.

    Raises:
        ModelError: The file, the site, the body or a joint is missing or not usable.
    """
    if path.exists() and not path.is_file():
        raise ModelError(f"{path}: is not a regular file; give a file in MJCF or URDF")
    if not path.is_file():
        models = [*path.parent.glob("*.xml"), *path.parent.glob("*.urdf")]
        near = did_you_mean(path.name, [file.name for file in models]) or suggestion(path, "models")
        raise ModelError(f"{path}: no such model file{near}")
    arm = _arm(path, read(path, packages), joints, _frame(site=site, body=body, tool=tool))
    return replace(arm, packages=tuple(sorted((packages or {}).items())))


def is_model(model: object) -> bool:
    """Return whether `load_model` accepts an object."""
    return isinstance(model, mujoco.MjModel | mujoco.MjSpec)


def load_model(
    model: mujoco.MjModel | mujoco.MjSpec, site: str | None = None, joints: Sequence[str] | None = None, *,
    body: str | None = None,
) -> Arm:  # fmt: skip
    """Find the arm in a loaded model.

    Args:
        model: The model; it is not changed. No site can be added to a compiled model: its arm needs a site,
            and names of all joints. A base that floats there is not fixed: its pose is in MuJoCo's data.
        site: As in `load`, like the others.
        joints: Names of the joints to actuate.
        body: Name of the body whose frame to control.

    Raises:
        ModelError: The site, the body or a joint is missing or not usable, or a number is not finite.
    """
    spec = model.copy() if isinstance(model, mujoco.MjSpec) else None
    title = spec.modelname if spec else bytes(model.names).partition(b"\0")[0].decode("utf-8", "replace")
    path = Path(title or "the model")
    file = Read(spec, model if spec is None else compiled(path, spec), None, ())
    return _arm(path, file, joints, _frame(site=site, body=body))


def load_asked(section: ArmSection) -> Arm:
    """Return the arm of a scenario's section, not stretched.

    Raises:
        ModelError: See `load`.
    """
    keys = ("site", "joints", "body", "tool", "packages")
    return load(section.model, **{key: getattr(section, key) for key in keys})


def _frame(**frames: str | ToolSection | None) -> NamedFrame | None:
    return next(((key, value) for key, value in frames.items() if value is not None), None)


def _arm(path: Path, file: Read, joints: Sequence[str] | None, frame: NamedFrame | None) -> Arm:
    """Return the arm of a model: see `load`."""
    spec, robot, notes = file.spec, file.robot, [*file.notes]
    model, site, frame = mounted(path, spec, file.model, frame, notes)
    chain = _chain(path, model, site, refuses_balls=joints is None)
    links = find_links(path, model, chain)
    driven = _driven(path, site, chain, links, joints, notes)
    following = followers(model, chain, links, driven)
    ids = [model.joint(joint).id for joint in driven]
    positions, rates, torques = limits(model, driven, following, robot.velocity if robot else {})
    keys, home = keyframes(model, ids, positions, notes)
    if robot is not None and (apart := urdf.keep_apart(spec, model, keys.get("home", model.qpos0))):
        notes += apart
        model = compiled(path, spec)
    if robot is not None:
        moved = is_behind(model, int(model.jnt_bodyid[ids[0]]))
        notes += urdf.assumed_masses(robot, model, moved)
    moving = {*driven, *(each.name for each in following if not each.pitch)}
    others = {name: links[name] for name in chain if name in links and links[name].leader not in ids}
    arm = Arm(
        path=path, site=site, joints=driven, axis_names=tuple(name for name in chain if name in moving),
        is_slide=model.jnt_type[ids] == SLIDE, followers=following, position_limit=positions,
        rate_limit=rates, torque_limit=torques, keyframes=keys, model=model, _spec=spec, _links=others,
        frame=frame, notes=tuple(notes), home=home,
        is_urdf=robot is not None,
    )  # fmt: skip
    ties = find_ties(model, arm.configuration("home"), arm.motion, arm.others.locked | arm.others.held)
    if not ties:
        return arm
    verbs = ("tie", "are") if len(ties) > 1 else ("ties", "is")
    line = f"{listed(ties)} {verbs[0]} the arm, and {verbs[1]} ignored in its kinematics"
    return replace(arm, ties=ties, notes=(*arm.notes, line))


def _chain(path: Path, model: mujoco.MjModel, site: str, refuses_balls: bool) -> list[str]:
    """Return the names of the hinge and slide joints between the world and a site, outward."""
    chain: list[str] = []
    for i in joints_above(model, int(model.site(site).bodyid[0])):
        kind, body, name = model.jnt_type[i], model.body(model.jnt_bodyid[i]), model.joint(i).name
        called = f'body "{body.name or f"body{body.id}"}"'
        if refuses_balls and kind == mujoco.mjtJoint.mjJNT_BALL:
            why = f'the joint of {called} on the chain to site "{site}" is a ball joint; only hinge and slide'
            raise ModelError(f"{path}: {why} joints can be driven at a rate: list those in joints", "joints")
        if kind in (HINGE, SLIDE) and not name:
            raise ModelError(f"{path}: a joint of {called} has no name; give it one")
        chain += [name] if kind in (HINGE, SLIDE) else []
    if not chain:
        raise ModelError(f'{path}: no joint moves site "{site}"; choose a site on a moving body', "site")
    return chain[::-1]


def _driven(
    path: Path, site: str, chain: Sequence[str], links: Mapping[str, Follower],
    joints: Sequence[str] | None, notes: list[str],
) -> tuple[str, ...]:  # fmt: skip
    """Return the joints to actuate, outward."""
    free = [name for name in chain if name not in links]
    joints = free if joints is None else [joints] if isinstance(joints, str) else joints
    for name in joints:
        if name not in free or joints.count(name) > 1:
            why = f'no hinge or slide joint "{name}" on the chain to site "{site}"{did_you_mean(name, free)}'
            if name in links or name in free:
                why = f'joint "{name}" {"is listed twice" if name in free else "follows by an equality"}'
            raise ModelError(f"{path}: {why}; the chain: {', '.join(free)}", "joints")
    outward = tuple(name for name in free if name in joints)
    if free and not outward:
        raise ModelError(f"{path}: must name one joint or more; the chain: {', '.join(free)}", "joints")
    if not outward:
        why = f'each joint on the chain to site "{site}" follows another by an equality'
        raise ModelError(f"{path}: {why}; choose a site that a joint moves that follows none", "site")
    if outward != tuple(joints):
        notes.append(f"list joints, and values for them, from the base outward: {', '.join(outward)}")
    return outward


def files(path: Path, packages: Mapping[str, Path] | None = None) -> list[Path]:
    """Return a model's file and every file that it depends on: included files, meshes, textures.

    Args:
        path: The file, absolute.
        packages: Folders of a URDF's packages, by their names.

    Returns:
        Those that exist, also of a file that is no model, which `load` reports.
    """
    needed = {path}
    with suppress(ModelError), in_our_words(path):
        robot = opened(path, packages)
        if robot is None:
            needed |= {Path(file) for file in mujoco.mju_getXMLDependencies(str(path))}
        else:  # with what makes folders above it packages
            needed |= {*robot.meshes, *(above / "package.xml" for above in path.parents)}
    return sorted(file for file in needed if file.is_file())
