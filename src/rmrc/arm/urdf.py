"""A URDF file as MuJoCo can read it: packages are found, links kept, and inertias made physical."""

import re
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.scan import Tag, tags
from rmrc.support.errors import ModelError
from rmrc.support.legible import listed

# The least mass [kg] and moments of inertia [kg·m²] of a moving link: a gram, radius of gyration 3 cm,
# which is little beside any link of an arm, and enough for MuJoCo to divide by.
LEAST_MASS, LEAST_INERTIA = 1e-3, 1e-6

# Compiler settings where the file has no others: visual geoms are for the recording, and links that are fixed
# to others keep their names.
_KEPT = {"discardvisual": "false", "fusestatic": "false"}
_SCHEME = re.compile(r"(package|model|file)://+(.*)", re.DOTALL)


class Urdf(NamedTuple):
    """The contents of a URDF file.

    Attributes:
        text: Text for MuJoCo, with the paths of meshes absolute.
        velocity: The largest rate of each joint that has one, by its name [rad/s or m/s].
        notes: Assumptions.
    """

    text: str
    velocity: Mapping[str, float]
    notes: tuple[str, ...]


def is_urdf(path: Path) -> bool:
    """Return whether the first element of a file is a robot's."""
    with path.open(encoding="utf-8", errors="replace") as file:
        first = next(tags(file.read(100_000)), None)
    return first is not None and first.name == "robot"


def read(path: Path, packages: Mapping[str, Path]) -> Urdf:
    """Return a URDF file as MuJoCo can read it.

    Args:
        path: The file.
        packages: Folders of packages, by their names; others are searched upward from the file.

    Raises:
        ModelError: It is not UTF-8, or a xacro file.
    """
    try:
        text = path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise ModelError(f"{path}: must be UTF-8, but byte {error.start} is not") from None
    return _Reading(path, text, packages).done()


def files(path: Path, packages: Mapping[str, Path]) -> set[Path]:
    """Return the existing meshes of a URDF file, and the files that make folders above it packages.

    Args:
        path: The file, absolute.
        packages: Folders of packages, by their names.

    Raises:
        ModelError: It cannot be read.
    """
    meshes = {
        Path(tag.attributes.get("filename", ""))
        for tag in tags(read(path, packages).text)
        if tag.name == "mesh"
    }
    marks = {above / "package.xml" for above in path.parents}
    return {file for file in meshes | marks if file.is_file()}


