"""The answer of a search, described once: for the terminal, the page and the file of settings."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.results.facts import versions
from rmrc.show.sheets import Sheet, number
from rmrc.study.margins.margins import Margin
from rmrc.tuning.robot import GAIN_MARGIN
from rmrc.tuning.space import rounded
from rmrc.tuning.trials import CHATTER, SATURATED, TOLERANCE
from rmrc.tuning.tune import Tuned, Tuning
from rmrc.tuning.verdict import ALIKE, Trial

# Number of displayed rows of the front; the file has all.
MOST_ROWS = 12
_HEADINGS, _UNITS = ("setting", "numbers", "error", "peak rate", "time", ""), ("", "", "m", "rad/s", "s", "")

Answer: TypeAlias = Mapping[str, Any]


def answer_of(work: Tuning, tuned: Tuned) -> Answer:
    """Return the answer as strict JSON.

    Its keys: the `name` of the scenario; a `title`; `facts` about the trials; rows of the `front` and of the
    `named` settings, the recommended one first; `margins`; finite rate `limits`; `lines` of judgment; the
    `block` to paste; `versions`.
    """
    verdict, limits = tuned.verdict, tuned.limits.rate / tuned.limits.scale
    named = [verdict.recommended, verdict.second, tuned.own, verdict.better] if tuned.feasible else []
    unique = {id(trial): trial for trial in named if trial is not None}
    whole = f"{len(tuned.feasible)} were tried on every perturbed scenario and keep the limits"
    return {
        "name": work.scenario.name,
        "title": f"{work.scenario.name}: {len(tuned.tried)} settings in {tuned.runs} runs; {whole}",
        "facts": _facts(work, tuned),
        "front": [_row(trial, tuned.role(trial)) for trial in verdict.front],
        "named": [
            _row(trial, tuned.role(trial) or "dominates as written") for trial in unique.values()
        ],
        "margins": [
            (name, _bears(found.gain, 1.0), _bears(found.delay, 1e3), _bears(found.lag, 1e3))
            for name, found in tuned.margins.items()
        ],
        "limits": sorted(set(limits[np.isfinite(limits)].tolist())),
        "lines": list(_lines(tuned)),
        "block": tuned.block,
        "versions": versions(),
    }


def sheets(answer: Answer) -> list[Sheet]:
    """Return the tables of an answer: trials and limits, the front, the named settings, costs, margins."""
    front, named = answer["front"], answer["named"]
    facts = Sheet(answer["title"], ("", ""), [tuple(fact) for fact in answer["facts"]], frozenset({0, 1}))
    if not named:
        return [facts]
    best, *others = named
    rows, words = _shown(front, named), frozenset({0, 1, 5})
    title = f"Pareto front, {len(rows)} of its {len(front)} settings"
    against = ("against", "error", "", "peak rate", "", "time", "")
    costs = [(other["role"], *_against(best, other)) for other in others]
    margins = ("loop margin of", "gain", "more delay", "more lag"), ("", "times", "ms", "ms")
    return [
        facts,
        Sheet(title, _HEADINGS, [_UNITS, *map(_cells, rows)], words),
        Sheet("Recommendations, and others", _HEADINGS, [_UNITS, *map(_cells, named)], words),
        *([Sheet("The recommended setting costs (+) or saves (-)", against, costs)] if costs else []),
        *([Sheet("Margins, on the slowest of the robots", margins[0],
                 [margins[1], *map(tuple, answer["margins"])])] if answer["margins"] else []),
    ]  # fmt: skip


def words(trial: Trial) -> str:
    """Return a structure in words: `damped, constant`, and choices other than `damp` and the scenario's."""
    structure = trial.setting.structure
    policy = structure.at_singularity.replace("damp", "")
    return ", ".join(filter(None, (structure.method, structure.schedule, policy, structure.on_excess)))


def _numbers(trial: Trial) -> str:
    """Return the numbers in words: `maximum 0.1, below 0.3, feedback 20`."""
    short = {
        key.removeprefix("control.").removeprefix("inverse.").removeprefix("damping."): value
        for key, value in trial.setting.by_key.items()
    }
    return ", ".join(f"{key} {value:.6g}" for key, value in short.items())


def _row(trial: Trial, role: str) -> dict[str, Any]:
    worst = trial.worst
    return {
        "role": role, "words": words(trial), "numbers": _numbers(trial), "error": worst.error,
        "peak_rate": worst.peak_rate, "time": worst.time,
    }  # fmt: skip


def _facts(work: Tuning, tuned: Tuned) -> list[tuple[str, str]]:
    """Return the limits and the trials."""
    limits, perturbed = tuned.limits, len(tuned.scenarios) - 1
    whose = "the setting as written"
    if tuned.own.worst.completed < 1.0:
        whose += ", or of the path if that does not complete it"
    spread = work.spread.words(work.nominal)
    off = f"and {perturbed} perturbed scenario{'s' * (perturbed != 1)}: {spread}" if perturbed else "alone"
    lines = [
        ("tried on", f"the scenario {off}"),
        ("robot", _robot(work)),
        ("rates", _allowed(limits.rate, "rate", limits.units, "/s")),
        ("accelerations", _allowed(limits.acceleration, "acceleration", limits.units, "/s²")),
        ("time", f"at most {work.slower:g} times that of {whose}, for each perturbed scenario"),
        ("chatter", f"at most {CHATTER:g} sign changes of a joint's commanded acceleration per second"),
        ("torque", f"at its limit for at most {SATURATED:.0%} of the time"),
    ]
    if work.loops:
        every = f"on {len(work.loops)} more loops, evenly spaced from the fastest to the slowest"
        lines.append(("final checks", f"the recommended and the second best setting, {every}"))
    return lines + [("not possible", reason) for reason in work.left_out]


