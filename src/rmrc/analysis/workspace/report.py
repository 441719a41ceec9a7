"""A workspace as a table and as JSON, as arrays in a file, and as a picture."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke

from rmrc.analysis.workspace.slices import Map
from rmrc.analysis.workspace.workspace import Workspace
from rmrc.arm import Arm
from rmrc.law.task import Array
from rmrc.show import figures
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.support.files import written_whole

# What a set has: its key in JSON, and its words in the table.
WORDS = {
    "area": "area of the slice [m²]",
    "area_accuracy": "  off by at most [m²]",
    "volume_if_first_joint_turns_fully": "volume, first joint turned fully [m³]",
    "sigma_min": "σ_min [1], in cells",
    "manipulability": "manipulability w [1], in cells",
    "condition": "condition κ [1], in cells",
    "singular_curves": "singular curves",
    "singular_samples": "singular samples",
}
# Color and marker of each factor of a determinant; singularities of no known family are black.
FAMILIES = {
    "shoulder": ("#e06c00", "o"), "elbow": ("#8c1d40", ""), "wrist": ("#5b2fd0", "D"),
    "boom": ("#00809c", "s"), "pivot": ("#8c1d40", ""), "singular": ("black", ""),
}  # fmt: skip
BLUE = "#1f4e9c"
# Where along the curve of a limit its words stand: apart for the limits of two joints.
SHARES = (0.3, 0.7, 0.4, 0.6)
WIDTH = 7.2  # width of the picture [in]
# Curves must be visible on maps and on gray.
CASING = [Stroke(linewidth=4.2, foreground="white"), Normal()]


def report(space: Workspace, measure: str | None = None) -> Report:
    """Return the report of a workspace, or of a map over two joints.

    The JSON has the question, and for each reachable set its area (and volume, for a slice about an axis)
    with its accuracy, the largest extents that were reached, the smallest and the largest σ_min, w and κ of
    the cells, and the number of singular curves, or of singular samples, by factor. Over two joints a curve
    det J = 0 makes the smallest σ_min and w 0, and κ infinite, which is null.

    Args:
        space: The answer of `workspace`.
        measure: The color map of the picture: `sigma_min`, `manipulability` or `condition`; None: none, or
            over two joints `sigma_min`.

    Example:
        >>> from rmrc.analysis.workspace.workspace import workspace
        >>> shown = report(workspace("models/planar_2link.xml", cells=20))
        >>> shown.sheets[0].rows[0], shown.json["with_limits"]["y"]
        (('x [m]', '-2.000 to 2.000', '-1.985 to 2.000'), [-2.0, 2.0])
    """
    facts, names = _facts(space), list(_sets(space))
    words = {label: f"{label} [m]" for label in facts["labels"]} | WORDS
    rows = [
        (word, *(_text(facts[name].get(key)) for name in names))
        for key, word in words.items()
        if key in facts[names[0]]
    ]
    title = f"{facts['model']}, site {facts['site']}, {facts['map']}, rows {' '.join(space.task.axes)}"
    headings = ("", *(name.replace("_", " ") for name in names))
    notes = [f"{rule['name']}, {rule['family']}: {rule['where']}" for rule in facts["families"]]
    return Report(
        [Sheet(title, headings, rows, notes=tuple(notes))],
        plain(facts),
        partial(draw, space, measure=measure),
    )


def save(space: Workspace, path: Path) -> None:
    """Write all results as arrays, atomically, into an `.npz` file; `about` is the JSON of the report."""
    arrays: dict[str, Any] = {"home": space.home, "about": json.dumps(plain(_facts(space)))}
    arrays |= dict(zip("ab", space.limited.edges, strict=True))
    for name, some in _sets(space).items():
        values = {"share": some.share, "q": some.q} | some.values
        arrays |= {f"{name}_{key}": value for key, value in values.items()}
    curves = [*space.singular, *space.limits]
    arrays["curve"] = np.repeat([curve.name for curve in curves] or [""], [len(c.q) for c in curves] or [0])
    for key in ("q", "points", "within"):
        arrays[f"curve_{key}"] = np.concatenate([getattr(curve, key) for curve in curves] or [np.empty(0)])
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _sets(space: Workspace) -> dict[str, Map]:
    if space.part is None:
        return {"over_joints": space.limited}
    return {"without_limits": space.free, "with_limits": space.limited}


def _facts(space: Workspace) -> dict[str, Any]:
    """Return the JSON of a workspace, with numbers and arrays of numpy."""
    task, part, arm = space.task, space.part, space.task.arm
    names = tuple(arm.joints[joint] for joint in space.over)
    name = f"slice {part.name}" if part else f"over {' and '.join(names)}"
    families = [{"name": rule.name, "family": rule.family, "where": rule.where} for rule in space.families]
    about = {
        "model": arm.path.name, "site": arm.site, "joints": arm.joints, "q": space.home, "axes": task.axes,
        "task_frame": task.frame, "length": task.length, "map": name,
        "labels": part.labels if part else names, "cells": space.limited.count.shape,
        "posture": "worst" if space.limited.worst else "best", "families": families,
    }  # fmt: skip
    return about | {name: _set_facts(space, some) for name, some in _sets(space).items()}


def _set_facts(space: Workspace, some: Map) -> dict[str, Any]:
    part, facts, counts = some.part, dict[str, Any](), dict[str, int]()
    for curve in space.singular:
        inside = curve.within | (some is space.free)
        counts[curve.name] = counts.get(curve.name, 0) + int(
            inside.any() if space.has_lines else inside.sum()
        )
    ends = {key: [np.nanmin(value), np.nanmax(value)] for key, value in some.values.items()}
    if part is None and space.singular:
        ends["sigma_min"][0] = ends["manipulability"][0] = 0.0
        ends["condition"][1] = np.inf
    if part and some.extents is not None:
        facts = dict(zip(part.labels, some.extents.round(9) + 0.0, strict=True))
        facts |= {"area": some.area, "area_accuracy": some.accuracy}
    if part and part.is_round:
        facts["volume_if_first_joint_turns_fully"] = some.volume
    is_square = part is not None or len(space.task.rows) == space.task.arm.n
    return (
        facts
        | ends
        | {"singular_curves" if space.has_lines else "singular_samples": counts if is_square else None}
    )


def _text(value: Any) -> str:
    """Return a number, ends, or counts by name as a cell of a table."""
    if value is None:
        return UNDEFINED
    if isinstance(value, dict):
        return ", ".join(f"{name} {count}".removeprefix("singular ") for name, count in value.items()) or "0"
    return number(value) if isinstance(value, float) else " to ".join(map(number, value))


def draw(space: Workspace, path: Path, measure: str | None = None) -> None:
    """Draw a slice of a workspace, or a map over two joints.

    Args:
        space: What to draw.
        path: File to write atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`.
        measure: As in `report`.
    """
    with figures.lettering():
        figures.save(picture(space, measure), [path])


def picture(space: Workspace, measure: str | None = None) -> Figure:
    """Return the picture of a workspace; see `draw`."""
    arm, part, measure = space.task.arm, space.part, measure or ("" if space.part else "sigma_min")
    scale = np.array([1.0 if arm.is_slide[joint] else np.degrees(1.0) for joint in space.over] or [1.0, 1.0])
    labels = [f"{figures.plain(arm.joints[i])} [{'m' if arm.is_slide[i] else '°'}]" for i in space.over]
    a, b = (edges * factor for edges, factor in zip(space.limited.edges, scale, strict=True))
    # The axes are narrower than the picture by labels, and by a colorbar.
    width = WIDTH - (2.3 if measure else 1.0)
    high = float(np.clip(width * (b[-1] - b[0]) / (a[-1] - a[0]), 2.0, 7.5)) if part else width
    figure = figures.sheet(WIDTH, high + 1.9)
    axes, patches = figure.add_subplot(aspect="equal" if part else "auto"), list[Patch]()
    if part:
        axis = f"distance from the axis of {figures.plain(arm.joints[part.movers[0]])}, " * part.is_round
        labels = [f"{axis}${part.labels[0]}$ [m]", f"${part.labels[1]}$ [m]"]
        patches.append(_region(axes, space.free, "0.88", "....", "reached without joint limits"))
    if measure:
        _colored(figure, axes, a, b, space.limited, measure)
    else:
        patches.append(_region(axes, space.limited, "0.7", "////", "reached within the limits"))
    _singular(axes, space, scale)
    for share, curve in zip(SHARES, space.limits, strict=False):
        at, joint = curve.points[int(share * len(curve.q))], arm.joints.index(curve.name.rpartition(" ")[0])
        value = (
            f"{curve.q[0, joint]:.3g} m" if arm.is_slide[joint] else f"{np.degrees(curve.q[0, joint]):.4g}°"
        )
        axes.plot(*curve.points.T, "k", linewidth=1.2, label="a joint at its limit")
        box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
        text = f"{figures.plain(arm.joints[joint])} = {value}".replace("-", "−")
        axes.annotate(text, (at[0], at[1]), fontsize=8, ha="center", va="center", zorder=7, bbox=box)
    links = part.coordinates(_links(arm, space.home)) if part else space.home[None, space.over] * scale
    style: dict[str, Any] = {"linewidth": 3.5, "marker": "o", "markersize": 7.0, "markerfacecolor": "white"}
    axes.plot(*links.T, color=BLUE, zorder=5, label="the arm", **style)
    axes.plot(*links[-1], "*", markersize=14.0, color=BLUE, markeredgecolor="white", zorder=6)
    axes.set(xlabel=labels[0], ylabel=labels[1], xlim=a[[0, -1]], ylim=b[[0, -1]])
    rows = "workspace" if part else f"rows {' '.join(space.task.axes)}"
    figures.entitle(figure, figures.plain(f"{arm.path.stem}: {rows} of {arm.site}"))
    handles = {handle.get_label(): handle for handle in [*patches, *axes.get_legend_handles_labels()[0]]}
    figures.explain(
        figure, handles=[*handles.values()], loc="outside lower center", ncols=2, handlelength=3.5
    )
    return figure


def _region(axes: Axes, some: Map, color: str, hatch: str, label: str) -> Patch:
    """Fill the reached cells, up to the middle of those at the edge."""
    (a, b), share = some.centers, some.share
    if some.part and some.part.is_round:  # it begins on the axis, not in the middle of its first cells
        a, share = np.insert(a, 0, 0.0), np.vstack([share[:1], share])
    filled = axes.contourf(a, b, share.T, levels=[0.49, 1.5], colors=[color], hatches=[hatch])
    filled.set(edgecolor="0.5", linewidth=0.0)
    return Patch(facecolor=color, edgecolor="0.5", hatch=hatch, label=label)


def _singular(axes: Axes, space: Workspace, scale: Array) -> None:
    """Draw singular curves: bold within the limits, dashed beyond; or samples: points, and crosses beyond."""
    labels = {rule.name: f"singular: {rule.name}, {rule.family}" for rule in space.families}
    for within, more in ((False, ", beyond the limits"), (True, "")):
        for curve in space.singular:
            color, marker = FAMILIES.get(curve.name, FAMILIES["singular"])
            shown: Any = curve.within == within
            style: dict[str, Any] = {"linestyle": "", "marker": "." if within else "x", "markersize": 3.0}
            if space.has_lines:
                shown = shown | ((not within) & (np.roll(shown, 1) | np.roll(shown, -1)))  # up to the limit
                style = {"marker": marker, "markevery": 0.12, "markersize": 5.0, "markerfacecolor": "white"}
                style |= (
                    {"linewidth": 2.8, "path_effects": CASING}
                    if within
                    else {"linewidth": 1.4, "dashes": (7, 4)}
                )
            if shown.any():
                points = np.where(shown[:, None], curve.points * scale, np.nan)
                (line,) = axes.plot(*points.T, color=color, zorder=4, **style)
                line.set_label(labels.get(curve.name, "singular") + more)


def _colored(figure: Figure, axes: Axes, a: Array, b: Array, some: Map, measure: str) -> None:
    """Draw a map with contours and its colorbar."""
    values, most = some.values[measure], np.nanmax(some.values[measure])
    norm, colors, levels = Normalize(0.0, most), "viridis", most * np.array([0.1, 0.25, 0.5, 0.75, 0.9])
    if measure == "condition":  # larger ones are drawn alike
        norm, colors, levels = LogNorm(1.0, 100.0), "viridis_r", np.array([2.0, 5.0, 10.0, 20.0, 50.0])
    mesh = axes.pcolormesh(a, b, values.T, norm=norm, cmap=colors, rasterized=True, zorder=1.5)
    posture = f", {'worst' if some.worst else 'best'} posture" if some.part else ""
    scale = figure.colorbar(
        mesh, ax=axes, label=WORDS[measure].removesuffix(", in cells") + posture, shrink=0.85
    )
    centers = [0.5 * (edges[1:] + edges[:-1]) for edges in (a, b)]
    scale.add_lines(axes.contour(*centers, values.T, levels=levels, colors="white", linewidths=1.0, zorder=2))


def _links(arm: Arm, q: Array) -> Array:
    """Return the origins of the bodies along the arm from the world to the site, (k, 3)."""
    poses, _ = arm.frames(arm.configuration(q)[None])
    chain, body = [arm.pose(q)[:3]], int(arm.wiring.body)
    while body > 0:
        chain.insert(0, poses[0, body, :3])
        body = int(arm.model.body_parentid[body])
    return np.array(chain)
