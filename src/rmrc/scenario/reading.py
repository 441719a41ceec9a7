"""Files and YAML texts, both untrusted, as plain values with their places.

Only plain YAML values are built. The size of a file, its depth and the number of its values (aliases
counted as often as they are used) are bounded.
"""

import os
import re
import stat
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from rmrc.scenario.keys import Place, SourceMap
from rmrc.scenario.wording import brief, nearby, show
from rmrc.support.legible import visible
from rmrc.support.problems import Key, Origin, Problem
from rmrc.support.shipped import suggestion

# A scenario is a page of text. The bounds are far above that and far below the size that takes a second.
_MAX_BYTES = 2**20
_MAX_VALUES = 10_000
_MAX_DEPTH = 50

_MERGE = "tag:yaml.org,2002:merge"
_Mapping = tuple[dict[str, Any], dict[str | int, Place]]  # the values and their places


class TextError(Exception):
    """A text that cannot be used at all: why, and where in it."""

    def __init__(self, problem: str, mark: tuple[int, int] = (0, 0)) -> None:
        """Keep the problem, and the line and column where it is."""
        super().__init__(problem)
        self.mark = mark


@dataclass
class Document:
    """Plain values, their origins, and their problems so far.

    Attributes:
        value: All of them.
        sources: The origin of each.
        problems: In the order in which they were found.
        hidden: Keys without a valid value: further problems at one of them only follow from that.
    """

    value: Any
    sources: SourceMap
    problems: list[Problem] = field(default_factory=list)
    hidden: frozenset[Key] = frozenset()


