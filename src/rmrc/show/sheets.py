"""Tables without a form: texts and numbers in cells, to be shown in a terminal or as Markdown."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rmrc.support.text import escaped

UNDEFINED = "-"


@dataclass(frozen=True)
class Sheet:
    """A table without a form: texts, and which columns are words and not numbers.

    Attributes:
        title: The title above; may be empty.
        headings: One for each column; none if there are only notes.
        rows: A cell for each column.
        left: Columns of words; the first names the rows.
        notes: Lines below the table.
    """

    title: str
    headings: tuple[str, ...] = ()
    rows: Sequence[tuple[str, ...]] = ()
    left: frozenset[int] = frozenset({0})
    notes: tuple[str, ...] = ()


def as_markdown(sheet: Sheet) -> str:
    """Return a sheet as Markdown, its title as a heading and its notes as paragraphs."""
    parts = [f"## {sheet.title}"] if sheet.title else []
    if sheet.headings:
        rules = tuple("---" if column in sheet.left else "---:" for column in range(len(sheet.headings)))
        head, *body = (tuple(map(escaped, row)) for row in (sheet.headings, *sheet.rows))
        parts.append("\n".join(f"| {' | '.join(row)} |" for row in (head, rules, *body)))
    return "\n\n".join([*parts, *map(escaped, sheet.notes)])


def number(value: float) -> str:
    """Return three to six digits in at most seven characters and a sign, so that columns fit."""
    size = abs(value)
    if math.isnan(value):
        return UNDEFINED
    if size == 0.0 or math.isinf(value):
        return f"{value:g}"
    if 0.001 <= size < 9999.5:
        return f"{value:#.{4 if size >= 0.01 else 3}g}".rstrip(".")
    if 9999.5 <= size < 999_999.5:  # whole, as in sentences
        return f"{value:.0f}"
    mantissa, _, exponent = f"{value:.2e}".partition("e")
    return f"{mantissa}e{int(exponent)}"
