"""Plots for a paper or a lecture: of one run, or of several side by side."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from rmrc.results.run import Run
from rmrc.show import compare_figure, run_figure
from rmrc.show.figures import save


def plot(
    runs: Run | Mapping[str, Run],
    path: str | Path | None = None,
    panels: Sequence[str] = (),
    width: float = 7.16,
    font: float = 8.0,
) -> Figure:
    """Draw a run, or several side by side: path, rates, singular values, errors, torque, status, filter.

    Args:
        runs: A run; or runs by label, as `compare` returns them. Each has one tick at least.
        path: File to write atomically: `.png`, `.svg` or `.pdf`; None: no file.
        panels: Panels among path, rates, sigma, error, torque, pace, status and g, in this order from the
            top; none: all that have data.
        width: Width of the figure [in]: 3.5 and 7.16 are one and two columns of a journal.
        font: Font size [pt].

    Returns:
        The figure, which a notebook shows.
    """
    # matplotlib reads sizes of letters when a figure is made.
    with mpl.rc_context({"font.size": font, "legend.fontsize": max(min(7.0, font), font - 1.0)}):
        several = {runs.name: runs} if isinstance(runs, Run) else runs
        if len(several) == 1:
            picture = run_figure.figure(next(iter(several.values())), panels, width)
        else:
            picture = compare_figure.figure(several, panels, width)
        if path is not None:
            save(picture, [Path(path)])
    return picture
