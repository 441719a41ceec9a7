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


def draw_fits(found: Identified, path: Path) -> None:
    """Draw each fitted joint in a row of two panels.

    Args:
        found: The result of `identify`.
        path: File to write atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`.
    """
    save(figure(found), [path])


def figure(found: Identified) -> Figure:
    """Return the figure for `draw_fits`."""
    joints = [one for one in found.joints if one.fit is not None]
    picture = Figure(figsize=(12.0, 1.2 + 2.6 * len(joints)), layout="constrained")
    for row, joint in enumerate(joints):
        left, right = (picture.add_subplot(len(joints), 2, 2 * row + side) for side in (1, 2))
        if joint.fit is not None:
            _draw_answer(left, joint, joint.fit, found.log.period)
            _draw_rest(right, joint, joint.fit)
        if row == len(joints) - 1:
            left.set_xlabel("time [s]")
            right.set_xlabel("time [s]")
    picture.suptitle(plain(f"{found.log.name}: positions, and commands after delay and lag"))
    picture.legend(
        *picture.axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=3, frameon=False
    )
    return picture


def _draw_answer(axes: Axes, joint: Joint, fit: Fitted, period: float) -> None:
    """Draw the positions where the command changes most within the time of delay and lag."""
    samples, best = fit.samples, fit.best
    wide = max(TIMES * abs(best.delay + best.lag), PERIODS * period)
    begin = _sharpest(fit, max(abs(best.delay + best.lag), period)) - 0.25 * wide
    rows = (samples.time >= begin) & (samples.time <= begin + wide)
    time = np.linspace(begin, begin + wide, 500)
    offset = samples.position - fit.residual - best.gain * _travel(fit, samples.time, True)
    drift = np.interp(time, samples.time, offset)
    zero = float(drift[0] + best.gain * _travel(fit, time[:1], False)[0])
    asked = drift + best.gain * _travel(fit, time, False) - zero
    answer = drift + best.gain * _travel(fit, time, True) - zero
    axes.plot(
        time, asked, color="0.45", linestyle=(0, (5, 2)), linewidth=1.2, label="commanded rates, integrated"
    )
    axes.plot(time, answer, color=ORANGE, linewidth=1.8, label="the same with delay and lag")
    axes.plot(
        samples.time[rows], samples.position[rows] - zero, "o", color=BLUE, markersize=3.2, linestyle="",
        label="logged positions",
    )  # fmt: skip
    told = f"delay {1e3 * best.delay:.4g} ms, lag {1e3 * best.lag:.4g} ms"
    axes.set_title(
        plain(f"{joint.name}: {'not identified' if joint.trouble else told}"), loc="left", fontsize=10
    )
    axes.set_ylabel("position [rad or m]")
    axes.grid(color="0.9", linewidth=0.8)


def _draw_rest(axes: Axes, joint: Joint, fit: Fitted) -> None:
    """Draw the residual of the fit over the whole time."""
    every = -(-len(fit.residual) // MOST_POINTS)
    axes.plot(fit.samples.time[::every], fit.residual[::every], ".", color=BLUE, markersize=2.0)
    if joint.noise is not None:
        spread = 2.0 * float(np.hypot(joint.noise.value, joint.resolution / np.sqrt(12.0)))
        for side in (-spread, spread):
            axes.axhline(side, color="0.35", linestyle=(0, (5, 2)), linewidth=1.0)
        title = f"residual of the fit; dashed: twice the noise, {spread:.2g}"
        axes.set_title(title, loc="left", fontsize=10)
    axes.set_ylabel("residual [rad or m]")
    # 50 µ, because the exponent of an axis would collide with the title
    axes.yaxis.set_major_formatter(EngFormatter(sep="\N{THIN SPACE}"))
    axes.grid(color="0.9", linewidth=0.8)


def _travel(fit: Fitted, time: np.ndarray, is_answer: bool) -> np.ndarray:
    commands, best = fit.samples.commands, fit.best
    return (commands.lagged(best.lag).at(time - best.delay) if is_answer else commands.lagged(0.0).at(time))[
        0
    ]


def _sharpest(fit: Fitted, wide: float) -> float:
    """Return the time when the commands change most within a duration [s]."""
    sent = fit.samples.commands
    inside = (sent.time >= fit.samples.time[0]) & (sent.time <= fit.samples.time[-1])
    change = np.abs(np.interp(sent.time + wide, sent.time, sent.rate) - sent.rate)
    return float(sent.time[np.argmax(np.where(inside, change, -1.0))])
