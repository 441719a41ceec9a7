"""Pictures that do not depend on color alone, and their files, written whole."""

import io
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from rmrc.show.picture_size import ASKED
from rmrc.support.files import written_whole

# Without colors, these distinguish neighbors.
MARKERS = "osD^vP*X"
# Resolution of a PNG [1/in].
DPI = 150


# A picture narrower than this is for a column: its legend is below it, and the caption replaces its title
# [in].
COLUMN = 5.0
# Least height of such a picture, as a part of its width; width of a letter, as a part of its size.
LOWEST, LETTER = 0.75, 0.55


class Picture(Figure):
    """A figure that a notebook shows by itself. It shows pyplot's figures only after pyplot has drawn one."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()


def sheet(width: float, height: float) -> Figure:
    """Return an empty figure of a size [in], or of the requested width with the same proportions.

    Letters have the requested size if the code that draws into the figure runs within `lettering`.
    """
    wide = ASKED.get().width or width
    high = height * wide / width
    return Figure(figsize=(wide, max(high, LOWEST * wide) if is_narrow() else high), layout="constrained")


def lettering() -> AbstractContextManager[None]:
    """Have letters of the requested size: those that are smaller by custom have at least 7 pt."""
    font = ASKED.get().font or (8.0 if is_narrow() else None)
    if font is None:
        return nullcontext()
    small = max(min(7.0, font), font - 1.0)
    return mpl.rc_context(
        {"font.size": font, "legend.fontsize": small, "axes.titlesize": font, "figure.titlesize": font}
    )


def entitle(figure: Figure, text: str) -> None:
    """Put a title above a picture, unless it is for a column."""
    if not is_narrow():
        figure.get_axes()[0].set_title(text)


def explain(figure: Figure, **options: Any) -> None:
    """Put a legend outside the axes of a picture, or below them, entry by entry, if it is for a column."""
    if not is_narrow():
        figure.legend(frameon=False, **options)
        return
    # The figure grows by the height of the legend, so the axes keep their size.
    found = figure.legend(**{**options, "frameon": False, "loc": "outside lower left", "ncols": 1})
    (width, height), size = figure.get_size_inches(), mpl.rcParams["font.size"]
    for text in found.get_texts():
        letters = int((72.0 * width - 6.0 * size) / (LETTER * size))
        text.set_text(
            "\n".join(fill(one, letters, drop_whitespace=False) for one in text.get_text().split("\n"))
        )
    count = sum(1 + text.get_text().count("\n") for text in found.get_texts())
    figure.set_size_inches(width, height + 1.5 * count * size / 72.0)


def is_narrow() -> bool:
    """Return whether a picture is for a column of a journal."""
    width = ASKED.get().width
    return width is not None and width < COLUMN


def save(figure: Figure, paths: Sequence[Path]) -> None:
    """Write a picture, atomically.

    Args:
        figure: The picture.
        paths: Files to write, in the format of their suffix: `.png`, `.svg` or `.pdf`.
    """
    for path in paths:
        with written_whole(path) as temporary:
            _write(figure, temporary, path.suffix[1:])


def as_svg(figure: Figure) -> str:
    """Return a picture as the text of an SVG file."""
    stream = io.BytesIO()
    _write(figure, stream, "svg")
    return stream.getvalue().decode()


def _write(figure: Figure, to: Path | io.BytesIO, kind: str) -> None:
    # Text stays text, so that a page can be searched, in fonts that journals accept (they refuse Type 3). A
    # date would make the files of equal pictures differ.
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rmrc", "pdf.fonttype": 42}):
        if engine := figure.get_layout_engine():  # savefig alone would arrange it twice
            engine.execute(figure)
            figure.set_layout_engine("none")
        figure.savefig(to, format=kind, dpi=DPI, metadata=metadata)


def plain(text: str) -> str:
    """Return a text that matplotlib does not read as mathematics."""
    return text.replace("$", r"\$")
