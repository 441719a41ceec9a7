"""`--vary KEY=V1,V2,...`: the variants of a scenario to compare, each as changes with a label."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

from rmrc.scenario.changes import Change, Variant, changes_of, read_change
from rmrc.scenario.reading import TextError, items
from rmrc.scenario.sections import parse_key
from rmrc.scenario.wording import brief, inline
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Key, Origin, Problem, join

# Up to a dozen curves can be told apart; for more variants than this, use a sweep.
MOST_VARIANTS = 50

EXAMPLE = "control.inverse.method=inverse,damped"

# Values of a key, each as in a label and as a change.
_Axis: TypeAlias = list[tuple[str, Change]]


def variants(texts: Sequence[str]) -> tuple[Variant, ...]:
    """Return all combinations of the values of some keys, the last key changing fastest.

    Args:
        texts: One `KEY=V1,V2,...` per key; a value is YAML, so a comma within brackets or quotes is its own.

    Raises:
        ScenarioError: Lists all problems of the texts.
    """
    problems: list[Problem] = []
    axes: dict[Key, _Axis] = {}
    for text in texts:
        try:
            key, choices = _axis(text)
            if key in axes:
                raise _refused(join(key), "is varied twice")
            axes[key] = choices
        except ScenarioError as error:
            problems += error.problems
    return _combined(axes, problems, "--vary", f"--vary {EXAMPLE}")


def grid(values: Mapping[str, Iterable[object]]) -> tuple[Variant, ...]:
    """Return all combinations of the values of some keys, the last key changing fastest.

    Args:
        values: By dotted key, each as a file would have it.

    Raises:
        ScenarioError: Lists all problems.

    Example:
        >>> [one.label for one in grid({"control.feedback": [5, 10], "control.inverse.method": ["damped"]})]
        ['5, damped', '10, damped']
    """
    problems: list[Problem] = []
    axes: dict[Key, _Axis] = {}
    for name, some in values.items():
        try:
            key = parse_key(name)
        except ValueError as error:
            problems.append(Problem((), str(error), Origin(f"vary {brief(name)}")))
            continue
        if isinstance(some, str | Mapping) or not isinstance(some, Iterable):
            problems.append(Problem((), f"must be a list of values, got {some!r}", Origin(f"vary {name}")))
            continue
        changes = [changes_of({name: value})[0] for value in some]
        axes[key] = [(_text(change.value), change) for change in changes]
    return _combined(axes, problems, "vary", '{"control.inverse.method": ["inverse", "damped"]}')


def _combined(
    axes: Mapping[Key, _Axis], problems: list[Problem], option: str, example: str
) -> tuple[Variant, ...]:
    """Return all combinations of values; raise their problems and those found before."""

    def add(text: str) -> None:
        problems.append(Problem((), text, Origin(option)))

    count = math.prod(map(len, axes.values())) if axes else 0
    if not problems and count < 2:
        add(f"must give 2 variants or more, got {count}; for example {example}")
    if not problems and count > MOST_VARIANTS:
        add(f"must give at most {MOST_VARIANTS} variants, got {count}")
    found = () if problems else tuple(map(_variant, itertools.product(*axes.values())))
    labels = [variant.label for variant in found]
    for label in dict.fromkeys(labels):
        if labels.count(label) > 1:
            add(f"two variants have the same values: {label}")
    if problems:
        raise ScenarioError(problems)
    return found


def _refused(name: str, text: str) -> ScenarioError:
    return ScenarioError.about(f"--vary {name}", text)


def _axis(text: str) -> tuple[Key, _Axis]:
    """Return a key and its values, each as a text and as a change."""
    name, equals, rest = text.partition("=")
    try:
        key = parse_key(name.strip() if equals else "")
    except ValueError:
        raise _refused(brief(text), f"must be KEY=V1,V2,..., for example {EXAMPLE}") from None
    origin = Origin(f"--vary {join(key)}", key=join(key))
    try:
        return key, [(read, read_change(key, written, origin)) for read, written in items(rest)]
    except TextError as error:
        raise _refused(join(key), str(error)) from None


def _variant(chosen: tuple[tuple[str, Change], ...]) -> Variant:
    label = ", ".join(read for read, _ in chosen)
    if len(chosen) == 1 and not _is_word(*chosen[0]):  # a lone word explains itself, a lone number does not
        label = f"{join(chosen[0][1].key).rpartition('.')[2]}={label}"
    return Variant(brief(label), tuple(change for _, change in chosen))


def _text(value: object) -> str:
    """Return a value as in a label: a text as it is, all others as YAML writes them."""
    return value if isinstance(value, str) else inline(value)


def _is_word(read: str, change: Change) -> bool:
    return read[:1].isalpha() and (change.written or read) not in ("true", "false", "null")