class _Reading:
    """One pass through the tags of a file, which collects the replacements."""

    def __init__(self, path: Path, text: str, packages: Mapping[str, Path]) -> None:
        self._path, self._text, self._packages = path, text, packages
        self._tags = list(tags(text))
        self._instead: list[tuple[tuple[int, int], str]] = []
        self._velocity: dict[str, float] = {}
        self._floating: list[str] = []
        self._colors: list[str] = []  # lines
        self._unknown: dict[str, None] = {}  # packages; a dict keeps the order
        self._shapes = {""}  # names
        of_compiler = (tag.attributes for tag in self._tags if tag.name == "compiler" and not tag.closes)
        self._compiler = next(of_compiler, None)

    def done(self) -> Urdf:
        inside: list[Tag] = []
        for tag in self._tags:
            if tag.name.startswith("xacro:"):
                raise ModelError(
                    f"{self._path}:{tag.line}: is a xacro file, which must be expanded first: "
                    f"xacro {self._path.name} > {self._path.name.partition('.')[0]}.expanded.urdf"
                )
            if not tag.closes:
                self._take(tag, inside)
                if not tag.is_alone:
                    inside.append(tag)
            elif inside and inside[-1].name == tag.name:
                inside.pop()
        return Urdf(self._rewritten(), self._velocity, tuple(self._notes()))

    def _take(self, tag: Tag, inside: Sequence[Tag]) -> None:
        names = [each.name for each in inside]
        if tag.name == "robot" and not names and self._compiler is None:
            section = f"<mujoco>{_element('compiler', _KEPT)}</mujoco>"
            self._instead.append(((tag.span[1], tag.span[1]), section))
        elif tag.name == "mujoco" and names == ["robot"] and self._compiler is None:
            # MuJoCo accepts only one
            raise ModelError(f"{self._path}:{tag.line}: mujoco must have a compiler in it; write <compiler/>")
        elif tag.name == "compiler" and names == ["robot", "mujoco"]:
            # absolute paths must keep their folders
            self._replace(tag, **{**_KEPT, **tag.attributes, "strippath": "false"})
        elif tag.name in ("visual", "collision") and "name" in tag.attributes:
            name = tag.attributes["name"]
            if name in self._shapes:  # MuJoCo would print it
                self._instead.append((tag.span, _element(tag.name, {}, tag.is_alone)))
            self._shapes.add(name)
        elif tag.name == "mesh" and "filename" in tag.attributes:
            self._replace(tag, filename=str(self._found(tag.attributes["filename"])))
        elif tag.name == "color" and not _is_color(tag.attributes.get("rgba", "")):
            self._replace(tag, rgba="0.5 0.5 0.5 1")
            self._colors.append(str(tag.line))
        elif tag.name == "joint" and names == ["robot"] and tag.attributes.get("type") == "floating":
            self._floating.append(tag.attributes.get("name", ""))
            self._replace(tag, type="fixed")
        elif tag.name == "limit" and names == ["robot", "joint"]:
            velocity = _positive(tag.attributes.get("velocity", ""))
            self._velocity |= {} if velocity is None else {inside[-1].attributes.get("name", ""): velocity}

    def _replace(self, tag: Tag, **attributes: str) -> None:
        self._instead.append((tag.span, _element(tag.name, {**tag.attributes, **attributes}, tag.is_alone)))

    def _found(self, uri: str) -> Path:
        """Return the file that a mesh names; a possible path if none exists."""
        scheme = _SCHEME.fullmatch(uri.strip())
        if scheme is None:
            compiler = self._compiler or {}
            stripped = compiler.get("strippath") == "true"
            folder = self._path.parent / compiler.get("meshdir", compiler.get("assetdir", ""))
            return (folder / (Path(uri).name if stripped else uri)).absolute()
        if scheme[1] == "file":
            return Path("/", scheme[2])
        name, _, rest = scheme[2].partition("/")
        folders = self._folders(name)
        if not folders:
            self._unknown[name] = None
        return next((file for folder in folders if (file := folder / rest).is_file()),
                    (folders[0] if folders else self._path.parent / name) / rest)  # fmt: skip

    def _folders(self, name: str) -> list[Path]:
        """Return the possible folders of a package: the given one, else those above the file."""
        if name in self._packages:
            return [self._packages[name].absolute()]
        found = []
        for above in self._path.absolute().parents:
            if above.name == name or _package_of(above) == name:
                found.append(above)
            elif (above / name).is_dir():
                found.append(above / name)
        return found

    def _rewritten(self) -> str:
        parts, at = list[str](), 0
        for (begin, end), instead in sorted(self._instead):
            parts += [self._text[at:begin], instead]
            at = end
        return "".join((*parts, self._text[at:]))

    def _notes(self) -> list[str]:
        notes = []
        if self._floating:
            notes.append(f"joint {listed(self._floating)}, which is floating in the file, is fixed")
        if self._colors:
            notes.append(
                f"a color must be four numbers from 0 to 1; the one in line {listed(self._colors)} is gray"
            )
        if self._unknown:
            ways = " ".join(f"--package {name}=FOLDER" for name in self._unknown)
            notes.append(
                f"package {listed(self._unknown)} was not found above the file; give {ways}, or arm.packages"
            )
        return notes


def _element(name: str, attributes: Mapping[str, str], is_alone: bool = True) -> str:
    pairs = "".join(f' {key}="{escape(value)}"' for key, value in attributes.items())
    return f"<{name}{pairs}{'/' * is_alone}>"


