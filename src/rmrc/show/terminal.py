"""Tables in a terminal of any width: nothing depends on color alone, is cut off, or is read as markup."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import Literal

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from rmrc.show.sheets import Sheet
from rmrc.support.legible import visible


def as_table(sheet: Sheet) -> "Fitted":
    """Return a sheet for a terminal of any width."""
    return Fitted(sheet)


class Fitted:
    """A sheet as one table, or as several with some of its columns each if it is wider than the terminal.

    Lines break between words only, numbers stay whole, and there is no ellipsis. If the names of rows leave
    no room for a number, the rows are numbered, and a list above names them.
    """

    def __init__(self, sheet: Sheet) -> None:
        """Keep a sheet in printable form."""
        cells = [tuple(visible(cell, keep="\n") for cell in row) for row in (sheet.headings, *sheet.rows)]
        self._sheet = replace(sheet, title=visible(sheet.title), headings=cells[0], rows=cells[1:])
        # One blank between columns, or two where there are few: names of joints need the room.
        self._gap = 2 if len(sheet.headings) <= 6 else 1
        columns = list(zip(*cells, strict=True))
        self._widest = [max(map(_line, column)) for column in columns]
        # A column of numbers can only become narrower by its heading.
        self._least = [
            max(map(_word, column)) if i in sheet.left else max(_word(column[0]), *map(_line, column[1:]), 0)
            for i, column in enumerate(columns)
        ]
        ends = [*accumulate(sheet.groups or [1] * (len(columns) - 1), initial=1)]
        self._groups = [[*range(*pair)] for pair in pairwise(ends)]

    @property
    def width(self) -> int:
        """Width in the terminal with one line per row."""
        return self._total(self._widest)

    def _total(self, widths: Sequence[int]) -> int:
        return sum(widths) + self._gap * (len(widths) - 1)

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        """Return its width, for the layout beside other tables."""
        return Measurement(
            min(self._total(self._least), options.max_width), min(self.width, options.max_width)
        )

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield tables that are no wider than the console."""
        rows = self._sheet.rows
        is_narrow = not all(self._fits([0, i], options.max_width) for i in range(1, len(self._least)))
        if is_narrow and len(str(len(rows))) < self._least[0]:
            for i, row in enumerate(rows, 1):
                yield Text(f"{i}  {' '.join(row[0].split())}")
            yield Text()
            numbered = [(str(i), *row[1:]) for i, row in enumerate(rows, 1)]
            yield Fitted(replace(self._sheet, rows=numbered))
            return
        for i, part in enumerate(self._parts(options.max_width)):
            if i:
                yield Text()
            yield self._table(part, self._fitting(part, options.max_width), is_first=i == 0)

    def _parts(self, width: int) -> list[list[int]]:
        """Return the columns of each part, each with the first column."""
        parts: list[list[int]] = [[0]]
        for group in self._groups:
            is_whole = self._fits([0, *group], width)
            for piece in [group] if is_whole else [[column] for column in group]:
                begins = not is_whole and piece[0] == group[0]  # a divided group begins a part of its own
                if len(parts[-1]) > 1 and (begins or not self._fits([*parts[-1], *piece], width)):
                    parts.append([0])
                parts[-1] = [*parts[-1], *piece]
        return parts

    def _fits(self, part: list[int], width: int) -> bool:
        return self._total([self._least[i] for i in part]) <= width

    def _fitting(self, part: list[int], width: int) -> list[int]:
        """Return the widths of some columns; the widest becomes narrower first, and words before headings."""
        widths, left = [self._widest[i] for i in part], self._sheet.left
        for words in (True, False):
            while self._total(widths) > width:
                can = [k for k, i in enumerate(part) if (i in left) == words and widths[k] > self._least[i]]
                if not can:
                    break
                widths[max(can, key=lambda k: widths[k])] -= 1
        while self._total(widths) > width and max(widths) > 1:  # a word may be wider than the terminal
            widths[widths.index(max(widths))] -= 1
        return widths

    def _table(self, part: list[int], widths: list[int], is_first: bool) -> Table:
        sheet = self._sheet
        table = Table(
            title=Text(sheet.title, style="bold") if sheet.title and is_first else None,
            title_justify="left",
            show_header=any(sheet.headings[i] for i in part),
            box=box.SIMPLE_HEAD,
            padding=(0, self._gap - 1),
            show_edge=False,
            pad_edge=False,
            collapse_padding=True,
        )
        for column, width in zip(part, widths, strict=True):
            justify: Literal["left", "right"] = "left" if column in sheet.left else "right"
            table.add_column(Text(sheet.headings[column]), justify=justify, overflow="fold", width=width)
        for row in sheet.rows:
            table.add_row(*(Text(row[i], _style(row[i])) for i in part))
        return table


def _line(cell: str) -> int:
    """Return the width of the longest line of a cell."""
    return max((cell_len(line) for line in cell.split("\n")), default=0)


def _word(cell: str) -> int:
    """Return the width of the longest word of a cell."""
    return max((cell_len(word) for word in cell.split()), default=0)


def _style(cell: str) -> str:
    word = cell.partition(" ")[0]
    return {"ok": "green", "met": "green", "MISSED": "bold red", "missed": "bold red"}.get(word, "")


def render(sheets: Sequence[Sheet]) -> RenderableType:
    """Return sheets one below another, for a terminal; a title may be wider than its table."""
    parts: list[RenderableType] = []
    for sheet in sheets:
        parts += [Text(visible(sheet.title), style="bold")] if sheet.title else []
        parts += [as_table(replace(sheet, title=""))] if sheet.headings else []
        parts += [Text(visible(note)) for note in sheet.notes]
        parts += [Text()] if sheet.is_spaced else []
    return Group(*parts)
