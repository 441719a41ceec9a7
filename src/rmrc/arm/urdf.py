"""A URDF file as MuJoCo can read it: packages are found, links kept, and inertias made physical."""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.tree import note
from rmrc.support.errors import ModelError
from rmrc.support.text import listed, shortened, visible

# Scan of the XML text -----------------------------------------------------------------------------
#
# What an XML file asks of MuJoCo is checked before MuJoCo reads it: nothing can interrupt its reading.
#
# One line can ask for a million bodies, which takes MuJoCo hours, and a NaN compiles without an error.

# The largest number of elements, for which MuJoCo takes some seconds: its time is quadratic. Published models
# have some hundreds.
_MOST = 10_000
# The largest values of attributes for which MuJoCo would step or search practically forever.
_BOUNDS = {"inttotal": 1e3, **dict.fromkeys(("iterations", "ls_iterations", "ccd_iterations"), 1e4)}
# The largest other number: no equation here makes it infinite.
_LARGEST = 1e30
# Other formats by the beginning of a file, its root, or the end of its name: what each is, and the way out.
POINTER = "version https://git-lfs"
_FORMATS = {
    (POINTER,): "a pointer of Git LFS, not the file itself; run `git lfs pull` in its repository",
    ("<!doctype html", "<html"): "an HTML page; download the file itself, not the page that shows it",
    ("<sdf",): "SDF; convert it to MJCF, such as by `sdf2mjcf FILE arm.xml` of the package sdformat-mjcf",
    ("<srdf",): "SRDF, which describes groups of the joints of a URDF; give that URDF",
    ("<collada", ".stl", ".obj", ".ply", ".glb"): "{}, a mesh; give the URDF or MJCF file that names it",
    ("#usda", "pxr-usdc", ".usd"): "USD; export it as URDF or MJCF where it was made",
    (".yaml", ".yml"): "YAML; give the file that arm.model of a scenario names, or `rmrc run` the scenario",
}
# Characters that end a line or reverse the direction of the rest, and the one for bytes that are not UTF-8.
_UNFIT = re.compile("[\x01-\x08\x0a-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ufffd]")


def check_file(path: Path, above: tuple[Path, ...] = ()) -> tuple[ET.Element, int]:
    """Check an MJCF or URDF file and those that it names.

    Args:
        path: The file.
        above: The files that name one another and finally this one.

    Returns:
        Its root, and the number of its elements, each counted as often as it is copied.

    Raises:
        ModelError: It is no XML, asks for too much, a number of it is not finite, or a name is not fit to
            print.
        OSError: It cannot be read.
    """
    root, lines = _parsed(path)
    names = {element.get(key) for element in root.iter() for key in ("name", "class")}
    above, total, copies = (*above, path.resolve()), 0, {root: 1}
    for element in root.iter():
        place = f"{path}:{lines[element]}: {element.tag}"
        _check_attributes(place, element, names)
        times, count = copies.pop(element), _count(element)
        if element.tag in ("include", "model"):
            for file in {folder / element.get("file", "") for folder in (above[0].parent, path.parent)}:
                if file.resolve() not in above:
                    count += check_file(file, above)[1] if file.is_file() else 0
                elif element.tag == "model":  # MuJoCo would never end
                    raise ModelError(f'{place} must name another file than itself, got "{file.name}"')
        is_copied = element.tag == "replicate"
        copies |= dict.fromkeys(element, times * count if is_copied else times)
        total += times * (1 if is_copied else count)
        if total > _MOST:
            what = f"a model must have {_MOST} elements at most, counting each copy, got {total} by here"
            raise ModelError(f"{place}: {what}; remove parts outside the arm")
    return root, total


def numbers(text: str) -> list[float]:
    """Return the numbers of a text; none if it has another word."""
    try:
        return [float(number) for number in text.split()]
    except ValueError:
        return []


def _parsed(path: Path) -> tuple[ET.Element, dict[ET.Element, int]]:
    """Return the root of an XML file and the lines of its elements; prefixes need no declaration."""
    builder, parser, lines = ET.TreeBuilder(), expat.ParserCreate(), dict[ET.Element, int]()

    def start(tag: str, attributes: dict[str, str]) -> None:
        lines[builder.start(tag, attributes)] = parser.CurrentLineNumber

    parser.StartElementHandler, parser.EndElementHandler = start, builder.end
    parser.CharacterDataHandler = builder.data
    # comments are left out, as MuJoCo takes two dashes within one
    head, *comments = path.read_text("utf-8", "replace").lstrip().split("<!--")
    ended = (comment.partition("-->") for comment in comments)
    text = head + "".join("\n" * comment.count("\n") + after for comment, _, after in ended)
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        known = _other_format(text[:99].lower()) or _other_format(path.suffix.lower())
        raise ModelError(f"{path}: {known or f'must be XML, but is not: {error}'}") from None
    root = builder.close()
    tags = {child.tag for child in root} if root.tag == "robot" else {"link"}
    is_srdf = "link" not in tags and not tags.isdisjoint(("group", "disable_collisions", "virtual_joint"))
    if known := _other_format("<srdf" if is_srdf else f"<{root.tag.lower()}"):
        raise ModelError(f"{path}: {known}")
    return root, lines


def _other_format(sign: str) -> str:
    """Return which other format a file is in, and the way out; "" if none is known."""
    ways = (way.format(sign[1:].upper()) for signs, way in _FORMATS.items() if sign.startswith(signs))
    return next((f"must be URDF or MJCF, but is {way}" for way in ways), "")


def _count(element: ET.Element) -> int:
    """Return how many elements one asks for: points of a flex, keyframes, copies."""
    text = element.get("nkey" if element.tag == "size" else "count", "")
    return max(1, math.prod(int(number) for number in re.findall(r"\d{1,18}", text)))


def _check_attributes(place: str, element: ET.Element, names: set[str | None]) -> None:
    if element.get("name"):
        place += f' "{shortened(visible(element.attrib["name"]))}"'
    for key, value in element.attrib.items():
        sizes = [abs(number) for number in numbers(value)] if value not in names else []
        most = _BOUNDS.get(key, _LARGEST)
        if _UNFIT.search(value):
            wrong = "be UTF-8 without control characters"
        elif key == "class" and "%" in value:  # of an unknown one MuJoCo makes a format: %n ends the process
            wrong = 'not have a "%"'
        elif not all(map(math.isfinite, sizes)):
            wrong = "be finite, or be left out for no limit"
        elif max(sizes, default=0.0) > most:
            wrong = f"be {most:g} at most"
        else:
            continue
        raise ModelError(f'{place}: {key} must {wrong}, got "{shortened(visible(value))}"')


# The file -----------------------------------------------------------------------------------------

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
    if _number(limit, "effort") < 0.0:
        yield "unused", "the sign of effort in <limit> is not used", values["effort"]
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
