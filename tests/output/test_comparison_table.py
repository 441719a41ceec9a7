import io
import math
import re

import numpy as np
import pytest
from rich.console import Console

from rmrc.output.comparison_table import Row, flipped, markdown, render
from rmrc.run import COLUMNS, Divergence, Run
from rmrc.scenario import Check
from rmrc.scorecard import Figure, Scorecard, check, scorecard

PLANE, SPACE = ("x", "y"), ("x", "y", "z", "rx", "ry", "rz")


def run_of(ticks=3, joints=("shoulder", "elbow"), axes=PLANE, moved=(0.0, 0.0), **fields):
    """Return a run that stands still, but for how far the joints are from the start in the end."""
    width = {"n": len(joints), "k": min(len(joints), len(axes)), "6": 6, "7": 7}
    columns = {
        name: np.zeros((ticks, width[column.width]) if column.width else ticks)
        for name, column in COLUMNS.items()
    }
    columns["time"] = np.arange(ticks) * 0.001
    if "path_time" in columns:
        columns["path_time"] = columns["time"]
    columns["pose"][:, 3] = columns["pose_ref"][:, 3] = 1.0
    if ticks:
        columns["q"][-1] = moved
    fields = {"is_slide": (False,) * len(joints), "length": 1.0, "planned": ticks} | fields
    return Run("case", tuple(joints), axes=axes, period=0.001, columns=columns, **fields)


def row(label="inverse", run=None, expect=None, **values):
    run = run_of() if run is None else run
    card = scorecard(run)
    given = {name: Figure(value, card[name].unit, "") for name, value in values.items()}
    card = Scorecard(card.name, card.joints, {**card.figures, **given})
    return Row(label, run, card, check(card, expect or {}))


def printed(rows, width=100):
    console = Console(file=io.StringIO(), width=width)
    console.print(render("case", rows))
    return [line.rstrip() for line in console.file.getvalue().splitlines()]


# Flipped ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("moved", "text"),
    [
        ((0.0, 0.0), "no"),
        ((0.49, -0.49), "no"),
        ((0.0, 0.51), "elbow"),
        ((-0.51, 0.1), "shoulder"),
        ((2.0, 4.0), "shoulder, elbow"),
        ((2.0 * math.pi, 2.0 * math.pi + 0.1), "no"),  # full turns: the same posture
    ],
)
def test_a_joint_has_flipped_if_it_is_half_a_radian_off_in_the_end(moved, text):
    assert flipped(run_of(moved=moved)) == text


def test_a_slide_has_flipped_if_it_is_off_by_half_the_characteristic_length():
    slides = {"is_slide": (False, True), "length": 0.2}
    assert flipped(run_of(moved=(0.0, 0.09), **slides)) == "no"
    assert flipped(run_of(moved=(0.0, -0.11), **slides)) == "elbow"


def test_the_posture_of_a_redundant_arm_drifts_which_is_a_number():
    assert flipped(run_of(axes=("x",), moved=(0.1, -1.25))) == "1.250 rad"
    assert flipped(run_of(axes=("x",), moved=(0.1, -1.25), is_slide=(False, True))) == "1.250 m"


def test_without_a_return_nothing_is_said():
    assert flipped(run_of(ticks=0)) == "-"
    assert flipped(run_of(moved=(0.0, 3.0), planned=4)) == "-"
    away = run_of(moved=(0.0, 3.0))
    away.columns["pose_ref"][-1, 0] = 1.0
    assert flipped(away) == "-"


# The table ----------------------------------------------------------------------------------------

VALUES = {
    "joint_rate.peak": 1.125, "joint_rate.rms": 2.25, "joint_acceleration.peak": 33.5, "error_along.max": 0.0044,
    "error_across.max": 0.0055, "position_error.end": 0.0066, "status_time.DAMPED": 7.75,
}  # fmt: skip
NUMBERS = ["1.125", "2.250", "33.50", "0.00440", "0.00550", "0.00660", "7.750"]


def test_each_number_stands_below_its_heading_and_unit():
    lines = printed([row("damped", run_of(moved=(0.0, 1.0)), **VALUES)])
    assert lines[0] == "case"
    head = [line.split() for line in lines[2:5]]
    assert head[0] == ["rate", "rate", "accel.", "error", "error", "pos.", "at", "time"]
    assert head[1] == ["peak", "rms", "peak", "along", "across", "end", "DAMPED"]
    assert head[2] == ["variant", "rad/s", "rad/s", "rad/s²", "m", "m", "m", "s", "flipped", "expect"]
    assert lines[6].split() == ["damped", *NUMBERS, "elbow", "-"]


