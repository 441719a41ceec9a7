"""Margins as tables, as JSON, and as a picture."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.results.ci import Case
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.study.margins.margins import Margin, Margins
from rmrc.study.margins.ringing import STILL_RINGS, Judged

_WHAT = {"gain": ("gain, times", "1"), "delay": ("delay, more", "s"), "lag": ("lag, more", "s")}
_FAULTS = {
    "diverged": "diverges", "rings": "keeps ringing after the kick",
    "reverses": "oscillates from limit to limit after the kick",
}  # fmt: skip
# Smallest and largest response in the picture: a divergence has none, and rounding has a smaller one.
_LEAST, _MOST = 1e-3, 1e2


def report(margins: Margins) -> Report:
    """Return the report of margins; its condition is met if the loop is stable as written."""
    scenario, control, written = margins.scenario, margins.scenario.control, margins.written
    (delay, lag), state = margins.late, UNDEFINED if written is None else _in_words(written)
    rule, ideal = margins.gain.rule * control.feedback, margins.gain.ideal * control.feedback
    rows = [
        ("plant", scenario.plant.kind),
        ("control.period T", f"{control.period:g} s"),
        ("control.feedback K", f"{control.feedback:g} 1/s"),
        ("lateness of commands", f"{delay:g} s of dead time, {lag:g} s of lag, T/2"),
        ("as written", state),
        ("rule: K up to 1/(delay + T/2 + lag)", f"{number(rule)} 1/s"),
        ("limit of the ideal plant, K", f"{number(ideal)} 1/s"),
    ]
    headings = ("stability margin of", "by runs", "stable at", "unstable at", "ideal plant", "rule", "unit")
    title = f"{scenario.name}: stability margins, {margins.runs} runs"
    sheets = [
        Sheet(title, ("", ""), rows, frozenset({0, 1})),
        Sheet("", headings, [*map(_row, margins.all)], frozenset({0, 6}), notes=tuple(_notes(margins))),
    ]
    values = {
        "name": scenario.name, "plant": scenario.plant.kind, "period": control.period,
        "feedback": control.feedback, "delay": delay, "lag": lag, "rule": rule, "ideal": ideal,
        "written": written and _values(written), "stable": margins.is_stable,
        "margins": {margin.name: _margin(margin) for margin in margins.all},
        "runs": margins.runs, "interrupted": margins.interrupted,
    }  # fmt: skip
    problem = _problem(margins, state) if written and written.is_unstable else ""
    cases = [Case("stable", not problem, problem or "as written")] if written else []
    return Report(sheets, plain(values), lambda path: _draw(margins, path), not problem, problem, cases=cases)


def _in_words(judgment: Judged) -> str:
    """Return the state of a loop: `stable`, or its fault with the time."""
    return f"{_FAULTS[judgment.reason]} at {judgment.time:.4g} s" if judgment.is_unstable else "stable"


def _values(judgment: Judged) -> dict[str, Any]:
    return {
        "unstable": judgment.is_unstable, "reason": judgment.reason or None, "time": judgment.time,
        "left": judgment.remainder,
    }  # fmt: skip


def _margin(margin: Margin) -> dict[str, Any]:
    return {
        "value": margin.value, "found": margin.edge.is_found, "stable_at": margin.edge.low,
        "unstable_at": margin.edge.high, "bound": margin.bound, "ideal": margin.ideal, "rule": margin.rule,
        "tried": [{"value": value, **_values(judgment)} for value, judgment in margin.tried],
    }  # fmt: skip


def _row(margin: Margin) -> tuple[str, ...]:
    low, high = (number(end) if 0.0 < end < math.inf else UNDEFINED for end in margin.edge)
    value = number(margin.value) if margin.edge.is_found else f"> {low}" if margin.edge.low else f"< {high}"
    ideal = "any" if margin.ideal == math.inf else number(margin.ideal)
    return _WHAT[margin.name][0], value, low, high, ideal, number(margin.rule), _WHAT[margin.name][1]


def _notes(margins: Margins) -> list[str]:
    notes = []
    if margins.scenario.control.state == "integrated":
        notes.append(
            "control.state: integrated: the law gets no feedback from the plant, so delays cannot make it "
            'unstable. "ideal plant" and "rule" apply to a measured state.'
        )
    if ends := [
        f"{margin.name} {number(margin.bound)}" for margin in margins.all if margin.edge.high == math.inf
    ]:
        notes.append(f'">": stable in all runs; the search ends at {", ".join(ends)}.')
    if margins.interrupted:
        notes.append("Interrupted: the limits have the precision reached until then.")
    return notes


def _problem(margins: Margins, state: str) -> str:
    feedback, (low, high) = margins.scenario.control.feedback, margins.gain.edge
    fault = f"the loop is unstable as written: it {state}"
    if low > 0.0:
        most = f"{low:.3g} times its {feedback:g} 1/s, which are {low * feedback:.3g} 1/s"
        return f"{fault}; it is stable with control.feedback up to {most}"
    if margins.interrupted:
        return fault
    return f"{fault}, and remains so with {high:.2g} times its feedback: feedback is not the cause"


def _draw(margins: Margins, path: Path) -> None:
    """Draw the remaining response to a kick for each tried setting, and the limits."""
    from rmrc.show import figures

    figure = figures.sheet(1.2 + 4.0 * len(margins.all), 4.4)
    panels = figure.subplots(1, len(margins.all), sharey=True, squeeze=False)[0]
    for axes, margin in zip(panels, margins.all, strict=True):
        for is_unstable, style, label in (
            (False, "oC0", "decays: stable"), (True, "XC3", "keeps ringing: unstable"),
        ):  # fmt: skip
            points = [
                (x, judgment.remainder) for x, judgment in margin.tried if judgment.is_unstable == is_unstable
            ]
            y = np.clip([y for _, y in points], STILL_RINGS if is_unstable else _LEAST, _MOST)
            axes.plot([x for x, _ in points], y, style, label=label)
        for value, style, label in (
            (margin.value if margin.edge.is_found else math.inf, "k-", "limit by simulation"),
            (margin.ideal, "k--", "limit of the ideal plant"),
            (margin.rule, "k:", "rule 1/(delay + T/2 + lag)"),
        ):  # fmt: skip
            if 0.0 < value < math.inf:
                axes.plot([value, value], [_LEAST, _MOST], style, label=label)
        axes.set(yscale="log", xscale="log" if margin.name == "gain" else "linear")
        axes.set_xlabel("{} [{}]".format(*_WHAT[margin.name]))
    panels[0].set_ylabel("remaining response to a kick [1]")
    panels[0].legend()
    figure.suptitle(f"{figures.plain(margins.scenario.name)}: stability margins")
    figures.save(figure, [path])
