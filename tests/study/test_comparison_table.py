import io
import math
import re

import numpy as np
import pytest
from rich.console import Console

from rmrc.results.columns import COLUMNS, Divergence
from rmrc.results.expectations import check
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure, Scorecard, scorecard
from rmrc.scenario import Check, Variant
from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.show import sheets
from rmrc.show.terminal import render
from rmrc.study import compare_table
from rmrc.study.compare_table import Compared, flipped, markdown

PLANE, SPACE = ("x", "y"), ("x", "y", "z", "rx", "ry", "rz")


def run_of(ticks=3, joints=("shoulder", "elbow"), axes=PLANE, moved=(0.0, 0.0), **fields):
    """Return a run that stands still, but for how far the joints are from the start in the end."""
    width = {"n": len(joints), "k": min(len(joints), len(axes)), "nq": len(joints), "6": 6, "7": 7}
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


def row(label="inverse", run=None, expect=None, stated_for=None, **values):
    run = run_of() if run is None else run
    card = scorecard(run)
    given = {name: Figure(value, card[name].unit, "") for name, value in values.items()}
    card = Scorecard(card.name, card.joints, {**card.figures, **given})
    outcomes = tuple(check(card, expect or {}))
    ended = (card, outcomes, run.divergence, False, False, run)
    return Compared(0, None, *ended, Variant(label), stated_for or {})


def printed(rows, width=100):
    console = Console(file=io.StringIO(), width=width)
    console.print(render(compare_table.sheets("case", rows)))
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
    "joint_rate.peak": 1.125, "joint_rate_cmd.peak": 5.5, "joint_rate.rms": 2.25, "joint_acceleration.peak": 33.5,
    "tau.share_of_limit": 0.75, "position_error_along.max": 0.0044, "position_error_across.max": 0.0055,
    "position_error.end": 0.0066, "status_time.DAMPED": 7.75,
}  # fmt: skip
NUMBERS = ["1.125", "5.500", "2.250", "33.50", "0.7500", "0.00440", "0.00550", "0.00660", "7.750"]


def test_each_number_stands_below_its_heading_and_unit():
    lines = printed([row("damped", run_of(moved=(0.0, 1.0)), **VALUES)])
    assert lines[0] == "case"
    head = [line.split() for line in lines[2:6]]
    assert head[0] == ["pos.", "pos.", "pos."]
    assert head[1] == ["rate", "command", "rate", "accel.", "torque", *["error"] * 3, "time"]
    assert head[2] == ["peak", "peak", "rms", "peak", "peak", "along", "across", "at", "end", "DAMPED"]
    units = "variant rad/s rad/s rad/s rad/s² of limit m m m s flipped expect"
    assert head[3] == units.split()
    assert lines[7].split() == ["damped", *NUMBERS, "elbow", "-"]


def test_the_table_has_a_column_for_each_status_that_occurs_in_any_variant_and_for_no_other():
    text = markdown([row("a", **{"status_time.SINGULAR": 0.5}), row("b", **{"status_time.STOPPED": 0.25})])
    assert "| variant | time SINGULAR | time STOPPED |" in text
    assert "| a | 0.5000 | 0 |" in text and "| b | 0 | 0.2500 |" in text
    assert "time" not in markdown([row("a"), row("b")])
    every = {f"status_time.{one.name}": 1.0 for one in IN_RUNS}
    assert all(f"time {one.name} |" in markdown([row("a", **every)]) for one in IN_RUNS)


def test_a_task_with_rotations_has_their_error_and_one_without_positions_no_other():
    six = run_of(joints=tuple("abcdef"), axes=SPACE, moved=(0.0,) * 6)
    errors = [
        f"{kind}_error_{part}.max" for kind in ("position", "orientation") for part in ("along", "across")
    ]
    names = [*errors, "position_error.end", "orientation_error.end"]
    given = dict(zip(names, (0.125, 0.25, 0.375, 0.5, 0.625, 0.75), strict=True))
    text = markdown([row("both", six, **given)])
    assert (
        "| pos. error along | pos. error across | rot. error along | rot. error across "
        "| pos. error at end | rot. error at end |" in text
    )
    assert "|  | m | m | rad | rad | m | rad |" in text
    assert "| both | 0.1250 | 0.2500 | 0.3750 | 0.5000 | 0.6250 | 0.7500 |" in text
    text = markdown([row("one", run_of(axes=("rx", "ry")), **{"orientation_error.end": 0.5})])
    assert "pos." not in text and "| rot. error at end |" in text
    mixed = markdown([row("both", six, **given), row("flat", **{"position_error.end": 0.125})])
    assert "| flat | 0 | 0 | - | - | 0.1250 | - |" in mixed


def test_expectations_are_counted():
    expect = {"ticks": Check(above=5), "duration": Check(above=5), "completed": Check(above=0)}
    texts = markdown(
        [row("a", expect=expect), row("b", expect={"ticks": Check(above=0)}), row("c")]
    ).splitlines()
    assert [line.split(" | ")[-1] for line in texts[-3:]] == ["missed 2 |", "met |", "- |"]


