"""A URDF file as MuJoCo can read it: packages are found, links kept, and inertias made physical."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.scan import numbers
from rmrc.support.errors import ModelError
from rmrc.support.legible import listed

# The least mass [kg] and moments of inertia [kg·m²] of a moving link: a gram, radius of gyration 3 cm,
# which is little beside any link of an arm, and enough for MuJoCo to divide by.
_LEAST_MASS, _LEAST_INERTIA = 1e-3, 1e-6

_HIDDEN = 3  # group of geoms that viewers hide


class Urdf(NamedTuple):
    """The contents of a URDF file.

    Attributes:
        text: Text for MuJoCo, with the paths of meshes absolute.
        meshes: These paths.
        velocity: The largest rate of each joint that has one, by its name [rad/s or m/s].
        notes: Assumptions.
    """

    text: str
    meshes: tuple[Path, ...]
    velocity: Mapping[str, float]
    notes: tuple[str, ...]


def read(path: Path, robot: ET.Element, packages: Mapping[str, Path]) -> Urdf:
    """Return a URDF file as MuJoCo can read it.

    Args:
        path: The file.
        robot: Its root, which is changed.
        packages: Folders of packages, by their names; others are searched upward from the file.

    Raises:
        ModelError: It is a xacro file.
    """
    meshes, unknown = _find_meshes(path.absolute(), robot, packages)
    shapes, gray = dict[str, ET.Element](), 0
    for element in robot.iter():
        if element.tag.startswith("xacro:"):
            how = f"xacro {path.name} > {path.name.partition('.')[0]}.expanded.urdf"
            raise ModelError(f"{path}: is a xacro file, which must be expanded first: {how}")
        if element.tag in ("visual", "collision"):
            if shapes.setdefault(element.get("name", ""), element) is not element:
                element.attrib.pop("name", None)  # MuJoCo would print that it is not the first of its name
        elif element.tag == "color":
            rgba = numbers(element.get("rgba", ""))
            if len(rgba) != 4 or min(rgba) < 0.0 or max(rgba) > 1.0:
                element.set("rgba", "0.5 0.5 0.5 1")
                gray += 1
    floating = []
    for joint in robot.findall("joint[@type='floating']"):
        joint.set("type", "fixed")
        floating.append(joint.get("name", ""))
    limits = ((joint.get("name", ""), joint.find("limit")) for joint in robot.findall("joint"))
    rates = {name: numbers(limit.get("velocity", "")) for name, limit in limits if limit is not None}
    # in many published files, 0 means unknown
    velocity = {name: rate[0] for name, rate in rates.items() if rate and rate[0] > 0.0}
    notes = {
        f"joint {listed(floating)}, which is floating in the file, is fixed": floating,
        f"a color must be four numbers from 0 to 1; {gray} in the file are gray instead": gray,
        f"package {listed(unknown)} was not found above the file; give --package NAME=FOLDER": unknown,
    }
    lines = tuple(note for note, applies in notes.items() if applies)
    return Urdf(ET.tostring(robot, "unicode"), meshes, velocity, lines)


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
