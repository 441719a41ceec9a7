"""The strip below an arm: its joint rates over time against their limits, and a cursor that moves."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import blended_transform_factory
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.show.figure import draw
from rmrc.show.panels import panels

DPI = 100.0
# Size of the letters [pt]: 11 pixels, legible on a screen.
LETTERS = 8.0
# Sizes [pixels]: least margin for the numbers at the left of the plot, margin below it, free space, and least
# height of a plot with a legend. Margins beside the name of the axis, and between it and the frame.
LEFT, BELOW, FREE, LEAST = 54, 38, 14, 40
EDGE, TICK = 3, 12
CURSOR = (0.9, 0.28, 0.3)


class Strip:
    """Joint rates of a run, drawn once.

    Attributes:
        axes: matplotlib's axes.
    """

    def __init__(self, run: Run, end: float, width: int, height: int) -> None:
        """Draw the rates.

        Args:
            run: The run, with at least one tick.
            end: End of the time axis [s].
            width: Width of the picture [pixels].
            height: Height of the picture [pixels].
        """
        with mpl.rc_context({"font.size": LETTERS, "legend.fontsize": LETTERS}):
            figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
            self._canvas = FigureCanvasAgg(figure)
            self.axes: Axes = figure.add_subplot()
            draw(self.axes, panels(run, ["rates"])[0], room=54.0 * width / DPI)
            self.axes.set_xlim(0.0, end)
            self.axes.set_xlabel("time [s]", labelpad=1.0)
        self._picture: NDArray[np.uint8] | None = None
        above, legend = float(FREE), self.axes.get_legend()
        if legend is not None:
            renderer = self._canvas.get_renderer()  # type: ignore[no-untyped-call]
            above = legend.get_window_extent(renderer).height + 2.0
            if height - BELOW - above < LEAST:
                legend.remove()
                above = float(FREE)
        self.axes.set_position((LEFT / width, BELOW / height, 1.0, (height - BELOW - above) / height))

    def _make_room(self) -> None:
        """Place the name of the axis beside its longest number, with both within the picture."""
        renderer = self._canvas.get_renderer()  # type: ignore[no-untyped-call]
        name, (width, _) = self.axes.yaxis.label, self._canvas.get_width_height()
        numbers = max(one.get_window_extent(renderer).width for one in self.axes.get_yticklabels())
        right = EDGE + name.get_window_extent(renderer).width
        left = max(LEFT, right + numbers + TICK)
        frame = self.axes.get_position()
        self.axes.set_position((left / width, frame.y0, (width - left - FREE) / width, frame.height))
        across = blended_transform_factory(self._canvas.figure.transFigure, self.axes.transAxes)
        self.axes.yaxis.set_label_coords(right / width, 0.5, transform=across)

    def at(self, time: float) -> NDArray[np.uint8]:
        """Return the strip with the cursor at a time [s], (height, width, 3)."""
        if self._picture is None:
            self._make_room()
            self._canvas.draw()  # type: ignore[no-untyped-call]
            pixels = self._canvas.buffer_rgba()  # type: ignore[no-untyped-call]
            self._picture = np.asarray(pixels)[:, :, :3].copy()
        picture, box = self._picture.copy(), self.axes.get_window_extent()
        column = self.axes.transData.transform((min(time, self.axes.get_xlim()[1]), 0.0))[0]
        left = int(np.clip(round(column), box.x0, box.x1 - 2))
        top = picture.shape[0] - round(box.y1)
        picture[top : picture.shape[0] - round(box.y0), left : left + 2] = np.multiply(255, CURSOR)
        return picture


def share_scale(strips: Sequence[Strip]) -> None:
    """Give strips, also logarithmic ones, one range, so that adjacent rates can be compared."""
    ranges = [strip.axes.get_ylim() for strip in strips]
    scales = {strip.axes.get_yscale() for strip in strips}
    if len(scales) == 1:
        for strip in strips:
            strip.axes.set_ylim(min(low for low, _ in ranges), max(high for _, high in ranges))
