"""How pictures are drawn without colors alone, and saved whole."""

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
    # Text as text, so that a page can be searched, in fonts that journals take (they refuse Type 3); and the
    # same bytes for the same picture.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rmrc", "pdf.fonttype": 42}):
        for path in paths:
            kind = path.suffix[1:]
            # A date would make equal pictures differ.
            metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
            with written_whole(path) as temporary:
                figure.savefig(temporary, format=kind, dpi=150, metadata=metadata)


def plain(text: str) -> str:
    """Return a text that is not read as mathematics."""
    return text.replace("$", r"\$")
