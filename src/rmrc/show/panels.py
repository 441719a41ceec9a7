"""What the figures of runs are made of: panels and how they are arranged, curves, axes, legends."""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.show.palette import BLACK, distinct, mix
from rmrc.support.spatial import AXES

Array = NDArray[np.float64]

# In the order from the top.
NAMES = ("path", "rates", "sigma", "error", "torque", "pace", "status", "g")
# The others have another axis than time.
OVER_TIME = frozenset(NAMES) - {"path", "g"}
# A figure that is as wide as this has the path beside the plots over time, else above them [in].
WIDE = 5.0
# Points of a curve: each of these spans of time keeps its least and its largest value, so that peaks stay.
SPANS = 1500
# Heights of a panel over time, of a lane of the status, of the path, of the filter [in].
TALL, LANE, PATH, FILTER = 1.15, 0.17, 2.1, 1.9
# Of legends: lengths of a handle and between columns, as parts of the size of letters; and the room that the
# vertical axis takes beside a panel [pt].
HANDLE, SPACE, AXIS = 2.2, 1.2, 45.0
# Rates are drawn up to so many times their limits; where a peak is beyond, its value is written.
CLIPPED = 1.6
# Limits are drawn up to so many times the peak: farther away they would flatten the curves.
FAR = 3.0
# Where one curve has a peak so many times that of another, a logarithmic scale keeps the other to be seen.
APART = 30.0
GRAY = "0.45"
DOTTED = (0, (1, 1.5))
# What of a formula takes no width, and digits above a line.
_MARKS = str.maketrans("", "", "${}^_")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Panel(NamedTuple):
    """A part of a figure.

    Attributes:
        name: One of NAMES.
        draw: What draws it.
        lanes: Of a panel that has some, how many.
    """

    name: str
    draw: Callable[[Axes], None]
    lanes: int = 0

    @property
    def height(self) -> float:
        """How high it is [in]."""
        heights = {"path": PATH, "g": FILTER, "status": 0.35 + LANE * self.lanes}
        return heights.get(self.name, TALL)


def arranged(panels: Sequence[Panel], end: float, width: float) -> Figure:
    """Return a figure of panels: those over time below each other, the others beside or above them.

    Args:
        panels: One at least.
        end: Of the time axis, which begins at 0 [s].
        width: Of the figure [in].
    """
    timed, others = (
        [one for one in panels if (one.name in OVER_TIME) is is_timed] for is_timed in (True, False)
    )
    tall, beside = ([one.height for one in members] for members in (timed, others))
    is_wide = width >= WIDE and bool(timed and others)
    height = max(sum(tall), sum(beside)) if is_wide else sum(tall) + sum(beside)
    picture = Figure(figsize=(width, 0.5 + height), layout="constrained")
    picture.get_layout_engine().set(h_pad=0.02, w_pad=0.02)  # type: ignore[union-attr, call-arg]
    if is_wide:
        ((left, right),) = picture.subfigures(1, 2, width_ratios=[2, 3], squeeze=False)
        places = [(left, others, beside), (right, timed, tall)]
    else:
        places = [(picture, [*others, *timed], beside + tall)]
    for place, members, sizes in places:
        grid = place.add_gridspec(len(members), 1, height_ratios=sizes)
        for row, panel in enumerate(members):
            axes = place.add_subplot(grid[row])
            panel.draw(axes)
            if panel.name in OVER_TIME:
                axes.set_xlim(0.0, end)
                axes.tick_params(labelbottom=panel is timed[-1])
                axes.set_xlabel("time [s]" if panel is timed[-1] else "")
    return picture


def path_plane(positions: Sequence[Array]) -> tuple[int, int, Array, Array]:
    """Return the two world axes along which most happens, and the ends of the plot along each, (3,) [m].

    A straight path, and a tip that only turns, still need a plane to be drawn in.

    Args:
        positions: Of all that is drawn, (T, 3) each [m].
    """
    both = np.vstack(positions)
    extent = np.ptp(both, axis=0)
    first, second = sorted(np.argsort(-extent, kind="stable")[:2])
    middle, longest = (both.max(axis=0) + both.min(axis=0)) / 2, max(float(extent.max()), 1e-3)
    room = 0.55 * np.maximum(extent, 0.8 * longest)
    return int(first), int(second), middle - room, middle + room


