"""The table of a comparison: what is in each cell, in a terminal and as Markdown."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from rmrc.results.columns import COLUMNS, Divergence
from rmrc.results.expectations import check
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure, Scorecard, scorecard
from rmrc.scenario import Check
from rmrc.show.sheets import as_markdown
from rmrc.show.terminal import render
from rmrc.study import compare_table
from rmrc.study.compare_table import flipped
from rmrc.study.study import Result


def run_of(ticks=3, axes=("x", "y"), moved=(0.0, 0.0), **fields):
    """Return a run of two joints that stands still, but for how far they are from the start in the end."""
    width = {"n": 2, "k": min(2, len(axes)), "nq": 2, "6": 6, "7": 7}
    columns = {
        name: np.zeros((ticks, width[column.width]) if column.width else ticks)
        for name, column in COLUMNS.items()
    }
    columns["time"] = columns["path_time"] = np.arange(ticks) * 0.001
    columns["pose"][:, 3] = columns["pose_ref"][:, 3] = 1.0
    if ticks:
        columns["q"][-1] = moved
    fields = {"is_slide": (False, False), "length": 1.0, "planned": ticks} | fields
    return Run("case", ("shoulder", "elbow"), axes=axes, period=0.001, columns=columns, **fields)


def row(label, run=None, expect=None, **values):
    run = run_of() if run is None else run
    card = scorecard(run)
    figures = {name: Figure(value, card[name].unit, "") for name, value in values.items()}
    card = Scorecard(card.name, card.joints, {**card.figures, **figures})
    return label, Result(None, run, card, tuple(check(card, expect or {})), "complete")


def table(rows):
    return compare_table.table("case", *zip(*rows, strict=True))


@pytest.mark.parametrize(
    ("text", "fields"),
    [
        ("no", {"moved": (0.49, -0.49)}),
        ("elbow", {"moved": (0.0, 0.51)}),
        ("shoulder, elbow", {"moved": (2.0, 4.0)}),
        ("no", {"moved": (2.0 * math.pi, 2.0 * math.pi + 0.1)}),  # full turns: the same posture
        ("no", {"moved": (0.0, 0.09), "is_slide": (False, True), "length": 0.2}),
        ("elbow", {"moved": (0.0, -0.11), "is_slide": (False, True), "length": 0.2}),
        ("1.250 rad", {"moved": (0.1, -1.25), "axes": ("x",)}),  # a redundant arm drifts
        ("1.250 m", {"moved": (0.1, -1.25), "axes": ("x",), "is_slide": (False, True)}),
        ("-", {"ticks": 0}),
        ("-", {"moved": (0.0, 3.0), "planned": 4}),
    ],
)
def test_a_joint_has_flipped_if_it_is_half_a_radian_off_in_the_end_of_a_closed_path(text, fields):
    assert flipped(run_of(**fields)) == text
    if "moved" in fields:
        away = run_of(**fields)
        away.columns["pose_ref"][-1, 0] = 1.0
        assert flipped(away) == "-"


def test_each_number_stands_below_its_heading_and_unit_and_what_ended_early_says_so():
    values = {"joint_rate.peak": 1.125, "position_error_along.max": 0.0044, "status_time.DAMPED": 7.75}
    sheet = table([
        row("damped", run_of(moved=(0.0, 1.0)), {"ticks": Check(above=5)}, **values),
        row("[red]", run_of(planned=9, divergence=Divergence(3, 0.61234, "elbow", "not finite"))),
        row("unknown", run_of(planned=9)),
    ])  # fmt: skip
    rates, errors, times, ends = (
        part.splitlines() for part in as_markdown(replace(sheet, title="")).split("\n\n")
    )
    assert rates[0].startswith("| variant | rate peak rad/s | command peak rad/s |")
    assert rates[2].startswith("| damped | 1.125 | 0 |") and "| damped | 0.00440 | 0 |" in errors[2]
    assert errors[0] == "| variant | pos. error along m | pos. error across m | pos. error at end m |"
    assert (times[0], times[2]) == ("| variant | time DAMPED s |", "| damped | 7.750 |")
    assert ends[2] == "| damped | elbow | missed 1 |"
    console = Console(file=io.StringIO(), width=100)
    console.print(render([sheet]))
    text = console.file.getvalue()
    assert "\n[red] " in text and "\ndiverged at 0.612" in text and "\nunfinished" in text
