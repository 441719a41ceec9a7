"""Files and YAML texts, both untrusted, as plain values with their places.

Only plain YAML values are built. The size of a file, its depth and the number of its values (aliases
counted as often as they are used) are bounded.
"""

import json
import math
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Self

import yaml

from rmrc.support.errors import Key, Origin, Problem, ScenarioError, did_you_mean
from rmrc.support.shipped import suggestion
from rmrc.support.text import shortened, visible

_TAG = "tag:yaml.org,2002:"
# Decimal numbers. An exponent needs no point, as in `1e-5`. To YAML 1.1, `010` would be 8 and `1:20` 80.
_NUMBERS = {
    "int": re.compile(r"[-+]?(0|[1-9]\d*)$"),
    "float": re.compile(
        r"[-+]?((\d+\.\d*|\.\d+)([eE][-+]?\d+)?|\d+[eE][-+]?\d+|\.(inf|Inf|INF))$|\.(nan|NaN|NAN)$"
    ),
}


class _Loader(yaml.SafeLoader):
    """A safe loader of decimal numbers."""


class _Dumper(yaml.SafeDumper):
    """A safe dumper that quotes texts which that loader would take for numbers."""


for part in (_Loader, _Dumper):
    part.yaml_implicit_resolvers = {
        first: [pair for pair in pairs if pair[0].removeprefix(_TAG) not in _NUMBERS]
        for first, pairs in part.yaml_implicit_resolvers.items()
    }
    for kind, numbers in _NUMBERS.items():
        part.add_implicit_resolver(_TAG + kind, numbers, [*"-+.0123456789"])

# Words for values ---------------------------------------------------------------------------------
#
# Show values, foreign texts and similar names in messages: on one line, printable and short.


def show(value: object) -> str:
    """Return a value as YAML would write it on one line."""
    if value is None:
        return "nothing"
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    try:
        return brief(json.dumps(value, ensure_ascii=False, default=repr))
    except ValueError:  # Python writes 4300 digits at most
        return "a huge integer"


def inline(value: object) -> str:
    """Return a value as YAML on one line, which is read back to an equal value."""
    text = _dumped(value, default_flow_style=True, width=math.inf)
    return text.strip().removesuffix("...").strip()


def block(value: object, width: int = 100) -> str:
    """Return a value as readable YAML: one line per key, with the innermost values on one line."""
    return _dumped(value, default_flow_style=None, width=width)


def _dumped(value: object, **layout: Any) -> str:
    return str(yaml.dump(value, Dumper=_Dumper, allow_unicode=True, sort_keys=False, **layout))


def brief(text: str) -> str:
    """Return a printable text of about 80 characters at most, which says how many it has if it is longer."""
    return shortened(visible(text))


def nearby(path: Path, *suffixes: str) -> str:
    """Suggest a file beside one that does not exist."""
    try:
        names = sorted(entry.name for entry in path.parent.iterdir() if entry.suffix in suffixes)
    except (OSError, ValueError):  # a NUL
        return ""
    return did_you_mean(path.name, names)


# Reading of files ---------------------------------------------------------------------------------

# A scenario is a page of text. The bounds are far above that, and keep hostile texts to seconds.
_MAX_BYTES = 2**18
_MAX_VALUES = 10_000
_MAX_DEPTH = 50

_SCALARS = ("!!str", "!!timestamp", "!!null", "!!bool", "!!int", "!!float")

# YAML's reasons, whether the mistake is where the value starts, and the mistake in words.
_MISTAKES = (
    ("mapping values are not", False, "a key that is indented too far, or below a line "
        "without its colon, or a value with a colon that is not in quotes"),
    ("could not find expected ':'", True, "a key without a colon; write KEY: VALUE"),
    (r"'\\t'", False, "a tab; indent with spaces"),
    ("found '<block|found '[-?]'", False, "not indented as the lines beside it, or a dash "
        "without a space"),
    ("found '[]}]'", False, "a bracket that was not opened"),
    ("flow", True, "a bracket that is not closed, or a comma too few or too many in it"),
    ("end of stream", True, "a quote that is not closed"),
    ("cannot start any token", False, "a text that begins with this character must be in quotes"),
    ("another document", False, "a second scenario after ---; give it a file of its own"),
)  # fmt: skip


