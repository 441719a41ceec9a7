"""Sheets and the tables of a scorecard: every number that says something, whole, at any width."""

import io
import math
import re

import numpy as np
import pytest
from rich.console import Console

from rmrc.results.columns import COLUMNS
from rmrc.results.expectations import check
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure, Scorecard, scorecard
from rmrc.scenario import Check
from rmrc.scenario.choices import Status
from rmrc.show import tables
from rmrc.show.sheets import Sheet, number
from rmrc.show.tables import render
from shipped import shipped

NUMBER = r"(?<![\w.])-?(?:\d+(?:\.\d+)?(?:e-?\d+)?|inf)(?![\w.])"
SIX = ("waist", "shoulder", "elbow", "roll", "pitch", "yaw")


def printed(sheets, width=80, **options):
    console = Console(file=io.StringIO(), width=width, **options)
    console.print(render(sheets))
    return console.file.getvalue()


def random_card(joints, ticks=200, scale=1.0):
    rng, n = np.random.default_rng(len(joints)), len(joints)
    width = {"n": n, "k": min(n, 6), "nq": n, "6": 6, "7": 7}
    columns = {
        name: scale * rng.uniform(0.1, 1.0, (ticks, width[c.width]) if c.width else ticks)
        for name, c in COLUMNS.items()
    }
    columns["time"] = columns["path_time"] = np.arange(ticks) * 0.001
    columns["status"] = rng.integers(0, 2 * max(Status), ticks)
    axes = ("x", "y", "z", "rx", "ry", "rz")
    run = Run(
        "case", tuple(joints), (False,) * n, axes, length=1.0, period=0.001, planned=2 * ticks,
        wall_time=0.0123, columns=columns,
    )  # fmt: skip
    return scorecard(run)


def with_values(card, **values):
    figures = {name: Figure(value, card[name].unit, "") for name, value in values.items()}
    return Scorecard(card.name, card.joints, {**card.figures, **figures})


@pytest.mark.parametrize("form", [lambda card: printed(tables.sheets(card)), tables.markdown])
@pytest.mark.parametrize("joints", [("a",), SIX, ("shoulder_pan_joint", "elbow_joint")])
def test_every_value_of_a_scorecard_is_shown(form, joints):
    card = random_card(joints)
    # a value of its own for each: neighbors differ by 1.7 %, and half a unit of the third digit is 0.5 %
    own = {
        name: figure.value if isinstance(figure.value, str) else 1.017 ** (i + 50)
        for i, (name, figure) in enumerate(card.items())
    }
    text = form(with_values(card, **own))
    numbers = np.array([float(found) for found in re.findall(NUMBER, text)])
    missing = [
        name
        for name, value in own.items()
        if not (value in text if isinstance(value, str) else np.any(abs(numbers / value - 1.0) <= 0.005))
    ]
    assert missing == []


@pytest.mark.parametrize("scale", [1e-9, 0.003, 1e6])
@pytest.mark.parametrize("width", [60, 80, 100])
def test_nothing_is_cut_off_and_no_line_is_too_long(scale, width):
    card = random_card(tuple("abcdefghijkl"), scale=scale)
    outcomes = check(card, {f"tau.{joint}.peak": Check(below=1e-12, above=-1) for joint in "abc"})
    for sheets in (tables.sheets(card, outcomes, card), [tables.few(card, outcomes, card)]):
        text = printed(sheets, width)
        assert "…" not in text and max(map(len, text.splitlines())) <= width
        wanted = {
            cell for sheet in sheets for row in sheet.rows for cell in row if re.fullmatch(NUMBER, cell)
        }
        assert wanted <= set(text.split())


@pytest.mark.parametrize(
    ("name", "most"), [("approach_singularity", 23), ("puma_wrist", 23), ("fr3_stop", 26)]
)
def test_a_run_fits_a_screen_and_its_numbers_are_those_of_the_scorecard(name, most):
    run = shipped(name)
    outcomes = check(run.scorecard, {"position_error.max": Check(below=0.5), "ticks": Check(below=1)})
    beside = run.baseline.scorecard if run.baseline else None
    sheet = tables.few(run.scorecard, outcomes, beside)
    lines = printed([Sheet("", notes=(run.verdict,)), sheet]).splitlines()
    assert len(lines) + 4 <= most  # the files and the next command
    for row in sheet.rows:
        assert row[1] == number(float(run.scorecard[row[0]].value)) or row[0] == "ticks"
        if beside and not row[0].startswith("joint_rate_plain"):
            assert row[4] in (number(float(beside[row[0]].value)), str(beside[row[0]].value))
    marks = {row[0]: row[3] for row in sheet.rows if row[3]}
    assert marks == {"position_error.max": "ok, below 0.5", "ticks": "MISSED, below 1"}
    (times,) = (note for note in sheet.notes if note.startswith("OK"))
    for status, seconds in re.findall(r"(\w+) ([\d.]+) s", times):
        assert float(seconds) == pytest.approx(run.scorecard[f"status_time.{status}"].value, rel=1e-3)


def test_without_colors_the_text_is_the_same_and_names_are_no_markup():
    card = random_card(("[red]", "a|b", "*x*"))
    sheets = tables.sheets(card, check(card, {"ticks": Check(above=100), "completed": Check(above=1)}))
    plain, colored = printed(sheets), printed(sheets, force_terminal=True)
    assert colored != plain and re.sub(r"\x1b\[[0-9;]*m", "", colored) == plain
    assert "joint_rate.[red]" in plain and "ok " in plain and "MISSED " in plain
    text = tables.markdown(card)
    assert all(name in text for name in (r"\[red\]", r"a\|b", r"\*x\*"))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"), (1.0, "1.000"), (-1.0, "-1.000"), (1234.4, "1234"), (9999.4, "9999"), (12369.6, "12370"),
        (999_999.4, "999999"), (1.5e6, "1.50e6"), (0.0123456, "0.01235"), (0.00123456, "0.00123"),
        (0.000999, "9.99e-4"), (1.5e-123, "1.50e-123"), (math.inf, "inf"), (-math.inf, "-inf"), (math.nan, "-"),
    ],
)  # fmt: skip
def test_numbers_have_three_to_six_digits(value, text):
    assert number(value) == text
