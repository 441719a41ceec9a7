"""Events of a run, in words, on one strip: states are as long as they last, labels of short ones beside."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, reduce
from itertools import groupby, pairwise
from operator import or_
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario.choices import Status
from rmrc.show.palette import BLACK, GRAVE, RED, SLATE, TEAL, mix, of_status

# Number of letters that fit into the strip in a window of 1280 points, if nothing else is known.
LETTERS = 80.0
FREE = "free"
# Entity of the times of the strip, if there are any: the viewer sorts its lanes, and this one comes first.
CLOCK = "clock"
# Adjacent states that change their color this often count as one; the colors from calm to grave.
FLICKER, SEVERITY = 12, (SLATE, TEAL, RED)


class Label(NamedTuple):
    """A part of the strip, up to the next label.

    Attributes:
        time: Where it begins [s].
        text: The text on it; " ": none, as it has no room, and a neighbor has the text.
        color: 0xRRGGBBAA.
        state: Its name, which differs from that of labels with another text or color.
    """

    time: float
    text: str
    color: int
    state: str


@cache
def words(status: int) -> str:
    """Return a status as words.

    >>> words(Status.DAMPED | Status.RATE_LIMITED), words(0)
    ('damped, rate limited', 'free')
    """
    return ", ".join(str(one.name).lower().replace("_", " ") for one in Status if one & status) or FREE


class Strip:
    """The statuses of a run, from which the labels of its strip are made at the end."""

    def __init__(self) -> None:
        """Begin with none."""
        self._changes: list[tuple[float, int]] = []
        self._last: list[Label] = []

    def add(self, time: NDArray[np.float64], status: NDArray[np.int64]) -> NDArray[np.int64]:
        """Take times and statuses of a block, (T,) each; return the rows at which the status changes."""
        before = self._changes[-1][1] if self._changes else -1
        rows = np.flatnonzero(np.diff(status, prepend=before))
        self._changes += zip(time[rows].tolist(), status[rows].tolist(), strict=True)
        return rows

    def end_with(self, time: float, text: str) -> None:
        """Note why the run ended."""
        self._last = [Label(time, text, RED, text)]

    def held(self, end: float) -> dict[Status, float]:
        """Return the duration of each status that occurs [s].

        Args:
            end: End of the run [s].
        """
        found: dict[Status, float] = {}
        for begin, until, one in self._spans(end):
            for flag in Status:
                if flag & one:
                    found[flag] = found.get(flag, 0.0) + until - begin
        return found

    def _spans(self, end: float) -> list[tuple[float, float, int]]:
        ends = [*(time for time, _ in self._changes[1:]), end]
        return [(begin, until, one) for (begin, one), until in zip(self._changes, ends, strict=False)]

    def labels(self, end: float, letters: float = LETTERS) -> list[Label]:
        """Return the labels of the whole strip, whose parts begin and end where their states do.

        States too short for their words share a label, which names the gravest of them and its duration.
        The label is on them if together they have the room and one color, or else on a neighbor with
        room, with an arrow to them. If no neighbor has room, they share it with the shorter one. States
        that change their color more than `FLICKER` times get the color of the gravest.

        Args:
            end: End of the run [s].
            letters: Number of letters that fit into the strip.
        """
        unit, blocks = end / letters, list[_Block]()
        for is_long, some in groupby(self._spans(end), lambda span: _Block([span]).is_plain(unit)):
            spans = [*some]
            blocks += [_Block([span]) for span in spans] if is_long else [_Block(spans)]
        while (lost := _first_untold(blocks, unit)) is not None:
            beside = [i for i in (lost - 1, lost + 1) if 0 <= i < len(blocks)]
            first, last = sorted((lost, min(beside, key=lambda i: blocks[i].length)))
            blocks[first : last + 1] = [_Block(blocks[first].spans + blocks[last].spans)]
        return [label for block in blocks for label in block.labels(unit)] + self._last


@dataclass(eq=False)
class _Block:
    """States next to each other that have one label.

    Attributes:
        spans: Begin, end and status of each.
        around: Statuses before and after it.
        before: Text of the block before it.
        after: Text of the block after it.
        is_told: Whether another block has its text.
    """

    spans: list[tuple[float, float, int]]
    around: int = 0
    before: str = ""
    after: str = ""
    is_told: bool = False

    @property
    def length(self) -> float:
        """Its duration [s]."""
        return self.spans[-1][1] - self.spans[0][0]

    @cached_property
    def runs(self) -> list[tuple[float, float, int]]:
        """Begin, end and color of its parts."""
        found = list[tuple[float, float, int]]()
        for begin, until, one in self.spans:
            color = of_status(one)
            since = found.pop()[0] if found and found[-1][2] == color else begin
            found.append((since, until, color))
        gravest = of_status(reduce(or_, (one for *_, one in self.spans)))
        return found if len(found) <= FLICKER else [(found[0][0], found[-1][1], gravest)]

    @cached_property
    def gravest(self) -> tuple[int, float, int]:
        """The gravest state, its duration [s], and the number of the others."""
        lasted: dict[int, float] = {}
        for since, until, one in self.spans:
            lasted[one] = lasted.get(one, 0.0) + until - since
        first, *others = sorted(lasted, key=lambda one: (not one & GRAVE, not one, -lasted[one]))
        return first, lasted[first], sum(1 for one in others if one)

    def texts(self) -> list[str]:
        """Return its texts, from long to short: the gravest state, its time, the number of others."""
        gravest, lasted, others = self.gravest
        more, milliseconds = f" +{others}" * (others > 0), f" {1e3 * lasted:.0f} ms"
        own = gravest & ~self.around
        rest = words(own or gravest)
        last = words(own & GRAVE or own).rpartition(", ")[2] if own else rest
        return [words(gravest) + milliseconds + more, rest + milliseconds + more,
                last + milliseconds + more, last + milliseconds, last]  # fmt: skip

    def own(self, unit: float) -> str:
        """Return its own text on it, given the time that a letter takes; "": there is no room."""
        found = [words(self.spans[0][2])] if len(self.spans) == 1 else self.texts()[:3]
        return next((text for text in found if room(text) * unit <= self.length), "")

    def is_plain(self, unit: float) -> bool:
        """Return whether it has one color, and room for its own label."""
        return len(self.runs) == 1 and bool(self.own(unit))

    def says(self, text: str, unit: float, *, is_before: bool, says_free: bool) -> bool:
        """Take the text of the block before or after it, if there is room, and return whether there is."""
        before, after = (text, self.after) if is_before else (self.before, text)
        need = room(_joined(before, self.own(unit), says_free=says_free)) + (
            room(f"{after} →") if after else 0.0
        )
        if not self.is_plain(unit) or need * unit > self.length:
            return False
        self.before, self.after = before, after
        return True

    def within(self, unit: float) -> tuple[int, str] | None:
        """Return the number of its longest part, and the text on it for all of them, if there is room."""
        runs = self.runs
        at = max(range(len(runs)), key=lambda i: runs[i][1] - runs[i][0])
        grave = min(range(len(runs)), key=lambda i: (-SEVERITY.index(runs[i][2]), i != at))
        for text in self.texts():
            told = f"← {text}" if grave < at else f"{text} →" if grave > at else text
            if room(told) * unit <= runs[at][1] - runs[at][0]:
                return at, told
        return None

    def labels(self, unit: float) -> list[Label]:
        """Return its parts on the strip."""
        runs = self.runs
        if self.is_told or len(runs) > 1:
            at, told = (not self.is_told and self.within(unit)) or (-1, "")
            return [
                Label(begin, told, color, f"{told}; {color:08x}") if i == at
                else Label(begin, " ", color, f"short: {color:08x}")
                for i, (begin, _, color) in enumerate(runs)
            ]  # fmt: skip
        begin, until, color = runs[0]
        own = self.own(unit) or (self.within(unit) or (0, self.texts()[-1]))[1]
        rest = room(f"{self.after} →") if self.after else 0.0
        text = _joined(self.before, own, says_free=True)
        if (room(text) + rest) * unit > self.length:
            text = _joined(self.before, own, says_free=False)
        found = [Label(begin, text, color, text)]
        if self.after:
            told = f"{self.after} →"
            found.append(Label(until - room(told) * unit, told, color, f"{text}; {told}"))
        return found


def _first_untold(blocks: Sequence[_Block], unit: float) -> int | None:
    """Place the text of each block, on it or beside it; return the first block whose text has no room."""
    for block in blocks:
        block.before = block.after = ""
        block.is_told, block.around = False, 0
    for one, other in pairwise(blocks):
        one.around |= other.spans[0][2]
        other.around |= one.spans[-1][2]
    for i, block in enumerate(blocks):
        if block.is_plain(unit):
            continue
        beside = [(blocks[at], at > i) for at in (i + 1, i - 1) if 0 <= at < len(blocks)]
        block.is_told = any(
            one.says(text, unit, is_before=is_before, says_free=says_free)
            for says_free, texts in ((True, block.texts()[:4]), (False, block.texts()))
            for text in texts
            for one, is_before in beside
        )
        if not block.is_told and beside and not block.within(unit):
            return i
    return None


def _joined(before: str, own: str, *, says_free: bool) -> str:
    """Return the text of a block with that of the one before it; a free block may leave its own out."""
    if not before:
        return own
    return f"← {before}" + f" · {own}" * (says_free or own != FREE)


def room(text: str) -> float:
    """Return the number of letters of the strip that a label needs."""
    return len(text) + 2.0


def ruled(times: Sequence[float]) -> list[Label]:
    """Return the labels of a lane of times [s]."""
    shades = SLATE, mix(SLATE, BLACK, 0.4)
    return [Label(time, f"{time:g} s", shades[i % 2], f"{time:g} s") for i, time in enumerate(times)]
