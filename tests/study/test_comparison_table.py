"""The table of a comparison: what is in each cell, in a terminal and as Markdown."""

import math

import numpy as np
import pytest

from rmrc.results.columns import COLUMNS, Divergence
from rmrc.results.expectations import check
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure, Scorecard, scorecard
from rmrc.show.sheets import as_markdown
from rmrc.study.run import flipped, tables
from rmrc.study.study import Result


def run_of(ticks=3, joints=("shoulder", "elbow"), axes=("x", "y"), moved=(0.0, 0.0), **fields):
    """Return a run that stands still, but for how far the joints are from the start in the end."""
    width = {"n": len(joints), "k": min(len(joints), len(axes)), "nq": len(joints), "6": 6, "7": 7}
    columns = {
        name: np.zeros((ticks, width[column.width]) if column.width else ticks)
        for name, column in COLUMNS.items()
    }
    columns["time"] = np.arange(ticks) * 0.001
    columns["path_time"] = columns["time"]
    columns["pose"][:, 3] = columns["pose_ref"][:, 3] = 1.0
    if ticks:
        columns["q"][-1] = moved
    fields = {"is_slide": (False,) * len(joints), "length": 1.0, "planned": ticks} | fields
    return Run("case", tuple(joints), axes=axes, period=0.001, columns=columns, **fields)


def row(label="inverse", run=None, expect=None, **values):
    run = run_of() if run is None else run
    card = scorecard(run)
    figures = {name: Figure(value, card[name].unit, "") for name, value in values.items()}
    card = Scorecard(card.name, card.joints, {**card.figures, **figures})
    outcomes = tuple(check(card, expect or {}))
    return label, Result(None, run, card, outcomes, "complete")


def sheets(rows):
    return tables("case", *zip(*rows, strict=True))


def markdown(rows):
    return "\n\n".join(map(as_markdown, sheets(rows)))


@pytest.mark.parametrize(
    ("moved", "text"),
    [
        ((0.49, -0.49), "no"),
        ((0.0, 0.51), "elbow"),
        ((2.0, 4.0), "shoulder, elbow"),
        ((2.0 * math.pi, 2.0 * math.pi + 0.1), "no"),  # full turns: the same posture
    ],
)
def test_a_joint_has_flipped_if_it_is_half_a_radian_off_in_the_end(moved, text):
    assert flipped(run_of(moved=moved)) == text


def test_a_slide_flips_by_lengths_a_redundant_arm_drifts_and_an_open_path_says_nothing():
    slides = {"is_slide": (False, True), "length": 0.2}
    assert flipped(run_of(moved=(0.0, 0.09), **slides)) == "no"
    assert flipped(run_of(moved=(0.0, -0.11), **slides)) == "elbow"
    assert flipped(run_of(axes=("x",), moved=(0.1, -1.25))) == "1.250 rad"
    assert flipped(run_of(axes=("x",), moved=(0.1, -1.25), is_slide=(False, True))) == "1.250 m"
    away = run_of(moved=(0.0, 3.0))
    away.columns["pose_ref"][-1, 0] = 1.0
    for run in (run_of(ticks=0), run_of(moved=(0.0, 3.0), planned=4), away):
        assert flipped(run) == "-"


VALUES = {
    "joint_rate.peak": 1.125, "joint_rate_cmd.peak": 5.5, "joint_rate.rms": 2.25, "joint_acceleration.peak": 33.5,
    "tau.share_of_limit": 0.75, "position_error_along.max": 0.0044, "position_error_across.max": 0.0055,
    "position_error.end": 0.0066, "status_time.DAMPED": 7.75,
}  # fmt: skip
NUMBERS = ["1.125", "5.500", "2.250", "33.50", "0.7500", "0.00440", "0.00550", "0.00660", "7.750"]


def test_each_number_stands_below_its_metric_and_unit():
    rates, errors, times, ends = sheets([row("damped", run_of(moved=(0.0, 1.0)), **VALUES)])
    assert rates.title == "case"
    assert [" ".join(heading.split()) for heading in rates.headings] == [
        "variant", "joint_rate peak rad/s", "joint_rate_cmd peak rad/s", "joint_rate rms rad/s",
        "joint_acceleration peak rad/s²", "tau share_of_limit",
    ]  # fmt: skip
    assert errors.headings[1] == "position_error\n_along\nmax\nm"
    assert [cell for sheet in (rates, errors, times) for cell in sheet.rows[0][1:]] == NUMBERS
    assert (ends.headings, ends.rows[0]) == (("variant", "flipped", "expect"), ("damped", "elbow", "-"))


def test_what_ended_early_says_so_and_has_no_posture_to_come_back_to():
    diverged = run_of(planned=9, divergence=Divergence(3, 0.61234, "elbow", "not finite"))
    rows = [row("[red]", diverged), row("b", run_of(planned=9)), row("c", run_of(ticks=0, planned=9))]
    ends = sheets(rows)[-1].rows
    assert [end[0] for end in ends] == ["[red]\ndiverged at 0.612 s", "b\nunfinished", "c\nunfinished"]
    assert [end[1:] for end in ends] == [("-", "-")] * 3 and "nan" not in markdown(rows)
