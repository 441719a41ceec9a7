"""The numbers of a workspace, as tables, as JSON and as a picture."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.analysis.workspace.joint_map import JointMap
from rmrc.analysis.workspace.reach import MEASURES, Reach, Workspace
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number

WORDS = {"sigma_min": "σ_min [1]", "manipulability": "manipulability w [1]", "condition": "condition κ [1]"}
# Sources of the worst values of a workspace.
SOURCES = {"singular": "singular curves", "limits": "limit curves", "cells": "cells"}


def report(found: Workspace | JointMap, measure: str | None = None) -> Report:
    """Return the report of a workspace, or of a map over two joints.

    The JSON of a workspace has slice and cells. For both reachable sets it has area (and volume, for a slice
    about an axis) with their errors, extents with their accuracy, the extremes of σ_min, w and κ, and in
    `worst_from` the source of the worse ones: `singular` curves, those of `limits`, or the middles of
    `cells`, from which the better ones always come; and counts of singular configurations, in all and per
    family. For samples an extent is reached to its accuracy, but is only the largest that was found:
    `extent_is_at_least`. Over two joints the extremes are searched between the positions of the map, to 1e-9
    and less; an infinite κ is null.

    Args:
        found: The result of `workspace` or `joint_map`.
        measure: The color map of the picture: `sigma_min`, `manipulability`, `condition`, or for a slice
            `postures`; None: none, or over two joints `sigma_min`.

    Example:
        >>> from rmrc.analysis.workspace.workspace import workspace
        >>> shown = report(workspace("models/planar_2link.xml", cells=20))
        >>> shown.sheets[0].rows[0][0], shown.json["without_limits"]["x"]
        ('area of the slice [m²]', [-2.0, 2.0])
    """
    if isinstance(found, JointMap):
        values = plain(_joint_values(found))
        return Report([_joint_table(values)], values, partial(_draw, found, measure))
    values = plain(_values(found))
    return Report([_table(values)], values, partial(_draw, found, measure))


def _draw(found: Workspace | JointMap, measure: str | None, path: Path) -> None:
    from rmrc.analysis.workspace.figure import draw

    draw(found, path, measure)


# JSON -------------------------------------------------------------------------------------------


def _values(found: Workspace) -> dict[str, Any]:
    arm, part = found.task.arm, found.part
    return {
        "model": arm.path.name, "site": arm.site, "joints": arm.joints, "slice": part.name,
        "labels": part.labels, "origin": part.origin, "axes": found.task.axes,
        "task_frame": found.task.frame, "length": found.task.length,
        "method": "sheet" if part.is_surface else "samples",
        "posture": "worst" if found.worst else "best", "configurations": found.samples,
        "cell": found.free.size, "cells": found.free.reached.shape,
        "without_limits": _reach_values(found, found.free),
        "with_limits": _reach_values(found, found.limited),
        "singular": {
            "curves": len(found.singular) if part.is_surface else None,
            "configurations": sum(len(curve.q) for curve in found.singular),
            "within_limits": sum(int(curve.within.sum()) for curve in found.singular),
            "families": _family_values(found),
        },
        "limit_curves": [curve.label for curve in found.limits],
    }  # fmt: skip


def _family_values(found: Workspace) -> list[dict[str, Any]]:
    """Return the families of singularities that were found, each with its counts."""
    values = []
    for i, rule in enumerate(found.families):
        own = [curve.within[curve.family == i] for curve in found.singular]
        values.append(
            {
                "name": rule.name, "family": rule.family, "where": rule.where,
                "configurations": sum(map(len, own)), "within_limits": sum(int(some.sum()) for some in own),
            }
        )  # fmt: skip
    return values


def _reach_values(found: Workspace, reach: Reach) -> dict[str, Any]:
    values: dict[str, Any] = {"area": reach.area, "area_accuracy": reach.accuracy}
    if found.part.is_round:
        values["volume_if_first_joint_turns_fully"] = found.volume(reach)
    for label, extent in zip(found.part.labels, reach.extents or (None, None), strict=True):
        values[label] = None if extent is None else [extent.low, extent.high]
    accuracy = max((extent.accuracy for extent in reach.extents), default=None)
    values |= {"extent_accuracy": accuracy, "extent_is_at_least": not found.part.is_surface}
    values |= {measure: reach.ends.get(measure) for measure in MEASURES}
    values["worst_from"] = {measure: reach.source[measure] for measure in MEASURES if measure in reach.source}
    values["postures"] = np.unique(reach.postures[reach.postures > 0]).tolist() or None
    return values


def _joint_values(found: JointMap) -> dict[str, Any]:
    arm = found.task.arm
    return {
        "model": arm.path.name, "site": arm.site, "over": [arm.joints[joint] for joint in found.joints],
        "q": found.q, "axes": found.task.axes, "task_frame": found.task.frame, "length": found.task.length,
        "cells": [len(found.first) - 1, len(found.second) - 1],
        "configurations": found.values["sigma_min"].size,
        # det J has as many rows as joints
        "singular_curves": len(found.singular) if len(found.task.rows) == arm.n else None,
        "families": [
            {"name": rule.name, "family": rule.family, "where": rule.where, "curves": found.family.count(i)}
            for i, rule in enumerate(found.families)
        ],
        **{measure: found.ends[measure] for measure in MEASURES},
    }  # fmt: skip


# Tables -----------------------------------------------------------------------------------------


def _table(values: dict[str, Any]) -> Sheet:
    both = [values["without_limits"], values["with_limits"]]
    rows: list[tuple[str, ...]] = [
        ("area of the slice [m²]", *(number(one["area"]) for one in both)),
        ("  off by at most [m²]", *(_accuracy(values, one) for one in both)),
    ]
    if "volume_if_first_joint_turns_fully" in both[0]:
        rows.append(
            (
                "volume, first joint turned fully [m³]",
                *(number(one["volume_if_first_joint_turns_fully"]) for one in both),
            )
        )
    rows += [(f"{label} [m]", *(_range(one[label]) for one in both)) for label in values["labels"]]
    rows.append(("  off by at most [m]", *(_extent_accuracy(one) for one in both)))
    rows += [
        (f"{word}, {values['posture']} posture", *(_range(one[key]) for one in both))
        for key, word in WORDS.items()
    ]
    rows.append(("  worse end from", *(_source(one) for one in both)))
    rows.append(("  better end from cells of [m]", *([number(values["cell"])] * 2)))
    rows.append(("postures that reach a point", *(_counts(one["postures"]) for one in both)))
    singular = values["singular"]
    rows.append(
        ("singular configurations found", str(singular["configurations"]), str(singular["within_limits"]))
    )
    rows += [
        (f"  {_called(one)}", str(one["configurations"]), str(one["within_limits"]))
        for one in singular["families"]
    ]
    title = (
        f"{values['model']}, site {values['site']}, slice {values['slice']}, rows {' '.join(values['axes'])}"
    )
    return Sheet(title, ("", "without limits", "with limits"), rows)


def _joint_table(values: dict[str, Any]) -> Sheet:
    over, counted = " and ".join(values["over"]), " ".join(values["axes"])
    title = f"{values['model']}, site {values['site']}, over {over}, rows {counted}"
    rows = [(word, _range(values[key])) for key, word in WORDS.items()]
    rows.append(("  searched between steps of a grid", " x ".join(map(str, values["cells"]))))
    rows.append(("curves of det J = 0", _count(values["singular_curves"])))
    rows += [(f"  {_called(one)}: {one['where']}", str(one["curves"])) for one in values["families"]]
    return Sheet(title, ("", "from least to most"), rows)


def _called(one: dict[str, Any]) -> str:
    """Return the name of a family of singularities and its kind."""
    return f"{one['name']}{', ' * bool(one['family'])}{one['family']}"


def _count(count: int | None) -> str:
    return UNDEFINED if count is None else str(count)


def _accuracy(values: dict[str, Any], one: dict[str, Any]) -> str:
    # Samples find cells, and may miss some.
    return number(one["area_accuracy"]) + (" or more" if values["method"] == "samples" else "")


def _extent_accuracy(one: dict[str, Any]) -> str:
    if one["extent_accuracy"] is None:
        return UNDEFINED
    return number(one["extent_accuracy"]) + (" or more" if one["extent_is_at_least"] else "")


def _source(one: dict[str, Any]) -> str:
    found = {SOURCES[source] for source in one["worst_from"].values()}
    return ", ".join(sorted(found)) or UNDEFINED


def _range(ends: list[float | None] | None) -> str:
    if ends is None:
        return UNDEFINED
    return " to ".join("inf" if end is None else number(end) for end in ends)


def _counts(counts: list[int] | None) -> str:
    return UNDEFINED if counts is None else ", ".join(map(str, counts))
