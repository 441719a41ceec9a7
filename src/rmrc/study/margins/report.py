"""Margins as tables, as JSON, and as a picture."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.results.junit import Case
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.study.margins.margins import Margins
from rmrc.study.margins.ringing import STILL_RINGS, Judged

_WHAT = {"gain": ("gain, times", "1"), "delay": ("delay, more", "s"), "lag": ("lag, more", "s")}
_FAULTS = {
    "diverged": "diverges", "rings": "keeps ringing after the kick",
    "reverses": "oscillates from limit to limit after the kick",
}  # fmt: skip
# Smallest and largest response in the picture: a divergence has none, and rounding has a smaller one.
_LEAST, _MOST = 1e-3, 1e2


def report(found: Margins) -> Report:
    """Return the report of margins; its condition is met if the loop is stable as written."""
    control, (delay, lag), written = found.scenario.control, found.late, found.written
    values = plain({
        "name": found.scenario.name, "plant": found.scenario.plant.kind, "period": control.period,
        "feedback": control.feedback, "delay": delay, "lag": lag,
        "rule": found.gain.rule * control.feedback, "ideal": found.gain.ideal * control.feedback,
        "written": written and _judged(written), "stable": found.is_stable,
        "margins": {one.name: {
            "value": one.value, "found": one.edge.is_found, "stable_at": one.edge.low,
            "unstable_at": one.edge.high, "bound": one.bound, "ideal": one.ideal, "rule": one.rule,
            "tried": [{"value": value, **_judged(judgment)} for value, judgment in one.tried],
        } for one in found.all},
        "runs": found.runs, "interrupted": found.interrupted,
    })  # fmt: skip
    loop = (
        ("plant", values["plant"]),
        ("control.period T", f"{control.period:g} s"),
        ("control.feedback K", f"{control.feedback:g} 1/s"),
        ("lateness of commands", f"{delay:g} s of dead time, {lag:g} s of lag, T/2"),
        ("as written", in_words(written) if written else UNDEFINED),
        ("rule: K up to 1/(delay + T/2 + lag)", f"{number(values['rule'])} 1/s"),
        ("limit of the ideal plant, K", f"{number(values['ideal'])} 1/s"),
    )
    title = f"{values['name']}: stability margins, {found.runs} runs"
    headings = ("stability margin of", "by runs", "stable at", "unstable at", "ideal plant", "rule", "unit")
    rows = [_row(name, one) for name, one in values["margins"].items()]
    sheets = [
        Sheet(title, ("", ""), loop, frozenset({0, 1})),
        Sheet("", headings, rows, frozenset({0, 6}), notes=_notes(found)),
    ]
    problem = _problem(found, written) if written and written.is_unstable else ""
    cases = [Case("stable", not problem, problem or "as written")] if written else []
    return Report(sheets, values, lambda path: _draw(found, path), not problem, problem, cases=cases)


def in_words(one: Judged) -> str:
    """Return the state of a loop: `stable`, or its fault with the time."""
    return f"{_FAULTS[one.reason]} at {one.time:.4g} s" if one.is_unstable else "stable"


def _judged(one: Judged) -> dict[str, Any]:
    return {"unstable": one.is_unstable, "reason": one.reason or None, "time": one.time, "left": one.left}


def _row(name: str, one: dict[str, Any]) -> tuple[str, ...]:
    """Return the row of a margin in the JSON."""
    low, high = (number(end) if end else UNDEFINED for end in (one["stable_at"], one["unstable_at"]))
    value = number(one["value"]) if one["found"] else f"> {low}" if one["stable_at"] else f"< {high}"
    ideal = "any" if one["ideal"] is None else number(one["ideal"])
    return _WHAT[name][0], value, low, high, ideal, number(one["rule"]), _WHAT[name][1]


def _notes(found: Margins) -> tuple[str, ...]:
    ends = ", ".join(f"{one.name} {number(one.bound)}" for one in found.all if one.edge.high == math.inf)
    notes = {
        "control.state: integrated: the law gets no feedback from the plant, so delays cannot make it "
        'unstable. "ideal plant" and "rule" apply to a measured state.': (
            found.scenario.control.state == "integrated"
        ),
        f'">": stable in all runs; the search ends at {ends}.': ends,
        "Interrupted: the limits have the precision reached until then.": found.interrupted,
    }
    return tuple(note for note, applies in notes.items() if applies)


def _problem(found: Margins, written: Judged) -> str:
    feedback, (low, high) = found.scenario.control.feedback, found.gain.edge
    fault = f"the loop is unstable as written: it {in_words(written)}"
    if low > 0.0:
        most = f"{low:.3g} times its {feedback:g} 1/s, which are {low * feedback:.3g} 1/s"
        return f"{fault}; it is stable with control.feedback up to {most}"
    if found.interrupted:
        return fault
    return f"{fault}, and remains so with {high:.2g} times its feedback: feedback is not the cause"


def _draw(found: Margins, path: Path) -> None:
    """Draw the remaining response to a kick for each tried setting, and the limits."""
    from rmrc.show import figures

    figure = figures.sheet(1.2 + 4.0 * len(found.all), 4.4)
    panels = figure.subplots(1, len(found.all), sharey=True, squeeze=False)[0]
    for axes, one in zip(panels, found.all, strict=True):
        for is_unstable, style, label in (
            (False, "oC0", "decays: stable"),
            (True, "XC3", "keeps ringing: unstable"),
        ):
            some = [(x, judgment.left) for x, judgment in one.tried if judgment.is_unstable == is_unstable]
            y = np.clip([left for _, left in some], STILL_RINGS if is_unstable else _LEAST, _MOST)
            axes.plot([x for x, _ in some], y, style, label=label)
        for value, style, label in (
            (one.value if one.edge.is_found else math.inf, "k-", "limit by simulation"),
            (one.ideal, "k--", "limit of the ideal plant"), (one.rule, "k:", "rule 1/(delay + T/2 + lag)"),
        ):  # fmt: skip
            if 0.0 < value < math.inf:
                axes.plot([value, value], [_LEAST, _MOST], style, label=label)
        axes.set(yscale="log", xscale="log" if one.name == "gain" else "linear")
        axes.set_xlabel("{} [{}]".format(*_WHAT[one.name]))
    panels[0].set_ylabel("remaining response to a kick [1]")
    panels[0].legend()
    figure.suptitle(f"{figures.plain(found.scenario.name)}: stability margins")
    figures.save(figure, [path])
