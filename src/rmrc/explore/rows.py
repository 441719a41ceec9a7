"""Rows of docs/textbook.md for a scenario or a lesson, and a page of this server with all of them."""

import html
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from rmrc.scenario.lesson import SHIPPED, load_lesson
from rmrc.support import shipped

# Address of the page on the server, relative to the page with the sliders.
PLACE = "textbook"
_ROW = re.compile(r"^\| ([A-D]\d+) \| (.+?) \| `(.+?)` \|", re.MULTILINE)


@cache
def rows() -> dict[str, tuple[str, str]]:
    """Return subject and command of each row by its number; none if the package came without documents."""
    file = (shipped.root() or Path()) / "docs" / "textbook.md"
    text = file.read_text("utf-8") if file.is_file() else ""
    return {key: (what, command) for key, what, command in _ROW.findall(text)}


@cache
def _taught() -> dict[str, frozenset[str]]:
    """Return the rows that the shipped lessons name, by their scenario."""
    lessons = [load_lesson(name)[0] for name in SHIPPED]
    names = {one.scenario for one in lessons}
    return {
        name: frozenset(key for one in lessons if one.scenario == name for key in one.rows) for name in names
    }


def links(scenario: str, named: Sequence[str] = ()) -> str:
    """Return links to rows as Markdown, or an empty text if there are none.

    Args:
        scenario: Name of a scenario: the rows that run it, and those of the lessons about it.
        named: Numbers of further rows.
    """
    found = {key for key, (_, command) in rows().items() if f"/{scenario}.yaml" in command}
    found |= _taught().get(scenario, frozenset()) | set(named)
    told = [f"[{key}]({PLACE}#{key}) {what}" for key, (what, _) in rows().items() if key in found]
    return f"**Textbook.** {'; '.join(told)}" if told else ""


@cache
def page() -> bytes:
    """Return all rows as an HTML page, each with its number as its name."""
    told = "".join(
        f'<tr id="{key}"><td>{key}<td>{html.escape(what)}<td><code>{html.escape(command)}</code>'
        for key, (what, command) in rows().items()
    )
    style = "body{font-family:system-ui}td{padding:.3em .6em;vertical-align:top}tr:target{background:#fd6}"
    head = f'<!DOCTYPE html><meta charset="utf-8"><title>The textbook</title><style>{style}</style>'
    return f"{head}<h1>The textbook</h1><table>{told}</table>".encode()
