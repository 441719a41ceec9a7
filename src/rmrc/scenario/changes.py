"""Changes of a scenario, variants of it, and the texts of the command line for both."""

import itertools
import math
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import reduce, wraps
from inspect import signature
from typing import Any, NamedTuple, ParamSpec, TypeVar

from rmrc.scenario.messages import ALIASES, below, fields, fields_at
from rmrc.scenario.reading import Document, brief, inline, parse, show
from rmrc.scenario.sections import Sections, parse_key
from rmrc.scenario.values import Section
from rmrc.support.errors import Key, Origin, Problem, ScenarioError, did_you_mean, join

D = TypeVar("D", bound=Document)

# Up to a dozen curves can be told apart; for more variants than this, use a sweep.
MOST_VARIANTS = 50

EXAMPLE = "control.inverse.method=inverse,damped"


class Change(NamedTuple):
    """A replacement of a value.

    Attributes:
        key: Key of the value.
        value: The value as in a file: a number, a text, a switch, null, or a list or mapping of these.
        origin: The place where it was given; None: in Python.
    """

    key: Key
    value: Any
    origin: Origin | None = None

    def __str__(self) -> str:
        """Return the change as `KEY=VALUE`, which the command line takes."""
        return f"{join(self.key)}={inline(self.value)}"


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
    return deeper_last(
        Change(parse_key(name), plain(value), Origin(f"{option} {name}", key=name) if option else None)
        for name, value in values.items()
    )


def deeper_last(changes: Iterable[Change]) -> tuple[Change, ...]:
    """Return changes that are given together, deeper keys later: they win over those above them."""
    return tuple(sorted(changes, key=lambda change: len(change.key)))


def plain(value: Any) -> Any:
    """Return a value as a file would have it: lists for tuples and arrays, Python's numbers for numpy's."""
    if isinstance(value, Mapping):
        return {name: plain(inner) for name, inner in value.items()}
    if isinstance(value, Section):
        return value.model_dump(mode="json")
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
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
        return Change(key, parse(text if text.strip() else "null", key=key)[0], origin)
    except ScenarioError as error:
        raise ScenarioError(
            each._replace(key=each.key or key, origin=origin) for each in error.problems
        ) from None


def read_setting(text: str) -> Change:
    """Return the change for a text `KEY=VALUE`.

    Args:
        text: Such as `control.inverse.method=inverse` or `arm.start[1]=10 deg`; VALUE is YAML.

    Raises:
        ScenarioError: It is no such text.
    """
    key, value = _parted(text, "--set", "KEY=VALUE, for example control.feedback=10")
    return read_change(key, value, f"--set {join(key)}")


def _parted(text: str, option: str, wanted: str) -> tuple[Key, str]:
    """Return the key of an option's text, and what is after its `=`."""
    name, equals, value = text.partition("=")
    try:
        return parse_key(name.strip() if equals else ""), value
    except ValueError:
        raise ScenarioError.about(f"{option} {brief(text)}", f"must be {wanted}") from None


def applied(document: D, changes: Sequence[Change]) -> D:
    """Return a document with changes, later ones on top; the parts beside their values are shared.

    Raises:
        ScenarioError: There is no such place.
    """
    places = *document.changes, *((change.key, change.origin or Origin()) for change in changes)
    return replace(document, value=reduce(_put, changes, document.value), changes=places)


def _put(node: Any, change: Change, depth: int = 0) -> Any:
    """Return plain data with one value set deep in it, and the mappings on the way there.

    Args:
        node: The data at the first steps of the key.
        change: The change.
        depth: Number of steps of its key that lead to the node.

    Raises:
        ScenarioError: There is no such place.
    """
    if depth == len(change.key):
        return change.value
    step, above, problem = change.key[depth], change.key[:depth], ""
    if node is None:
        node = {} if isinstance(step, str) else _default(above)
    if not isinstance(node, dict if isinstance(step, str) else list):
        problem = f"is {show(node)}, not a {'mapping' if isinstance(step, str) else 'list'}"
    elif isinstance(step, int) and step >= len(node):
        problem = f"has {len(node)} item(s), counted from 0"
    if problem:
        raise ScenarioError([Problem(change.key, f"{join(above)} {problem}", change.origin)])
    changed: Any = node.copy()
    below = changed.get(step) if isinstance(step, str) else changed[step]
    changed[step] = _put(below, change, depth + 1)
    return changed


def _default(key: Key) -> Any:
    """Return the default of a key, if it is a list."""
    field = fields_at(Sections, key[:-1]).get(str(key[-1]))
    return list(field.default) if field and isinstance(field.default, tuple) else None


# Variants ----------------------------------------------------------------------------------------


