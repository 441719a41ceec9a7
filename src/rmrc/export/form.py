"""The parts of the page that people fill in: menus and sliders, and the questions of a lesson."""

import re
from collections.abc import Sequence
from html import escape

from rmrc.export.controls import Control
from rmrc.scenario.lesson import Lesson

SYMBOLS = {"damping.maximum": "λ", "damping.below": "ε", "feedback": "K"}


def form(controls: Sequence[Control]) -> str:
    """Return menus and sliders, by sections; the value of each is the number of what is chosen."""
    sections = dict[str, list[str]]()
    for number, control in enumerate(controls):
        title, _, name = control.key.removeprefix("control.").partition(".")
        title, name = (title, name) if name else ("control", title)
        sections.setdefault(title, []).append(_row(number, name, control))
    return "\n".join(
        f"<fieldset><legend>{title}</legend>{''.join(rows)}</fieldset>" for title, rows in sections.items()
    )


def _row(number: int, name: str, control: Control) -> str:
    """Return a label, what is chosen, and a menu or a slider."""
    if isinstance(control.values[control.start], str):
        options = (f'<option value="{k}">{escape(value)}</option>' for k, value in enumerate(control.values))
        entry = f'<select id="control-{number}">{"".join(options)}</select>'
    else:
        entry = f'<input id="control-{number}" type="range" min="0" max="{len(control.values) - 1}">'
    label = f'<label for="control-{number}">{name} {SYMBOLS.get(name, "")}</label><output></output>'
    return f'<div class="control" title="{escape(control.meaning)}">{label}{entry}</div>'


def questions(lesson: Lesson | None) -> str:
    """Return the questions of a lesson, and an entry for its number; "" without one."""
    if lesson is None:
        return ""
    asked = "".join(
        f"<details><summary>{_text(each.ask)}</summary><p>{_text(each.do)}</p></details>"
        for each in lesson.questions
    )
    number = f"{_text(lesson.number.ask)} [{_text(lesson.number.unit)}]"
    return (
        f"<h2>{_text(lesson.title)}</h2><p>{_text(lesson.about)}</p>{asked}<p><label>{number} "
        '<input id="answer" type="number" step="any"></label> <output id="verdict"></output></p>'
    )


def _text(text: str) -> str:
    """Return a text with its `code` and *names*."""
    return re.sub(r"\*(.+?)\*", r"<em>\1</em>", re.sub(r"`(.+?)`", r"<code>\1</code>", escape(text)))
