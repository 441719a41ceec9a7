"""Sheets in a terminal: tables of rich, in which words wrap and numbers stay whole.

Nothing depends on color alone, is cut off, or is read as markup.
"""

from collections.abc import Iterator, Sequence

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.table import Table
from rich.text import Text

from rmrc.show.sheets import Sheet
from rmrc.support.text import visible

_STYLES = {"ok": "green", "met": "green", "MISSED": "bold red", "missed": "bold red"}


def render(sheets: Sequence[Sheet]) -> RenderableType:
    """Return sheets one below another, with an empty line between them."""
    parts: list[RenderableType] = []
    for sheet in sheets:
        parts += [Text()] * bool(parts)
        parts += [Text(visible(sheet.title), "bold")] * bool(sheet.title)
        parts += [_Columns(sheet)] * bool(sheet.headings)
        parts += [Text(visible(note)) for note in sheet.notes]
    return Group(*parts)


class _Columns:
    """A table, or several below one another with some of its columns each where the terminal is narrow."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet, self._gap = sheet, 2 if len(sheet.headings) < 6 else 1
        columns = zip(sheet.headings, *sheet.rows, strict=True)
        self._least = [_least(*column, is_text=i in sheet.left) for i, column in enumerate(columns)]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for i, part in enumerate(self._parts(options.max_width)):
            yield from [Text()] * bool(i)
            yield self._table(part)

    def _parts(self, width: int) -> Iterator[list[int]]:
        """Yield the columns of each table, each with the first, which names the rows."""
        part = [0]
        for column in range(1, len(self._least)):
            if len(part) > 1 and sum(self._least[i] + self._gap for i in [*part, column]) - self._gap > width:
                yield part
                part = [0]
            part.append(column)
        yield part

    def _table(self, part: Sequence[int]) -> Table:
        sheet = self._sheet
        table = Table(
            box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, self._gap - 1, 0, 0),
            collapse_padding=True, show_header=any(sheet.headings[i] for i in part),
        )  # fmt: skip
        for i in part:
            is_text = i in sheet.left
            heading = sheet.headings[i] if is_text else "\n".join(sheet.headings[i].split())
            table.add_column(
                _text(heading), justify="left" if is_text else "right", no_wrap=not is_text, overflow="fold"
            )
        for row in sheet.rows:
            table.add_row(*(_text(row[i], _STYLES.get(row[i].split(",")[0].split(" ")[0], "")) for i in part))
        return table


def _least(heading: str, *cells: str, is_text: bool) -> int:
    """Return the width of a column whose words, or whose numbers and words of the heading, stay whole."""
    pieces = [*heading.split(), *(part for cell in cells for part in (cell.split() if is_text else [cell]))]
    return max(map(cell_len, pieces), default=0)


def _text(text: str, style: str = "") -> Text:
    return Text(visible(text, keep="\n"), style)
