"""Margins as tables, as JSON, and as a picture."""

import math
from pathlib import Path
from typing import Any

from rmrc.results.ci import Case
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.study.margins.margins import Margin, Margins
from rmrc.study.margins.ringing import Judged

_WHAT = {
    "gain": ("gain, times", "1"), "delay": ("delay, more", "s"), "lag": ("lag, more", "s"),
}  # fmt: skip


def report(found: Margins) -> Report:
    """Return the report of margins; its condition is met if the loop is stable as written."""
    sheets = [_loop(found), _edges(found)]
    return Report(
        sheets, plain(_values(found)), lambda path: _draw(found, path), _holds(found), _problem(found),
        cases=[Case("stable", _holds(found), _problem(found) or "as written")] if found.written else [],
    )  # fmt: skip


def _holds(found: Margins) -> bool:
    return found.written is None or not found.written.is_unstable


def in_words(one: Judged) -> str:
    """Return the state of a loop: `stable`, or its fault with the time."""
    if one.reason == "diverged":
        return f"diverges at {one.time:.4g} s"
    what = {"rings": "keeps ringing", "reverses": "oscillates from limit to limit"}
    return f"{what[one.reason]} after the kick at {one.time:.4g} s" if one.is_unstable else "stable"


def _problem(found: Margins) -> str:
    if found.written is None or not found.written.is_unstable:
        return ""
    feedback, (low, high) = found.scenario.control.feedback, found.gain.edge
    told = f"the loop is unstable as written: it {in_words(found.written)}"
    if low > 0.0:
        most = f"{low:.3g} times its {feedback:g} 1/s, which are {low * feedback:.3g} 1/s"
        return f"{told}; it is stable with control.feedback up to {most}"
    if found.interrupted:
        return told
    return f"{told}, and remains so with {high:.2g} times its feedback: feedback is not the cause"


def _loop(found: Margins) -> Sheet:
    control, (delay, lag) = found.scenario.control, found.late
    rows = [
        ("plant", found.scenario.plant.kind),
        ("control.period T", f"{control.period:g} s"),
        ("control.feedback K", f"{control.feedback:g} 1/s"),
        ("lateness of commands", f"{delay:g} s of dead time, {lag:g} s of lag, T/2"),
        ("as written", UNDEFINED if found.written is None else in_words(found.written)),
        ("rule: K up to 1/(delay + T/2 + lag)", f"{number(found.rule)} 1/s"),
        ("limit of the ideal plant, K", f"{number(found.ideal)} 1/s"),
    ]
    title = f"{found.scenario.name}: stability margins, {found.runs} runs"
    return Sheet(title, ("", ""), rows, frozenset({0, 1}))


def _edges(found: Margins) -> Sheet:
    headings = ("stability margin of", "by runs", "stable at", "unstable at", "ideal plant", "rule", "unit")
    rows = [_row(one) for one in found.all]
    notes = []
    if found.scenario.control.state == "integrated":
        notes.append(
            "control.state: integrated: the law gets no feedback from the plant, so delays cannot make it "
            'unstable. "ideal plant" and "rule" apply to a measured state.'
        )
    if open_ := [one for one in found.all if one.edge.high == math.inf]:
        what = ", ".join(f"{one.name} {number(one.bound)}" for one in open_)
        notes.append(f'">": stable in all runs; the search ends at {what}.')
    if found.interrupted:
        notes.append("Interrupted: the limits have the precision reached until then.")
    return Sheet("", headings, rows, frozenset({0, 6}), notes=tuple(notes))


def _row(one: Margin) -> tuple[str, ...]:
    low, high = one.edge
    found = (
        number(one.value) if one.edge.is_found else f"> {number(low)}" if low > 0.0 else f"< {number(high)}"
    )
    ends = [number(end) if 0.0 < end < math.inf else UNDEFINED for end in (low, high)]
    ideal = "any" if one.ideal == math.inf else number(one.ideal)
    what, unit = _WHAT[one.name]
    return what, found, *ends, ideal, number(one.rule), unit


def _values(found: Margins) -> dict[str, Any]:
    control, (delay, lag) = found.scenario.control, found.late
    return {
        "name": found.scenario.name, "plant": found.scenario.plant.kind, "period": control.period,
        "feedback": control.feedback, "delay": delay, "lag": lag, "rule": found.rule, "ideal": found.ideal,
        "written": found.written and _judged(found.written), "stable": found.is_stable,
        "margins": {one.name: _margin(one) for one in found.all},
        "runs": found.runs, "interrupted": found.interrupted,
    }  # fmt: skip


def _margin(one: Margin) -> dict[str, Any]:
    return {
        "value": one.value, "found": one.edge.is_found, "stable_at": one.edge.low,
        "unstable_at": one.edge.high, "bound": one.bound, "ideal": one.ideal, "rule": one.rule,
        "tried": [{"value": value, **_judged(what)} for value, what in one.tried],
    }  # fmt: skip


def _judged(one: Judged) -> dict[str, Any]:
    return {"unstable": one.is_unstable, "reason": one.reason or None, "time": one.time, "left": one.left}


def _draw(found: Margins, path: Path) -> None:
    from rmrc.study.margins.figure import draw_margins

    draw_margins(found, path)
