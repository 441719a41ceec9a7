"""The parts of plots of runs: panels and their arrangement, curves, axes, legends."""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.show.figures import Picture
from rmrc.show.palette import BLACK, distinct, mix
from rmrc.support.spatial import AXES

Array = NDArray[np.float64]

# Panels in their order from the top.
NAMES = ("path", "rates", "sigma", "error", "torque", "pace", "status", "g")
# Panels over time; the others have another axis.
OVER_TIME = frozenset(NAMES) - {"path", "g"}
# A figure of at least this width has the path beside the plots over time, a narrower one above them [in].
WIDE = 5.0
# Number of spans of time of a long curve. Each keeps its least and its largest value, so that peaks stay.
SPANS = 1500
# Heights of a panel over time, of a lane of the status, of the path, of the filter, in sizes of letters.
TALL, LANE, PATH, FILTER = 10.0, 1.6, 17.0, 15.0
# Room for numbers and the name of the vertical axis, for half a number at the right, between panels, and for
# numbers and the name of the horizontal axis, in sizes of letters.
SIDE, RIGHT, GAP, BELOW = 6.8, 1.6, 0.8, 3.6
# A line of a legend, in sizes of its letters.
ENTRY = 1.7
# Lengths in a legend: of a handle and between columns, as parts of the size of letters.
HANDLE, SPACE = 2.2, 1.2
# Rates are drawn up to this multiple of their limits; the value of a peak beyond is written.
CLIPPED = 1.6
# Limits are drawn up to this multiple of the peak: farther away they would flatten the curves.
FAR = 3.0
# Where one curve has a peak this many times that of another, a logarithmic scale keeps the other visible.
APART = 30.0
# A path that is no longer than this is a point, and is drawn in a plot of this size [m].
POINT, SMALLEST = 1e-6, 0.01
GRAY = "0.45"
DOTTED = (0, (1, 1.5))
# Characters of a formula that take no width, and digits above a line.
_MARKS = str.maketrans("", "", "${}^_")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Panel(NamedTuple):
    """A part of a figure.

    Attributes:
        name: One of NAMES.
        draw: Draws it, and returns the number of lines of its legend.
        lanes: Names of the lanes of a panel that has some.
    """

    name: str
    draw: Callable[[Axes], int]
    lanes: Sequence[str] = ()

    @property
    def height(self) -> float:
        """Height of its frame, in sizes of letters."""
        heights = {"path": PATH, "g": FILTER, "status": 0.6 + LANE * len(self.lanes)}
        return heights.get(self.name, TALL)


def arranged(panels: Sequence[Panel], end: float, width: float) -> Picture:
    """Return a figure of panels: those over time below each other, the others beside or above them.

    The layout needs no drawing: sizes follow from those of letters, so that frames are aligned and a legend
    of many lines takes no room from a frame.

    Args:
        panels: One at least.
        end: End of the time axis, which begins at 0 [s].
        width: Width of the figure [in].
    """
    timed, others = (
        [one for one in panels if (one.name in OVER_TIME) is is_timed] for is_timed in (True, False)
    )
    is_wide = width >= WIDE and bool(timed and others)
    columns = [(0.4, others), (0.6, timed)] if is_wide else [(1.0, [*others, *timed])]
    # Frames are placed here: a layout that a user has chosen for all figures would move them.
    picture = Picture(figsize=(width, width))
    picture.set_layout_engine("none")
    size, x, placed = mpl.rcParams["font.size"], 0.0, []
    entry = ENTRY * FontProperties(size=mpl.rcParams["legend.fontsize"]).get_size_in_points()
    for share, members in columns:
        lanes = max((_width(name, size) for one in members for name in one.lanes), default=0.0)
        side = max(SIDE * size, lanes + 1.4 * size)
        free = 72.0 * share * width - side - RIGHT * size
        column, top = [], GAP * size
        for panel in members:
            axes = picture.add_axes((x + side / (72.0 * width), 0.0, free / (72.0 * width), 0.1))
            top += entry * panel.draw(axes)
            is_last = panel.name not in OVER_TIME or panel is timed[-1]
            if panel.name in OVER_TIME:
                axes.set_xlim(0.0, end)
                axes.tick_params(labelbottom=is_last)
                axes.set_xlabel("time [s]" if is_last else "")
            if panel.name != "path":  # its frame has the width that its scale needs
                _name_side(axes, panel.height * size, -(SIDE - 0.9) * size / free, size)
            column.append((axes, top, panel.height * size))
            top += panel.height * size + (BELOW if is_last else GAP) * size
        placed.append((column, top))
        x += share
    high = max(top for _, top in placed)
    picture.set_size_inches(width, high / 72.0)
    for column, top in placed:
        grows = [height if axes.get_aspect() == "auto" else 0.0 for axes, _, height in column]
        more, grown = (high - top) / max(sum(grows), size), 0.0  # of the frames of a short column
        for (axes, above, height), its in zip(column, grows, strict=True):
            left, _, across, _ = axes.get_position(original=True).bounds
            grown += more * its
            axes.set_position(
                (left, 1.0 - (above + height + grown) / high, across, (height + more * its) / high)
            )
    return picture


