"""The page of a search: the recommendation, the front, the stability margins, and the block to paste."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rmrc.show.page import Page
from rmrc.show.run_page import versions
from rmrc.study.dataset import Left
from rmrc.support.errors import QuestionError
from rmrc.tuning import tables
from rmrc.tuning.figure import front_figure
from rmrc.tuning.tables import Row

METHOD = "control.inverse.method"


def page(path: Path, left: Left) -> Page:
    """Return the page of a search.

    Args:
        path: The `.parquet` file of `tune`.
        left: Its contents.

    Raises:
        QuestionError: It is another kind of file.
    """
    try:
        told: dict[str, Any] = json.loads(left.about)
        front, named = ([Row(*one) for one in told[name]] for name in ("front", "named"))
    except (KeyError, ValueError, TypeError):
        raise QuestionError(f"{path}: does not contain the result of `rmrc tune`; run it again") from None
    rows = [dict(zip(left.rows, row, strict=True)) for row in zip(*left.rows.values(), strict=True)]
    made = Page(f"Tuning of {told['name']}", _verdict(named, told))
    if told["block"]:
        made.section("To paste", "The recommended control section.")
        made.code(told["block"], "Copy the block")
    made.section("Trials", told["title"].partition(": ")[2])
    made.table(tables.heading("", [tuple(one) for one in told["facts"]]))
    if named:
        _found(made, front, named, told, rows)
    made.section("Notes")
    made.items(told["lines"])
    made.section("Made with", "The same versions give the same bits on one machine.")
    made.table(versions(told["versions"]))
    return made


def _found(
    made: Page, front: list[Row], named: list[Row], told: Mapping[str, Any], rows: list[dict[str, Any]]
) -> None:
    """Add the front, the margins and the tables."""

    def row(one: dict[str, Any]) -> Row:
        return Row(one["role"] or "", one[METHOD], "", one["error"], one["peak_rate"], one["time"])

    points = [row(one) for one in rows if one["feasible"]]
    roles = ("recommended", "second best", "as written")
    marks = [row(one) for role in roles for one in rows if one["role"] == role]
    made.section("Error against peak rate")
    picture = front_figure(told["name"], points, front, marks, told["limits"])
    made.figure(
        picture,
        "Settings that keep the limits on every perturbed scenario, the Pareto front, "
        "and the recommendations",
    )
    _, *sheets = tables.sheets("", [], front, named)
    for sheet in sheets:
        made.table(sheet)
    if told["margins"]:
        made.table(tables.margins([tuple(one) for one in told["margins"]]))


def _verdict(named: list[Row], told: Mapping[str, Any]) -> str:
    """Return the recommendation in a sentence."""
    if not named:
        return "No tried setting keeps the limits."
    best = named[0]
    bears = {name: gain for name, gain, *_ in told["margins"]}.get("recommended")
    margin = f"; its gain margin is {bears}" if bears and bears != "none" else ""
    return (
        f"Recommended: {best.words} ({best.numbers}), with an error of {1e3 * best.error:.3g} mm "
        f"at a peak rate of {best.peak_rate:.3g} rad/s{margin}."
    )
