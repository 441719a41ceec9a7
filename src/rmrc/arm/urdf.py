"""A URDF file as MuJoCo can read it: packages are found, links kept, and inertias made physical."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.frames import note
from rmrc.arm.scan import numbers
from rmrc.support.errors import ModelError
from rmrc.support.text import listed

# The least mass [kg] and moments of inertia [kg·m²] of a moving link: a gram, radius of gyration 3 cm,
# which is little beside any link of an arm, and enough for MuJoCo to divide by.
_LEAST_MASS, _LEAST_INERTIA = 1e-3, 1e-6

_HIDDEN = 3  # group of geoms that viewers hide


_TURN = 6.5  # angles of a file in rad are smaller
_SIZES = ("size", "radius", "length", "scale")  # attributes of shapes
# Attributes of a limit that are used, and the types of joints that have both ends of a range.
_LIMITS = ("lower", "upper", "velocity", "effort")
_RANGED = ("revolute", "prismatic")


class Urdf(NamedTuple):
    """The contents of a URDF file.

    Attributes:
        text: Text for MuJoCo, with the paths of meshes absolute.
        meshes: These paths.
        velocity: The largest rate of each joint that has one, by its name [rad/s or m/s].
        masses: The mass of each link, by its name [kg]; 0 without one.
        notes: Assumptions.
    """

    text: str
    meshes: tuple[Path, ...]
    velocity: Mapping[str, float]
    masses: Mapping[str, float]
    notes: tuple[str, ...]


def read(path: Path, robot: ET.Element, packages: Mapping[str, Path]) -> Urdf:
    """Return a URDF file as MuJoCo can read it.

    Args:
        path: The file.
        robot: Its root, which is changed.
        packages: Folders of packages, by their names; others are searched upward from the file.

    Raises:
        ModelError: It is a xacro file; properties alone, which nothing uses, do not make it one.
    """
    text = ET.tostring(robot, "unicode")
    if "<xacro:" in text and re.search(r"<xacro:(?!property\b)|\$[{(]", text):
        how = f"xacro {path.name} > {path.name.partition('.')[0]}.expanded.urdf"
        raise ModelError(f"{path}: is a xacro file, which must be expanded first: {how}")
    meshes, unknown = _find_meshes(path.absolute(), robot, packages)
    joints, links = robot.findall("joint"), robot.findall("link")
    floating = [joint for joint in joints if joint.get("type") == "floating"]
    for joint in floating:
        joint.set("type", "fixed")
    notes = {
        f"joint {listed(map(_name, floating))}, which is floating in the file, is fixed": floating,
        **_mend_shapes(robot, links),
        f"package {listed(unknown)} was not found above the file; give --package NAME=FOLDER": unknown,
    }
    lines = *(note for note, applies in notes.items() if applies), *_unused(joints)
    rates = ((_name(joint), _number(joint.find("limit"), "velocity")) for joint in joints)
    velocity = {name: rate for name, rate in rates if rate > 0.0}  # in many published files, 0 means unknown
    masses = {_name(link): _number(link.find("inertial/mass"), "value") for link in links}
    return Urdf(ET.tostring(robot, "unicode"), meshes, velocity, masses, lines)


def _name(element: ET.Element) -> str:
    return element.get("name", "")


def _number(element: ET.Element | None, key: str) -> float:
    """Return a number of an element; 0 without it."""
    return next(iter(numbers("" if element is None else element.get(key, ""))), 0.0)


def _mend_shapes(robot: ET.Element, links: Sequence[ET.Element]) -> dict[str, object]:
    """Leave out shapes without a size, names that are there twice, and colors that are none.

    Returns:
        Notes, and whether each applies.
    """
    names, empty, gray = set[str](), [], 0
    for link in links:
        for shape in [each for each in link if each.tag in ("visual", "collision")]:
            form = shape.find("geometry/*")
            if form is None or 0.0 in numbers(" ".join(form.get(key, "") for key in _SIZES)):
                link.remove(shape)
                empty.append(_name(link))
            if _name(shape) in names:
                shape.attrib.pop("name", None)  # MuJoCo would print that it is not the first of its name
            names.add(_name(shape))
    for color in robot.iter("color"):
        rgba = numbers(color.get("rgba", ""))
        if len(rgba) != 4 or min(rgba) < 0.0 or max(rgba) > 1.0:
            color.set("rgba", "0.5 0.5 0.5 1")
            gray += 1
    return {
        f"a shape of link {listed(dict.fromkeys(empty))} has size 0 or none, and is left out": empty,
        f"a color must be four numbers from 0 to 1; {gray} in the file are gray instead": gray,
    }


def _unused(joints: Sequence[ET.Element]) -> list[str]:
    """Return notes about data of joints that nothing here uses."""
    leaders = {_name(joint) for joint in joints if joint.get("type") in (*_RANGED, "continuous")}
    lines: dict[tuple[str, str], list[str]] = {}
    for joint in joints:
        for code, text, value in _unused_of(joint, leaders):
            lines.setdefault((code, text), []).append(f"{_name(joint)} ({value})")
    return [
        note(code, f"{text}: {listed(values)}", level="warning" if code.startswith("range") else "note")
        for (code, text), values in lines.items()
    ]


def _unused_of(joint: ET.Element, leaders: Collection[str]) -> Iterator[tuple[str, str, str]]:
    """Yield code, text and value of each."""
    limit, soft = joint.find("limit"), joint.find("safety_controller")
    mimic, origin = joint.find("mimic"), joint.find("origin")
    lower, upper = _number(limit, "lower"), _number(limit, "upper")
    low, high = _number(soft, "soft_lower_limit"), _number(soft, "soft_upper_limit")
    values = {} if limit is None else limit.attrib
    ends, is_ranged = f"{lower:g} to {upper:g}", joint.get("type") in _RANGED
    stops = [key for key in ("lower", "upper") if key in values]
    if is_ranged and stops and (len(stops) < 2 or lower >= upper):
        yield "range-reversed", "a joint has a range only if its <limit> has lower and a larger upper", ends
    if joint.get("type") == "continuous" and lower < upper:
        yield "unused", "lower and upper of a continuous joint are not used", ends
    if low < high and (low > lower or high < upper or lower >= upper):
        yield "unused", "soft limits of <safety_controller> are not used, <limit> is", f"{low:g} to {high:g}"
    for key, value in values.items():
        if key not in _LIMITS or (key == "velocity" and _number(limit, key) < 0.0):
            yield "unused", f"{key} of <limit> is not used; set control.limits of a scenario", value
    if mimic is not None and mimic.get("joint") not in leaders:
        why = "<mimic> is not used, as the file has no such joint that moves"
        yield "unused", why, f'"{mimic.get("joint", "")}"'
    angles = "" if origin is None else origin.get("rpy", "")
    if max(map(abs, numbers(angles)), default=0.0) > _TURN:
        yield "range-suspicious", "rpy of <origin> is read in rad, and seems to be in degrees", angles


def _find_meshes(
    path: Path, robot: ET.Element, packages: Mapping[str, Path]
) -> tuple[tuple[Path, ...], list[str]]:
    """Name each mesh by its absolute path, and have MuJoCo keep all links and shapes.

    Returns:
        The paths, and names of packages that are not found.
    """
    section = robot.find("mujoco")
    section = ET.SubElement(robot, "mujoco") if section is None else section
    compiler = section.find("compiler")
    compiler = ET.SubElement(section, "compiler") if compiler is None else compiler
    folder = path.parent / compiler.get("meshdir", compiler.get("assetdir", ""))
    strips = compiler.get("strippath") == "true"
    kept = {"discardvisual": "false", "fusestatic": "false"}
    compiler.attrib = {**kept, **compiler.attrib, "strippath": "false"}
    meshes, unknown = [], []
    for mesh in robot.iter("mesh"):
        uri = mesh.get("filename", "").strip()
        scheme, _, rest = uri.partition(":/")
        name, _, inside = rest.strip("/").partition("/")
        if scheme in ("package", "model"):
            folders = _folders(path, name, packages)
            unknown += [name] if not folders and name not in unknown else []
            files = [place / inside for place in folders or [path.parent / name]]
        elif scheme == "file":
            files = [Path("/", rest.lstrip("/"))]
        else:
            files = [folder / (Path(uri).name if strips else uri)]
        meshes.append(next((file for file in files if file.is_file()), files[0]))
        mesh.set("filename", str(meshes[-1]))
    return tuple(meshes), unknown


def _folders(path: Path, name: str, packages: Mapping[str, Path]) -> list[Path]:
    """Return the possible folders of a package: the one that was given, or those above the file."""
    if name in packages:
        return [packages[name].absolute()]
    folders = []
    for above in path.parents:
        manifest = above / "package.xml"
        text = manifest.read_text("utf-8", "replace") if manifest.is_file() else ""
        is_it = above.name == name or re.search(rf"<name>\s*{re.escape(name)}\s*</name>", text)
        folders += [above] if is_it else [above / name] if (above / name).is_dir() else []
    return folders


def hide_collisions(spec: mujoco.MjSpec) -> None:
    """Hide collision geoms of links with visual ones."""
    for body in spec.bodies[1:]:
        touching = [geom for geom in body.geoms if geom.contype or geom.conaffinity]
        for geom in touching if len(touching) < len(body.geoms) else ():
            geom.group = _HIDDEN


def bound_masses(spec: mujoco.MjSpec, error: ValueError) -> list[str]:
    """Have MuJoCo raise masses and inertias that are too small, and balance those that no body can have.

    Args:
        spec: The specification, with a link that MuJoCo refuses.
        error: Its reason.

    Returns:
        A note.
    """
    spec.compiler.boundmass, spec.compiler.boundinertia = _LEAST_MASS, _LEAST_INERTIA
    spec.compiler.balanceinertia = True
    least = f"{_LEAST_MASS:g} kg and {_LEAST_INERTIA:g} kg m^2 at least"
    return [f"each link gets {least}, and a possible inertia; MuJoCo: {' '.join(str(error).split())}"]


def assumed_masses(robot: Urdf, model: mujoco.MjModel, bodies: NDArray[np.bool_]) -> list[str]:
    """Return a note about links whose mass is not in the file.

    MuJoCo computes it from the shapes for contact, as if they were full of water.

    Args:
        robot: The file.
        model: The compiled model.
        bodies: The bodies whose masses matter, (nbody,).
    """
    total, texts = 0.0, []
    for b in np.flatnonzero(bodies):
        name, mass = model.body(b).name, float(model.body_mass[b])
        written, least = robot.masses.get(name, 1.0), 0.0 if model.body_jntnum[b] else _LEAST_MASS
        if written < 0.0 or (written == 0.0 and mass > least):
            total += mass
            texts.append(f"{name} {mass:.4g} kg" + (f" ({written:g} in the file)" if written else ""))
    what = f"masses that the file lacks are assumed, {total:.4g} kg in all: {listed(texts)}"
    how = f"shapes for contact weigh 1000 kg/m^3, links without any {_LEAST_MASS:g} kg"
    return [f"{what}; {how}; torques depend on them: add <inertial>"] if texts else []


def keep_apart(spec: mujoco.MjSpec, model: mujoco.MjModel, qpos: NDArray[np.float64]) -> list[str]:
    """Exclude contacts between bodies of a URDF that overlap at home.

    A URDF cannot list pairs that do not collide, and MuJoCo uses the convex hull of each mesh, so neighboring
    links of the chain overlap wherever they are.

    Args:
        spec: The specification of the model; pairs are added.
        model: The compiled model.
        qpos: Home, (nq,).

    Returns:
        Assumptions.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_fwdKinematics(model, data)
    mujoco.mj_collision(model, data)
    met = data.contact.geom[data.contact.dist < 0.0]
    pairs = sorted({tuple(sorted(model.geom_bodyid[pair].tolist())) for pair in met})
    names = [[model.body(body).name for body in pair] for pair in pairs]
    for first, second in names:
        spec.add_exclude(bodyname1=first, bodyname2=second)
    told = listed(map(" and ".join, names))
    return [f"ignoring contacts between bodies that overlap at home: {told}"] if names else []
