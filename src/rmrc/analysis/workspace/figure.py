"""Pictures of a workspace: the reached set, with and without limits, and how well the arm moves there."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from numpy.typing import NDArray

from rmrc.analysis.factors import Rule
from rmrc.analysis.workspace.joint_map import JointMap
from rmrc.analysis.workspace.reach import Workspace
from rmrc.law.task import Array
from rmrc.show.figures import entitle, explain, lettering, plain, save, sheet

NAMES = {
    "sigma_min": r"$\sigma_{\min}$ [1]",
    "manipulability": r"manipulability $w = \prod\sigma$ [1]",
    "condition": r"condition $\kappa = \sigma_1/\sigma_{\min}$ [1]",
    "postures": "postures [1]",
}
WIDTH = 7.2  # width of the picture [in]
# Larger condition numbers are drawn alike.
WORST_CONDITION = 100.0
# Line styles of joints at their limits, for pictures without colors.
DASHES = ((0, (1, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
MARKERS = "^sD+vP*<"


class Look(NamedTuple):
    """The style of a family of singularities: its color, and its markers on lines, and of points."""

    color: str = "black"
    on_line: str = ""
    within: str = "o"
    beyond: str = "x"


# By the name of the factor; others, and singularities of no known family, have the default.
FAMILIES = {
    "shoulder": Look("#e06c00", "o", ">", "1"),
    "elbow": Look("#8c1d40"),
    "wrist": Look("#5b2fd0", "D", "h", "2"),
    "boom": Look("#00809c", "s", "d", "3"),
    "pivot": Look("#8c1d40"),
}
# Curves must be visible on maps and on gray.
CASING = [Stroke(linewidth=4.2, foreground="white"), Normal()]
PALE, DARK = "0.88", "0.70"
_LEGEND = {"markersize": 6.0}


def draw(found: Workspace | JointMap, path: Path, measure: str | None = None) -> None:
    """Draw a slice of a workspace, or a map over two joints.

    Args:
        found: What to draw.
        path: File to write atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`.
        measure: `sigma_min`, `manipulability`, `condition`, or for a slice `postures`, as a map of the set
            that is reached within the limits; None: none, or over two joints `sigma_min`.
    """
    with lettering():
        if isinstance(found, JointMap):
            save(_joint_map(found, measure or "sigma_min"), [path])
        else:
            save(_workspace(found, measure), [path])


def _workspace(found: Workspace, measure: str | None) -> Figure:
    arm, part = found.task.arm, found.part
    wide, high = found.a[-1] - found.a[0], found.b[-1] - found.b[0]
    figure = sheet(WIDTH, float(np.clip(WIDTH * high / wide, 4.0, 8.0)) + 1.7)
    axes = figure.add_subplot(aspect="equal")
    handles: list[Patch | Line2D] = []
    same = bool((found.free.reached == found.limited.reached).all())
    _region(axes, found, found.free.reached, PALE, "....")
    word = "reached" if same else "reached without joint limits"
    handles.append(Patch(facecolor=PALE, edgecolor="0.6", hatch="....", label=word))
    if measure is None:
        if not same:
            _region(axes, found, found.limited.reached, DARK, "////")
            handles.append(
                Patch(facecolor=DARK, edgecolor="0.35", hatch="////", label="reached within the limits")
            )
    else:
        values = (
            np.where(found.limited.postures > 0, found.limited.postures, np.nan)
            if measure == "postures"
            else found.limited.values[measure]  # type: ignore[index]
        )
        _colored(figure, axes, found.a, found.b, values, measure, _posture(found, measure))
    handles += _singular(axes, found)
    handles += _limits(axes, found)
    (drawn,) = axes.plot(
        *found.links.T, color="#1f4e9c", linewidth=3.5, marker="o", markersize=7.0, markerfacecolor="white",
        markeredgewidth=1.6, zorder=5, solid_capstyle="round", label="the arm",
    )  # fmt: skip
    axes.plot(
        *found.links[-1], marker="*", markersize=14.0, color="#1f4e9c", markeredgecolor="white", zorder=6
    )
    handles.append(drawn)
    first = (
        f"distance from the axis of {plain(arm.joints[part.movers[0]])}, $r$"
        if part.is_round
        else f"${part.labels[0]}$"
    )
    axes.set_xlabel(f"{first} [m]")
    axes.set_ylabel(f"${part.labels[1]}$ [m]")
    axes.set_xlim(found.a[0], found.a[-1])
    axes.set_ylim(found.b[0], found.b[-1])
    where = ""
    if part.cuts:
        other = ({"x", "y", "z"} - set(part.name)).pop()
        where = f", {other} = {round(float(part.origin @ part.normal), 9) + 0.0:.3g} m"
    entitle(figure, f"{plain(arm.path.stem)}: workspace of {plain(arm.site)}{where}")
    explain(figure, handles=handles, loc="outside lower center", ncols=2, handlelength=3.5)
    return figure


def _posture(found: Workspace, measure: str) -> str:
    return "" if measure == "postures" else f", {'worst' if found.worst else 'best'} posture"


def _region(axes: Axes, found: Workspace, reached: NDArray[np.bool_], color: str, hatch: str) -> None:
    """Fill the reached cells, up to the middle of their borders."""
    a, b = (0.5 * (edges[1:] + edges[:-1]) for edges in (found.a, found.b))
    # A half-plane begins on the axis, not in the middle of its first cells.
    if found.part.is_round:
        a, reached = np.insert(a, 0, found.a[0]), np.vstack([reached[:1], reached])
    if reached.any():
        filled = axes.contourf(
            a, b, reached.T.astype(float), levels=[0.5, 1.5], colors=[color], hatches=[hatch]
        )
        filled.set_edgecolor("0.6" if color == PALE else "0.35")
        filled.set_linewidth(0.0)


def _singular(axes: Axes, found: Workspace) -> list[Line2D]:
    """Draw singular curves: solid within the limits, dashed beyond; or points, filled and crosses.

    Each family has its color; curves of no known family are black.
    """
    handles: dict[tuple[str, str], Line2D] = {}
    for within, word in ((False, ", beyond the limits"), (True, "")):
        style: dict[str, Any] = {"linewidth": 2.8, "linestyle": "-"}
        if not within:
            style = {"linewidth": 1.4, "linestyle": (0, (7, 4))}
        if not found.part.is_surface:
            style = {"linestyle": "", "markersize": 2.2 if within else 2.8}
        for curve in found.singular:
            for i, rule in enumerate(found.families or [None]):
                shown = curve.within == within
                if found.part.is_surface and not within:  # up to the limit
                    shown = shown | np.roll(shown, 1) | np.roll(shown, -1)
                if curve.family is not None:
                    shown = shown & (curve.family == i)
                if not shown.any():
                    continue
                style |= _look(rule, found.part.is_surface, within)
                points = np.where(shown[:, None], curve.points, np.nan)
                axes.plot(*points.T, zorder=4, path_effects=CASING, **style)
                label = _family(rule) + word
                handles[label, style["color"]] = Line2D([], [], **style | _LEGEND, label=label)
    return list(handles.values())


def _family(rule: Rule | None) -> str:
    """Return the name of a family of singular curves."""
    if rule is None:
        return "singular"
    return f"singular: {rule.name}" + (f", {rule.family}" if rule.family else "")


def _look(rule: Rule | None, is_line: bool, within: bool = True) -> dict[str, Any]:
    """Return color and markers of a family of singularities."""
    look = FAMILIES.get(rule.name, Look()) if rule is not None else Look()
    if not is_line:
        return {"color": look.color, "marker": look.within if within else look.beyond}
    marks = {"markevery": 0.12, "markersize": 5.0, "markerfacecolor": "white", "markeredgewidth": 1.2}
    return {"color": look.color, "marker": look.on_line, **marks}


def _limits(axes: Axes, found: Workspace) -> list[Line2D]:
    """Draw limit curves with one style per joint, and write the limit beside each."""
    arm, handles, taken = found.task.arm, [], [*found.links]
    for i, joint in enumerate(found.part.joints):
        style: dict[str, Any] = {"linestyle": DASHES[i % len(DASHES)], "color": "black", "linewidth": 2.2}
        if not found.part.is_surface:
            style = {
                "linestyle": "",
                "marker": MARKERS[i % len(MARKERS)],
                "markersize": 3.6,
                "color": "black",
            }
            style |= {"markerfacecolor": "white", "markeredgewidth": 0.6}
        curves = [c for c in found.limits if c.label.rpartition(" ")[0] == arm.joints[joint] and len(c.q)]
        for curve in curves:
            shown = curve.points
            if found.part.is_surface and curve is not curves[0]:
                # Where two curves coincide, as at ±160°, the dashes of both would make a solid line.
                gap = np.linalg.norm(shown[:, None] - curves[0].points, axis=-1).min(axis=1)
                shown = np.where(gap[:, None] < found.free.size, np.nan, shown)
            axes.plot(*shown.T, zorder=3, **style)
            if found.part.is_surface:
                low, high = arm.position_limit[joint]
                value = high if curve.label.endswith("upper") else low
                text = f"{value:.3g} m" if arm.is_slide[joint] else f"{np.degrees(value):.4g}°"
                at = _clearest(curve.points, found, taken)
                taken.append(at)
                box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
                axes.annotate(
                    f"{plain(arm.joints[joint])} = {text}", (at[0], at[1]), fontsize=8, ha="center",
                    va="center", zorder=7, bbox=box,
                )  # fmt: skip
        if curves:
            handles.append(Line2D([], [], **style | _LEGEND, label=f"{plain(arm.joints[joint])} at a limit"))
    return handles


def _clearest(points: Array, found: Workspace, taken: list[Array]) -> Array:
    """Return the point of a curve that is farthest from the frame, the arm, and existing texts."""
    low, high = np.array([found.a[0], found.b[0]]), np.array([found.a[-1], found.b[-1]])
    # A text is about three times as wide as high.
    frame = (np.minimum(points - low, high - points) / [2.0, 1.0]).min(axis=1)
    written = np.linalg.norm((points[:, None] - np.array(taken)) / [2.0, 1.0], axis=-1).min(axis=1)
    return np.asarray(points[np.argmax(np.minimum(2.0 * frame, written))])


def _colored(figure: Figure, axes: Axes, a: Array, b: Array, values: Array, measure: str, more: str) -> None:
    """Draw a map with labeled contours and its colorbar."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return
    norm: Normalize
    colors: Colormap = colormaps["viridis"]
    if measure == "postures":
        most = int(finite.max())
        # Bright enough for black lines.
        colors = ListedColormap([str(gray) for gray in np.linspace(0.95, 0.5, most)])
        norm, levels = BoundaryNorm(np.arange(0.5, most + 1.0), most), np.empty(0)
    elif measure == "condition":
        values = np.minimum(np.where(np.isnan(values), np.nan, values), WORST_CONDITION)
        norm, levels, colors = (
            LogNorm(1.0, WORST_CONDITION),
            np.array([1.5, 2, 3, 5, 10, 30]),
            colormaps["viridis_r"],
        )
    else:
        norm = Normalize(0.0, finite.max())
        levels = finite.max() * np.array([0.1, 0.25, 0.5, 0.75, 0.9])
    mesh = axes.pcolormesh(a, b, values.T, norm=norm, cmap=colors, rasterized=True, zorder=1.5)
    if measure != "postures":
        middle = [edges if len(edges) == n else 0.5 * (edges[1:] + edges[:-1])
                  for edges, n in zip((a, b), values.shape, strict=True)]  # fmt: skip
        lines = axes.contour(*middle, values.T, levels=levels, colors="white", linewidths=1.0, zorder=2)
        axes.clabel(lines, fmt="%.2g", fontsize=8, colors="white")
    bar = figure.colorbar(mesh, ax=axes, label=NAMES[measure] + more, shrink=0.85)
    if measure == "postures":
        bar.set_ticks(list(range(1, int(finite.max()) + 1)))
    elif measure == "condition":
        ticks = [1, 2, 5, 10, 20, 50, 100]
        bar.set_ticks(ticks, labels=[*map(str, ticks[:-1]), "≥ 100"])


def _joint_map(found: JointMap, measure: str) -> Figure:
    arm = found.task.arm
    figure = sheet(WIDTH, 6.4)
    axes = figure.add_subplot()
    degrees = [1.0 if arm.is_slide[joint] else 180.0 / np.pi for joint in found.joints]
    first, second = found.first * degrees[0], found.second * degrees[1]
    _colored(figure, axes, first, second, found.values[measure], measure, "")
    drawn: set[str] = set()
    for i, curve in enumerate(found.singular):
        rule = found.families[found.family[i]] if found.family else None
        label = r"singular: det $J$ = 0" if rule is None else _family(rule)
        axes.plot(
            *(curve * degrees).T, linewidth=2.6, path_effects=CASING, label="" if label in drawn else label,
            **_look(rule, is_line=True),
        )  # fmt: skip
        drawn.add(label)
    names = [f"{plain(arm.joints[joint])} [{'m' if arm.is_slide[joint] else '°'}]" for joint in found.joints]
    axes.set_xlabel(names[0])
    axes.set_ylabel(names[1])
    entitle(figure, f"{plain(arm.path.stem)}: {plain(arm.site)}, rows {' '.join(found.task.axes)}")
    axes.plot(
        found.q[found.joints[0]] * degrees[0], found.q[found.joints[1]] * degrees[1], "*", markersize=14.0,
        color="white", markeredgecolor="black", label="the arm at --q or --keyframe",
    )  # fmt: skip
    explain(figure, loc="outside lower center", ncols=2, handlelength=3.5)
    return figure
