"""The figure of a run for a paper or a lecture: how an arm crossed a singularity, in panels."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.show.figures import DASHES, plain, save
from rmrc.show.palette import BLACK, distinct, mix

Array = NDArray[np.float64]

# A figure that is as wide as this has the path beside the plots over time, else above them [in].
WIDE = 5.0
# Points of a curve: each of these spans of time keeps its least and its largest value, so that peaks stay.
SPANS = 1500
# Rates are drawn up to so many times their limits; where a peak is beyond, its value is written.
CLIPPED = 1.6
# Without limits, rates are drawn on a signed logarithmic scale if the peak is so many times the median peak.
BLOWN_UP = 30.0
# Torque limits are drawn up to so many times the peak: farther away they would flatten the curves.
FAR = 3.0
# Heights of a panel over time, of a lane of the status, of the path, of the filter [in].
TALL, LANE, PATH, FILTER = 1.15, 0.17, 2.1, 1.9
GRAY = "0.45"


@dataclass(frozen=True)
class Panel:
    """A part of the figure.

    Attributes:
        name: As `--panels` has it.
        draw: What draws it.
        over_time: Whether its horizontal axis is time.
        applies: Whether a run has something for it.
    """

    name: str
    draw: Callable[[Axes, Run], None]
    over_time: bool = True
    applies: Callable[[Run], bool] = lambda _: True


def plot(
    run: Run,
    path: str | Path | None = None,
    panels: Sequence[str] = (),
    width: float = 7.16,
    font: float = 8.0,
) -> Figure:
    """Draw a run: path, rates and limits, singular values, errors, torque, status, filter.

    Args:
        run: Of one tick at least.
        path: File to write, whole or not at all; `.png`, `.svg` or `.pdf`; None: no file.
        panels: Of path, rates, sigma, error, torque, pace, status and g, in this order from the top; none:
            all that the run has something for.
        width: Of the figure [in]: 3.5 and 7.16 are one and two columns of a journal.
        font: Size of the letters [pt].

    Returns:
        The figure, which a notebook shows.
    """
    with mpl.rc_context({"font.size": font, "legend.fontsize": max(min(7.0, font), font - 1.0)}):
        picture = figure(run, panels, width)
        if path is not None:
            save(picture, [Path(path)])
    return picture


def figure(run: Run, panels: Sequence[str] = (), width: float = 7.16) -> Figure:
    """Return the figure of a run, in the sizes of letters of the context."""
    by_name = {panel.name: panel for panel in PANELS}
    chosen = [by_name[name] for name in panels] or [panel for panel in PANELS if panel.applies(run)]
    timed, others = ([one for one in chosen if one.over_time is over_time] for over_time in (True, False))
    heights = {"path": PATH, "g": FILTER, "status": 0.35 + LANE * len(_seen(run))}
    tall, beside = [heights.get(one.name, TALL) for one in timed], [heights[one.name] for one in others]
    is_wide = width >= WIDE and bool(timed and others)
    height = max(sum(tall), sum(beside)) if is_wide else sum(tall) + sum(beside)
    picture = Figure(figsize=(width, 0.5 + height), layout="constrained")
    picture.get_layout_engine().set(h_pad=0.02, w_pad=0.02)  # type: ignore[union-attr, call-arg]
    axes: dict[str, Axes] = {}
    if is_wide:
        ((left, right),) = picture.subfigures(1, 2, width_ratios=[2, 3], squeeze=False)
        places = [(left, others, beside), (right, timed, tall)]
    else:
        places = [(picture, [*others, *timed], beside + tall)]
    for place, members, sizes in places:
        grid = place.add_gridspec(len(members), 1, height_ratios=sizes)
        for row, panel in enumerate(members):
            axes[panel.name] = place.add_subplot(grid[row])
            panel.draw(axes[panel.name], run)
    _share_time([axes[one.name] for one in timed], run)
    return picture


def _share_time(axes: Sequence[Axes], run: Run) -> None:
    """Give all plots over time the same axis, which begins at 0, with numbers at the last one."""
    end = max(float(run["time"][-1]), run.period)
    for one in axes:
        one.set_xlim(0.0, end)
        one.tick_params(labelbottom=one is axes[-1])
    if axes:
        axes[-1].set_xlabel("time [s]")


def _draw_path(axes: Axes, run: Run) -> None:
    """Draw the path wanted and the path taken, on the two world axes along which most happens."""
    wanted, taken = run["pose_ref"][:, :3], run["pose"][:, :3]
    extent = np.ptp(np.vstack([wanted, taken]), axis=0)
    first, second = sorted(np.argsort(-extent, kind="stable")[:2])
    blue = _paints(1)[0]
    axes.plot(wanted[:, first], wanted[:, second], "--", color=GRAY, linewidth=1.4, label="wanted")
    axes.plot(taken[:, first], taken[:, second], color=blue, linewidth=1.1, label="actual")
    closest = int(np.argmin(run["sigma"][:, -1]))
    axes.plot(*taken[0, [first, second]], "o", color=blue, markersize=4, label="start")
    axes.plot(
        *taken[closest, [first, second]], "D", color="black", markersize=4, markerfacecolor="none",
        label=r"smallest $\sigma_{\min}$",
    )  # fmt: skip
    axes.set_xlabel(f"${'xyz'[first]}$ [m]")
    axes.set_ylabel(f"${'xyz'[second]}$ [m]")
    # A straight path, and a tip that only turns, still need a plane to be drawn in.
    both = np.vstack([wanted, taken])
    middle, longest = (both.max(axis=0) + both.min(axis=0)) / 2, max(float(extent.max()), 1e-3)
    for axis, set_limits in ((first, axes.set_xlim), (second, axes.set_ylim)):
        room = 0.55 * max(extent[axis], 0.8 * longest)
        set_limits(middle[axis] - room, middle[axis] + room)
    axes.set_aspect("equal", adjustable="box")
    axes.xaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3))
    _legend(axes, 2)


def _draw_rates(axes: Axes, run: Run) -> None:
    """Draw measured and commanded rates against their limits; a peak beyond the plot is written."""
    paints, limit = _paints(len(run.joints)), np.array(run.rate_limit or [math.inf] * len(run.joints))
    for j, (name, paint) in enumerate(zip(run.joints, paints, strict=True)):
        dashes = (0, DASHES[j % len(DASHES)])
        axes.plot(*_thinned(run["time"], run["qdot"][:, j]), color=paint, linestyle=dashes, label=plain(name))
        axes.plot(*_thinned(run["time"], run["qdot_cmd"][:, j]), color=paint, linewidth=0.5, alpha=0.6)
    known = sorted(set(limit[np.isfinite(limit)].tolist()))
    _draw_limits(axes, limit, paints)
    both = np.abs(np.hstack([run["qdot"], run["qdot_cmd"]]))
    peak = float(both.max())
    if known and peak > CLIPPED * known[-1]:
        axes.set_ylim(-CLIPPED * known[-1], CLIPPED * known[-1])
        joint = run.joints[int(both.max(axis=0).argmax()) % len(run.joints)]
        axes.text(
            0.99, 0.96, f"peak {_grouped(peak)} {_unit(run)}/s ↑ ({plain(joint)})", transform=axes.transAxes,
            va="top", ha="right", bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
        )  # fmt: skip
    elif peak > BLOWN_UP * max(float(np.median(both.max(axis=1))), 1e-12):
        axes.set_yscale("symlog", linthresh=_power(float(np.median(both.max(axis=1)))))
    axes.set_ylabel(rf"rate $\dot q$ [{_unit(run)}/s]")
    _legend(axes, 4)


def _draw_sigma(axes: Axes, run: Run) -> None:
    """Draw the smallest singular value, the damping, and where damping begins, on a logarithmic scale."""
    (blue, orange), time = _paints(2), run["time"]
    sigma, damping = run["sigma"][:, -1], run["damping"]
    axes.plot(*_thinned(time, sigma), color=blue, label=r"$\sigma_{\min}$")
    shown = [sigma[sigma > 0.0]]
    if (damping > 0.0).any():
        axes.plot(
            *_thinned(time, np.where(damping > 0.0, damping, np.nan)), color=orange,
            linestyle=(0, DASHES[1]), label=r"$\lambda$",
        )  # fmt: skip
        shown.append(damping[damping > 0.0])
    if run.damping_below > 0.0:
        axes.axhline(run.damping_below, color="black", linewidth=0.7, linestyle=(0, (1, 1.5)),
                     label=r"$\varepsilon$")  # fmt: skip
        shown.append(np.array([run.damping_below]))
    axes.set_yscale("log")
    if len(positive := np.concatenate(shown)):
        axes.set_ylim(_decades(positive))
    axes.set_ylabel(r"$\sigma$, $\lambda$ [1]" if len(shown) > 1 else r"$\sigma$ [1]")
    _legend(axes, 4)


def _draw_error(axes: Axes, run: Run) -> None:
    """Draw the position error along and across the path, and the rotation error."""
    (blue, orange, green), time = _paints(3), run["time"]
    moved = [i for i, axis in enumerate("xyz") if axis in run.axes]
    if moved and run.view.frame == "world":
        along, across = _split(run, moved)
        axes.plot(*_thinned(time, 1e3 * along), color=blue, label="along the path [mm]")
        axes.plot(*_thinned(time, 1e3 * across), color=orange, linestyle=(0, DASHES[1]), label="across [mm]")
    elif moved:
        off = np.linalg.norm(run["pose_error"][:, moved], axis=1)
        axes.plot(*_thinned(time, 1e3 * off), color=blue, label="position [mm]")
    turned = [3 + i for i, axis in enumerate(("rx", "ry", "rz")) if axis in run.axes]
    if turned:
        off = np.linalg.norm(run["pose_error"][:, turned], axis=1)
        axes.plot(*_thinned(time, 1e3 * off), color=green, linestyle=(0, DASHES[2]), label="rotation [mrad]")
    axes.set_ylabel(f"error [{'mm, mrad' if moved and turned else 'mrad' if turned else 'mm'}]")
    _legend(axes, 3)


def _split(run: Run, moved: Sequence[int]) -> tuple[Array, Array]:
    """Return the position error along the path and across, (T,) each [m].

    Where the path rests, its last direction counts.
    """
    error = np.zeros((len(run), 3))
    error[:, moved] = (run["pose_ref"] - run["pose"])[:, moved]
    speed = np.linalg.norm(run["twist_ref"][:, :3], axis=1)
    moves = speed > 1e-9 * max(float(speed.max()), 1e-12)
    last = np.maximum.accumulate(np.where(moves, np.arange(len(run)), 0))
    along = run["twist_ref"][last, :3] / np.maximum(speed[last], 1e-300)[:, None]
    signed = (error * along).sum(axis=1)
    return np.abs(signed), np.linalg.norm(error - signed[:, None] * along, axis=1)


def _draw_torque(axes: Axes, run: Run) -> None:
    """Draw the actuator torques against their limits."""
    for j, (name, paint) in enumerate(zip(run.joints, _paints(len(run.joints)), strict=True)):
        dashes = (0, DASHES[j % len(DASHES)])
        axes.plot(*_thinned(run["time"], run["tau"][:, j]), color=paint, linestyle=dashes, label=plain(name))
    peak = float(np.abs(run["tau"]).max())
    limit = np.array(run.torque_limit or [math.inf] * len(run.joints))
    _draw_limits(axes, np.where(limit < FAR * peak, limit, math.inf), _paints(len(run.joints)))
    slides = set(run.is_slide)
    axes.set_ylabel(rf"torque $\tau$ [{'N·m, N' if len(slides) > 1 else 'N' if slides == {True} else 'N·m'}]")
    _legend(axes, 4)


def _draw_pace(axes: Axes, run: Run) -> None:
    """Draw the pace along the path."""
    axes.plot(*_thinned(run["time"], run["path_rate"]), color=_paints(1)[0])
    axes.set_ylim(-0.05, 1.1)
    axes.set_ylabel(r"pace $\dot s$ [1]")
    axes.grid(color="0.92", linewidth=0.6)


def _draw_status(axes: Axes, run: Run) -> None:
    """Draw when each status holds, a lane each."""
    flags, status, time = _seen(run), run["status"].astype(np.int64), run["time"]
    for lane, flag in enumerate(flags):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], (status & int(flag)) != 0, [0]]).astype(int)))
        spans = [
            (time[begin], max(time[end - 1] - time[begin], run.period))
            for begin, end in zip(edges[::2], edges[1::2], strict=True)
        ]
        # Outlined, so that a status of one tick is seen.
        axes.broken_barh(spans, (lane - 0.32, 0.64), facecolor="0.4", edgecolor="0.4", linewidth=0.8)
    axes.set_yticks(range(len(flags)), [str(flag.name).lower().replace("_", " ") for flag in flags])
    axes.set_ylim(len(flags) - 0.4, -0.6)
    axes.tick_params(left=False)


def _draw_filter(axes: Axes, run: Run) -> None:
    """Draw the gain that the inverse gave each direction, over its singular value."""
    sigma, gain = run["sigma"].ravel(), run["gain"].ravel()
    order = np.argsort(sigma, kind="stable")
    sigma, gain = sigma[order], gain[order]
    seen = (sigma > 0.0) & (gain > 0.0)
    if seen.any():
        every = max(1, int(seen.sum()) // (2 * SPANS))
        blue = _paints(1)[0]
        axes.plot(
            sigma[seen][::every], gain[seen][::every], ".", color=blue, markersize=2.5, label="of the run"
        )
        ends = np.array([sigma[seen][0], sigma[-1]])
        axes.plot(ends, 1.0 / ends, "--", color=GRAY, label=r"$1/\sigma$")
        axes.set_yscale("log")
        axes.set_xscale("log")
        axes.set_xlim(_decades(sigma[seen]))
        axes.set_ylim(_decades(gain[seen]))
    axes.set_xlabel(r"$\sigma$ [1]")
    axes.set_ylabel(r"gain $g(\sigma)$ [1]")
    axes.grid(color="0.92", linewidth=0.6)
    _legend(axes, 2)


PANELS = (
    Panel("path", _draw_path, over_time=False),
    Panel("rates", _draw_rates),
    Panel("sigma", _draw_sigma),
    Panel("error", _draw_error),
    Panel("torque", _draw_torque, applies=lambda run: bool(run["tau"].any())),
    Panel("pace", _draw_pace, applies=lambda run: bool((run["path_rate"] < 1.0).any())),
    Panel("status", _draw_status, applies=lambda run: bool(_seen(run))),
    Panel("g", _draw_filter, over_time=False),
)


def _draw_limits(axes: Axes, limit: Array, paints: Sequence[str]) -> None:
    """Draw finite limits of joints, (n,), to both sides: black where they are one, else in their colors."""
    finite = np.isfinite(limit)
    is_one = len(set(limit.tolist())) == 1
    for i, j in enumerate(np.flatnonzero(finite)[: 1 if is_one else None]):
        for side in (limit[j], -limit[j]):
            axes.axhline(side, color="black" if is_one else paints[j], linewidth=0.8, linestyle=(0, (1, 1.5)),
                         label="limit" if i == 0 and side > 0 else None)  # fmt: skip


def _grouped(value: float) -> str:
    """Return a number of four digits, or whole with its thousands apart."""
    return f"{value:,.0f}" if value >= 1e3 else f"{value:.4g}"


def _seen(run: Run) -> list[Status]:
    """Return the statuses that the run had, in their order."""
    bits = int(np.bitwise_or.reduce(run["status"].astype(np.int64))) if len(run) else 0
    return [flag for flag in Status if flag and int(flag) & bits]


def _thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """Return a curve by the least and the largest value of each span of time: no peak is lost."""
    every = -(-len(time) // SPANS)
    if every <= 2:
        return time, values
    whole = len(time) // every * every
    blocks = values[:whole].reshape(-1, every)
    filled = np.nan_to_num(blocks, nan=0.0)
    ends = np.sort(np.stack([filled.argmin(axis=1), filled.argmax(axis=1)], axis=1), axis=1)
    rows = (np.arange(len(blocks))[:, None] * every + ends).ravel()
    rows = np.unique(np.concatenate([[0], rows, np.arange(whole, len(time))]))
    return time[rows], values[rows]


def _paints(count: int) -> list[str]:
    """Return colors for white paper."""
    return [f"#{mix(color, BLACK, 0.15) >> 8:06x}" for color in distinct(count)]


def _unit(run: Run) -> str:
    slides = set(run.is_slide)
    return "rad, m" if len(slides) > 1 else "m" if slides == {True} else "rad"


def _power(value: float) -> float:
    """Return the power of ten next above a value, or 1."""
    return float(10.0 ** math.ceil(math.log10(value))) if value > 0.0 else 1.0


def _decades(values: Array) -> tuple[float, float]:
    """Return a range of whole decades around positive values, at least two, so that an axis has numbers."""
    low, high = math.floor(math.log10(values.min())), math.ceil(math.log10(values.max()))
    return float(10.0 ** min(low, high - 2)), float(10.0**high)


def _legend(axes: Axes, columns: int) -> None:
    """Put the legend above the panel, where it covers nothing."""
    axes.grid(color="0.92", linewidth=0.6)
    if axes.get_yscale() == "linear":
        axes.yaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3, steps=[1, 2, 2.5, 5, 10]))
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False, handlelength=2.2,
        columnspacing=1.2, borderaxespad=0.1, handletextpad=0.5,
    )  # fmt: skip
