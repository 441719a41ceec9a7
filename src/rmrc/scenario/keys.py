"""Keys of a scenario, and the origin of each value."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from rmrc.support.problems import Key, Origin, Problem, join


class Place(NamedTuple):
    """Where a value starts, and its key; an item of a list has none of its own."""

    value: Origin
    key: Origin


@dataclass(frozen=True)
class SourceMap:
    """The places where values were given.

    Attributes:
        source: The file.
        places: By key.
    """

    source: str = ""
    places: Mapping[Key, Place] = field(default_factory=dict)

    def origin(self, key: Key) -> Origin:
        """Return where a value was given, or else a part of it, or else its nearest parent."""
        if key in self.places:
            return self.places[key].value
        below = [place.value for part, place in self.places.items() if part[: len(key)] == key]
        parents = (key[:depth] for depth in reversed(range(len(key))))
        above = [self.places[parent].value for parent in parents if parent in self.places]
        return next(iter(below + above), Origin(self.source))

    def changed(self, key: Key, origin: Origin) -> "SourceMap":
        """Return the places of all values after one value was given elsewhere."""
        others = {part: place for part, place in self.places.items() if part[: len(key)] != key}
        return SourceMap(self.source, {**others, key: Place(origin, origin)})

    def below(self, step: str) -> "SourceMap":
        """Return the places of the values if they stood below another key."""
        return SourceMap(self.source, {(step, *key): place for key, place in self.places.items()})

    def problem(self, key: Key, text: str) -> Problem:
        """Return the problem of a value."""
        return Problem(key, text, self.origin(key))

    def locate(self, key: Key) -> str:
        """Return source, line, column and key, as messages begin."""
        return self.origin(key).of(join(key))


def in_order(problems: Iterable[Problem]) -> list[Problem]:
    """Return problems in their order of reporting: those of the file by line, then those of options."""

    def place(problem: Problem) -> tuple[bool, int, int]:
        origin = problem.origin or Origin()
        return not origin.line, origin.line, origin.column

    return sorted(problems, key=place)


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