def _name_side(axes: Axes, height: float, place: float, size: float) -> None:
    """Align the name of the vertical axis with the others of a column, in two lines if it is too long.

    Args:
        axes: The panel.
        height: Height of its frame [pt].
        place: Center of the name, in widths of the frame.
        size: Size of the letters [pt].
    """
    name = axes.get_ylabel()
    if _width(name, size) > height:
        axes.set_ylabel(name.replace(" [", "\n[", 1))
    axes.yaxis.set_label_coords(place, 0.5)
    axes.yaxis.label.set_verticalalignment("center")


def path_plane(positions: Sequence[Array]) -> tuple[int, int, Array, Array]:
    """Return the two world axes of the largest extents, and the ends of the plot along each, (3,) [m].

    A straight path, and a tip that only turns, also need a plane.

    Args:
        positions: Positions of all curves, (T, 3) each [m].
    """
    both = np.vstack(positions)
    extent = np.ptp(both, axis=0)
    first, second = sorted(np.argsort(-extent, kind="stable")[:2])
    longest = float(extent.max()) if extent.max() > POINT else SMALLEST
    middle = (both.max(axis=0) + both.min(axis=0)) / 2
    room = 0.55 * np.maximum(extent, 0.8 * longest)
    return int(first), int(second), middle - room, middle + room


def frame_path(axes: Axes, positions: Sequence[Array]) -> tuple[int, int]:
    """Frame a path in its plane, with equal scales; return the two axes."""
    first, second, low, high = path_plane(positions)
    axes.set_xlim(low[first], high[first])
    axes.set_ylim(low[second], high[second])
    axes.set_aspect("equal", adjustable="box", anchor="NW")
    axes.xaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3))
    axes.set_xlabel(f"${'xyz'[first]}$ [m]")
    axes.set_ylabel(f"${'xyz'[second]}$ [m]")
    return first, second


def draw_wanted(axes: Axes, wanted: Array, first: int, second: int) -> None:
    """Draw the wanted path, (T, 3), on two world axes; that of a tip that only turns is a point."""
    if is_point(wanted):
        axes.plot(*wanted[0, [first, second]], "+", color="black", markersize=9, label="wanted (a point)")
    else:
        axes.plot(wanted[:, first], wanted[:, second], "--", color=GRAY, linewidth=1.4, label="wanted")


def is_point(path: Array) -> bool:
    """Return whether positions (T, 3) are all the same [m]."""
    return bool(np.ptp(path, axis=0).max() <= POINT)


def draw_spans(axes: Axes, run: Run, flag: Status, lane: float, color: str) -> None:
    """Draw the times of a status, outlined, so that a status of a single tick is visible."""
    holds = (run["status"].astype(np.int64) & int(flag)) != 0
    edges, time = np.flatnonzero(np.diff(np.concatenate([[0], holds, [0]]).astype(int))), run["time"]
    spans = [
        (time[begin], max(time[end - 1] - time[begin], run.period))
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
    ]
    axes.broken_barh(spans, (lane - 0.32, 0.64), facecolor=color, edgecolor=color, linewidth=0.8)


