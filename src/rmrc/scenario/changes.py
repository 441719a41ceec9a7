"""Changes of a scenario: a value for a key, and the texts of the command line for them."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from rmrc.scenario.reading import Document, TextError, parse
from rmrc.scenario.sections import listed_default, parse_key
from rmrc.scenario.values import Section
from rmrc.scenario.wording import brief, inline, show
from rmrc.support.problems import Key, Origin, Problem, join


class Change(NamedTuple):
    """A replacement of a value.

    Attributes:
        key: Key of the value.
        value: The value as in a file: a number, a text, a switch, null, or a list or mapping of these.
        origin: The place where it was given; None: in Python.
        written: The value as it was written; "" if it was not.
    """

    key: Key
    value: Any
    origin: Origin | None = None
    written: str = ""

    def __str__(self) -> str:
        """Return the change as `KEY=VALUE`, which the command line takes."""
        return f"{join(self.key)}={self.written or inline(self.value)}"


class Variant(NamedTuple):
    """One of several scenarios.

    Attributes:
        label: Its name: `damped`, `maximum=0.05`, or `damped, 0.1` for several keys.
        changes: The changes that make it; later ones win.
    """

    label: str
    changes: tuple[Change, ...] = ()


@dataclass(frozen=True)
class Unread:
    """A placeholder for the value of a text that could not be read completely.

    Attributes:
        value: The part that could be read, if any.
        problems: The problems of the text.
        is_nothing: Whether there is no value at all.
    """

    value: Any
    problems: tuple[Problem, ...]
    is_nothing: bool = False


def changes_of(values: Mapping[str, object], option: str = "") -> tuple[Change, ...]:
    """Return changes made in Python.

    Args:
        values: By dotted key, such as `control.feedback` or `arm.start[1]`.
        option: Command-line option behind the problems, which messages then name with the key.

    Raises:
        ValueError: A key is not valid.
    """
    return tuple(
        Change(parse_key(name), _plain(value), Origin(f"{option} {name}", key=name) if option else None)
        for name, value in values.items()
    )


def _plain(value: Any) -> Any:
    """Return a value as a file would have it: lists for tuples and arrays, Python's numbers for numpy's."""
    if isinstance(value, Mapping):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, Section):
        return value.model_dump(mode="json")
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def read_change(key: Key, text: str, origin: Origin) -> Change:
    """Return the change of a key by a text; the function that applies it reports problems of the text.

    Args:
        key: The key to change.
        text: The value as YAML; an empty text means null.
        origin: The place where it was given.
    """
    try:
        inner = parse(text if text.strip() else "null", key=key)
    except TextError as error:
        unread = Unread(None, (Problem(error.key or key, str(error), origin),), is_nothing=True)
        return Change(key, unread, origin, text)
    return Change(key, inner.value, origin, text)


def read_setting(text: str) -> Change:
    """Return the change for a text `KEY=VALUE`; a change from any other text cannot be applied.

    Args:
        text: Such as `control.inverse.method=inverse` or `arm.start[1]=10 deg`; VALUE is YAML.
    """
    name, equals, value = text.partition("=")
    try:
        key = parse_key(name.strip() if equals else "")
    except ValueError:
        wrong = "must be KEY=VALUE, for example control.feedback=10"
        problem = Problem((), wrong, Origin(f"--set {brief(text)}"))
        return Change((), Unread(None, (problem,), is_nothing=True))
    return read_change(key, value, Origin(f"--set {join(key)}", key=join(key)))


def applied(document: Document, change: Change) -> Document:
    """Return a document with one change; problems of the change are added to the document's.

    The parts beside the way to the value are shared with the given document, which stays as it is.
    """
    key, origin, value = change.key, change.origin or Origin(), change.value
    unread = value if isinstance(value, Unread) else Unread(value, ())
    found = replace(document, problems=[*document.problems, *unread.problems])
    if unread.is_nothing:
        return found
    try:
        found.value = put(document.value, key, unread.value)
    except TextError as error:
        wrong = Problem(key, str(error), origin)
        return replace(document, problems=[*document.problems, wrong])
    found.sources = document.sources.changed(key, origin)
    return found


def put(node: Any, key: Key, value: object, depth: int = 0) -> Any:
    """Return plain data with one value set deep in it, and the mappings on the way there.

    Args:
        node: The data at the first steps of the key.
        key: Key of the value.
        value: The value to set.
        depth: Number of steps of the key that lead to the node.

    Raises:
        TextError: There is no such place.
    """
    if depth == len(key):
        return value
    step, above = key[depth], join(key[:depth])
    if isinstance(step, str) and not isinstance(node, dict):
        raise TextError(f"{above} is {show(node)}, not a mapping")
    if isinstance(step, int) and not isinstance(node, list):
        raise TextError(f"{above} is {show(node)}, not a list")
    if isinstance(step, int) and step >= len(node):
        raise TextError(f"{above} has {len(node)} item{'s' * (len(node) != 1)}, counted from 0")
    below = node.get(step) if isinstance(node, dict) else node[step]
    if below is None and isinstance(node, dict) and isinstance((*key, 0)[depth + 1], str):
        below = {}
    if below is None and isinstance(node, dict) and step not in node:  # an item of an unwritten value
        below = listed_default(key[: depth + 1])
    changed = node.copy()
    changed[step] = put(below, key, value, depth + 1)
    return changed