class Place(NamedTuple):
    """Where a value starts, and its key; an item of a list has none of its own."""

    value: Origin
    key: Origin


@dataclass(frozen=True)
class Document:
    """Plain values and where they were given.

    Attributes:
        value: All of them.
        source: Their file; "" without one.
        places: Those of the values in the file, by key.
        changes: Values that were given elsewhere, by key and origin, later ones on top.
        folder: Where relative paths start.
        root: Below it are all files, by their absolute paths; None: they are where they are.
    """

    value: Any = field(default_factory=dict)
    source: str = ""
    places: Mapping[Key, Place] = field(default_factory=dict)
    changes: tuple[tuple[Key, Origin], ...] = ()
    folder: Path = Path()
    root: Path | None = None

    @classmethod
    def read(cls, source: str, text: str | None = None) -> Self:
        """Return the values of a YAML text, which is a mapping.

        Args:
            source: Its file, or its name in messages.
            text: The text, whose relative paths start at the working directory; None: that of the file.

        Raises:
            ScenarioError: It cannot be read, or is not a mapping.
        """
        value, places = parse(_read(source) if text is None else text, source)
        if not isinstance(value, dict):
            place = places[()].value
            raise ScenarioError([Problem((), f"must be a mapping, got {show(value)}", place)])
        folder = Path() if text else Path(source).parent
        return cls(value, source, places, folder=folder.resolve())

    def origin(self, key: Key) -> Origin:
        """Return where a value was given, or else a part of it, or else its nearest parent."""
        return next(filter(None, self._origins(key)), Origin(self.source))

    def _origins(self, key: Key) -> Iterator[Origin | None]:
        yield self._exact(key)
        yield from (origin for part, origin in self.changes if part[: len(key)] == key)
        yield from (self._exact(key[:depth]) for depth in reversed(range(len(key))))

    def _exact(self, key: Key) -> Origin | None:
        above = (origin for part, origin in reversed(self.changes) if key[: len(part)] == part)
        return next(above, self.places[key].value if key in self.places else None)

    def problem(self, key: Key, text: str) -> Problem:
        """Return the problem of a value."""
        return Problem(key, text, self.origin(key))


@lru_cache(1024)
def split(text: str) -> Key:
    """Return the steps of a key.

    Raises:
        ValueError: If the text is no key.
    """
    part = r"[^.\[\]=\s]+(\[[0-9]{1,6}\])*"
    if not re.fullmatch(rf"{part}(\.{part})*", text):
        raise ValueError(f"{text!r} is not a key such as control.feedback or arm.start[1]")
    return tuple(int(i) if i else name for i, name in re.findall(r"\[([0-9]+)\]|([^.\[\]]+)", text))


def parse(text: str, source: str = "", key: Key = ()) -> tuple[Any, dict[Key, Place]]:
    """Return the value of one YAML document, and its places; `key` is where it will stand.

    Raises:
        ScenarioError: The text cannot be used.
    """
    builder = _Builder(*_composed(text, source), source)
    return builder.value(builder.root, key), builder.places


def _error(text: str, source: str, mark: yaml.Mark | None = None, key: Key = ()) -> ScenarioError:
    return ScenarioError([Problem(key, text, _origin(source, mark))])


def _origin(source: str, mark: yaml.Mark | None) -> Origin:
    return Origin(source, mark.line + 1, mark.column + 1) if mark else Origin(source)


