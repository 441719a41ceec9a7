"""Tables of a search: the Pareto front, the recommendations, and their cost relative to others."""

from collections.abc import Sequence
from typing import NamedTuple

from rmrc.show.sheets import Sheet, number

# Number of displayed rows of the front; the file has all.
MOST_ROWS = 12


class Row(NamedTuple):
    """A setting and its results.

    Attributes:
        name: Its role: recommended, second best, as written, or "".
        words: Method, schedule and policy at a singularity.
        numbers: In words.
        error: [m].
        peak_rate: [rad/s].
        time: [s].
    """

    name: str
    words: str
    numbers: str
    error: float
    peak_rate: float
    time: float


def heading(title: str, facts: Sequence[tuple[str, str]]) -> Sheet:
    """Return the first table: trials and limits."""
    return Sheet(title, ("", ""), facts, frozenset({0, 1}))


def sheets(
    title: str, facts: Sequence[tuple[str, str]], front: Sequence[Row], named: Sequence[Row]
) -> list[Sheet]:
    """Return the tables.

    Args:
        title: Title of the tables.
        facts: Trials and limits: names and values in words.
        front: Nondominated settings, by rising peak rate.
        named: Recommended, second best if there is one, and as written.
    """
    rows, (best, *others) = shown(front, named), named
    headings = ("setting", "numbers", "error", "peak rate", "time", "")
    units = ("", "", "m", "rad/s", "s", "")
    title_of_front = f"Pareto front, {len(rows)} of its {len(front)} settings"
    left = frozenset({0, 1, 5})
    costs = Sheet(
        "The recommended setting costs (+) or saves (-)",
        ("against", "error", "", "peak rate", "", "time", ""),
        [(one.name, *_against(best, one)) for one in others],
    )
    return [
        heading(title, facts),
        Sheet(title_of_front, headings, [units, *map(_cells, rows)], left),
        Sheet("Recommendations, and others", headings, [units, *map(_cells, named)], left),
        *([costs] if others else []),
    ]


def margins(rows: Sequence[tuple[str, ...]]) -> Sheet:
    """Return the table of stability margins: name, and margins of gain, delay and lag."""
    headings, units = ("loop margin of", "gain", "more delay", "more lag"), ("", "times", "ms", "ms")
    return Sheet("Margins, on the slowest of the robots", headings, [units, *rows], frozenset({0}))


def shown(front: Sequence[Row], named: Sequence[Row]) -> list[Row]:
    """Return the displayed rows of a front: evenly, up to the largest error with a name."""
    largest = max(one.error for one in named)
    near = [one for one in front if one.error <= largest] or list(front)
    # of rows with the same displayed digits, the one with a name, or the last, with the smallest error
    alike: dict[tuple[str, str], Row] = {}
    for one in near:
        key = number(one.error), number(one.peak_rate)
        alike[key] = alike[key] if key in alike and alike[key].name and not one.name else one
    near = list(alike.values())
    if len(near) <= MOST_ROWS:
        return near
    chosen = {round(i * (len(near) - 1) / (MOST_ROWS - 1)) for i in range(MOST_ROWS)}
    return [one for i, one in enumerate(near) if i in chosen or one.name]


def _cells(row: Row) -> tuple[str, ...]:
    return row.words, row.numbers, number(row.error), number(row.peak_rate), number(row.time), row.name


def _against(best: Row, other: Row) -> list[str]:
    """Return ratio and difference of error, peak rate and time."""
    cells = []
    for own, its, unit in zip(best[3:], other[3:], ("m", "rad/s", "s"), strict=True):
        cells += [f"x {number(own / its)}" if its else "", f"{own - its:+.3g} {unit}"]
    return cells
