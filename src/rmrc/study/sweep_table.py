"""The rows of a sweep at a glance: how the runs ended, and the extremes of the main figures."""

from collections.abc import Mapping, Sequence

from rmrc.show.sheets import UNDEFINED, Sheet, number

Extreme = tuple[str, str, tuple[float, int], tuple[float, int]]


def sheets(
    name: str, statuses: Mapping[str, int], met: int | None, extremes: Sequence[Extreme], runs: Sequence[str]
) -> list[Sheet]:
    """Return the tables.

    Args:
        name: Of the scenario.
        statuses: How many runs ended how.
        met: How many met what is expected, or None.
        extremes: Name and unit of a figure, its least value and the run that has it, its largest and its run.
        runs: What was varied in the runs that are named, in words.
    """
    total = sum(statuses.values())
    counts = [(status, str(count)) for status, count in sorted(statuses.items())]
    counts += [] if met is None else [("all expectations met", str(met))]
    rows = [(f"{figure} [{unit}]", *_end(least), *_end(most)) for figure, unit, least, most in extremes]
    return [
        Sheet(f"{name}: {total} runs", ("", ""), counts),
        Sheet("", ("figure", "least", "run", "most", "run"), rows),
        Sheet("", ("",), [(run,) for run in runs]),
    ]


def _end(end: tuple[float, int]) -> tuple[str, str]:
    value, run = end
    return (number(value), str(run)) if run >= 0 else (UNDEFINED, UNDEFINED)