def _robot(work: Tuning) -> str:
    """Return on which robots it was tried, and how to give others, in a line."""
    robot, margin = work.robot, f", with a gain margin of {work.margin:g}" if work.margin > 1.0 else ""
    if robot.is_assumed:
        return f"assumed: {robot.words}{margin}; give yours by --delay, --lag and --noise"
    if robot.profile:
        return f"{robot.words}, as the profile {robot.profile} has it{margin}"
    if robot.words:
        return f"{robot.words}{margin}"
    return f"as the scenario has it{margin}: --delay, --lag and --noise give a range"


def _allowed(values: NDArray[np.float64], what: str, units: Sequence[str], per: str) -> str:
    """Return a limit in words."""
    if not np.isfinite(values).any():
        return f"no limit; control.limits.{what} sets one"
    each = [f"{value:.4g} {unit}{per}" for value, unit in zip(values, units, strict=True)]
    text = each[0] if len(set(each)) == 1 else ", ".join(each)
    return f"at most {text}, measured, and {TOLERANCE:.0%} for overshoot"


def _lines(tuned: Tuned) -> list[str]:
    """Return the judgment: of the setting as written, of equals, and doubts about the recommended one."""
    best, nearest = tuned.verdict.recommended, tuned.verdict.nearest
    if nearest is not None:
        which = f"{words(nearest)} ({_numbers(nearest)})"
        return [f"no tried setting keeps the limits; the nearest is {which}: {nearest.worst.missed}"]
    assert best is not None  # something is feasible
    lines = [_as_written(tuned)]
    if tuned.verdict.alike:
        names = "; ".join(dict.fromkeys(map(words, tuned.verdict.alike)))
        lines.append(f"As good, within {ALIKE:.0%} of error: {names}.")
    margin = tuned.margins.get("recommended")
    if margin and margin.gain.edge.high <= GAIN_MARGIN:
        lines.append(
            f"Warning: its gain margin is {margin.gain.value:.3g}, below {GAIN_MARGIN:g}: if your robot "
            f"may be slower than assumed here, use less feedback, by --gain-margin {GAIN_MARGIN:g}."
        )
    for key, value in {} if best.setting.is_written else best.setting.by_key.items():
        if value in map(rounded, tuned.bounds.get(key, ())):
            lines.append(
                f"Warning: {key} is at its search bound, {value:.6g}: values beyond were not tried; --only "
                f"{key}=V1,V2 tries values of your choice."
            )
    return lines


def _as_written(tuned: Tuned) -> str:
    """Return the judgment of the setting as written."""
    own, better = tuned.own, tuned.verdict.better
    if not own.keeps_limits:
        return f"The setting as written violates a limit: {own.worst.missed}."
    if better is None and own not in tuned.feasible:
        return "The setting as written is outside --only; no setting within --only dominates it."
    if better is None:
        return "The setting as written is on the Pareto front: no tried setting dominates it."
    which = "the recommended setting" if better is tuned.verdict.recommended else words(better)
    # a dominated setting has the larger error or peak rate; if one of them is 0, it is 0 in both
    error, rate = (f"{a / b if b else 1.0:.3g}" for a, b in zip(better.worst[:2], own.worst[:2], strict=True))
    return f"The setting as written is dominated: {which} has {error} times its error at {rate} times its peak rate."


def _bears(margin: Margin | None, scale: float) -> str:
    if margin is None:
        return "none"
    value = scale * margin.value
    text = f"{value:.3g}" if value < 1000 else f"{value:.0f}"
    return text if margin.edge.is_found else f"> {text}"


def _shown(front: Sequence[Answer], named: Sequence[Answer]) -> list[Answer]:
    """Return the displayed rows of a front: evenly, up to the largest error with a name."""
    largest = max(row["error"] for row in named)
    near = [row for row in front if row["error"] <= largest] or list(front)
    chosen = {round(i * (len(near) - 1) / (MOST_ROWS - 1)) for i in range(MOST_ROWS)}
    is_short = len(near) <= MOST_ROWS
    return [row for i, row in enumerate(near) if is_short or i in chosen or row["role"]]


def _cells(row: Answer) -> tuple[str, ...]:
    figures = (number(row[name]) for name in ("error", "peak_rate", "time"))
    return (row["words"], row["numbers"], *figures, row["role"])


def _against(best: Answer, other: Answer) -> list[str]:
    """Return ratio and difference of error, peak rate and time."""
    cells = []
    for name, unit in (("error", "m"), ("peak_rate", "rad/s"), ("time", "s")):
        a, b = best[name], other[name]
        cells += [f"x {number(a / b)}" if b else "", f"{a - b:+.3g} {unit}"]
    return cells
