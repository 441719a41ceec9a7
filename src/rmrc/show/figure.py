"""The figure of a run, or of several side by side, for a paper or a lecture."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from textwrap import wrap

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN, CARETUP
from matplotlib.ticker import MaxNLocator

from rmrc.results.run import Run
from rmrc.show.figures import Picture, closest, plain, save, shadows, skeleton
from rmrc.show.palette import GRAY, GREEN, SLATE, css, distinct
from rmrc.show.panels import DASHES, LOOKS, Lane, Panel, Runs, decades, is_point, lanes, thinned
from rmrc.show.panels import NAMES as QUANTITIES
from rmrc.show.panels import panels as panels_over_time
from rmrc.support.errors import QuestionError

# Panels in their order from the top; `arm` and `joints` are drawn only where they are named. Those over time.
NAMES = ("arm", "path", *QUANTITIES, "status", "g")
OVER_TIME = frozenset(QUANTITIES) | {"status"}
# A figure of at least this width has the other panels beside those over time, a narrower one above them [in].
WIDE, SHARES = 5.0, (0.4, 0.6)
# Number of spans of time of a long curve. Each keeps its least and its largest value, so that peaks stay.
SPANS = 1500
# Heights of a panel over time, of a lane, and of the filter; room for the numbers beside and below a panel,
# and between panels; in sizes of letters.
TALL, LANE, FILTER, SIDE, BELOW, GAP = 9.0, 2.2, 14.0, 6.0, 3.5, 1.0
# In a legend: height of a line and width of a letter, in sizes of its letters; width of an entry beside its
# name, in letters.
LINE, LETTER, ENTRY = 1.5, 0.58, 7.0
# The smallest extent of a plot of a path [m].
SMALLEST = 0.01


def plot(
    runs: Run | Runs,
    path: str | Path | None = None,
    panels: Sequence[str] = (),
    width: float = 7.16,
    font: float = 8.0,
) -> Figure:
    """Draw a run, or several side by side: path, rates, singular values, errors, torque, status, filter.

    Args:
        runs: A run; or runs by label, as `compare` returns them. Each has one tick at least.
        path: File to write atomically: `.png`, `.svg` or `.pdf`; None: no file.
        panels: Panels among NAMES, in this order from the top, `error` with `turn_error`; none: all that have
            data, but arm and joints.
        width: Width of the figure [in]: 3.5 and 7.16 are one and two columns of a journal.
        font: Font size [pt].

    Returns:
        The figure, which a notebook shows.

    Raises:
        QuestionError: The runs have no data for the panels.
    """
    several = {runs.name: runs} if isinstance(runs, Run) else runs
    # matplotlib reads sizes of letters when a figure is made.
    with mpl.rc_context({"font.size": font, "legend.fontsize": max(min(7.0, font), font - 1.0)}):
        drawers = _drawers(several, panels)
        if not drawers:
            raise QuestionError(f"{', '.join(several)}: has no data for {', '.join(panels)}")
        end = max(max(float(run["time"][-1]), run.period) for run in several.values())
        picture = _arranged(drawers, end, width)
        save(picture, [] if path is None else [Path(path)])
    return picture


def _drawers(runs: Runs, names: Sequence[str]) -> dict[str, Callable[..., int]]:
    """Return what draws each panel, from the top; it returns the number of lines above the frame."""
    states = lanes(runs)
    drawers: dict[str, Callable[..., int]] = {
        "arm": partial(_draw_path, runs=runs, is_whole=True), "path": partial(_draw_path, runs=runs),
        "status": partial(_draw_lanes, states=states), "g": partial(_draw_filter, runs=runs),
    }  # fmt: skip
    if not names:
        del drawers["arm"]
        if not states:
            del drawers["status"]
        if not any(
            {*run.axes} & {"x", "y", "z"} or not is_point(run["pose"][:, :3]) for run in runs.values()
        ):
            del drawers["path"]
    named = [part for name in names for part in ([name, "turn_error"] if name == "error" else [name])]
    for panel in panels_over_time(runs, [name for name in named if name in QUANTITIES]):
        drawers[panel.name] = partial(draw, panel=panel)
    return {name: drawers[name] for name in dict.fromkeys(named or NAMES) if name in drawers}


def _arranged(drawers: Mapping[str, Callable[..., int]], end: float, width: float) -> Figure:
    """Return the figure: panels over time below each other, the others beside or above them.

    Args:
        drawers: What draws each panel, one at least.
        end: End of the time axis, which begins at 0 [s].
        width: Width of the figure [in].
    """
    below = [name for name in drawers if name in OVER_TIME]
    others = [name for name in drawers if name not in OVER_TIME]
    columns, shares = [[*others, *below]], [1.0]
    if width >= WIDE and below and others:
        columns, shares = [others, below], [*SHARES]
    elif width >= WIDE and len(others) > 1:
        columns, shares = [[name] for name in others], [1.0 / len(others)] * len(others)
    picture, font = Picture(figsize=(width, width), layout="constrained"), mpl.rcParams["font.size"]
    grid, first, placed = picture.add_gridspec(1, len(columns), width_ratios=shares), None, []
    for i, (members, share) in enumerate(zip(columns, shares, strict=True)):
        rows, room = grid[i].subgridspec(len(members), 1), 72.0 * share * width - SIDE * font
        frames, around = [], 0.0
        for j, name in enumerate(members):
            is_timed, is_last = name in OVER_TIME, name in (*others, below[-1] if below else "")
            axes = picture.add_subplot(rows[j], sharex=first if is_timed else None)
            lines = drawers[name](axes, room=room)
            if is_timed:
                first = first or axes
                axes.set_xlim(0.0, end)
                axes.tick_params(labelbottom=is_last)
                axes.set_xlabel("time [s]" if is_last else "")
            axes.grid(color="0.92", linewidth=0.6)
            axes.set_axisbelow(True)
            frames.append(_height(axes, room))
            around += font * (LINE * lines + BELOW * is_last + GAP)
        placed.append((rows, frames, around))
    high = max(sum(frames) + around for _, frames, around in placed)
    for rows, frames, around in placed:  # the last panel of a shorter column fills it
        rows.set_height_ratios([*frames[:-1], high - around - sum(frames[:-1])])
    picture.set_size_inches(width, high / 72.0)
    return picture


def _height(axes: Axes, room: float) -> float:
    """Return the height of a panel [pt], whose width is `room` [pt]: of a path, as its scale needs it."""
    font = float(mpl.rcParams["font.size"])
    if axes.get_aspect() != "auto":
        return room * float(np.ptp(axes.get_ylim()) / np.ptp(axes.get_xlim()))
    if axes.get_xscale() == "log":
        return FILTER * font
    return LANE * len(axes.get_yticks()) * font if axes.yaxis_inverted() else TALL * font


def draw(axes: Axes, panel: Panel, room: float) -> int:
    """Draw a panel over time.

    Args:
        axes: Where.
        panel: What.
        room: Width for its legend [pt].

    Returns:
        The number of lines above its frame.
    """
    entries = dict[str, Artist]()
    for curve in sorted(panel.curves, key=lambda curve: curve.role in ("plain", "baseline")):
        width, _ = LOOKS[curve.role]
        (line,) = axes.plot(
            *thinned(curve.time, curve.values, SPANS), color=css(curve.color), linewidth=width,
            linestyle=(0, curve.dashes), label=curve.label,
            zorder=1.8 if curve.role in ("plain", "baseline") else 2.0,
        )  # fmt: skip
        if curve.role == "commanded":
            entries.setdefault("cmd", Line2D([], [], color=css(SLATE), linewidth=width))
        elif curve.role in ("plain", "baseline") and not curve.run:  # without its joint
            entries[curve.name.partition(",")[0]] = line
        else:
            entries[curve.name] = line
    for level in panel.levels:
        line = axes.axhline(level.value, color=css(level.color), linewidth=0.9, linestyle=(0, (1, 1.5)))
        entries.setdefault(level.name.partition(",")[0], line)
    for peak in panel.peaks:
        end, mark = (panel.range[1], CARETUP) if peak.is_up else (panel.range[0], CARETDOWN)
        axes.plot(peak.time, end, marker=mark, color=css(peak.color), markersize=5.0, zorder=4.0)
    axes.set_ylim(panel.range)
    if panel.is_logarithmic:
        axes.set_yscale("log")
        axes.minorticks_off()
    else:
        axes.yaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3, steps=[1, 2, 2.5, 5, 10]))
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:.4g}".replace("-", "−"))
    names = entries if len(entries) > 1 else {}  # the title says what a single curve is
    return _explain(axes, [f"{panel.title} [{panel.unit}]", *panel.beyond], names, room)


def _draw_path(axes: Axes, runs: Runs, room: float, is_whole: bool = False) -> int:
    """Draw the wanted path and those taken, on the two world axes of the largest extents.

    A run alone has the shadows of its velocity ellipsoids. The arm is that of the first run, at its start and
    where it is closest to a singularity.
    """
    run, entries = next(iter(runs.values())), dict[str, Artist]()
    wanted, ways = run["pose_ref"][:, :3], [run["pose"][:, :3] for run in runs.values()]
    arms = [skeleton(run, row) for row in (0, closest(run))] if is_whole and run.screws else []
    whole = np.vstack([wanted, *ways, *arms])
    plane = sorted(np.argsort(-np.ptp(whole, axis=0), kind="stable")[:2].tolist())
    time, outlines, is_shadow = shadows(run, *plane) if len(runs) == 1 else (0.0, [], False)
    for arm, gray, name in zip(arms, ("0.7", "0.3"), ("arm, start", "arm, σ_min least"), strict=False):
        (entries[name],) = axes.plot(*arm[:, plane].T, "o-", color=gray, linewidth=2.2, markersize=3.5)
    for outline in outlines:
        name, green = f"velocity ellips{'oid, shadow' if is_shadow else 'e'}, {time:g} s", css(GREEN)
        (entries[name],) = axes.fill(
            *outline[:, plane].T, facecolor=f"{green}30", edgecolor=green, linewidth=0.7, label=name
        )
    if is_point(wanted):
        (entries["wanted (a point)"],) = axes.plot(*wanted[0, plane], "+", color="black", markersize=9)
    else:
        (entries["wanted"],) = axes.plot(*wanted[:, plane].T, "--", color=css(GRAY), linewidth=1.4)
    for i, (label, way) in enumerate(zip(runs, ways, strict=True)):
        name, color = label if len(runs) > 1 else "actual", css(distinct(len(runs))[i])
        (entries[name],) = axes.plot(
            *way[:, plane].T, color=color, linewidth=1.2, linestyle=(0, DASHES[i % len(DASHES)])
        )
    if len(runs) == 1 and not is_whole:
        for name, mark, row in (("start", "o", 0), ("smallest σ_min", "D", closest(run))):
            (entries[name],) = axes.plot(*ways[0][row, plane], mark, color="black", ms=4, mfc="none")
    shown = np.vstack([whole, *outlines])[:, plane]
    middle, extent = (shown.max(axis=0) + shown.min(axis=0)) / 2, np.ptp(shown, axis=0)
    half = 0.55 * np.maximum(extent, 0.8 * max(float(extent.max()), SMALLEST))
    axes.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] - half[1], middle[1] + half[1]))
    axes.set_aspect("equal", adjustable="box", anchor="NW")
    axes.xaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3))
    axes.yaxis.set_major_locator(MaxNLocator(5, min_n_ticks=3))
    axes.set(xlabel=f"${'xyz'[plane[0]]}$ [m]", ylabel=f"${'xyz'[plane[1]]}$ [m]")
    return _explain(axes, ["Arm and path" if is_whole else "Path"], entries, room)


def _draw_lanes(axes: Axes, states: Sequence[Lane], room: float) -> int:
    """Draw the times of each status below its name, outlined, so that a single tick is visible."""
    for i, lane in enumerate(states):
        spans, color = [(begin, end - begin) for begin, end in lane.spans], css(lane.color)
        axes.broken_barh(spans, (i + 0.6, 0.3), facecolor=color, edgecolor=color, linewidth=0.8)
        axes.text(
            0.01, i + 0.32, plain(lane.name), transform=axes.get_yaxis_transform(), va="center",
            fontsize=mpl.rcParams["legend.fontsize"],
        )  # fmt: skip
    axes.set_yticks([i + 1.0 for i in range(len(states))], [])
    axes.set_ylim(max(1, len(states)), 0.0)
    axes.tick_params(left=False)
    return _explain(axes, ["Status"], {}, room)


def _draw_filter(axes: Axes, runs: Runs, room: float) -> int:
    """Draw the gain that each inverse gave each direction, over its singular value."""
    entries, drawn = dict[str, Artist](), []
    for i, (label, run) in enumerate(runs.items()):
        both = np.stack([run["sigma"].ravel(), run["gain"].ravel()])
        both = both[:, (both > 0.0).all(axis=0)]
        both = both[:, np.argsort(both[0], kind="stable")][:, :: max(1, both.shape[1] // (2 * SPANS))]
        name, color = label if len(runs) > 1 else "of the run", css(distinct(len(runs))[i])
        (entries[name],) = axes.plot(*both, ".", color=color, markersize=2.5, label=name)
        drawn.append(both)
    sigma, gain = np.hstack(drawn)
    axes.set_xlabel("σ [1]")
    if len(sigma):
        axes.set(xscale="log", yscale="log")
        ends = np.array([sigma.min(), sigma.max()])
        (entries["1/σ"],) = axes.plot(ends, 1.0 / ends, "--", color=css(GRAY), label="1/σ")
        axes.minorticks_off()
        axes.set_xlim(decades(*ends.tolist()))
        axes.set_ylim(decades(float(gain.min()), float(gain.max())))
    return _explain(axes, ["Filter: gain g(σ) [1]"], entries, room)


def _explain(axes: Axes, lines: Sequence[str], entries: Mapping[str, Artist], room: float) -> int:
    """Put title and legend above a panel, where they cover nothing; return their number of lines.

    Args:
        axes: The panel.
        lines: Its title, and what is beyond its axis.
        entries: What is drawn, by name.
        room: Width of the panel [pt].
    """
    size = FontProperties(size=mpl.rcParams["legend.fontsize"]).get_size_in_points()
    letters = room / (LETTER * size)
    words = [part for line in lines for part in wrap(plain(line), max(20, int(letters)))]
    columns = max(1, min(4, int(letters / (max(map(len, entries), default=0) + ENTRY))))
    names = [wrap(plain(name), max(10, int(letters - ENTRY))) for name in entries]
    axes.legend(
        [*entries.values()], ["\n".join(name) for name in names], title="\n".join(words), title_fontsize=size,
        alignment="left", loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False,
        handlelength=2.2, columnspacing=1.2, borderaxespad=0.1, borderpad=0.3, handletextpad=0.5,
    )  # fmt: skip
    return len(words) + -(-sum(map(len, names)) // columns)