def test_expectations_that_are_not_counted_are_a_dash_and_a_line_below_says_why():
    method = {"control.inverse.method": "damped"}
    expect = {"ticks": Check(above=0)}
    rows = [row("damped", expect=expect), row("inverse", stated_for=method), row("jparse", stated_for=method)]
    why = '"-": the expectations of the scenario are for control.inverse.method=damped; they are not checked for other choices.'
    lines = printed(rows, width=len(why))
    assert lines[-2:] == ["", why]
    assert [line.split()[-1] for line in lines[-5:-2]] == ["met", "-", "-"]
    assert markdown(rows).endswith(f"\n\n{why}\n")
    assert why not in "\n".join(printed(rows[:1], width=len(why)))
    more = row("b", stated_for={"control.at_singularity": "damp"})
    wanted = "control.inverse.method=damped and control.at_singularity=damp"
    assert wanted in " ".join(printed([*rows, more]))


def test_what_ended_early_says_so_and_has_no_posture_to_come_back_to():
    diverged = run_of(planned=9, divergence=Divergence(3, 0.61234, "elbow", "not finite"))
    rows = [row("a", diverged), row("b", run_of(planned=9)), row("c", run_of(ticks=0, planned=9))]
    text = "\n".join(printed(rows))
    assert re.search(
        r"\na .* -  +-\ndiverged at 0\.612 s\nb .* -  +-\nunfinished\nc .* -  +-\nunfinished$", text
    )
    assert "nan" not in text


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


def tables_of(lines):
    """Return the tables of an output: the words of each heading, and of each row."""
    text = "\n".join(lines)
    parts = re.split(r"\n\n", text.partition("\n\n")[2])
    pairs = [re.split(r"\n─+\n", part) for part in parts]
    return [(head.split(), [line.split() for line in body.splitlines()]) for head, body in pairs]


@pytest.mark.parametrize("width", [100, 80, 60])
@pytest.mark.parametrize("scale", [1e-9, 0.003, 1.0, 1e6])
@pytest.mark.parametrize("six", [False, True])
def test_eight_methods_fit_a_terminal_and_nothing_is_cut_or_broken(width, scale, six):
    names = tuple(f"theta_{i}" for i in range(1, 7)) if six else ("shoulder", "elbow")
    run = run_of(joints=names, axes=SPACE if six else PLANE, moved=(*(0.0,) * (len(names) - 1), 1.0))
    kinds = ("position", "orientation") if six else ("position",)
    figures = [name for name in VALUES if name.startswith(("joint", "tau"))]
    figures += [f"{kind}_error_{part}.max" for kind in kinds for part in ("along", "across")]
    figures += [f"{kind}_error.end" for kind in kinds]
    figures += [f"status_time.{one.name}" for one in IN_RUNS]
    expect = {"ticks": Check(above=9)}
    number = 1.234567 * scale
    rows = [row(method, run, expect, **dict.fromkeys(figures, number)) for method in METHODS]
    lines = printed(rows, width)
    assert max(map(len, lines)) <= width
    assert "…" not in "".join(lines)
    counted, headings = 0, []
    for heading, body in tables_of(lines):
        assert [cells[0] for cells in body] == list(METHODS)  # each in a line of its own, whole
        numbers = [cell for cell in body[0][1:] if re.match(r"\d", cell) and cell != "1"]  # missed 1
        assert set(numbers) <= {sheets.number(number)}
        counted += len(numbers)
        headings += heading
    assert counted == len(figures)
    assert [word for word in headings if word in Status.__members__] == [one.name for one in IN_RUNS]
    assert body[0][-3:] == [names[-1], "missed", "1"]


@pytest.mark.parametrize("width", [100, 80, 60])
def test_long_labels_are_wrapped_between_words_and_those_that_leave_no_room_are_numbered(width):
    labels = ["selectively_damped, {maximum: 0.25, below: 0.125}, smallest_singular_value", "b, c"]
    rows = [row(label, **VALUES) for label in labels]
    lines = printed(rows, width)
    assert max(map(len, lines)) <= width
    words = " ".join(lines).split()
    assert [word for word in labels[0].split() if word not in words] == []
    label = "../models/" + "x" * 40 + ".xml"
    lines = printed([row(label, **VALUES), row("other.xml", **VALUES)], 60)
    assert max(map(len, lines)) <= 60
    assert lines[2:4] == [f"1  {label}", "2  other.xml"]
    rules = [index for index, line in enumerate(lines) if set(line) == {"─"}]
    assert rules and all([line.split()[0] for line in lines[i + 1 : i + 3]] == ["1", "2"] for i in rules)


def test_names_are_not_read_as_markup():
    assert "[red]" in "\n".join(printed([row("[red]")]))