def frame_path(axes: Axes, positions: Sequence[Array]) -> tuple[int, int]:
    """Frame a path in its plane, with equal scales; return the two axes."""
    first, second, low, high = path_plane(positions)
    axes.set_xlim(low[first], high[first])
    axes.set_ylim(low[second], high[second])
    axes.set_aspect("equal", adjustable="box")
    axes.xaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3))
    axes.set_xlabel(f"${'xyz'[first]}$ [m]")
    axes.set_ylabel(f"${'xyz'[second]}$ [m]")
    return first, second


def draw_spans(axes: Axes, run: Run, flag: Status, lane: float, color: str) -> None:
    """Draw when a status holds, outlined, so that one of a single tick is seen."""
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
    """Return the name of a status as a reader has it."""
    return str(flag.name).lower().replace("_", " ")


def statuses(run: Run) -> list[Status]:
    """Return the statuses that the run had, in their order."""
    bits = int(np.bitwise_or.reduce(run["status"].astype(np.int64))) if len(run) else 0
    return [flag for flag in Status if flag and int(flag) & bits]


def thinned(time: Array, values: Array) -> tuple[Array, Array]:
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


def paints(count: int) -> list[str]:
    """Return colors that are read on white paper."""
    return [f"#{mix(color, BLACK, 0.15) >> 8:06x}" for color in distinct(count)]


def rate_unit(run: Run) -> str:
    """Return the unit of joint positions, which over s is that of the rates."""
    slides = set(run.is_slide)
    return "rad, m" if len(slides) > 1 else "m" if slides == {True} else "rad"


def power(value: float) -> float:
    """Return the power of ten next above a value, or 1."""
    return float(10.0 ** math.ceil(math.log10(value))) if value > 0.0 else 1.0


def scale_by_decades(axes: Axes, names: str = "y") -> None:
    """Give axes a logarithmic scale: powers as letters, which are set sooner, and marks at 2 and 5.

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


def legend(axes: Axes, columns: int) -> None:
    """Put the legend above the panel, where it covers nothing.

    Args:
        axes: The panel.
        columns: At most; fewer where long names would make the legend wider than the figure.
    """
    axes.grid(color="0.92", linewidth=0.6)
    if axes.get_yscale() == "linear":
        axes.yaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3, steps=[1, 2, 2.5, 5, 10]))
    names = axes.get_legend_handles_labels()[1]
    size = FontProperties(size=mpl.rcParams["legend.fontsize"]).get_size_in_points()
    room = 72.0 * axes.figure.bbox.width / axes.figure.dpi - AXIS - SPACE * size
    width = max([size, *(_width(name, size) for name in names)]) + (HANDLE + SPACE + 0.5) * size
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=max(1, min(columns, int(room / width))),
        frameon=False, handlelength=HANDLE, columnspacing=SPACE, borderaxespad=0.1, handletextpad=0.5,
    )  # fmt: skip


def _width(text: str, size: float) -> float:
    """Return the width of a text in letters of a size [pt], of a formula roughly: to read it takes long."""
    plain = re.sub(r"\\[a-z]+", "x", text.replace(r"\$", "x")).translate(_MARKS)
    width, _, _ = text_to_path.get_text_width_height_descent(plain, FontProperties(size=size), ismath=False)
    return float(width)


def split_error(run: Run, moved: Sequence[int]) -> tuple[Array, Array]:
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


def off(run: Run) -> dict[str, tuple[Array, int]]:
    """Return the parts of the tracking error by their names, with units, (T,) each, and which curve each is.

    A path along the axes of the arm or of the site has no direction in which its error could be split.
    """
    moved, turned = error_rows(run)
    found: dict[str, tuple[Array, int]] = {}
    if moved and run.view.frame == "world":
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
    """Return the units of some parts of the tracking error, each once."""
    return [unit for unit in ("mm", "mrad") if any(f"[{unit}]" in name for name in names)]


def grouped(value: float) -> str:
    """Return a number of four digits, or whole with its thousands apart."""
    return f"{value:,.0f}" if 1e3 <= value < 1e9 else f"{value:.4g}"


def torque_unit(run: Run) -> str:
    """Return the unit of the actuator torques of an arm."""
    slides = set(run.is_slide)
    return "N·m, N" if len(slides) > 1 else "N" if slides == {True} else "N·m"


def applies(name: str, run: Run) -> bool:
    """Say whether a run has something for a panel."""
    if name == "torque":
        return bool(run["tau"].any())
    if name == "pace":
        return bool((run["path_rate"] < 1.0).any())
    return name != "status" or bool(statuses(run))
