"""Keys of a scenario, and the origin of each value."""

import re
from dataclasses import dataclass, field, replace
from functools import lru_cache

from rmrc.support.problems import Key, Origin, Problem, join


@dataclass
class Place:
    """The start of a value, the place of its key, and the places of its parts."""

    origin: Origin | None = None
    below: dict[str | int, "Place"] = field(default_factory=dict)
    key: Origin | None = None


@dataclass
class SourceMap:
    """The place where each value was given."""

    source: str = ""
    root: Place = field(default_factory=Place)

    def find(self, key: Key) -> Place:
        """Return the place of a value, or of its nearest parent that has one."""
        place = parent = self.root
        for step in key:
            if step not in place.below:
                return parent
            place = place.below[step]
            parent = place if place.origin else parent
        while place.below and not place.origin:  # a mapping made for a change
            place = next(iter(place.below.values()))
        return place

    def changed(self, key: Key, origin: Origin) -> "SourceMap":
        """Return the places of all values after one value was given elsewhere.

        Mappings made for it have only its own place. The rest is shared.
        """

        def put(place: Place, steps: Key) -> Place:
            if not steps:
                return Place(origin)
            below = put(place.below.get(steps[0], Place()), steps[1:])
            return replace(place, below={**place.below, steps[0]: below})

        return SourceMap(self.source, put(self.root, key))

    def origin(self, key: Key) -> Origin:
        """Return the origin of a value, or of its nearest parent that has one."""
        return self.find(key).origin or Origin(self.source)

    def problem(self, key: Key, text: str) -> Problem:
        """Return the problem of a value."""
        return Problem(key, text, self.origin(key))

    def locate(self, key: Key) -> str:
        """Return source, line, column and key, as messages begin."""
        return self.origin(key).of(join(key))


def in_order(problems: list[Problem]) -> list[Problem]:
    """Return problems in their order of reporting: those of the file by line, then those of options."""

    def place(one: Problem) -> tuple[bool, int, int]:
        origin = one.origin or Origin()
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
