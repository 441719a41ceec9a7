"""A workspace as tables, as JSON, and as a picture."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke

from rmrc.analysis.workspace import Reach, Workspace
from rmrc.arm import Arm
from rmrc.law.task import Array
from rmrc.show import figures
from rmrc.show.sheets import Report, Sheet, number, plain

UNITS = {"area": "m²", "area_accuracy": "m²", "sigma_min": "1", "manipulability": "1"}
# Color and marker of each factor of a determinant; singularities of no known family are black.
BLUE, RED = "#1f4e9c", ("#8c1d40", "")
FAMILIES = {"shoulder": ("#e06c00", "o"), "boom": ("#00809c", "s"), "elbow": RED, "pivot": RED}
MARKS: dict[str, Any] = {"markevery": 0.12, "markersize": 5.0, "markerfacecolor": "white", "zorder": 4}
WIDTH = 7.2  # width of the picture [in]
# Curves must be visible on maps and on gray.
CASING = [Stroke(linewidth=4.2, foreground="white"), Normal()]


def report(space: Workspace, measure: str | None = None) -> Report:
    """Return the report of a workspace.

    The JSON has the question, and for both reachable sets of a slice the largest extents that were reached
    along its coordinates; `area` and how much it can be off; the smallest and the largest σ_min and w of the
    cells; and the number of singular curves by factor, if two joints determine the slice. `others` has the
    same of other slices.

    Args:
        space: The answer of `workspace`.
        measure: The color map of the picture: `sigma_min` or `manipulability`; None: none.

    Example:
        >>> from rmrc.analysis.workspace import workspace
        >>> shown = report(workspace("models/planar_2link.xml", cells=20))
        >>> shown.sheets[0].rows[0], shown.json["with_limits"]["y"]
        (('x [m]', '-2.000 to 2.000', '-1.985 to 2.000'), [-2.0, 2.0])
    """
    spaces = [_facts(each) for each in (space, *space.others)]
    sheets = [_sheet(facts) for facts in spaces]
    return Report(sheets, plain(spaces[0] | {"others": spaces[1:]}), partial(draw, space, measure=measure))


def _facts(space: Workspace) -> dict[str, Any]:
    """Return the JSON of a workspace, with numbers and arrays of numpy."""
    task, arm = space.task, space.task.arm
    families = [{"name": rule.name, "family": rule.family, "where": rule.where} for rule in space.families]
    return {
        "model": arm.path.name, "site": arm.site, "joints": arm.joints, "q": space.home, "axes": task.axes,
        "task_frame": task.frame, "length": task.length, "slice": space.part.name,
        "cells": space.limited.reached.shape, "families": families,
        "without_limits": _measured(space.free), "with_limits": _measured(space.limited),
    }  # fmt: skip


def _measured(reach: Reach) -> dict[str, Any]:
    facts = dict(zip(reach.part.labels, reach.extents.round(9) + 0.0, strict=True))
    facts |= {"area": reach.area, "area_accuracy": reach.accuracy}
    facts |= {name: [np.nanmin(value), np.nanmax(value)] for name, value in reach.values.items()}
    names = [curve.name for curve in reach.singular]
    curves = {name: names.count(name) for name in dict.fromkeys(names)}
    return facts | ({"singular_curves": curves} if reach.part.is_surface else {})


def _sheet(facts: dict[str, Any]) -> Sheet:
    """Return the table of both sets in a slice."""
    title = f"{facts['model']}, site {facts['site']}, slice {facts['slice']}, rows {' '.join(facts['axes'])}"
    rows = []
    for name, value in facts["without_limits"].items():
        unit = "" if isinstance(value, dict) else f" [{UNITS.get(name, 'm')}]"
        rows.append((f"{name}{unit}", _text(value), _text(facts["with_limits"][name])))
    notes = [f"{rule['name']}, {rule['family']}: {rule['where']}" for rule in facts["families"]]
    return Sheet(title, ("", "without limits", "with limits"), rows, notes=tuple(notes))


def _text(value: Any) -> str:
    """Return a number, ends, or counts by name as a cell of a table."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {count}" for name, count in value.items()) or "0"
    return number(value) if isinstance(value, float) else " to ".join(map(number, value))


