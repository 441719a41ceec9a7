"""What happens to a run, in words, on one strip: each state once, and short ones long enough to be read."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario.choices import Status
from rmrc.show.palette import GRAVE, RED, of_status

# Letters that the strip has room for in a window of 1280 points, if nothing else is known.
LETTERS = 80.0
FREE = "free"


class Label(NamedTuple):
    """A part of the strip, up to the next label.

    Attributes:
        time: Where it begins [s].
        text: On it.
        color: 0xRRGGBBAA.
    """

    time: float
    text: str
    color: int


@cache
def words(status: int) -> str:
    """Return a status as words.

    >>> words(Status.DAMPED | Status.RATE_LIMITED), words(0)
    ('damped, rate limited', 'free')
    """
    return ", ".join(str(one.name).lower().replace("_", " ") for one in Status if one & status) or FREE


class Strip:
    """The statuses of a run, of which the labels of its strip are made in the end."""

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
        self._last = [Label(time, text, RED)]

    def held(self, end: float) -> dict[Status, float]:
        """Return how long each status holds that ever does [s].

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
        """Return the labels of the whole strip.

        States too short for a label share one, which names the gravest of them and says how long it lasts.

        Args:
            end: End of the run [s].
            letters: That the strip has room for.
        """
        found, spans, i, begin = list[Label](), self._spans(end), 0, 0.0
        while i < len(spans):
            begin, (_, until, one) = max(begin, spans[i][0]), spans[i]
            if until - begin >= room(words(one), letters) * end or len(spans) == 1:
                found.append(Label(begin, words(one), of_status(one)))
                i += 1
                continue
            # From here to where a label ends: all that is under it, and the rest of the last one after it.
            last = i
            while last + 1 < len(spans) and not _fits(spans[i : last + 1], begin, end, letters):
                last += 1
            since, until, after = spans[last]
            stop, need = begin, max(begin, since)
            while stop < min(need, until):  # what the label says depends on where it ends
                stop = min(need, until)
                need = begin + room(_shared(spans[i : last + 1], begin, stop).text, letters) * end
            goes_on = last > i and until - stop >= room(words(after), letters) * end
            found.append(_shared(spans[i : last + 1], begin, stop if goes_on else until))
            i, begin = (last, stop) if goes_on else (last + 1, begin)
        return _with_room_at_the_end(found, end, letters) + self._last


def room(text: str, letters: float = LETTERS) -> float:
    """Return the share of the strip that a label needs."""
    return (len(text) + 2) / letters


def _fits(spans: Sequence[tuple[float, float, int]], begin: float, end: float, letters: float) -> bool:
    """Return whether the label of some states has the room for it until the last of them ends."""
    until = spans[-1][1]
    return until - begin >= room(_shared(spans, begin, until).text, letters) * end


def _with_room_at_the_end(labels: list[Label], end: float, letters: float) -> list[Label]:
    """Begin the last label earlier if it lacks room, where the one before has more than it needs.

    If that does not suffice, it gets a shorter text, with the most serious status.
    """
    if len(labels) > 1:
        before, last = labels[-2:]
        earliest = before.time + room(before.text, letters) * end
        while ", " in last.text and earliest + room(last.text, letters) * end > end:
            last = last._replace(text=last.text.partition(", ")[2])
        earlier = max(earliest, end - room(last.text, letters) * end)
        labels[-1] = last._replace(time=min(last.time, earlier))
    return labels


def _shared(spans: Sequence[tuple[float, float, int]], begin: float, end: float) -> Label:
    """Return the label of several states: the gravest, how long it lasts, and how many others there are."""
    lasted: dict[int, float] = {}
    for since, until, one in spans:
        lasted[one] = lasted.get(one, 0.0) + min(until, end) - max(since, begin)
    together = 0
    for one in lasted:
        together |= one
    ranked = sorted(lasted, key=lambda one: (not one & GRAVE, not one, -lasted[one]))
    texts = [f"{words(one)} {1e3 * lasted[one]:.0f} ms" for one in ranked if one or len(lasted) == 1]
    more = f" +{len(texts) - 1}" * (len(texts) > 1)
    return Label(begin, texts[0] + more, of_status(together))
