"""The text of a model is checked before MuJoCo reads it, because nothing can interrupt MuJoCo's reading.

One line can ask for a million bodies, for which MuJoCo would take hours, and a NaN compiles without an error.
"""

import math
import re
from collections.abc import Iterator, Mapping
from html import unescape
from pathlib import Path
from typing import NamedTuple

from rmrc.scenario.wording import brief
from rmrc.support.errors import ModelError

# The largest XML of those models has 1 MB, 300 geoms and 130 joints. MuJoCo's time is quadratic: these
# numbers take it some seconds.
_MOST_BYTES, _MOST_ELEMENTS, _MOST_JOINTS = 50_000_000, 10_000, 3_000
# Elements with grids or counts: the attributes whose product is the count, and the largest total.
_GRIDS = {
    "flexcomp": (("count",), 30_000),
    "texture": (("width", "height"), 2**26),
    "hfield": (("nrow", "ncol"), 2**24),
    "size": (("nkey",), 10_000),
}
_TAG = re.compile(r"""<(/?)([\w:.\-]+)((?:[^<>"']|"[^"]*"|'[^']*')*+)>""")
_ATTRIBUTE = re.compile(r"""([\w:.\-]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_INFINITE = re.compile(r"[+-]?(nan(\(\w*\))?|inf(inity)?)", re.IGNORECASE)
_ENDS = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>", "<!": ">"}
# The values of these attributes are words, even if they look like numbers.
_WORDS = frozenset({
    "actuator", "body", "body1", "body2", "childclass", "class", "cranksite", "file", "geom", "geom1",
    "geom2", "hfield", "joint", "joint1", "joint2", "jointinparent", "material", "mesh", "model", "name",
    "objname", "prefix", "refname", "refsite", "site", "site1", "site2", "slidersite", "target", "tendon",
    "tendon1", "tendon2", "texture",
})  # fmt: skip


class Tag(NamedTuple):
    """A tag of a file.

    Attributes:
        closes: Whether it closes an element.
        name: Name of the element.
        attributes: Their texts by name.
        line: Line in the file.
        is_alone: Whether the element ends where it begins.
        span: Its start and end in the text.
    """

    closes: bool
    name: str
    attributes: Mapping[str, str]
    line: int
    is_alone: bool
    span: tuple[int, int]


def check_file(path: Path) -> None:
    """Check an MJCF file and those that it includes, as far as they can be read; MuJoCo reports the rest.

    Raises:
        ModelError: It is too large, has too many elements, or a number of it is NaN or infinite.
        OSError: It cannot be read.
    """
    _Scan(path).read(path, 1)


class _Scan:
    """Elements of a model, counted as often as they are repeated."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._elements = self._joints = 0
        self._attached = (0, 0)  # elements and joints of the models that may be attached
        self._sizes: dict[str, int] = {}
        self._read: set[Path] = set()
        self._open: list[Path] = []  # each names the next

    def read(self, path: Path, times: int) -> None:
        """Count the elements of one file.

        Args:
            path: Its path.
            times: Number of repetitions of its elements.
        """
        if not path.is_file() or path.resolve() in self._read:  # MuJoCo refuses it
            return
        self._read.add(path.resolve())
        size = path.stat().st_size
        if size > _MOST_BYTES:
            raise ModelError(f"{path}: must have {_MOST_BYTES / 1e6:g} MB at most, got {size / 1e6:.6g} MB")
        self._open.append(path.resolve())
        inside: list[tuple[Tag, int]] = []  # open elements, and the factor of repetition within them
        for tag in tags(path.read_text("utf-8", "surrogateescape")):
            if tag.closes:
                if inside and inside[-1][0].name == tag.name:
                    times //= inside.pop()[1]
                continue
            place = f"{path}:{tag.line}"
            self._measure(place, tag)
            _check_finite(place, tag, inside[-1][0] if inside else None)
            _check_class(place, tag)
            self._count(place, tag, times)
            if "file" in tag.attributes and tag.name in ("include", "model"):
                self._follow(path, tag, times)
            if not tag.is_alone:
                factor = _whole(tag.attributes.get("count", "")) if tag.name == "replicate" else 1
                inside.append((tag, factor))
                times *= factor
        self._open.pop()

    def _follow(self, path: Path, tag: Tag, times: int) -> None:
        """Count the elements of a file that another one names."""
        before = self._elements, self._joints
        for folder in dict.fromkeys((self._path.parent, path.parent)):
            named = folder / tag.attributes["file"]
            if tag.name == "model" and named.resolve() in self._open:  # MuJoCo would read it endlessly
                what = f'model must name another file than itself, got "{brief(tag.attributes["file"])}"'
                raise ModelError(f"{path}:{tag.line}: {what}")
            self.read(named, times)
        if tag.name == "model":
            elements, joints = self._elements - before[0], self._joints - before[1]
            self._attached = max(self._attached[0], elements), max(self._attached[1], joints)

    def _measure(self, place: str, tag: Tag) -> None:
        words, most = _GRIDS.get(tag.name, ((), 0))
        if not any(word in tag.attributes for word in words):
            return
        number = math.prod(_whole(part) for word in words for part in tag.attributes.get(word, "").split())
        self._sizes[tag.name] = self._sizes.get(tag.name, 0) + number
        if self._sizes[tag.name] > most:
            sizes = " ".join(f'{word}="{tag.attributes[word]}"' for word in words if word in tag.attributes)
            what = f"must be {most} at most in all, got {self._sizes[tag.name]}"
            raise ModelError(f"{place}: {tag.name} {brief(sizes)} {what}")

    def _count(self, place: str, tag: Tag, times: int) -> None:
        attached = self._attached if tag.name == "attach" else (0, 0)
        self._elements += times * (1 + attached[0])
        self._joints += times * ((tag.name in ("joint", "freejoint")) + attached[1])
        for what, number, most in (
            ("elements", self._elements, _MOST_ELEMENTS),
            ("joints", self._joints, _MOST_JOINTS),
        ):
            if number > most:
                raise ModelError(
                    f"{place}: a model must have {most} {what} at most, counting each copy of a replicate, "
                    f"got {number} by here; remove parts outside the arm"
                )


def tags(text: str) -> Iterator[Tag]:
    """Iterate over the tags of an XML text, until invalid text, at which MuJoCo stops too."""
    at, line, counted = text.find("<"), 1, 0
    while at >= 0:
        line, counted = line + text.count("\n", counted, at), at
        end = next((end for start, end in _ENDS.items() if text.startswith(start, at)), None)
        if end is not None:
            after = text.find(end, at)
            at = text.find("<", after) if after >= 0 else -1
            continue
        found = _TAG.match(text, at)
        if found is None:
            return
        closes, name, rest = found.groups()
        attributes = {key: unescape(a or b) for key, a, b in _ATTRIBUTE.findall(rest)}
        yield Tag(bool(closes), name, attributes, line, rest.rstrip().endswith("/"), found.span())
        at = text.find("<", found.end())


def _check_finite(place: str, tag: Tag, parent: Tag | None) -> None:
    for key, value in tag.attributes.items():
        if key in _WORDS or tag.name == "text" or "n" not in value.lower():
            continue
        parts = value.split()
        if any(map(_INFINITE.fullmatch, parts)) and all(map(_is_number, parts)):
            in_named = parent is not None and "name" in parent.attributes and "name" not in tag.attributes
            of = f" of {_called(parent)}" if in_named and parent else ""
            what = f'{key} must be finite, got "{brief(value)}"'
            raise ModelError(f"{place}: {_called(tag)}{of}: {what}; omit it for no limit")


def _check_class(place: str, tag: Tag) -> None:
    """Refuse a class that MuJoCo would use as a C format if undefined: `%n` ends its process."""
    name = tag.attributes.get("class", "")
    if "%" in name:
        raise ModelError(
            f'{place}: {_called(tag)}: class must not have a "%", got "{brief(name)}"; rename it'
        )


def _called(tag: Tag) -> str:
    name = tag.attributes.get("name")
    return f'{tag.name} "{brief(name)}"' if name else tag.name


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return _INFINITE.fullmatch(text) is not None
    return True


def _whole(text: str) -> int:
    """Return a positive whole number, or 1 for any other text."""
    found = re.match(r"\s*\+?(\d{1,18})", text)
    return max(1, int(found[1])) if found else 1
