"""The answer of a search, as rows and facts: for the terminal, the page and the file of settings."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

from rmrc.results.facts import versions
from rmrc.show.sheets import Sheet, number
from rmrc.tuning.space import AT_SINGULARITY, NUMBERS, WORDS
from rmrc.tuning.tune import Tuned, Tuning

ROLES = ("recommended", "second best", "as written", "dominates as written")

Row: TypeAlias = Mapping[str, Any]


def rows_of(tuned: Tuned) -> list[Row]:
    """Return a row per setting, in the order of trial: its keys, its worst outcome, and what became of it."""
    verdict = tuned.verdict
    better = verdict.better if verdict.better is not verdict.recommended else None
    roles = dict(zip(ROLES, (verdict.recommended, verdict.second, tuned.own, better), strict=True))
    rows = list[Row]()
    for index, trial in enumerate(tuned.tried):
        names = [role for role, other in roles.items() if other is trial]
        about = {
            "index": index,
            "role": ", ".join(names) or None,
            "scenarios": sum(world < len(tuned.scenarios) for world in trial.outcomes),
            "feasible": trial in tuned.feasible,
            "on_front": trial in verdict.front,
        }
        rows.append({**trial.setting.values, **trial.worst._asdict(), **about})
    return rows


def about(work: Tuning, tuned: Tuned) -> Row:
    """Return what the rows do not say, ready for JSON.

    Its keys: the `name` of the scenario; `facts` about the trials; `lines` of judgment; the `block` to paste;
    `versions`.
    """
    return {
        "name": work.scenario.name,
        "facts": list(_facts(work, tuned)),
        "lines": list(_lines(tuned)),
        "block": tuned.block,
        "versions": versions(),
    }


def named(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with a role, the recommended one first; none if there is no such."""
    known = [row for role in ROLES for row in rows if (row["role"] or "").split(",")[0] == role]
    return known if known[0]["role"].startswith(ROLES[0]) else []


def front(rows: Sequence[Row]) -> list[Row]:
    """Return the rows on the Pareto front, by rising peak rate."""
    return sorted((row for row in rows if row["on_front"]), key=lambda row: (row["peak_rate"], -row["error"]))


def sheets(about: Row, rows: Sequence[Row]) -> list[Sheet]:
    """Return the tables of an answer: facts, and if there is a front, this and the settings with a role."""
    headings, units = (
        ("setting", "numbers", "error", "peak rate", "time", ""),
        ("", "", "m", "rad/s", "s", ""),
    )
    tables = {"Pareto front": front(rows), "Recommendations, and others": named(rows)}
    return [Sheet(about["name"], ("", ""), [tuple(it) for it in about["facts"]], frozenset({0, 1}))] + [
        Sheet(title, headings, [units, *map(_cells, some)], frozenset({0, 1, 5}))
        for title, some in tables.items()
        if some
    ]


def words(row: Row) -> str:
    """Return the choices of a setting: `damped, constant`; without `damp`, the usual policy."""
    return ", ".join(
        row[key] for key in WORDS if row.get(key) and (key, row[key]) != (AT_SINGULARITY, "damp")
    )


def numbers(row: Row) -> str:
    """Return the numbers of a setting: `maximum 0.1, below 0.3, feedback 20`."""
    values = {key.split(".")[-1]: row.get(key, math.nan) for key in NUMBERS}
    return ", ".join(f"{name} {value:.6g}" for name, value in values.items() if not math.isnan(value))


def _cells(row: Row) -> tuple[str, ...]:
    figures = (number(row[name]) for name in ("error", "peak_rate", "time"))
    return (words(row), numbers(row), *figures, row["role"] or "")


def _facts(work: Tuning, tuned: Tuned) -> Iterator[tuple[str, str]]:
    """Yield what was tried, and on what."""
    robot, options = work.robot, work.options
    feasible = f"{len(tuned.feasible)} keep the limits on every scenario"
    yield "settings", f"{len(tuned.tried)} in {tuned.runs} runs; {feasible}"
    start = f"start {math.degrees(options.start):.4g} deg"
    sizes = f"{start}, target {options.offset:g} m, payload {options.payload:g} kg"
    off = f" and {len(work.scenarios) - 1} perturbed by at most: {sizes}"
    yield "tried on", f"the scenario{off if options.perturbed else ''}"
    words = ": ".join(filter(None, (robot.origin, robot.words))) or "as the scenario has it"
    hint = "" if robot.words and not robot.origin else "; give yours by --delay, --lag and --noise"
    yield "robot", f"{words}, with a gain margin of at least {options.margin:g}{hint}"
    for reason in work.left_out:
        yield "not possible", reason


def _lines(tuned: Tuned) -> Iterator[str]:
    """Yield the judgment of the setting as written, and doubts about the recommended one."""
    own, better, nearest = tuned.own, tuned.verdict.better, tuned.verdict.nearest
    if nearest is not None:
        which = f"{words(nearest.setting.values)} ({numbers(nearest.setting.values)})"
        yield f"no tried setting keeps the limits; the nearest is {which}: {nearest.worst.missed}"
        return
    if not own.keeps_limits:
        yield f"The setting as written violates a limit: {own.worst.missed}."
    elif better is None:
        yield "The setting as written is not dominated by any other within the limits."
    else:
        which = (
            "the recommended setting" if better is tuned.verdict.recommended else words(better.setting.values)
        )
        # a dominated setting has the larger error or peak rate; if one of them is 0, it is 0 in both
        error, rate = (a / b if b else 1.0 for a, b in zip(better.worst[:2], own.worst[:2], strict=True))
        ratios = f"{error:.3g} times its error at {rate:.3g} times its peak rate"
        yield f"The setting as written is dominated: {which} has {ratios}."