def test_markdown_has_the_units_in_a_row_of_their_own():
    assert markdown([row("a|b", **VALUES, expect={"ticks": Check(above=0)})]).splitlines() == [
        "| variant | rate peak | rate rms | accel. peak | error along | error across | pos. at end | time DAMPED "
        "| flipped | expect |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- | --- |",
        "|  | rad/s | rad/s | rad/s² | m | m | m | s |  |  |",
        f"| a\\|b | {' | '.join(NUMBERS)} | no | met |",
    ]


def test_a_task_with_rotations_has_their_error_and_one_without_positions_no_other():
    six = run_of(joints=tuple("abcdef"), axes=SPACE, moved=(0.0,) * 6)
    given = {"position_error.end": 0.25, "orientation_error.end": 0.5}
    text = markdown([row("both", six, **given)])
    assert "| pos. at end | rot. at end |" in text
    assert "| m | rad |" in text
    assert "| 0.2500 | 0.5000 |" in text
    text = markdown([row("one", run_of(axes=("rx", "ry")), **{"orientation_error.end": 0.5})])
    assert "pos. at end" not in text and "| rot. at end |" in text
    mixed = markdown([row("both", six, **given), row("flat", **{"position_error.end": 0.125})])
    assert "| 0.1250 | - |" in mixed


def test_expectations_are_counted():
    expect = {"ticks": Check(above=5), "duration": Check(above=5), "completed": Check(above=0)}
    texts = markdown(
        [row("a", expect=expect), row("b", expect={"ticks": Check(above=0)}), row("c")]
    ).splitlines()
    assert [line.split(" | ")[-1] for line in texts[3:]] == ["missed 2 |", "met |", "- |"]


def test_what_ended_early_says_so_and_has_no_posture_to_come_back_to():
    diverged = run_of(planned=9, divergence=Divergence(3, 0.61234, "elbow", "not finite"))
    rows = [row("a", diverged), row("b", run_of(planned=9)), row("c", run_of(ticks=0, planned=9))]
    text = "\n".join(printed(rows))
    assert re.search(
        r"\na .* -  +-\ndiverged at 0\.612 s\nb .* -  +-\nunfinished\nc .* -  +-\nunfinished$", text
    )
    assert "nan" not in text


def test_units_of_arms_with_joints_of_both_kinds_are_both_there():
    both = run_of(is_slide=(False, True))
    assert "| rad/s, m/s | rad/s, m/s | rad/s², m/s² |" in markdown([row("a", both)])
    lines = printed([row("turning"), row("sliding", both)])
    units = "variant or m/s or m/s or m/s² m m m s flipped expect"
    assert lines[5].split() == units.split()
    assert lines[4].split()[:3] == ["rad/s", "rad/s", "rad/s²"]


METHODS = (
    "inverse",
    "pseudoinverse",
    "damped",
    "truncated",
    "transpose",
    "filtered",
    "selectively_damped",
    "jparse",
)


@pytest.mark.parametrize("scale", [1e-9, 0.003, 1.0, 1e6])
@pytest.mark.parametrize("six", [False, True])
def test_eight_methods_fit_a_terminal_of_100_columns_each_in_a_line(scale, six):
    names = tuple(f"theta_{i}" for i in range(1, 7)) if six else ("shoulder", "elbow")
    run = run_of(joints=names, axes=SPACE if six else PLANE, moved=(*(0.0,) * (len(names) - 1), 1.0))
    figures = [name for name in VALUES if name in scorecard(run)] + ["orientation_error.end"] * six
    expect = {"ticks": Check(above=9)}
    rows = [row(method, run, expect, **dict.fromkeys(figures, 1.234567 * scale)) for method in METHODS]
    lines = printed(rows)
    assert max(map(len, lines)) <= 100
    assert "…" not in "".join(lines)
    body = [line.split() for line in lines[-8:]]
    assert [cells[0] for cells in body] == list(METHODS)
    assert all(len(cells) == len(figures) + 4 for cells in body)
    assert all(cells[-3:] == [names[-1], "missed", "1"] for cells in body)


def test_names_are_not_read_as_markup():
    assert "[red]" in "\n".join(printed([row("[red]")]))
