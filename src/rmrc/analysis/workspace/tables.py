"""The numbers of a workspace, as a table."""

from typing import Any

from rmrc.show.sheets import UNDEFINED, Sheet, number

WORDS = {
    "sigma_min": "σ_min [1]",
    "manipulability": "manipulability w [1]",
    "condition": "condition κ [1]",
}
# Where the worst of a workspace was found.
SOURCES = {"singular": "singular curves", "limits": "limit curves", "cells": "cells"}


def sheet(facts: dict[str, Any]) -> Sheet:
    """Return the table of a summary by `rmrc.analysis.workspace.files.summary`."""
    both = [facts["without_limits"], facts["with_limits"]]
    rows: list[tuple[str, ...]] = [
        ("area of the slice [m²]", *(number(one["area"]) for one in both)),
        ("  off by at most [m²]", *(_accuracy(facts, one) for one in both)),
    ]
    if "volume_if_first_joint_turns_fully" in both[0]:
        rows.append(
            (
                "volume, first joint turned fully [m³]",
                *(number(one["volume_if_first_joint_turns_fully"]) for one in both),
            )
        )
    rows += [(f"{label} [m]", *(_range(one[label]) for one in both)) for label in facts["labels"]]
    rows.append(("  off by at most [m]", *(_extent_accuracy(one) for one in both)))
    rows += [
        (f"{word}, {facts['posture']} posture", *(_range(one[key]) for one in both))
        for key, word in WORDS.items()
    ]
    rows.append(("  worse end from", *(_source(one) for one in both)))
    rows.append(("  better end from cells of [m]", *([number(facts["cell"])] * 2)))
    rows.append(("postures that reach a point", *(_counts(one["postures"]) for one in both)))
    singular = facts["singular"]
    rows.append(
        ("singular configurations found", str(singular["configurations"]), str(singular["within_limits"]))
    )
    title = f"{facts['model']}, site {facts['site']}, slice {facts['slice']}, rows {' '.join(facts['axes'])}"
    return Sheet(title, ("", "without limits", "with limits"), rows)


def joint_sheet(facts: dict[str, Any]) -> Sheet:
    """Return the table of a summary by `rmrc.analysis.workspace.files.joint_summary`."""
    over, counted = " and ".join(facts["over"]), " ".join(facts["axes"])
    title = f"{facts['model']}, site {facts['site']}, over {over}, rows {counted}"
    rows = [(word, _range(facts[key])) for key, word in WORDS.items()]
    rows.append(("  searched between steps of a grid", " x ".join(map(str, facts["cells"]))))
    return Sheet(
        title, ("", "from least to most"), [*rows, ("curves of det J = 0", _count(facts["singular_curves"]))]
    )


def _count(count: int | None) -> str:
    return UNDEFINED if count is None else str(count)


def _accuracy(facts: dict[str, Any], one: dict[str, Any]) -> str:
    # Samples find cells, and may miss some.
    return number(one["area_accuracy"]) + (" or more" if facts["method"] == "samples" else "")


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
