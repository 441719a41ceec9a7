"""Files and YAML texts, both untrusted, as plain values with their places.

Only plain YAML values are built. The size of a file, its depth and the number of its values (aliases
counted as often as they are used) are bounded.
"""

import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from rmrc.scenario.keys import Place, SourceMap
from rmrc.scenario.wording import brief, nearby
from rmrc.support.problems import Key, Origin, Problem
from rmrc.support.shipped import suggestion

# A scenario is a page of text. The bounds are far above that, and keep hostile texts to seconds.
_MAX_BYTES = 2**18
_MAX_VALUES = 10_000
_MAX_DEPTH = 50

_TAG = "tag:yaml.org,2002:"
_SCALARS = ("str", "timestamp", "null", "bool", "int", "float")


class TextError(Exception):
    """A text that cannot be used: why, and where in it."""

    def __init__(self, problem: str, line: int = 0, column: int = 0, key: Key = ()) -> None:
        """Keep the problem, its line and column, counted from 1, and the key of the value there."""
        super().__init__(problem)
        self.line, self.column, self.key = line, column, key

    def problem(self, source: str) -> Problem:
        """Return the problem of a file."""
        return Problem(self.key, str(self), Origin(source, self.line, self.column))


@dataclass
class Document:
    """Plain values and their origins.

    Attributes:
        value: All of them.
        sources: The origin of each.
    """

    value: Any
    sources: SourceMap


def read(source: str) -> str:
    """Return the text of a file; refuse anything but a small text file without reading it.

    Raises:
        TextError: It cannot be read.
    """
    try:
        status = os.stat(source)
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
        raise TextError(f"is not UTF-8 text: byte 0x{error.object[error.start]:02x}") from None
    except (OSError, ValueError) as error:  # a NUL in the path is a ValueError
        reason = getattr(error, "strerror", None) or str(error)
        raise TextError(f"cannot be read: {reason.lower()}") from None


def _check_size(size: int) -> None:
    if size > _MAX_BYTES:
        raise TextError(f"is {size / 2**10:,.0f} KiB, more than the 256 KiB a scenario may have")


def parse(text: str, source: str = "", key: Key = ()) -> Document:
    """Parse one YAML document; `key` is where its value will stand.

    Raises:
        TextError: The text cannot be used.
    """
    builder = _Builder(*_composed(text), source)
    return Document(builder.value(builder.root, key), SourceMap(source, builder.places))


def items(text: str) -> list[tuple[str, str]]:
    """Return the values of a YAML list without its brackets, each as it is read and as it is written.

    A quoted text is read without quotes, `damped` for `"damped"`; any other value stays as written.

    Raises:
        TextError: If the text is no such list.
    """
    listed = f"[{text}\n]"  # a comment must not hide the bracket
    pairs = []
    for node in _composed(listed)[1].value:
        written = listed[node.start_mark.index : node.end_mark.index]
        pairs.append((node.value if node.tag == _TAG + "str" else written, written))
    return pairs


def _composed(text: str) -> tuple[yaml.SafeLoader, yaml.Node]:
    """Return the nodes of a text after their loader."""
    _check_size(len(text.encode(errors="surrogatepass")))
    try:
        loader = yaml.SafeLoader(text)
        root = loader.get_single_node()
    except yaml.reader.ReaderError as error:
        *above, line = text[: error.position].split("\n")
        what = f"is not a text file: it holds the character U+{ord(text[error.position]):04X}"
        raise TextError(what, len(above) + 1, len(line) + 1) from None
    except yaml.MarkedYAMLError as error:
        problem = f"is not valid YAML: {', '.join(filter(None, (error.context, error.problem)))}"
        raise TextError(problem, *_at(error.problem_mark or error.context_mark)) from None
    except RecursionError:
        raise TextError(f"is nested more than {_MAX_DEPTH} deep") from None
    if root is None:
        raise TextError("is empty")
    return loader, root


def _at(mark: yaml.Mark | None) -> tuple[int, int]:
    return (mark.line + 1, mark.column + 1) if mark else (1, 1)


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
            raise TextError(f"is nested more than {_MAX_DEPTH} deep", *_at(node.start_mark))
        if self.count > _MAX_VALUES:
            raise TextError(f"has more than {_MAX_VALUES} values, aliases counted each time")
        starts = (Origin(self.source, *_at(part.start_mark)) for part in (node, name or node))
        self.places[key] = Place(*starts)
        if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
            return self._mapping(node, key)
        if isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
            return [self.value(item, (*key, i)) for i, item in enumerate(node.value)]
        return self._scalar(node, key)

    def _mapping(self, node: yaml.MappingNode, key: Key) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for name_node, inner in node.value:
            place = _at(name_node.start_mark)
            if name_node.tag != _TAG + "str":  # with << as well, which merges mappings
                raise TextError(f"a key must be text, got {_written(name_node)}", *place, key)
            name = self._scalar(name_node, key)
            full = (*key, name)
            if name in values:
                raise TextError(f"is given twice, first in line {self.places[full].key.line}", *place, full)
            values[name] = self.value(inner, full, name_node)
        return values

    def _scalar(self, node: yaml.Node, key: Key) -> Any:
        kind = node.tag.removeprefix(_TAG)
        try:
            if not isinstance(node, yaml.ScalarNode) or kind not in _SCALARS:
                raise TypeError
            if kind in ("str", "timestamp"):  # dates mean nothing here: text, as in YAML 1.2
                node.value.encode()  # half of a surrogate pair is no text: nothing could print or store it
                return node.value
            return self.loader.construct_object(node)
        except (TypeError, ValueError, KeyError, ArithmeticError):
            tag = brief(node.tag.replace(_TAG, "!!"))
            raise TextError(
                f"cannot be read as {tag}, got {_written(node)}", *_at(node.start_mark), key
            ) from None


def _written(node: yaml.Node) -> str:
    """Return a scalar as written in the file, or the kind of another node."""
    if isinstance(node, yaml.ScalarNode):
        return brief(node.value) or "nothing"
    return "a mapping" if isinstance(node, yaml.MappingNode) else "a list"