def _read(source: str) -> str:
    """Return the text of a file; refuse anything but a small text file without reading it."""
    if os.path.exists(source):
        if not os.path.isfile(source):  # reading a pipe or a device could wait forever
            raise _error("is not a regular file", source)
        _check_size(os.path.getsize(source), source)
    try:
        with open(source, "rb") as file:
            return file.read(_MAX_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        path = Path(source)
        near = nearby(path, ".yaml", ".yml") or suggestion(path, "scenarios")
        raise _error(f"no such file{near}", source) from None
    except UnicodeDecodeError as error:
        raise _error(f"is not UTF-8 text: byte 0x{error.object[error.start]:02x}", source) from None
    except (OSError, ValueError) as error:  # a NUL in the path is a ValueError
        reason = getattr(error, "strerror", None) or str(error)
        raise _error(f"cannot be read: {reason.lower()}", source) from None


def _check_size(size: int, source: str) -> None:
    if size > _MAX_BYTES:
        raise _error(f"is {size / 2**10:,.0f} KiB, more than the 256 KiB a scenario may have", source)


def _composed(text: str, source: str) -> tuple[yaml.SafeLoader, yaml.Node]:
    """Return the nodes of a text after their loader."""
    _check_size(len(text.encode(errors="surrogatepass")), source)
    try:
        loader = _Loader(text)
        root = loader.get_single_node()
    except yaml.reader.ReaderError as error:
        *above, line = text[: error.position].split("\n")
        what = f"is not a text file: it holds the character U+{error.character:04X}"
        raise ScenarioError([Problem((), what, Origin(source, len(above) + 1, len(line) + 1))]) from None
    except yaml.MarkedYAMLError as error:
        reason = ", ".join(filter(None, (error.context, error.problem)))
        starts, way = next((rule[1:] for rule in _MISTAKES if re.search(rule[0], reason)), (False, reason))
        mark = error.context_mark if starts else error.problem_mark
        raise _error(f"is not valid YAML: {way}", source, mark or error.context_mark) from None
    except RecursionError:
        raise _error(f"is nested more than {_MAX_DEPTH} deep", source) from None
    if root is None:
        raise _error("is empty", source)
    return loader, root


class _Builder:
    """Nodes to plain values and their places.

    Aliases are built anew wherever they are used, so that a change affects one place only.
    """

    def __init__(self, loader: yaml.SafeLoader, root: yaml.Node, source: str) -> None:
        self.loader, self.root, self.source, self.count = loader, root, source, 0
        self.places: dict[Key, Place] = {}

    def value(self, node: yaml.Node, key: Key, name: yaml.Node | None = None) -> Any:
        self.count += 1
        if len(key) > _MAX_DEPTH:
            raise _error(f"is nested more than {_MAX_DEPTH} deep", self.source, node.start_mark)
        if self.count > _MAX_VALUES:
            raise _error(f"has more than {_MAX_VALUES} values, aliases counted each time", self.source)
        starts = (_origin(self.source, part.start_mark) for part in (node, name or node))
        self.places[key] = Place(*starts)
        if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
            return self._mapping(node, key)
        if isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
            return [self.value(item, (*key, i)) for i, item in enumerate(node.value)]
        return self._scalar(node, key)

    def _mapping(self, node: yaml.Node, key: Key) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for name_node, inner in node.value:
            place = name_node.start_mark
            if name_node.tag != _TAG + "str":  # with << as well, which merges mappings
                raise _error(f"a key must be text, got {_written(name_node)}", self.source, place, key)
            name = self._scalar(name_node, key)
            full = (*key, name)
            if name in values:
                text = f"is given twice, first in line {self.places[full].key.line}"
                raise _error(text, self.source, place, full)
            values[name] = self.value(inner, full, name_node)
        return values

    def _scalar(self, node: yaml.Node, key: Key) -> Any:
        """Return a number, a text, a switch or null; a date is text, as in YAML 1.2."""
        tag = node.tag.replace(_TAG, "!!")
        try:
            if not isinstance(node, yaml.ScalarNode) or tag not in _SCALARS:
                raise ValueError
            if tag in ("!!str", "!!timestamp"):
                node.value.encode()  # half of a surrogate pair is no text: nothing could print or store it
                return node.value
            return self.loader.construct_object(node)
        except (TypeError, ValueError, KeyError, ArithmeticError):
            text = f"cannot be read as {brief(tag)}, got {_written(node)}"
            raise _error(text, self.source, node.start_mark, key) from None


def _written(node: yaml.Node) -> str:
    """Return a scalar as written in the file, or the kind of another node."""
    if isinstance(node, yaml.ScalarNode):
        return brief(node.value) or "nothing"
    return "a mapping" if isinstance(node, yaml.MappingNode) else "a list"
