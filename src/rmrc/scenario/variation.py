"""`--vary KEY=V1,V2,...`: the variants of a scenario to compare, each as changes with a label."""

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

from rmrc.scenario.changes import Change, Variant, changes_of, read_change
from rmrc.scenario.reading import TextError, items
from rmrc.scenario.sections import parse_key
from rmrc.scenario.wording import brief, inline
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Key, join

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
        ScenarioError: A text cannot be read; they are too few or too many, or two are the same.
    """
    axes = dict[Key, _Axis]()
    for text in texts:
        key, axis = _axis(text)
        if key in axes:
            raise ScenarioError.about(f"--vary {join(key)}", "is varied twice")
        axes[key] = axis
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
    axes = list[_Axis]()
    for name, listed in values.items():
        try:
            if isinstance(listed, str):
                raise ValueError(f"must be a list of values, got {listed!r}")
            changes = [changes_of({name: value})[0] for value in listed]
        except ValueError as error:
            raise ScenarioError.about(f"vary {brief(name)}", str(error)) from None
        axes.append([(c.value if isinstance(c.value, str) else inline(c.value), c) for c in changes])
    return _combined(axes, "vary", '{"control.inverse.method": ["inverse", "damped"]}')


def _combined(axes: Sequence[_Axis], option: str, example: str) -> tuple[Variant, ...]:
    """Return all combinations of values."""
    count = math.prod(map(len, axes)) if axes else 0
    if not 2 <= count <= MOST_VARIANTS:
        text = f"must give 2 variants to {MOST_VARIANTS}, got {count}; for example {example}"
        raise ScenarioError.about(option, text)
    combined = tuple(map(_variant, itertools.product(*axes)))
    (label, times), *_ = Counter(variant.label for variant in combined).most_common(1)
    if times > 1:
        raise ScenarioError.about(option, f"two variants have the same values: {label}")
    return combined


def _axis(text: str) -> tuple[Key, _Axis]:
    """Return a key and its values, each as a text and as a change."""
    name, equals, values = text.partition("=")
    try:
        key = parse_key(name.strip() if equals else "")
    except ValueError:
        wrong = f"must be KEY=V1,V2,..., for example {EXAMPLE}"
        raise ScenarioError.about(f"--vary {brief(text)}", wrong) from None
    option = f"--vary {join(key)}"
    try:
        return key, [(shown, read_change(key, written, option)) for shown, written in items(values)]
    except TextError as error:
        raise ScenarioError.about(option, str(error)) from None


def _variant(chosen: tuple[tuple[str, Change], ...]) -> Variant:
    label, (_, first) = ", ".join(shown for shown, _ in chosen), chosen[0]
    is_word = label[:1].isalpha() and (first.written or label) not in ("true", "false", "null")
    if len(chosen) == 1 and not is_word:  # a lone word explains itself, a lone number does not
        label = f"{join(first.key).rpartition('.')[2]}={label}"
    return Variant(brief(label), tuple(change for _, change in chosen))
