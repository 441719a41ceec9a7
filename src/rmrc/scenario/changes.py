"""Changes of a scenario: a value for a key; and the texts of the command line that stand for some."""

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
    """A value that takes the place of another.

    Attributes:
        key: Of the value.
        value: As a file would have it: a number, a text, a switch, nothing, or a list or mapping of these.
        origin: Where it was given; None: in Python.
        written: The value as it was written; "" where it was not.
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
        label: What it is called: `damped`, `maximum=0.05`, or `damped, 0.1` of several keys.
        changes: What makes it; later ones win.
    """

    label: str
    changes: tuple[Change, ...] = ()


@dataclass(frozen=True)
class Unread:
    """What stands for the value of a text that could not be read, or not all of it.

    Attributes:
        value: What could be read, if anything.
        problems: What is wrong with the text.
        hidden: Keys that have no value to judge.
        is_nothing: Whether there is no value at all.
    """

    value: Any
    problems: tuple[Problem, ...]
    hidden: frozenset[Key] = frozenset()
    is_nothing: bool = False


def changes_of(values: Mapping[str, object], option: str = "") -> tuple[Change, ...]:
    """Return changes that are made in Python.

    Args:
        values: By dotted key, such as `control.feedback` or `arm.start[1]`.
        option: Command-line option behind the problems, which messages then name with the key.

    Raises:
        ValueError: What should be a key is none.
    """
    return tuple(
        Change(parse_key(name), _plain(value), Origin(f"{option} {name}", key=name) if option else None)
        for name, value in values.items()
    )


def _plain(value: Any) -> Any:
    """Return a value as a file would have it: lists for tuples and arrays, numbers of Python for numpy's."""
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
    """Return the change of a key by a text; what is wrong with the text is told by whoever applies it.

    Args:
        key: What is changed.
        text: The value as YAML; nothing stands for null.
        origin: Where it was given.
    """
    try:
        inner = parse(text if text.strip() else "null", key=key)
    except TextError as error:
        unread = Unread(None, (Problem(key, str(error), origin),), frozenset([key]), is_nothing=True)
        return Change(key, unread, origin, text)
    if not inner.problems:
        return Change(key, inner.value, origin, text)
    problems = tuple(problem._replace(origin=origin) for problem in inner.problems)
    return Change(key, Unread(inner.value, problems, inner.hidden), origin, text)


def read_setting(text: str) -> Change:
    """Return the change that a text `KEY=VALUE` stands for; that of another text cannot be applied.

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
    """Return a document with one change; what is wrong with it joins the problems.

    It shares what is not on the way to the value with the document that is given, which stays as it is.
    """
    key, origin, value = change.key, change.origin or Origin(), change.value
    unread = value if isinstance(value, Unread) else Unread(value, ())
    found = replace(
        document, problems=[*document.problems, *unread.problems], hidden=document.hidden | unread.hidden
    )
    if unread.is_nothing:
        return found
    try:
        found.value = put(document.value, key, unread.value)
    except TextError as error:
        wrong = Problem(key, str(error), origin)
        return replace(document, problems=[*document.problems, wrong], hidden=document.hidden | {key})
    found.sources = document.sources.changed(key, origin)
    return found


def put(node: Any, key: Key, value: object, depth: int = 0) -> Any:
    """Return plain data with one value set deep in it, and the mappings that lead there.

    Args:
        node: What is at the first steps of the key.
        key: Of the value.
        value: That is set.
        depth: How many steps of the key lead to the node.

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
    if below is None and isinstance(node, dict) and step not in node:  # an item of what was not written
        below = listed_default(key[: depth + 1])
    changed = node.copy()
    changed[step] = put(below, key, value, depth + 1)
    return changed
