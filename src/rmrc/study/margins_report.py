"""Margins as tables, and as JSON."""

import math
from collections.abc import Iterator
from typing import Any

from rmrc.results.expectations import Case
from rmrc.show.sheets import UNDEFINED, Report, Sheet, number, plain
from rmrc.study.margins import Judged, Margin, Margins, lateness

_WHAT = {"gain": ("gain, times", "1"), "delay": ("delay, more", "s"), "lag": ("lag, more", "s")}
_FAULTS = {
    "diverged": "diverges", "rings": "keeps ringing after the kick",
    "reverses": "oscillates from limit to limit after the kick",
}  # fmt: skip
_BLIND = "control.state: integrated: the law gets no feedback from the plant, so delays cannot unsettle it."


def report(margins: Margins) -> Report:
    """Return the report of margins; its condition is met if the loop is stable as written."""
    scenario, written, gain = margins.scenario, margins.written, margins.gain
    control, (delay, lag) = scenario.control, lateness(scenario)
    state, problem = UNDEFINED if written is None else "stable", ""
    if written and written.is_unstable:
        state = f"{_FAULTS[written.reason]} at {written.time:.4g} s"
        problem = f"the loop is unstable as written: it {state}"
    if problem and gain.low:
        most = (
            f"{gain.low:.3g} times its {control.feedback:g} 1/s, which are {gain.low * control.feedback:.3g}"
        )
        problem = f"{problem}; it is stable with control.feedback up to {most} 1/s"
    facts = (
        ("plant", "plant", scenario.plant.kind, ""),
        ("period", "control.period T", control.period, "s"),
        ("feedback", "control.feedback K", control.feedback, "1/s"),
        ("delay", "dead time of commands", delay, "s"),
        ("lag", "lag of commands", lag, "s"),
        ("rule", "rule: K up to 1/(delay + T/2 + lag)", gain.rule * control.feedback, "1/s"),
        ("ideal", "limit of the ideal plant, K", gain.ideal * control.feedback, "1/s"),
    )
    rows = [(word, f"{x if isinstance(x, str) else f'{x:.4g}'} {unit}".strip()) for _, word, x, unit in facts]
    headings = ("stability margin of", "by runs", "stable at", "unstable at", "ideal plant", "rule", "unit")
    title = f"{scenario.name}: stability margins, {margins.runs} runs"
    sheets = [
        Sheet(title, ("", ""), [*rows, ("as written", state)], frozenset({0, 1})),
        Sheet("", headings, [*map(_row, margins.all)], frozenset({0, 6}), notes=tuple(_notes(margins))),
    ]
    values = {
        "name": scenario.name, **{key: value for key, _, value, _ in facts},
        "written": written and _judgment(written), "stable": margins.is_stable,
        "margins": {margin.name: _margin(margin) for margin in margins.all},
        "runs": margins.runs, "interrupted": margins.interrupted,
    }  # fmt: skip
    cases = [Case("stable", not problem, problem or "as written")] if written else []
    return Report(sheets, plain(values), met=not problem, problem=problem, cases=cases)


def _judgment(judgment: Judged) -> dict[str, Any]:
    unstable, reason = judgment.is_unstable, judgment.reason or None
    return {"unstable": unstable, "reason": reason, "time": judgment.time, "left": judgment.remainder}


def _margin(margin: Margin) -> dict[str, Any]:
    return {
        "value": margin.value, "found": margin.is_found, "stable_at": margin.low, "unstable_at": margin.high,
        "bound": margin.bound, "ideal": margin.ideal, "rule": margin.rule,
        "tried": [{"value": value, **_judgment(judgment)} for value, judgment in margin.tried],
    }  # fmt: skip


def _row(margin: Margin) -> tuple[str, ...]:
    low, high = (number(end) if 0.0 < end < math.inf else UNDEFINED for end in (margin.low, margin.high))
    value = number(margin.value) if margin.is_found else f"> {low}" if margin.low else f"< {high}"
    ideal = "any" if margin.ideal == math.inf else number(margin.ideal)
    name, unit = _WHAT[margin.name]
    return name, value, low, high, ideal, number(margin.rule), unit


def _notes(margins: Margins) -> Iterator[str]:
    if margins.scenario.control.state == "integrated":
        yield _BLIND
    endless = [f"{margin.name} {number(margin.bound)}" for margin in margins.all if margin.high == math.inf]
    if endless:
        yield f'">": stable in all runs; the search ends at {", ".join(endless)}.'
    if margins.interrupted:
        yield "Interrupted: the limits have the precision reached until then."