def draw(space: Workspace, path: Path, measure: str | None = None) -> None:
    """Write the picture of a workspace, atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`."""
    with figures.lettering():
        figures.save(picture(space, measure), [path])


def picture(space: Workspace, measure: str | None = None) -> Figure:
    """Return the picture of a workspace: a panel for each slice; `measure` as in `report`."""
    spaces = (space, *space.others)
    shapes = [float(np.divide(*np.ptp(each.free.extents[::-1], axis=1))) for each in spaces]
    # A panel is narrower than the picture by labels, and a colorbar is below it.
    high = float(np.clip(sum(shapes) * (WIDTH - 1.0), 2.0, 7.5))
    figure = figures.sheet(WIDTH, high + 1.1 + (1.6 if measure else 0.8) * len(spaces))
    panels = figure.subplots(len(spaces), height_ratios=shapes, squeeze=False)[:, 0]
    for axes, each in zip(panels, spaces, strict=True):
        _panel(axes, each, measure)
    if not figures.is_narrow():
        figure.suptitle(figures.plain(f"{space.task.arm.path.stem}: workspace of {space.task.arm.site}"))
    handles = [handle for axes in figure.axes for handle in axes.get_legend_handles_labels()[0]]
    unique = [*{handle.get_label(): handle for handle in handles}.values()]
    figures.explain(figure, handles=unique, loc="outside lower center", ncols=2, handlelength=3.5)
    return figure


def _panel(axes: Axes, space: Workspace, measure: str | None) -> None:
    """Draw a slice: both sets, singular curves, limits, and the arm."""
    arm, part = space.task.arm, space.part
    _region(axes, space.free, "0.88", "....", "reached without joint limits")
    if measure:
        values = space.limited.values[measure].T
        mesh = axes.pcolormesh(*space.limited.edges, values, vmin=0.0, rasterized=True, zorder=1.5)
        axes.figure.colorbar(mesh, ax=axes, label=f"best {measure} [1]", location="bottom", aspect=40)
    else:
        _region(axes, space.limited, "0.7", "////", "reached within the limits")
    families = {rule.name: f"singular: {rule.name}, {rule.family}" for rule in space.families}
    beyond: dict[str, Any] = {"linewidth": 1.4, "dashes": (7, 4)}
    within: dict[str, Any] = {"linewidth": 2.8, "path_effects": CASING}
    for reach, style, more in ((space.free, beyond, ", beyond the limits"), (space.limited, within, "")):
        for curve in reach.singular:
            color, marker = FAMILIES.get(curve.name, ("black", ""))
            label = families.get(curve.name, "singular") + more
            axes.plot(*curve.points.T, color=color, marker=marker, label=label, **style, **MARKS)
    for curve in space.limited.limits:
        axes.plot(*curve.points.T, "k", linewidth=1.2, label="a joint at its limit")
    links = part.coordinates(_links(arm, space.home))
    axes.plot(*links.T, "o-", color=BLUE, linewidth=3.5, markerfacecolor="white", zorder=5, label="the arm")
    axes.plot(*links[-1], "*", markersize=14.0, color=BLUE, markeredgecolor="white", zorder=6)
    first = f"distance from the axis of {figures.plain(arm.joints[part.movers[0]])}, " * part.is_round
    axes.set(xlabel=f"{first}${part.labels[0]}$ [m]", ylabel=f"${part.labels[1]}$ [m]", aspect="equal")
    axes.use_sticky_edges = False
    axes.margins(0.04)


def _region(axes: Axes, reach: Reach, color: str, hatch: str, label: str) -> None:
    """Fill the reached cells, up to the middle of those at the edge."""
    style: dict[str, Any] = {"edgecolor": "0.5", "linewidth": 0.0}
    filled = axes.contourf(*reach.centers, reach.share.T, levels=[0.49, 1.5], colors=[color], hatches=[hatch])
    filled.set(**style)
    axes.fill([], [], facecolor=color, hatch=hatch, label=label, **style)


def _links(arm: Arm, q: Array) -> Array:
    """Return the origins of the bodies along the arm from the world to the site, (k, 3)."""
    poses, _ = arm.frames(arm.configuration(q)[None])
    chain, body = [arm.pose(q)[:3]], int(arm.wiring.body)
    while body > 0:
        chain.insert(0, poses[0, body, :3])
        body = int(arm.model.body_parentid[body])
    return np.array(chain)
