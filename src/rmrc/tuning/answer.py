"""The answer of a search, described once: for the terminal, the page and the file of settings."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.results.facts import versions
from rmrc.show.sheets import Sheet, number
from rmrc.tuning.robot import GAIN_MARGIN
from rmrc.tuning.space import rounded
from rmrc.tuning.trials import CHATTER, SATURATED, TOLERANCE
from rmrc.tuning.tune import Tuned, Tuning
from rmrc.tuning.verdict import Trial

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
        "named": [_row(trial, tuned.role(trial) or "dominates as written") for trial in unique.values()],
        "margins": [
            (role, f"{math.sqrt(low * high):.3g}" if low and high < math.inf else f"> {low:.3g}")
            for role, (low, high) in tuned.margins.items()
        ],
        "limits": sorted(set(limits[np.isfinite(limits)].tolist())),
        "lines": list(_lines(tuned)),
        "block": tuned.block,
        "versions": versions(),
    }


def sheets(answer: Answer) -> list[Sheet]:
    """Return the tables of an answer: trials and limits, the front, the named settings, gain margins."""
    facts = Sheet(answer["title"], ("", ""), [tuple(fact) for fact in answer["facts"]], frozenset({0, 1}))
    if not answer["named"]:
        return [facts]
    tables = {"Pareto front": answer["front"], "Recommendations, and others": answer["named"]}
    each = [
        Sheet(title, _HEADINGS, [_UNITS, *map(_cells, rows)], frozenset({0, 1, 5}))
        for title, rows in tables.items()
    ]
    margins = Sheet("Margins, on the slowest of the robots", ("loop margin of", "gain"), answer["margins"])
    return [facts, *each, *([margins] if answer["margins"] else [])]


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
    low, high = tuned.margins.get("recommended", (0.0, math.inf))
    if high <= GAIN_MARGIN:
        lines.append(
            f"Warning: its gain margin is {math.sqrt(low * high):.3g}, below {GAIN_MARGIN:g}: if your robot "
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
    error, rate = (a / b if b else 1.0 for a, b in zip(better.worst[:2], own.worst[:2], strict=True))
    ratios = f"{error:.3g} times its error at {rate:.3g} times its peak rate"
    return f"The setting as written is dominated: {which} has {ratios}."


def _cells(row: Answer) -> tuple[str, ...]:
    figures = (number(row[name]) for name in ("error", "peak_rate", "time"))
    return (row["words"], row["numbers"], *figures, row["role"])
