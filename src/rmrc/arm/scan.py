"""What an XML file asks of MuJoCo is checked before MuJoCo reads it: nothing can interrupt its reading.

One line can ask for a million bodies, which takes MuJoCo hours, and a NaN compiles without an error.
"""

import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from xml.parsers import expat

from rmrc.support.errors import ModelError
from rmrc.support.text import shortened, visible

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
