"""The parts of the page that people fill in: menus and sliders, and the questions of a lesson."""

import re
from collections.abc import Mapping, Sequence
from html import escape

from rmrc.export.controls import Control
from rmrc.scenario.lesson import Lesson

# Titles of the settings, by the beginning of their keys; the beginnings that go without saying; symbols.
TITLES: Mapping[str, str] = {
    "control.inverse.": "Inverse", "control.feedback": "Inverse", "control.nullspace.": "Null space",
    "control.limits.": "Limits", "plant.": "Plant", "target.": "Path", "": "Near a singularity",
}  # fmt: skip
UNSAID = "control.inverse.", "control.nullspace.", "control.limits.", "control."
SYMBOLS: Mapping[str, str] = {
    "control.inverse.damping.maximum": "λ", "control.inverse.damping.below": "ε", "control.feedback": "K",
}  # fmt: skip


def form(controls: Sequence[Control]) -> str:
    """Return menus and sliders, by sections; the value of each is the number of what is chosen."""
    sections = dict[str, list[str]]()
    for i, control in enumerate(controls):
        title = next(title for start, title in TITLES.items() if control.key.startswith(start))
        sections.setdefault(title, []).append(_row(i, control))
    boxes = (
        f"<fieldset><legend>{name}</legend>{''.join(rows)}</fieldset>" for name, rows in sections.items()
    )
    return "\n".join(boxes)


def _row(number: int, control: Control) -> str:
    """Return a label, what is chosen, and a menu or a slider."""
    unsaid = next((start for start in UNSAID if control.key.startswith(start)), "")
    label = f"{control.key.removeprefix(unsaid)} {SYMBOLS.get(control.key, '')}"
    if isinstance(control.values[control.start], str):
        options = (f'<option value="{k}">{escape(value)}</option>' for k, value in enumerate(control.values))
        entry = f'<select id="control-{number}">{"".join(options)}</select>'
    else:
        last = len(control.values) - 1
        entry = f'<input id="control-{number}" type="range" min="0" max="{last}">'
    head = f'<label for="control-{number}">{label}</label><output></output>'
    return f'<div class="control" title="{escape(control.meaning)}">{head}{entry}</div>'


def questions(lesson: Lesson | None) -> str:
    """Return the questions of a lesson, and an entry for its number; "" without one."""
    if lesson is None:
        return ""
    asked = "".join(
        f"<details><summary>{_text(each.ask)}</summary><p>{_text(each.do)}</p></details>"
        for each in lesson.questions
    )
    entry = '<input id="answer" type="number" step="any">'
    number = f"<label>{_text(lesson.number.ask)} [{_text(lesson.number.unit)}] {entry}</label>"
    return (
        f"<h2>{_text(lesson.title)}</h2><p>{_text(lesson.about)}</p>{asked}"
        f'<p>{number} <output id="verdict"></output></p>'
    )


def _text(text: str) -> str:
    """Return a text with its `code` and *names*."""
    return re.sub(r"\*(.+?)\*", r"<em>\1</em>", re.sub(r"`(.+?)`", r"<code>\1</code>", escape(text)))
