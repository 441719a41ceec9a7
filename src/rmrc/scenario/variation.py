"""`--vary KEY=V1,V2,...`: the variants of a scenario that are compared, as overrides with a label each."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from rmrc.scenario.keys import Key, join
from rmrc.scenario.reading import TextError, items
from rmrc.scenario.sections import parse_key
from rmrc.scenario.wording import brief
from rmrc.support.errors import ScenarioError

# Curves can be told apart up to a dozen; a table of more rows than this is not read any more, but swept.
MOST_VARIANTS = 50

EXAMPLE = "control.inverse.method=inverse,damped"


@dataclass(frozen=True)
class Variant:
    """One of the scenarios that are compared.

    Attributes:
        label: Its values, short: `damped`, `maximum=0.05`, or `damped, 0.1` of several keys.
        overrides: `KEY=VALUE` texts that make it from the scenario.
    """

    label: str
    overrides: tuple[str, ...]


def variants(texts: Sequence[str]) -> tuple[Variant, ...]:
    """Return all combinations of the values of some keys, the last key changing fastest.

    Args:
        texts: `KEY=V1,V2,...` a key; a value is YAML, so a comma within brackets or quotes is its own.

    Raises:
        ScenarioError: All that is wrong with the texts.
    """
    problems: list[str] = []
    axes: dict[Key, list[tuple[str, str]]] = {}
    for text in texts:
        try:
            key, choices = _axis(text)
            if key in axes:
                raise TextError(f"{join(key)}: is varied twice")
            axes[key] = choices
        except TextError as error:
            problems.append(f"--vary {error}")
    count = math.prod(map(len, axes.values())) if axes else 0
    if not problems and count < 2:
        problems = [f"--vary: must give 2 variants or more, got {count}; for example --vary {EXAMPLE}"]
    if not problems and count > MOST_VARIANTS:
        problems = [f"--vary: must give at most {MOST_VARIANTS} variants, got {count}"]
    if not problems:
        grid = [_variant(tuple(axes), chosen) for chosen in itertools.product(*axes.values())]
        labels = [variant.label for variant in grid]
        alike = [label for label in dict.fromkeys(labels) if labels.count(label) > 1]
        problems = [f"--vary: two variants have the same values: {label}" for label in alike]
    if problems:
        raise ScenarioError(problems)
    return tuple(grid)


def _axis(text: str) -> tuple[Key, list[tuple[str, str]]]:
    """Return a key and its values, each as it is read and as it is written."""
    name, equals, rest = text.partition("=")
    try:
        key = parse_key(name.strip() if equals else "")
    except ValueError:
        raise TextError(f"{brief(text)}: must be KEY=V1,V2,..., for example {EXAMPLE}") from None
    try:
        return key, items(rest)
    except TextError as error:
        raise TextError(f"{join(key)}: {error}") from None


def _variant(keys: tuple[Key, ...], chosen: tuple[tuple[str, str], ...]) -> Variant:
    label = ", ".join(read for read, _ in chosen)
    if len(keys) == 1 and not _is_word(*chosen[0]):  # a lone word says what it is, a lone number does not
        label = f"{join(keys[0]).rpartition('.')[2]}={label}"
    overrides = (f"{join(key)}={written}" for key, (_, written) in zip(keys, chosen, strict=True))
    return Variant(brief(label), tuple(overrides))


def _is_word(read: str, written: str) -> bool:
    return read[:1].isalpha() and written not in ("true", "false", "null")
