"""The summary of a sweep as tables."""

from collections.abc import Callable

from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.study.summary import Summary


def sheets(name: str, found: Summary, label: Callable[[int], str]) -> list[Sheet]:
    """Return the tables.

    Args:
        name: Name of the scenario.
        found: Summary of the rows.
        label: Function from a run to its varied keys in words.
    """
    counts = [(status, str(count)) for status, count in sorted(found.statuses.items())]
    counts += [] if found.met is None else [("all expectations met", str(found.met))]
    rows = [
        (f"{one.column.name} [{one.column.unit}]", *_end(one.least), *_end(one.most))
        for one in found.extremes
    ]
    named = sorted({run for one in found.extremes for _, run in (one.least, one.most) if run >= 0})
    return [
        Sheet(f"{name}: {sum(found.statuses.values())} runs", ("", ""), counts),
        Sheet("", ("metric", "least", "run", "most", "run"), rows),
        Sheet("", ("",), [(label(run),) for run in named]),
    ]


def _end(end: tuple[float, int]) -> tuple[str, str]:
    value, run = end
    return (number(value), str(run)) if run >= 0 else (UNDEFINED, UNDEFINED)