def read(source: str) -> str:
    """Return the text of a file; refuse anything but a small text file without reading it."""
    if "\0" in source:
        raise TextError("cannot be read: a path must not hold a NUL")
    try:
        status = os.stat(source)
        if stat.S_ISDIR(status.st_mode):
            raise TextError("is a directory, not a YAML file")
        if not stat.S_ISREG(status.st_mode):  # reading a pipe or a device could wait forever
            raise TextError("is not a regular file")
        _check_size(status.st_size)
        with open(source, "rb") as file:
            return file.read(_MAX_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        path = Path(source)
        near = nearby(path, ".yaml", ".yml") or suggestion(path, "scenarios")
        raise TextError(f"no such file{near}") from None
    except UnicodeDecodeError as error:
        where = f"byte 0x{error.object[error.start]:02x} at offset {error.start}"
        raise TextError(f"is not UTF-8 text: {where}") from None
    except OSError as error:
        raise TextError(f"cannot be read: {(error.strerror or str(error)).lower()}") from None


def _check_size(size: int) -> None:
    if size > _MAX_BYTES:
        raise TextError(f"is {size / 1e6:.1f} MB, more than the 1 MiB a scenario may have")


def parse(text: str, source: str = "", key: Key = ()) -> Document:
    """Parse one YAML document; `key` is where its value will stand.

    The document keeps problems of single values.

    Raises:
        TextError: If the text as a whole cannot be used.
    """
    _check_size(len(text.encode(errors="surrogatepass")))
    try:
        loader = _Loader(text)
        root = loader.get_single_node()
        if root is None:
            raise TextError("is empty")
        builder = _Builder(loader, source)
        value, place = builder.build(root, key)
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        mark = before.count("\n") + 1, error.position - before.rfind("\n")
        what = f"it holds the character U+{ord(text[error.position]):04X}"
        raise TextError(f"is not a text file: {what}", mark) from None
    except yaml.MarkedYAMLError as error:
        raise TextError(_problem(error), _at(error.problem_mark or error.context_mark)) from None
    return Document(value, SourceMap(source, place), builder.problems, frozenset(builder.hidden))


def items(text: str) -> list[tuple[str, str]]:
    """Return the values of a YAML list without its brackets, each as it is read and as it is written.

    A quoted text is read without quotes, `damped` for `"damped"`; any other value stays as written.

    Raises:
        TextError: If the text is no such list.
    """
    _check_size(len(text.encode(errors="surrogatepass")))
    listed = f"[{text}\n]"  # a comment must not hide the bracket
    try:
        root = _Loader(listed).get_single_node()
    except yaml.reader.ReaderError as error:
        raise TextError(f"holds the character U+{ord(listed[error.position]):04X}") from None
    except yaml.MarkedYAMLError as error:
        raise TextError(_problem(error)) from None
    nodes = root.value if root else []  # the node of the brackets, so there is a root
    written = [listed[item.start_mark.index : item.end_mark.index] for item in nodes]
    return [(item.value if _is_text(item) else own, own) for item, own in zip(nodes, written, strict=True)]


def _problem(error: yaml.MarkedYAMLError) -> str:
    problem = visible(error.problem or error.context or "")
    if "but found another document" in problem:
        return "holds more than one YAML document"
    if r"character '\t'" in problem:
        return "is not valid YAML: a tab cannot stand here, use spaces"
    return f"is not valid YAML: {problem}"


def _at(mark: yaml.Mark | None) -> tuple[int, int]:
    return (mark.line + 1, mark.column + 1) if mark else (1, 1)


class _Loader(yaml.SafeLoader):
    """The safe loader, bounded while it composes nodes."""

    depth = 0
    count = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        self.depth += 1
        self.count += 1
        event = self.peek_event()  # type: ignore[no-untyped-call]
        _check_bounds(self.depth, self.count, event.start_mark)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def _check_bounds(depth: int, count: int, mark: yaml.Mark | None) -> None:
    # Both guard against files that are small but grow: brackets, aliases of aliases.
    if depth > _MAX_DEPTH:
        raise TextError(f"is nested more than {_MAX_DEPTH} deep", _at(mark))
    if count > _MAX_VALUES:
        text = f"has more than {_MAX_VALUES} values, aliases counted as often as they are used"
        raise TextError(text, _at(mark))


class _Builder:
    """Nodes to plain values and their places.

    Aliases are built anew wherever they are used, so that a change affects one place only.
    """

    def __init__(self, loader: _Loader, source: str) -> None:
        self.loader, self.source = loader, source
        self.problems: list[Problem] = []
        self.hidden: set[Key] = set()
        self.count = 0

    def origin(self, node: yaml.Node) -> Origin:
        return Origin(self.source, *_at(node.start_mark))

    def add(self, key: Key, text: str, node: yaml.Node) -> None:
        self.problems.append(Problem(key, text, self.origin(node)))

    def build(self, node: yaml.Node, key: Key, depth: int = 1) -> tuple[Any, Place]:
        self.count += 1
        _check_bounds(depth, self.count, node.start_mark)
        place = Place(self.origin(node))
        if isinstance(node, yaml.MappingNode) and node.tag == "tag:yaml.org,2002:map":
            value, place.below = self._mapping(node, key, depth)
            return value, place
        if isinstance(node, yaml.SequenceNode) and node.tag == "tag:yaml.org,2002:seq":
            items = [self.build(item, (*key, i), depth + 1) for i, item in enumerate(node.value)]
            place.below = {i: below for i, (_, below) in enumerate(items)}
            return [item for item, _ in items], place
        return self._scalar(node, key), place

    def _mapping(self, node: yaml.MappingNode, key: Key, depth: int) -> _Mapping:
        values: dict[str, Any] = {}
        places: dict[str | int, Place] = {}
        lines: dict[str, int] = {}
        # Merged keys first: an own key then replaces both the value and its place.
        for name, inner in sorted(node.value, key=lambda pair: pair[0].tag != _MERGE):
            if name.tag == _MERGE:
                merged, below = self._merged(inner, key, depth)
                values, places = merged | values, below | places
                continue
            if not _is_text(name):
                self.add(key, f"a key must be text, got {_written(name)}", name)
                continue
            full = (*key, name.value)
            if name.value in lines:
                self.add(full, f"is given twice, first in line {lines[name.value]}", name)
            lines.setdefault(name.value, self.origin(name).line)
            values[name.value], place = self.build(inner, full, depth + 1)
            places[name.value] = Place(place.origin, place.below, self.origin(name))
        return values, places

    def _merged(self, node: yaml.Node, key: Key, depth: int) -> _Mapping:
        """Return the keys that `<<` takes from one mapping or from several, the first of which wins."""
        values: dict[str, Any] = {}
        places: dict[str | int, Place] = {}
        for source in reversed(node.value if isinstance(node, yaml.SequenceNode) else [node]):
            value, place = self.build(source, key, depth + 1)
            if isinstance(value, dict):
                values |= value
                places |= place.below
            else:
                self.add(key, f"<< must name a mapping, got {show(value)}", source)
        return values, places

    def _scalar(self, node: yaml.Node, key: Key) -> Any:
        kind = node.tag.removeprefix("tag:yaml.org,2002:")
        try:
            if isinstance(node, yaml.ScalarNode):
                if kind in ("str", "timestamp"):  # dates mean nothing here: text, as in YAML 1.2
                    node.value.encode()  # a lone surrogate is no text
                    return node.value
                if kind in ("null", "bool", "int", "float"):
                    return self.loader.construct_object(node)
            text = f"the tag {brief(node.tag if kind == node.tag else f'!!{kind}')} is not supported"
        except (ValueError, KeyError, ArithmeticError):
            text = f"cannot be read as !!{kind}, got {_written(node)}"
        self.add(key, text, node)
        self.hidden.add(key)
        return None


def _is_text(node: yaml.Node) -> bool:
    # A lone surrogate ("\ud800") is no text: nothing could print or store it.
    plain = isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:str"
    return plain and not re.search("[\ud800-\udfff]", node.value)


def _written(node: yaml.Node) -> str:
    """Return a scalar as written in the file, or the kind of another node."""
    if isinstance(node, yaml.ScalarNode):
        return brief(node.value) or "nothing"
    return "a mapping" if isinstance(node, yaml.MappingNode) else "a list"