def variants(texts: Sequence[str]) -> tuple[Variant, ...]:
    """Return all combinations of the values of some keys, the last key changing fastest.

    Args:
        texts: One `KEY=V1,V2,...` per key; a value is YAML, so a comma within brackets or quotes is its own.

    Raises:
        ScenarioError: A text cannot be read; they are too few or too many, or two are the same.
    """
    axes = dict[Key, list[Change]]()
    for text in texts:
        key, values = _parted(text, "--vary", f"KEY=V1,V2,..., for example {EXAMPLE}")
        option = f"--vary {join(key)}"
        if key in axes:
            raise ScenarioError.about(option, "is varied twice")
        whole = read_change(key, f"[{values}\n]", option)  # a comment must not hide the bracket
        axes[key] = [whole._replace(value=value) for value in whole.value]
    return _combined(list(axes.values()), "--vary", f"--vary {EXAMPLE}")


def grid(values: Mapping[str, Iterable[object]]) -> tuple[Variant, ...]:
    """Return all combinations of the values of some keys, the last key changing fastest.

    Args:
        values: By dotted key, each as a file would have it.

    Raises:
        ScenarioError: A key is not valid; they are too few or too many, or two are the same.

    Example:
        >>> [each.label for each in grid({"control.feedback": [5, 10], "control.inverse.method": ["damped"]})]
        ['5, damped', '10, damped']
    """
    axes = list[list[Change]]()
    for name, listed in values.items():
        if isinstance(listed, str):
            raise ScenarioError.about(f"vary {brief(name)}", f"must be a list of values, got {listed!r}")
        try:
            axes.append([changes_of({name: value})[0] for value in listed])
        except ValueError as error:
            raise ScenarioError.about(f"vary {brief(name)}", str(error)) from None
    return _combined(axes, "vary", '{"control.inverse.method": ["inverse", "damped"]}')


def _combined(axes: Sequence[Sequence[Change]], option: str, example: str) -> tuple[Variant, ...]:
    """Return all combinations of changes."""
    count = math.prod(map(len, axes)) if axes else 0
    if not 2 <= count <= MOST_VARIANTS:
        text = f"must give 2 variants to {MOST_VARIANTS}, got {count}; for example {example}"
        raise ScenarioError.about(option, text)
    combined = tuple(Variant(_label(each), deeper_last(each)) for each in itertools.product(*axes))
    (label, times), *_ = Counter(variant.label for variant in combined).most_common(1)
    if times > 1:
        raise ScenarioError.about(option, f"two variants have the same values: {label}")
    return combined


def _label(changes: Sequence[Change]) -> str:
    values = [change.value for change in changes]
    label = ", ".join(value if isinstance(value, str) else inline(value) for value in values)
    is_word = isinstance(values[0], str) and label[:1].isalpha()
    if len(values) == 1 and not is_word:  # a lone word explains itself, a lone number does not
        label = f"{join(changes[0].key).rpartition('.')[2]}={label}"
    return brief(label)


# Unknown keywords ---------------------------------------------------------------------------------
#
# Arguments by keyword that a function does not have: the nearest, or the key of a scenario that is meant.

P = ParamSpec("P")
R = TypeVar("R")


def hinted(function: Callable[P, R], more: Callable[..., Any] | None = None) -> Callable[P, R]:
    """Return a function whose TypeError about an unknown keyword says what to write instead.

    Args:
        function: The function.
        more: Function that gets the keywords that it does not name itself.
    """

    @wraps(function)
    def called(*args: P.args, **named: P.kwargs) -> R:
        try:
            return function(*args, **named)
        except TypeError as error:
            match = re.search(r"unexpected keyword argument '(\w+)'", str(error))
            if match is None or match[1] not in named:
                raise
        known = [name for each in (function, more or function) for name in signature(each).parameters]
        name, text = (
            function.__qualname__.removesuffix(".__init__"),
            _instead(match[1], named[match[1]], known),
        )
        raise TypeError(f'{name} has no argument "{match[1]}"{text}')

    return called


def _instead(name: str, value: object, known: list[str]) -> str:
    """Return what to write instead of an argument, as the end of a message."""
    section = next(iter(below(name, fields(Sections))), None)
    if section is None:
        return did_you_mean(name, known) or f"; its arguments are {', '.join(known)}"
    value = ALIASES.get(value, value) if isinstance(value, str) else value
    if "control" not in known or not f"{section}.".startswith("control."):
        return f"; write scenario=rmrc.load(...).set({ {f'{section}.{name}': value} })"
    for step in (name, *reversed(section.split(".")[1:])):
        value = {step: value}
    return f"; write control={value}"
