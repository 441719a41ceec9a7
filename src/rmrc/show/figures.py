"""How pictures are drawn without colors alone, and saved whole."""

import io
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from rmrc.support.files import written_whole

# Without colors, neighbors differ by these; a dozen curves have a pair each.
DASHES = ((1, 0), (5, 2), (2, 1), (6, 1.5, 1.5, 1.5), (9, 3), (3, 1, 1, 1, 1, 1))
MARKERS = "osD^vP*X"


def save(figure: Figure, paths: Sequence[Path]) -> None:
    """Write a picture, whole or not at all.

    Args:
        figure: The picture.
        paths: Files to write; the suffix says how: `.png`, `.svg` or `.pdf`.
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
    # Text as text, so that a page can be searched, in fonts that journals take (they refuse Type 3); and the
    # same bytes for the same picture, which a date would make differ.
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rmrc", "pdf.fonttype": 42}):
        figure.savefig(to, format=kind, dpi=150, metadata=metadata)


def plain(text: str) -> str:
    """Return a text that is not read as mathematics."""
    return text.replace("$", r"\$")
