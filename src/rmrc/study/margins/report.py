"""Margins as tables, as JSON, and as a picture."""

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.results.expectations import Case
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.study.margins.margins import Margin, Margins
from rmrc.study.margins.ringing import STILL_RINGS, Judged, lateness

_WHAT = {"gain": ("gain, times", "1"), "delay": ("delay, more", "s"), "lag": ("lag, more", "s")}
_FAULTS = {
    "diverged": "diverges", "rings": "keeps ringing after the kick",
    "reverses": "oscillates from limit to limit after the kick",
}  # fmt: skip
_BLIND = (
    "control.state: integrated: the law gets no feedback from the plant, so delays cannot make it unstable. "
    '"ideal plant" and "rule" apply to a measured state.'
)
# Smallest and largest response in the picture: a divergence has none, and rounding has a smaller one.
_LEAST, _MOST = 1e-3, 1e2


def report(margins: Margins) -> Report:
    """Return the report of margins; its condition is met if the loop is stable as written."""
    scenario, control, written = margins.scenario, margins.scenario.control, margins.written
    delay, lag = lateness(scenario)
    state = UNDEFINED if written is None else "stable"
    if written and written.is_unstable:
        state = f"{_FAULTS[written.reason]} at {written.time:.4g} s"
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
    return Report(sheets, plain(values), partial(_draw, margins), not problem, problem, cases=cases)


def _values(judgment: Judged) -> dict[str, Any]:
    unstable, reason = judgment.is_unstable, judgment.reason or None
    return {"unstable": unstable, "reason": reason, "time": judgment.time, "left": judgment.remainder}


def _margin(margin: Margin) -> dict[str, Any]:
    return {
        "value": margin.value, "found": margin.is_found, "stable_at": margin.low, "unstable_at": margin.high,
        "bound": margin.bound, "ideal": margin.ideal, "rule": margin.rule,
        "tried": [{"value": value, **_values(judgment)} for value, judgment in margin.tried],
    }  # fmt: skip


def _row(margin: Margin) -> tuple[str, ...]:
    low, high = (number(end) if 0.0 < end < math.inf else UNDEFINED for end in (margin.low, margin.high))
    value = number(margin.value) if margin.is_found else f"> {low}" if margin.low else f"< {high}"
    ideal = "any" if margin.ideal == math.inf else number(margin.ideal)
    return _WHAT[margin.name][0], value, low, high, ideal, number(margin.rule), _WHAT[margin.name][1]


def _notes(margins: Margins) -> Iterator[str]:
    if margins.scenario.control.state == "integrated":
        yield _BLIND
    endless = [f"{margin.name} {number(margin.bound)}" for margin in margins.all if margin.high == math.inf]
    if endless:
        yield f'">": stable in all runs; the search ends at {", ".join(endless)}.'
    if margins.interrupted:
        yield "Interrupted: the limits have the precision reached until then."


def _problem(margins: Margins, state: str) -> str:
    feedback, gain = margins.scenario.control.feedback, margins.gain
    fault = f"the loop is unstable as written: it {state}"
    if gain.low > 0.0:
        most = f"{gain.low:.3g} times its {feedback:g} 1/s, which are {gain.low * feedback:.3g} 1/s"
        return f"{fault}; it is stable with control.feedback up to {most}"
    if margins.interrupted:
        return fault
    return f"{fault}, and remains so with {gain.high:.2g} times its feedback: feedback is not the cause"


def _draw(margins: Margins, path: Path) -> None:
    """Draw the remaining response to a kick for each tried setting, and the limits."""
    from rmrc.show import figures

    figure = figures.sheet(1.2 + 4.0 * len(margins.all), 4.4)
    panels = figure.subplots(1, len(margins.all), sharey=True, squeeze=False)[0]
    for axes, margin in zip(panels, margins.all, strict=True):
        x = np.array([value for value, _ in margin.tried])
        y = np.clip([judgment.remainder for _, judgment in margin.tried], _LEAST, _MOST)
        is_unstable = np.array([judgment.is_unstable for _, judgment in margin.tried])
        axes.plot(x[~is_unstable], y[~is_unstable], "oC0", label="decays: stable")
        y = np.maximum(y, STILL_RINGS)
        axes.plot(x[is_unstable], y[is_unstable], "XC3", label="keeps ringing: unstable")
        for value, style, label in (
            (margin.value if margin.is_found else math.inf, "-", "limit by simulation"),
            (margin.ideal, "--", "limit of the ideal plant"),
            (margin.rule, ":", "rule 1/(delay + T/2 + lag)"),
        ):
            if 0.0 < value < math.inf:
                axes.axvline(value, color="k", linestyle=style, label=label)
        axes.set(yscale="log", xscale="log" if margin.name == "gain" else "linear")
        axes.set_xlabel("{} [{}]".format(*_WHAT[margin.name]))
    panels[0].set_ylabel("remaining response to a kick [1]")
    panels[0].legend()
    figure.suptitle(f"{figures.plain(margins.scenario.name)}: stability margins")
    figures.save(figure, [path])
