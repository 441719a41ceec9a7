"""Pictures that do not depend on color alone, and their files, written whole.

An arm and its velocity ellipsoids are shadows on the plane of a figure.
"""

import io
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.show.palette import ASKED
from rmrc.support.files import written_whole
from rmrc.support.spatial import AXES, Array
from rmrc.textbook.chains import geometric_from_screws, space_jacobian
from rmrc.textbook.singularity import ellipsoid_points, holding_jacobian, velocity_ellipsoid

# Without colors, these distinguish neighbors.
MARKERS = "osD^vP*X"
# Resolution of a PNG [1/in].
DPI = 150


# A picture narrower than this is for a column: its legend is below it, and the caption replaces its title
# [in].
COLUMN = 5.0
# Least height of such a picture, as a part of its width; width of a letter, as a part of its size.
LOWEST, LETTER = 0.75, 0.55


class Picture(Figure):
    """A figure that a notebook shows by itself. It shows pyplot's figures only after pyplot has drawn one."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()


def sheet(width: float, height: float) -> Figure:
    """Return an empty figure of a size [in], or of the requested width with the same proportions.

    Letters have the requested size if the code that draws into the figure runs within `lettering`.
    """
    wide = ASKED.get().width or width
    high = height * wide / width
    return Figure(figsize=(wide, max(high, LOWEST * wide) if is_narrow() else high), layout="constrained")


def lettering() -> AbstractContextManager[None]:
    """Have letters of the requested size: those that are smaller by custom have at least 7 pt."""
    font = ASKED.get().font or (8.0 if is_narrow() else None)
    if font is None:
        return nullcontext()
    small = max(min(7.0, font), font - 1.0)
    return mpl.rc_context(
        {"font.size": font, "legend.fontsize": small, "axes.titlesize": font, "figure.titlesize": font}
    )


def entitle(figure: Figure, text: str) -> None:
    """Put a title above a picture, unless it is for a column."""
    if not is_narrow():
        figure.get_axes()[0].set_title(text)


def explain(figure: Figure, **options: Any) -> None:
    """Put a legend outside the axes of a picture, or below them, entry by entry, if it is for a column."""
    if not is_narrow():
        figure.legend(frameon=False, **options)
        return
    # The figure grows by the height of the legend, so the axes keep their size.
    found = figure.legend(**{**options, "frameon": False, "loc": "outside lower left", "ncols": 1})
    (width, height), size = figure.get_size_inches(), mpl.rcParams["font.size"]
    for text in found.get_texts():
        letters = int((72.0 * width - 6.0 * size) / (LETTER * size))
        text.set_text(
            "\n".join(fill(one, letters, drop_whitespace=False) for one in text.get_text().split("\n"))
        )
    count = sum(1 + text.get_text().count("\n") for text in found.get_texts())
    figure.set_size_inches(width, height + 1.5 * count * size / 72.0)


def is_narrow() -> bool:
    """Return whether a picture is for a column of a journal."""
    width = ASKED.get().width
    return width is not None and width < COLUMN


def save(figure: Figure, paths: Sequence[Path]) -> None:
    """Write a picture, atomically.

    Args:
        figure: The picture.
        paths: Files to write, in the format of their suffix: `.png`, `.svg` or `.pdf`.
    """
    for path in paths:
        with written_whole(path) as temporary:
            _write(figure, temporary, path.suffix[1:])


def as_svg(figure: Figure) -> str:
    """Return a picture as the text of an SVG file."""
    stream = io.BytesIO()
    _write(figure, stream, "svg")
    return stream.getvalue().decode()


def _write(figure: Figure, to: Path | io.BytesIO, kind: str) -> None:
    # Text stays text, so that a page can be searched, in fonts that journals accept (they refuse Type 3). A
    # date would make the files of equal pictures differ.
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rmrc", "pdf.fonttype": 42}):
        if engine := figure.get_layout_engine():  # savefig alone would arrange it twice
            engine.execute(figure)
            figure.set_layout_engine("none")
        figure.savefig(to, format=kind, dpi=DPI, metadata=metadata)


def plain(text: str) -> str:
    """Return a text that matplotlib does not read as mathematics."""
    return text.replace("$", r"\$")


# Number of ellipsoids on the way out, beside that at the smallest singular value.
COUNT = 4
# The longest half axis is at most this part of the path's extent. It is the motion at unit-norm joint rates
# in one of these times [s].
PART, TIMES = 0.5, (0.2, 0.1, 0.05, 0.02, 0.01)
# A half axis below this share of the longest is rounding: the ellipsoid lies in the plane.
FLAT = 1e-9


def shadows(run: Run, first: int, second: int) -> tuple[float, list[Array], bool]:
    """Return the shadows of velocity ellipsoids at a few instants, as `velocities` has them.

    The shadow of {M q̇ : ‖q̇‖ = 1} is that of its two rows M_p, an ellipse of the matrix M_p M_pᵀ.

    Args:
        run: The run, with at least one tick.
        first: World axis of the plane.
        second: The other one.

    Returns:
        The time in which a tip at unit-norm joint rates draws them [s], their outlines (p, 3) [m], and
        whether an ellipsoid extends out of the plane, so that its shadow does not show all of it.
    """
    if not run.screws or not {*run.axes} & {"x", "y", "z"}:
        return TIMES[0], [], False
    rows = instants(run)
    M = velocities(run, rows)
    whole = np.linalg.norm(M, axis=(1, 2)).max()
    drawn = M[:, [first, second]]
    longest = float(np.linalg.norm(drawn, ord=2, axis=(1, 2)).max())
    if longest <= FLAT * whole or not whole > 0.0:
        return TIMES[0], [], False
    extent = float(np.ptp(run["pose"][:, :3], axis=0).max())
    time = next((time for time in TIMES if time * longest <= PART * extent), TIMES[-1])
    outlines = []
    for row, both in zip(rows, drawn, strict=True):
        outline = np.tile(run["pose"][row, :3], (73, 1))
        outline[:, [first, second]] += time * ellipsoid_points(velocity_ellipsoid(both), 73)
        outlines.append(outline)
    across = np.delete(M, [first, second], axis=1)
    return time, outlines, bool(np.abs(across).max() > FLAT * whole)


def closest(run: Run) -> int:
    """Return the tick of the smallest singular value."""
    return int(np.argmin(run["sigma"][:, -1]))


def skeleton(run: Run, row: int) -> Array:
    """Return an arm at a tick as a chain of points from its first axis to its tip, (p, 3) [m].

    From the tip inward, each is the point of a joint's axis that is nearest to the one before. A sliding
    joint begins where it would be at 0.

    Args:
        run: One that knows its screws.
        row: The tick.
    """
    q, points = run["q"][row, list(run.leaders)], [run["pose"][row, :3]]
    axes = space_jacobian(run.screws, q).T
    for axis, position in zip(axes[::-1], q[::-1], strict=True):
        turn, speed = axis[:3], axis[3:]
        if size := np.linalg.norm(turn):
            foot = np.cross(turn, speed) / size**2
            points.append(foot + turn * (turn @ (points[-1] - foot)) / size**2)
        else:
            points.append(points[-1] - position * speed)
    return np.array(points[::-1])


def instants(run: Run) -> NDArray[np.intp]:
    """Return a few ticks that are evenly apart along the way out, and that of the smallest singular value."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(run["pose"][:, :3], axis=0), axis=1))])
    rows = np.searchsorted(way, np.linspace(0.0, 0.5 * way[-1], COUNT)).clip(0, len(run) - 1)
    return np.unique([*rows, closest(run)])


def velocities(run: Run, rows: NDArray[np.intp]) -> Array:
    """Return M = J_v S_q (1 − J_w⁺ J_w) along world axes at some ticks, (F, 3, n) [m].

    J_v has the translations of the task, J_w = J_ω S_q its rotations, which are held: without the projector M
    would stay round at a wrist singularity, where translations are only possible with a turn.

    Args:
        run: One that knows its screws.
        rows: Ticks, (F,).
    """
    leaders, pose = list(run.leaders), run["pose"][rows]
    chain = geometric_from_screws(space_jacobian(run.screws, run["q"][rows][:, leaders]), pose[:, :3])
    J = chain @ np.eye(len(run.joints))[leaders] * run.joint_scale  # axes that one joint moves add up
    J = run.view.turned(J, pose)
    axes = np.array([AXES.index(axis) for axis in run.axes])
    M = np.zeros((len(rows), 3, len(run.joints)))
    M[:, axes[axes < 3]] = holding_jacobian(J[:, axes[axes < 3]], J[:, axes[axes > 2]])
    return run.view.back(M, pose)
