"""Changes of a scenario: a value for a key, and the texts of the command line for them."""

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from rmrc.scenario.reading import Document, TextError, parse
from rmrc.scenario.sections import Sections, parse_key
from rmrc.scenario.values import Section
from rmrc.scenario.wording import brief, inline, show
from rmrc.support.errors import ScenarioError
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
        return {name: _plain(inner) for name, inner in value.items()}
    if isinstance(value, Section):
        return value.model_dump(mode="json")
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def read_change(key: Key, text: str, option: str) -> Change:
    """Return the change of a key by a text.

    Args:
        key: The key to change.
        text: The value as YAML; an empty text means null.
        option: The option that has it, with the key as messages name it.

    Raises:
        ScenarioError: The text cannot be read.
    """
    origin = Origin(option, key=join(key))
    try:
        inner = parse(text if text.strip() else "null", key=key)
    except TextError as error:
        raise ScenarioError([Problem(error.key or key, str(error), origin)]) from None
    return Change(key, inner.value, origin, text)


def read_setting(text: str) -> Change:
    """Return the change for a text `KEY=VALUE`.

    Args:
        text: Such as `control.inverse.method=inverse` or `arm.start[1]=10 deg`; VALUE is YAML.

    Raises:
        ScenarioError: It is no such text.
    """
    name, equals, value = text.partition("=")
    try:
        key = parse_key(name.strip() if equals else "")
    except ValueError:
        wrong = "must be KEY=VALUE, for example control.feedback=10"
        raise ScenarioError([Problem((), wrong, Origin(f"--set {brief(text)}"))]) from None
    return read_change(key, value, f"--set {join(key)}")


def applied(document: Document, change: Change) -> Document:
    """Return a document with one change; the parts beside the way to its value are shared.

    Raises:
        ScenarioError: There is no such place.
    """
    key, origin = change.key, change.origin or Origin()
    try:
        value = _put(document.value, key, change.value)
    except TextError as error:
        raise ScenarioError([Problem(key, str(error), origin)]) from None
    return replace(document, value=value, sources=document.sources.changed(key, origin))


def _put(node: Any, key: tuple[Any, ...], value: object, depth: int = 0) -> Any:
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
    if node is None:
        node = {} if isinstance(step, str) else _listed_default(key[:depth])
    if not isinstance(node, dict if isinstance(step, str) else list):
        wanted = "mapping" if isinstance(step, str) else "list"
        raise TextError(f"{above} is {show(node)}, not a {wanted}")
    if isinstance(step, int) and step >= len(node):
        raise TextError(f"{above} has {len(node)} item{'s' * (len(node) != 1)}, counted from 0")
    below = node.get(step) if isinstance(node, dict) else node[step]
    changed: Any = node.copy()
    changed[step] = _put(below, key, value, depth + 1)
    return changed


def _listed_default(key: Key) -> list[object] | None:
    """Return the default of a key that is not written, if it is a list."""
    fields = Sections.model_fields
    for step in key[:-1]:
        section = fields[str(step)].annotation if step in fields else None
        fields = getattr(section, "model_fields", {})
    default = fields[str(key[-1])].default if key[-1] in fields else None
    return list(default) if isinstance(default, tuple) else None
