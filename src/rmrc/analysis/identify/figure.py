"""The picture of a log: the positions and the fit at each joint's sharpest command, and the residuals."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from rmrc.analysis.identify.fit import Fitted
from rmrc.analysis.identify.identify import Identified, Joint
from rmrc.show.figures import plain, save
from rmrc.show.palette import HUES

# The left panel shows this multiple of delay and lag, and at least this many periods.
TIMES, PERIODS = 8.0, 40.0
# Largest number of drawn points of a residual.
MOST_POINTS = 4000
BLUE, ORANGE = (f"#{hue >> 8:06x}" for hue in HUES[:2])
DASHED = (0, (5, 2))


def draw_fits(answer: Identified, path: Path) -> None:
    """Draw each fitted joint in a row of two panels.

    Args:
        answer: The result of `identify`.
        path: File to write atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`.
    """
    pairs = [(joint, joint.fit) for joint in answer.joints if joint.fit]
    picture = Figure(figsize=(12.0, 1.2 + 2.6 * len(pairs)), layout="constrained")
    panels = picture.subplots(len(pairs), 2, squeeze=False)
    for (left, right), (joint, fit) in zip(panels, pairs, strict=True):
        _draw_answer(left, joint, fit)
        every = -(-len(fit.residual) // MOST_POINTS)
        right.plot(fit.samples.time[::every], fit.residual[::every], ".", color=BLUE, markersize=2.0)
        spread = 2.0 * joint.noise.total if joint.noise else 0.0
        for side in (-spread, spread):
            right.axhline(side, color="0.35", linestyle=DASHED, linewidth=1.0)
        right.set_title(
            f"residual of the fit; dashed: twice the noise, {spread:.2g}", loc="left", fontsize=10
        )
        right.set_ylabel("residual [rad or m]")
        # 50 µ, because the exponent of an axis would collide with the title
        right.yaxis.set_major_formatter(EngFormatter(sep="\N{THIN SPACE}"))
        for axes in (left, right):
            axes.grid(color="0.9", linewidth=0.8)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    picture.suptitle(plain(f"{answer.log.name}: positions, and commands after delay and lag"))
    picture.legend(
        *panels[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3, frameon=False
    )
    save(picture, [path])


def _draw_answer(axes: Axes, joint: Joint, fit: Fitted) -> None:
    """Draw the positions where the command changes most within the time of delay and lag."""
    sent, time, position = fit.samples
    late = max(abs(fit.total.value), sent.period)
    wide = max(TIMES * late, PERIODS * sent.period)
    inside = (sent.time >= time[0]) & (sent.time <= time[-1])
    change = np.abs(np.interp(sent.time + late, sent.time, sent.rate) - sent.rate)
    begin = float(sent.time[np.argmax(np.where(inside, change, -1.0))]) - 0.25 * wide
    rows = (time >= begin) & (time <= begin + wide)
    time, position, answer = time[rows], position[rows], (position - fit.residual)[rows]
    asked = fit.gain.value * sent.response(0.0).at(time)[0]
    axes.plot(
        time,
        asked - asked[0],
        color="0.45",
        linestyle=DASHED,
        linewidth=1.2,
        label="commanded rates, integrated",
    )
    axes.plot(time, answer - answer[0], color=ORANGE, linewidth=1.8, label="the same with delay and lag")
    axes.plot(time, position - answer[0], "o", color=BLUE, markersize=3.2, label="logged positions")
    times = f"delay {1e3 * fit.delay.value:.4g} ms, lag {1e3 * fit.lag.value:.4g} ms"
    axes.set_title(
        plain(f"{joint.name}: {'not identified' if joint.trouble else times}"), loc="left", fontsize=10
    )
    axes.set_ylabel("position [rad or m]")