def _positive(text: str) -> float | None:
    """Return a number above 0; in many published files, 0 means unknown."""
    try:
        return value if (value := float(text)) > 0.0 else None
    except ValueError:
        return None


def _is_color(text: str) -> bool:
    try:
        return len(values := text.split()) == 4 and all(0.0 <= float(value) <= 1.0 for value in values)
    except ValueError:
        return False


def _package_of(folder: Path) -> str | None:
    """Return the name of the package whose `package.xml` lies in a folder."""
    file = folder / "package.xml"
    try:
        text = file.read_text("utf-8", "replace") if file.is_file() else ""
    except OSError:
        return None
    found = re.search(r"<name>\s*([^<\s]+)\s*</name>", text)
    return found[1] if found else None


# Masses -----------------------------------------------------------------------------------------


def mend(spec: mujoco.MjSpec) -> list[str]:
    """Make the inertias of a URDF's links physical, and hide collision geoms of links with visual ones.

    Returns:
        Assumptions.
    """
    massless, unphysical = [], []
    for body in spec.bodies[1:]:
        if not _has_moments(body):
            unphysical.append(body.name)
        if body.joints and not _has_mass(body):
            _give(body, max(body.mass, LEAST_MASS), LEAST_INERTIA)
            massless.append(body.name)
        visual = [geom for geom in body.geoms if not geom.contype and not geom.conaffinity]
        for geom in body.geoms:
            if visual and (geom.contype or geom.conaffinity):
                geom.group = 3  # a group that viewers hide
    notes = []
    if massless:
        least = f"{LEAST_MASS:g} kg and {LEAST_INERTIA:g} kg m^2 at least"
        notes.append(f"link {listed(massless)} has no mass or inertia in the file, and gets {least}")
    if unphysical:
        nearest = "the nearest valid one is used"
        notes.append(f"physically impossible inertia of link {listed(unphysical)} in the file; {nearest}")
    return notes


def _has_moments(body: mujoco.MjsBody) -> bool:
    """Replace an impossible inertia by the nearest valid one, or by none; return whether it was valid."""
    xx, yy, zz, xy, xz, yz = body.fullinertia
    if np.isnan(xx):  # its only inertia is that of its geoms
        return True
    moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if moments[0] > mujoco.mjMINVAL and moments[0] + moments[1] >= moments[2]:
        return True
    if not moments.any():
        _give(body, body.mass, 0.0)
        return True
    moments = np.maximum(moments, LEAST_INERTIA)
    if moments[0] + moments[1] < moments[2]:
        moments[:] = moments.mean()  # as MuJoCo's balanceinertia does
    full = axes @ np.diag(moments) @ axes.T
    body.fullinertia = [full[0, 0], full[1, 1], full[2, 2], full[0, 1], full[0, 2], full[1, 2]]
    return False


def _has_mass(body: mujoco.MjsBody) -> bool:
    """Return whether a body, or one that is fixed to it, has mass and inertia."""
    if body.explicitinertial:
        own = body.mass > 0.0 and (not np.isnan(body.fullinertia[0]) or np.any(body.inertia))
    else:
        own = any(geom.density > 0.0 for geom in body.geoms)
    return bool(own) or any(_has_mass(child) for child in body.bodies if not child.joints)


def _give(body: mujoco.MjsBody, mass: float, inertia: float) -> None:
    body.explicitinertial, body.mass, body.inertia = True, mass, [inertia] * 3
    body.fullinertia = [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]


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
    met = [contact.geom for contact in data.contact[: data.ncon] if contact.dist < 0.0]
    pairs = sorted({tuple(sorted(int(model.geom_bodyid[geom]) for geom in pair)) for pair in met})
    named = [tuple(model.body(body).name for body in pair) for pair in pairs]
    for first, second in named:
        spec.add_exclude(bodyname1=first, bodyname2=second)
    if not named:
        return []
    told = listed(f"{first} and {second}" for first, second in named)
    return [f"ignoring contacts between bodies that overlap at home: {told}"]
