"""Picture and report page of a sweep: distributions, ends of its runs, extremes of its metrics."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rmrc.show.figures import COLUMN, Picture, plain, save
from rmrc.show.page import Page
from rmrc.show.panels import paints
from rmrc.show.run_page import versions
from rmrc.show.sheets import Sheet, number
from rmrc.study.swept import Swept
from rmrc.support.errors import QuestionError

# Panels of a figure of a sweep, from the top.
PANELS = ("distributions", "keys")
# Bins of a histogram; spread above which a scale is logarithmic; different words that an axis has room for.
BINS, WIDE, MOST_WORDS = 20, 30.0, 12


def plot(
    swept: Swept, path: Path | None, panels: Sequence[str] = (), width: float = 7.16, font: float = 8.0
) -> Figure:
    """Draw a sweep: distributions of its metrics, and the first metric over each varied key.

    Args:
        swept: Its rows.
        path: File to write atomically: `.png`, `.svg` or `.pdf`; None: no file.
        panels: Panels among distributions and keys; none: both.
        width: Width of the figure [in].
        font: Font size [pt].

    Raises:
        QuestionError: There are no numbers to draw.
    """
    panels, metrics = panels or PANELS, list(swept.figures)
    keys = [key for key in swept.varied if len(set(map(str, _coordinates(swept, key)))) > 1]
    cells = [(name, "") for name in metrics if "distributions" in panels]
    cells += [(name, key) for name in metrics[:1] for key in keys if "keys" in panels]
    if not cells:
        raise QuestionError(f"{swept.name}: no run has numbers to draw")
    columns = min(len(cells), 3 if width > COLUMN else 1)
    lines = -(-len(cells) // columns)
    with mpl.rc_context({"font.size": font}):
        picture = Picture(figsize=(width, lines * (1.4 + 0.07 * font)), layout="constrained")
        for i, (name, key) in enumerate(cells):
            axes, values = picture.add_subplot(lines, columns, i + 1), swept.figures[name]
            seen = values[np.isfinite(values)]
            scale = "log" if seen.min() > 0.0 and seen.max() > WIDE * seen.min() else "linear"
            if key:
                axes.scatter(_coordinates(swept, key), values, s=4.0, color=paints(1)[0])
                axes.set(xlabel=_label(swept, key), ylabel=_label(swept, name), yscale=scale)
            else:
                bins = np.geomspace(seen.min(), seen.max(), BINS + 1) if scale == "log" else BINS
                axes.hist(seen, bins, color=paints(1)[0])  # type: ignore[arg-type]
                axes.set(xlabel=_label(swept, name), ylabel="runs", xscale=scale)
        save(picture, [path] if path else [])
    return picture


def _coordinates(swept: Swept, key: str) -> list[float] | list[str]:
    """Return the values of a key in all runs: numbers, or a few different words; none for many words."""
    values = swept.rows[key]
    if all(value is None or isinstance(value, int | float) for value in values):
        return [math.nan if value is None else float(value) for value in values]
    words = list(map(str, values))
    return words if len(set(words)) <= MOST_WORDS else []


def _label(swept: Swept, name: str) -> str:
    return plain(name) + (f" [{swept.units[name]}]" if swept.units[name] not in ("", "1") else "")


def page(swept: Swept) -> Page:
    """Return the report page of a sweep."""
    ends, extremes = swept.sheets()
    ended = swept.rows["status"]
    page = Page(ends.title, f"{ended.count('complete')} of {len(ended)} runs completed the path.")
    rows = sorted({i for pair in swept.extremes().values() for i in pair})
    settings = [tuple(_text(swept.rows[key][i]) for key in ("index", *swept.varied)) for i in rows]
    for title, sheet in (
        ("End of the runs", Sheet("", ends.headings, ends.rows)),
        ("Extremes", extremes),
        ("Settings of these runs", Sheet("", ("run", *swept.varied), settings)),
    ):
        page.section(title)
        page.table(sheet)
    if swept.figures:
        page.section("Distributions of the metrics, and the first one over the varied keys")
        picture = plot(swept, None, width=9.6, font=9.0)
        page.figure(picture, "Number of runs by value, and one dot per run")
    page.section("Made with")
    page.table(versions(json.loads(swept.rows["versions"][0])))
    return page


def _text(value: object) -> str:
    return number(value) if isinstance(value, float) else str(value)
