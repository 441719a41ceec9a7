"""Where the values of a scenario come from: a line and column of a file, or an option of the command line."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from rmrc.scenario.wording import brief
from rmrc.support.legible import visible

Key = tuple[str | int, ...]  # the steps from the root to a value
Mark = tuple[int, ...] | str  # line and column from 1, or an option such as `--set KEY`; () if there is none


class Mistake(NamedTuple):
    """One mistake: at which key, what, and where if that is not the value's own place."""

    key: Key
    text: str
    mark: Mark = ()
    hides: bool = False  # there is no value to judge: what else is wrong at the key only follows


@dataclass
class Place:
    """Where one value starts, where its key stands, and the places of what it holds."""

    mark: Mark = ()
    below: dict[str | int, "Place"] = field(default_factory=dict)
    key: Mark = ()


@dataclass
class Origin:
    """Where each value came from. Any two are equal: it is no part of what a scenario says."""

    source: str = field(default="", compare=False)
    root: Place = field(default_factory=Place, compare=False)

    def find(self, key: Key) -> Place:
        """Return the place of a value, or of its nearest parent that has one."""
        place = parent = self.root
        for step in key:
            if step not in place.below:
                return parent
            place = place.below[step]
            parent = place if place.mark else parent
        while place.below and not place.mark:  # a mapping made for an override
            place = next(iter(place.below.values()))
        return place

    def overridden(self, key: Key, option: str) -> "Origin":
        """Return where all comes from if one value comes from an option.

        Mappings made for it have no place but its own. What is not on the way to it is shared.
        """

        def put(place: Place, steps: Key) -> Place:
            if not steps:
                return Place(f"{option} {join(key)}")
            below = put(place.below.get(steps[0], Place()), steps[1:])
            return replace(place, below={**place.below, steps[0]: below})

        return Origin(self.source, put(self.root, key))

    def locate(self, key: Key, mark: Mark = ()) -> str:
        """Return source, line, column and key, as messages begin."""
        mark, name = mark or self.find(key).mark, join(key)
        if isinstance(mark, str):
            return mark if name in ("", mark.partition(" ")[2]) else f"{mark}: {name}"
        where = ":".join([visible(self.source), *map(str, mark)])
        return ": ".join(part for part in (where, name) if part)

    def lines(self, mistakes: Sequence[Mistake]) -> list[str]:
        """Return the messages: the file's by line, then those of the overrides."""
        marked = [(mistake.mark or self.find(mistake.key).mark, mistake) for mistake in mistakes]
        marked.sort(key=lambda pair: (math.inf,) if isinstance(pair[0], str) else pair[0])
        return [f"{self.locate(mistake.key, mark)}: {mistake.text}" for mark, mistake in marked]


def join(key: Key) -> str:
    """Return a key as it is written: `arm.start[1]`."""
    parts = (f"[{step}]" if isinstance(step, int) else f".{brief(step)}" for step in key)
    return "".join(parts).removeprefix(".")


def split(text: str) -> Key:
    """Return the steps of a key.

    Raises:
        ValueError: If the text is no key.
    """
    part = r"[^.\[\]=\s]+(\[[0-9]{1,6}\])*"
    if not re.fullmatch(rf"{part}(\.{part})*", text):
        raise ValueError(f"{text!r} is not a key such as control.feedback or arm.start[1]")
    return tuple(int(i) if i else name for i, name in re.findall(r"\[([0-9]+)\]|([^.\[\]]+)", text))