def name_lanes(axes: Axes, names: Sequence[str]) -> None:
    """Name lanes 0, 1, … from the top."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(left=False)


def in_words(flag: Status) -> str:
    """Return the name of a status for a reader."""
    return str(flag.name).lower().replace("_", " ")


def statuses(run: Run) -> list[Status]:
    """Return the statuses that the run had, in their order."""
    bits = int(np.bitwise_or.reduce(run["status"].astype(np.int64))) if len(run) else 0
    return [flag for flag in Status if flag and int(flag) & bits]


def thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """Return a curve by the least and the largest value of each span of time, so that peaks stay."""
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


def paints(count: int) -> list[str]:
    """Return colors that are legible on white paper."""
    return [on_paper(color) for color in distinct(count)]


def on_paper(color: int) -> str:
    """Return a color of the palette as matplotlib takes it, legible on white paper."""
    return f"#{mix(color, BLACK, 0.15) >> 8:06x}"


def rate_unit(run: Run) -> str:
    """Return the unit of joint rates."""
    slides = set(run.is_slide)
    return "rad/s, m/s" if len(slides) > 1 else "m/s" if slides == {True} else "rad/s"


def power(value: float) -> float:
    """Return the power of ten next above a value, or 1."""
    return float(10.0 ** math.ceil(math.log10(value))) if value > 0.0 else 1.0


def scale_by_decades(axes: Axes, names: str = "y") -> None:
    """Give axes a logarithmic scale: powers as plain text, which is set faster, and marks at 2 and 5.

    Args:
        axes: The panel.
        names: `y`, or `xy`.
    """
    for name in names:
        axes.set(**{f"{name}scale": "log"})
        axis = axes.yaxis if name == "y" else axes.xaxis
        axis.set_major_formatter(lambda value, _: f"10{str(round(math.log10(value))).translate(_RAISED)}")
        axis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        axis.set_minor_formatter(NullFormatter())


def decades(values: Array) -> tuple[float, float]:
    """Return a range of whole decades around positive values, at least two, so that an axis has numbers."""
    low, high = math.floor(math.log10(values.min())), math.ceil(math.log10(values.max()))
    return float(10.0 ** min(low, high - 2)), float(10.0**high)


def legend(axes: Axes, columns: int) -> int:
    """Put the legend above the panel, where it covers nothing; return its number of lines.

    Args:
        axes: The panel.
        columns: Largest number; fewer if long names would make the legend wider than the panel.
    """
    axes.grid(color="0.92", linewidth=0.6)
    if axes.get_yscale() == "linear":
        axes.yaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3, steps=[1, 2, 2.5, 5, 10]))
    names = axes.get_legend_handles_labels()[1]
    size = FontProperties(size=mpl.rcParams["legend.fontsize"]).get_size_in_points()
    room = 72.0 * axes.bbox.width / axes.figure.dpi + SPACE * size
    width = max([size, *(_width(name, size) for name in names)]) + (HANDLE + SPACE + 0.5) * size
    columns = max(1, min(columns, int(room / width)))
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False, handlelength=HANDLE,
        columnspacing=SPACE, borderaxespad=0.1, borderpad=0.3, handletextpad=0.5,
    )  # fmt: skip
    return -(-len(names) // columns)


def _width(text: str, size: float) -> float:
    """Return the width of a text in letters of a size [pt]; roughly for a formula, which is slow."""
    plain = re.sub(r"\\[a-z]+", "x", text.replace(r"\$", "x")).translate(_MARKS)
    width, _, _ = text_to_path.get_text_width_height_descent(plain, FontProperties(size=size), ismath=False)
    return float(width)


def split_error(run: Run, moved: Sequence[int]) -> tuple[Array, Array]:
    """Return the position error along the path and across, (T,) each [m].

    While the path rests, its last direction counts.
    """
    error = np.zeros((len(run), 3))
    error[:, moved] = (run["pose_ref"] - run["pose"])[:, moved]
    speed = np.linalg.norm(run["twist_ref"][:, :3], axis=1)
    moves = speed > 1e-9 * max(float(speed.max()), 1e-12)
    last = np.maximum.accumulate(np.where(moves, np.arange(len(run)), 0))
    along = run["twist_ref"][last, :3] / np.maximum(speed[last], 1e-300)[:, None]
    signed = (error * along).sum(axis=1)
    return np.abs(signed), np.linalg.norm(error - signed[:, None] * along, axis=1)


def off(run: Run) -> dict[str, tuple[Array, int]]:
    """Return the parts of the tracking error by their names, with units, (T,) each, and which curve each is.

    An error along the axes of the arm or of the site cannot be split along the path. The path of a tip that
    only turns has no direction.
    """
    moved, turned = error_rows(run)
    found: dict[str, tuple[Array, int]] = {}
    if moved and run.view.frame == "world" and not is_point(run["pose_ref"][:, :3]):
        along, across = split_error(run, moved)
        found = {"along the path [mm]": (1e3 * along, 0), "across [mm]": (1e3 * across, 1)}
    elif moved:
        found = {"position [mm]": (1e3 * np.linalg.norm(run["pose_error"][:, moved], axis=1), 0)}
    if turned:
        found["rotation [mrad]"] = (1e3 * np.linalg.norm(run["pose_error"][:, turned], axis=1), 2)
    return found


def error_rows(run: Run) -> tuple[list[int], list[int]]:
    """Return the rows of the pose error that the task has: those of the position, and of the rotation."""
    rows = [i for i, axis in enumerate(AXES) if axis in run.axes]
    return [i for i in rows if i < 3], [i for i in rows if i >= 3]


def error_units(names: Iterable[str]) -> list[str]:
    """Return the units of some parts of the tracking error, without repetition."""
    return [unit for unit in ("mm", "mrad") if any(f"[{unit}]" in name for name in names)]


def grouped(value: float) -> str:
    """Return a number with four digits, or whole up to a million, with its thousands separated."""
    return f"{value:,.0f}" if 1e3 <= value < 1e6 else f"{value:.4g}"


def torque_unit(run: Run) -> str:
    """Return the unit of the actuator torques of an arm."""
    slides = set(run.is_slide)
    return "N·m, N" if len(slides) > 1 else "N" if slides == {True} else "N·m"


def applies(name: str, run: Run) -> bool:
    """Return whether a run has data for a panel."""
    if name == "path":  # the path of a tip that only turns is a point
        return not {"x", "y", "z"}.isdisjoint(run.axes) or bool(np.ptp(run["pose"], axis=0)[:3].max() > POINT)
    if name == "torque":
        return bool(run["tau"].any())
    if name == "pace":
        return bool((run["path_rate"] < 1.0).any())
    return name != "status" or bool(statuses(run))
