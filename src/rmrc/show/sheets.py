"""Tables without a form: texts and numbers in cells, to be shown in a terminal or as Markdown."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.results.expectations import Case
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


# Reports ------------------------------------------------------------------------------------------
#
# An answer in its forms: tables for people, JSON for machines, a picture.


@dataclass(frozen=True, eq=False)
class Report:
    """The presentation of an answer.

    Attributes:
        sheets: Tables without a form, the most general first.
        json: The same for strict JSON, as `plain` returns it.
        draw: Writes the picture to a file, atomically, in the format of its suffix: `.png`, `.svg` or `.pdf`;
            None if there is no picture.
        met: Whether the requested condition is met.
        problem: The reason why it is not met, in one line; "" if the sheets give it.
        block: Lines of a scenario to paste, which are not wrapped; "" for none.
        cases: The checks, as CI counts them.
    """

    sheets: Sequence[Sheet]
    json: Any
    draw: Callable[[Path], None] | None = None
    met: bool = True
    problem: str = ""
    block: str = ""
    cases: Sequence[Case] = ()

    def _repr_markdown_(self) -> str:
        """Return the tables, as a notebook shows them."""
        return "\n\n".join(map(as_markdown, self.sheets))


def plain(value: Any) -> Any:
    """Return dicts, lists, texts and finite numbers of Python; None for a number that is not finite.

    Args:
        value: May have arrays and numbers of numpy, and tuples.

    >>> plain({"q": np.array([1.0, np.inf]), "hits": np.int64(3), "axes": ("x", "y")})
    {'q': [1.0, None], 'hits': 3, 'axes': ['x', 'y']}
    """
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
