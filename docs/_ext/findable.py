"""Make the rows of the textbook findable, by linked numbers and by titles for the search of the site."""

import re
from typing import Any

PAGE = "docs/textbook"
ROW = re.compile(r"[A-D]\d+")
LABELS = {
    "Example": r"[Ee]xample (\d+\.\d+)",
    "Exercise": r"[Ee]xercise (\d+\.\d+)",
    "Section": r"§(\d+\.\d+)",
    "Figure": r"[Ff]ig\. (\d+\.\d+)",
    "Fig.": r"[Ff]ig\. (\d+\.\d+)",
}


def titles(row: str, subject: str) -> list[str]:
    """Return the titles of a row for the search: its number, and the labels in its subject."""
    found = ((kind, number) for kind, label in LABELS.items() for number in re.findall(label, subject))
    return [row, *dict.fromkeys(f"{kind} {number} ({row})" for kind, number in found)]


def setup(app: Any) -> None:
    """Called by Sphinx."""
    from docutils import nodes

    class Label(nodes.title):
        """A title that the search finds, under the anchor of its row, and that the page does not show."""

    def label_rows(_: object, doctree: Any, page: str) -> None:
        for row in doctree.findall(nodes.row) if page == PAGE else ():
            number, subject, *_ = (entry.astext() for entry in row.children)
            if ROW.fullmatch(number):
                row["ids"].append(number.lower())
                cell = row[0][0]
                cell.clear()
                cell += nodes.reference("", number, refid=number.lower())
                row += [Label("", text) for text in titles(number, subject)]

    def skip(*_: object) -> None:
        raise nodes.SkipNode

    app.add_node(Label, html=(skip, None))
    app.connect("doctree-resolved", label_rows)
