"""A page to send: one self-contained HTML file, which loads no other file and prints well."""

import json
import os
import re
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

from matplotlib.figure import Figure

from rmrc.show.figures import as_svg
from rmrc.show.sheets import Sheet
from rmrc.show.traces import Traces
from rmrc.support.files import written_whole
from rmrc.support.legible import visible

# Nothing may be loaded, sent or framed: the page contains everything that it needs.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
_ICON = "data:image/svg+xml,%3Csvg xmlns=%22http://www.w3.org/2000/svg%22/%3E"


@cache
def _asset(name: str) -> str:
    return files("rmrc.show").joinpath("assets", name).read_text("utf-8")


class Page:
    """A page, filled from the top down."""

    def __init__(self, title: str, lead: str = "") -> None:
        """Begin a page.

        Args:
            title: Its heading.
            lead: A sentence below it; "": none.
        """
        self._title, self._body, self._traces = title, list[str](), ""
        self._count, self._linked = 0, dict[str, Path]()
        if lead:
            self._body.append(f'<p class="lead">{_text(lead)}</p>')

    def section(self, title: str, note: str = "") -> None:
        """Begin a section; the note is a sentence below its heading."""
        self._body.append(f"<h2>{_text(title)}</h2>")
        if note:
            self._body.append(f'<p class="soft">{_text(note)}</p>')

    def items(self, lines: Sequence[str]) -> None:
        """Add a list of sentences."""
        rows = "".join(f"<li>{_text(line)}</li>" for line in lines)
        self._body.append(f"<ul>{rows}</ul>")

    def table(self, sheet: Sheet, links: Mapping[int, Mapping[str, Path]] | None = None) -> None:
        """Add a table and its notes; a cell that is `ok` or `MISSED` has that color as well.

        Args:
            sheet: The table.
            links: Files that cells link to, by column and text. The links are relative to the page.
        """
        if sheet.headings:
            title = f"<caption>{_text(sheet.title)}</caption>" if sheet.title else ""
            cells = [_heading(text, i in sheet.left) for i, text in enumerate(sheet.headings)]
            head = f"<thead><tr>{''.join(cells)}</tr></thead>" if any(sheet.headings) else ""
            rows = "".join(f"<tr>{self._row(row, sheet.left, links or {})}</tr>" for row in sheet.rows)
            self._body.append(
                f'<div class="wide" tabindex="0"><table>{title}{head}<tbody>{rows}</tbody></table></div>'
            )
        for note in sheet.notes:
            self._body.append(f"<p>{_text(note)}</p>")

    def figure(self, figure: Figure, caption: str) -> None:
        """Add a picture as vector graphics; the caption describes it."""
        drawn = re.sub(r"(?s)<metadata>.*?</metadata>", "", as_svg(figure))
        drawn = drawn[drawn.index("<svg") :]
        self._count += 1
        # Equal pictures have equal names of their parts, and names on a page must be unique.
        drawn = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>f{self._count}-", drawn)
        drawn = drawn.replace("<svg", f'<svg role="img" aria-label="{escape(visible(caption))}"', 1)
        self._body.append(f"<figure>{drawn}<figcaption>{_text(caption)}</figcaption></figure>")

    def code(self, text: str, button: str) -> None:
        """Add lines of text, with a button that copies them."""
        self._count += 1
        name = f"text-{self._count}"
        self._body.append(
            f'<p class="screen"><button type="button" data-copies="{name}">{_text(button)}</button></p>'
            f'<pre id="{name}" tabindex="0">{_text(text, lines=True)}</pre>'
        )

    def plots(self, traces: Traces) -> None:
        """Add plots over time with cursor and zoom; once per page."""
        self._body.append(
            '<div class="screen"><p>Move over a plot to read values, drag to zoom in on a time, and click '
            "a name below a plot to hide or show its line. "
            '<button type="button" id="whole">Show the whole time</button></p>'
        )
        for panel in traces.panels:
            peak = f' <span class="peak">{_text(panel.peak)}</span>' if panel.peak else ""
            self._body.append(f'<h3>{_text(panel.title)}{peak}</h3><div id="{panel.place}"></div>')
        self._body.append("</div>")
        # Within a script only "</" and "<!" have a meaning for the parser of the page.
        data = json.dumps(traces.json(), allow_nan=False).replace("<", "\\u003c")
        self._traces = f'<script type="application/json" id="traces">{data}</script>'

    def write(self, path: Path) -> None:
        """Write the page, atomically."""
        html = self._html()
        for place, file in self._linked.items():
            html = html.replace(place, _address(file, path.parent))
        with written_whole(path) as temporary:
            temporary.write_text(html, "utf-8")

    def _row(self, row: Sequence[str], left: frozenset[int], links: Mapping[int, Mapping[str, Path]]) -> str:
        cells = []
        for i, cell in enumerate(row):
            kinds = {"ok": ["ok"], "MISSED": ["missed"]}.get(cell, []) + ["word"] * (i in left)
            kind = f' class="{" ".join(kinds)}"' if kinds else ""
            text = _text(cell, lines=True)
            if file := links.get(i, {}).get(cell):
                place = f"rmrc:file-{len(self._linked)}-of-this-page"
                self._linked[place] = file
                text = f'<a href="{place}">{text}</a>'
            opening, closing = ('<th scope="row"', "</th>") if i == 0 and cell else ("<td", "</td>")
            cells.append(f"{opening}{kind}>{text}{closing}")
        return "".join(cells)

    def _html(self) -> str:
        title = _text(self._title)
        plotted = bool(self._traces)
        style = "\n".join(_asset(name) for name in ("uPlot.min.css", "page.css")[not plotted :])
        script = "\n".join(_asset(name) for name in ("uPlot.iife.min.js", "page.js")[not plotted :])
        return (
            f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<link rel="icon" href="{_ICON}">\n'
            f"<style>{style}</style></head>\n<body><header><h1>{title}</h1></header>\n<main>\n"
            + "\n".join(self._body)
            + f"\n</main>\n{self._traces}\n<script>{script}</script>\n</body></html>\n"
        )


def _text(text: str, lines: bool = False) -> str:
    return escape(visible(text, keep="\n" if lines else ""))


def _heading(text: str, is_word: bool) -> str:
    kind = ' class="word"' if is_word else ""
    return f'<th scope="col"{kind}>{_text(text, lines=True)}</th>' if text.strip() else f"<td{kind}></td>"


def _address(file: Path, folder: Path) -> str:
    """Return the address of a file relative to a folder; of one on another drive, the whole address."""
    try:
        return quote(Path(os.path.relpath(file, folder)).as_posix())
    except ValueError:
        return file.as_uri()
