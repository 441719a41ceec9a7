"""Tables without a form, and their two forms: for a terminal, and as markdown.

Nothing depends on color alone, is cut off, or is read as markup.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

UNDEFINED = "-"


@dataclass(frozen=True)
class Sheet:
    """A table without a form: texts, and which columns are words and not numbers."""

    title: str
    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    left: frozenset[int] = frozenset({0})


def as_table(sheet: Sheet) -> Table:
    """Return a sheet for a terminal."""
    table = Table(
        title=Text(sheet.title, style="bold") if sheet.title else None,
        title_justify="left",
        show_header=any(sheet.headings),
        box=box.SIMPLE_HEAD,
        # One blank between columns, or two where there are few: names of joints need the room.
        padding=(0, 1 if len(sheet.headings) <= 6 else 0),
        show_edge=False,
        pad_edge=False,
        collapse_padding=True,
    )
    for column, heading in enumerate(sheet.headings):
        # Words that do not fit go on in the next line, numbers stay whole; never an ellipsis.
        words = column in sheet.left
        justify: Literal["left", "right"] = "left" if words else "right"
        table.add_column(Text(heading), justify=justify, overflow="fold", no_wrap=not words)
    for row in sheet.rows:
        table.add_row(*(Text(cell, _style(cell)) for cell in row))
    return table


def _style(cell: str) -> str:
    word = cell.partition(" ")[0]
    return {"ok": "green", "met": "green", "MISSED": "bold red", "missed": "bold red"}.get(word, "")


def render(sheets: Sequence[Sheet]) -> RenderableType:
    """Return sheets one below another, for a terminal; a title may be wider than its table."""
    parts: list[RenderableType] = []
    for sheet in sheets:
        parts += [Text(sheet.title, style="bold")] if sheet.title else []
        parts += [as_table(replace(sheet, title="")), Text()]
    return Group(*parts)


def as_markdown(sheet: Sheet) -> str:
    """Return a sheet as markdown, its title as a heading."""
    rules = ["---" if column in sheet.left else "---:" for column in range(len(sheet.headings))]
    rows = [sheet.headings, *sheet.rows]
    head, *body = ("| " + " | ".join(map(escaped, row)) + " |" for row in rows)
    title = f"## {sheet.title}\n\n" if sheet.title else ""
    return title + "\n".join([head, f"| {' | '.join(rules)} |", *body])


def escaped(text: str) -> str:
    """Return one line that markdown shows as it is."""
    return re.sub(r"([\\|*`<\[\]])", r"\\\1", " ".join(text.split()))


def number(value: float) -> str:
    """Return three or four digits in at most seven characters and a sign, so that columns fit."""
    size = abs(value)
    if math.isnan(value):
        return UNDEFINED
    if size == 0.0 or math.isinf(value):
        return f"{value:g}"
    if 0.001 <= size < 9999.5:
        return f"{value:#.{4 if size >= 0.01 else 3}g}".rstrip(".")
    mantissa, _, exponent = f"{value:.2e}".partition("e")
    return f"{mantissa}e{int(exponent)}"
