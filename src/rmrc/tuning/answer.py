"""The answer of a search, as rows and facts: for the terminal, the page and the file of settings."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

from rmrc.results.run import versions
from rmrc.show.sheets import Sheet, number
from rmrc.support.text import listed
from rmrc.tuning.space import AT_SINGULARITY, NUMBERS, WORDS
from rmrc.tuning.tune import Tuned, Tuning
from rmrc.tuning.verdict import Trial

ROLES = ("recommended", "second best", "as written", "dominates as written", "exceeds a limit")
# Figures of a setting in its row, by the headings of their columns, with their units.
FIGURES = {"error": "m", "nominal": "m", "end": "m", "peak rate": "rad/s", "time": "s"}

Row: TypeAlias = Mapping[str, Any]


def rows_of(tuned: Tuned) -> list[Row]:
    """Return a row per setting, in the order of trial: its keys, its worst outcome, and what became of it."""
    verdict = tuned.verdict
    better = verdict.better if verdict.better is not verdict.recommended else None
    each = verdict.recommended, verdict.second, tuned.own, better, verdict.close
    roles = dict(zip(ROLES, each, strict=True))
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
        figures = zip(map(_column, FIGURES), _figures(trial), strict=True)
        rows.append({**trial.setting.values, **trial.worst._asdict(), **dict(figures), **about})
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
    headings, units = ("setting", "numbers", *FIGURES, ""), ("", "", *FIGURES.values(), "")
    tables = {"Pareto front": front(rows), "Recommendations, and others": named(rows)}
    return [Sheet(about["name"], ("", ""), [tuple(it) for it in about["facts"]], frozenset({0, 1}))] + [
        Sheet(title, headings, [units, *map(_cells, some)], frozenset({0, 1, 7}))
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


def _column(heading: str) -> str:
    return heading.replace(" ", "_")


def _cells(row: Row) -> tuple[str, ...]:
    figures = (number(row[_column(name)]) for name in FIGURES)
    return (words(row), numbers(row), *figures, row["role"] or "")


def _facts(work: Tuning, tuned: Tuned) -> Iterator[tuple[str, str]]:
    """Yield what was tried, and on what."""
    robot, options = work.robot, work.options
    feasible = f"{len(tuned.feasible)} keep the limits on every scenario"
    yield "settings", f"{len(tuned.tried)} in {tuned.runs} runs; {feasible}"
    start = f"start {math.degrees(options.start):.4g} deg"
    sizes = ", ".join((start, f"target {options.offset:g} m", *robot.weights))
    off = f" and {len(work.scenarios) - 1} perturbed by at most: {sizes}"
    yield "tried on", f"the scenario{off if options.perturbed else ''}"
    words = ": ".join(filter(None, (robot.origin, robot.words))) or "as the scenario has it"
    hint = "" if robot.words and not robot.origin else "; give yours by --delay, --lag and --noise"
    yield "robot", f"{words}, with a gain margin of at least {options.margin:g}{hint}"
    for reason in work.left_out:
        yield "not possible", reason


def _lines(tuned: Tuned) -> Iterator[str]:
    """Yield doubts about the recommended setting, the judgment of that as written, and what decided."""
    verdict, written = tuned.verdict, tuned.own.worst
    best, better, close, nearest = verdict.recommended, verdict.better, verdict.close, verdict.nearest
    if best is None:
        if nearest:
            which = f"the nearest is {_name(nearest)}: {nearest.worst.missed}"
            yield f"no tried setting keeps the limits; {which}"
        return
    if tuned.is_worse:
        times = best.worst.error / written.error
        yield f"The recommended setting has {times:.3g} times the error of the setting as written."
    if close:
        times = close.worst.error / best.worst.error
        yield f"With {times:.3g} times its error, {_name(close)} breaks a limit: {close.worst.missed}."
    if not tuned.own.keeps_limits:
        yield f"The setting as written violates a limit: {written.missed}."
    elif better is None:
        yield "The setting as written is not dominated by any other within the limits."
    else:
        which = "the recommended setting" if better is best else words(better.setting.values)
        # a dominated setting has the larger error or peak rate; if one of them is 0, it is 0 in both
        error, rate = (a / b if b else 1.0 for a, b in zip(better.worst[:2], written[:2], strict=True))
        ratios = f"{error:.3g} times its error at {rate:.3g} times its peak rate"
        yield f"The setting as written is dominated: {which} has {ratios}."
    first, second = ([number(it) for it in _figures(trial)] for trial in (best, verdict.second or best))
    ahead = [name for name, a, b in zip(FIGURES, first, second, strict=True) if float(b) < float(a)]
    if ahead:
        yield f"The second best has less {listed(ahead)}; what decided is {verdict.decided}."
    if tuned.per_kilogram:
        costs = (f"{1e3 * length:.3g} mm and {1e3 * angle:.3g} mrad" for length, angle in tuned.per_kilogram)
        yield "A kilogram moves the end of the path by {}; as written, by {}.".format(*costs)


def _figures(trial: Trial) -> tuple[float, ...]:
    """Return the values of `FIGURES`."""
    return trial.worst.error, trial.nominal, trial.end, trial.worst.peak_rate, trial.worst.time


def _name(trial: Trial) -> str:
    return f"{words(trial.setting.values)} ({numbers(trial.setting.values)})"
