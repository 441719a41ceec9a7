import io
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from project import mostly_long
from rmrc.results.columns import COLUMNS
from rmrc.results.expectations import check
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure, Scorecard, scorecard
from rmrc.scenario import Check, SchemaRow, schema_rows
from rmrc.scenario.choices import Status
from rmrc.show import tables
from rmrc.show.sheets import Sheet, number
from rmrc.show.terminal import as_table

SPACE = ("x", "y", "z", "rx", "ry", "rz")
NUMBER = r"(?<![\w.])-?(?:\d+(?:\.\d+)?(?:e-?\d+)?|inf)(?![\w.])"


def printed(renderable, width=80, **options):
    console = Console(file=io.StringIO(), width=width, **options)
    console.print(renderable)
    return console.file.getvalue()


def random_card(joints, ticks=200, scale=1.0, slides=None):
    rng = np.random.default_rng(len(joints))
    n = len(joints)
    width = {"n": n, "k": min(n, 6), "nq": n, "6": 6, "7": 7}
    columns = {
        name: scale * rng.uniform(0.1, 1.0, (ticks, width[c.width]) if c.width else ticks)
        for name, c in COLUMNS.items()
    }
    columns["time"] = columns["path_time"] = np.arange(ticks) * 0.001
    columns["status"] = rng.integers(0, 2 * max(Status), ticks)
    is_slide = slides or (False,) * n
    run = Run(
        "case", tuple(joints), is_slide, SPACE, length=1.0, period=0.001, planned=2 * ticks, wall_time=0.0123,
        columns=columns,
    )  # fmt: skip
    return scorecard(run)


def distinct(card):
    """Return the card with a value of its own for each figure: none can pass for another."""
    figures = {}
    for i, (name, figure) in enumerate(card.items()):
        value = figure.value if isinstance(figure.value, str) else 1.017 ** (i + 50)
        figures[name] = Figure(value, figure.unit, figure.meaning)
    return Scorecard(card.name, card.joints, figures)


def missing(card, text):
    """Return the figures whose values are not in the text, to three digits."""
    numbers = np.array([float(number) for number in re.findall(NUMBER, text)])
    return [
        name
        for name, figure in card.items()
        if not (
            figure.value in text
            if isinstance(figure.value, str)
            # Half a unit in the third digit is at most 0.5 %; neighbors differ by 1.7 %.
            else np.any(np.abs(numbers / figure.value - 1.0) <= 0.005)
        )
    ]


SIX = ("waist", "shoulder", "elbow", "roll", "pitch", "yaw")
FORMS = {"terminal": lambda *given: printed(tables.render(*given)), "markdown": tables.markdown}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("joints", [("a",), SIX, ("shoulder_pan_joint", "elbow_joint")])
def test_every_value_of_a_scorecard_is_shown(form, joints):
    card = distinct(random_card(joints))
    assert missing(card, form(card)) == []


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_a_figure_that_no_table_expects_is_shown_all_the_same(form):
    card = random_card(("a",))
    figures = {**card.figures, "novelty.max": Figure(123.25, "kg", "")}
    assert re.search(r"novelty\.max[ |]+123\.[23][ |]+kg", form(Scorecard("case", ("a",), figures)))


@pytest.mark.parametrize("scale", mostly_long([1e-9, 1e-4, 0.003, 1e6, 1.0, 1e3], 3))
@pytest.mark.parametrize("joints", [SIX, tuple("abcdefghijkl"), ("shoulder_pan_joint",)])
@pytest.mark.parametrize("width", [80, 100])
def test_nothing_is_cut_off_and_no_line_is_too_long(scale, joints, width):
    card = random_card(joints, scale=scale)
    outcomes = check(card, {f"tau.{joint}.peak": Check(below=1e-12, above=-1) for joint in joints})
    text = printed(tables.render(card, outcomes), width)
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    table = text.partition("\nJoints")[2].partition("\nErrors")[0].splitlines()
    for (
        joint
    ) in joints:  # eight numbers, whole; in two tables where they and a long name are too wide for one
        told = [line.split(maxsplit=1)[1] for line in table if line.startswith(f"{joint} ")]
        assert len(re.findall(NUMBER, " ".join(told))) == 8, told


def test_each_number_of_a_joint_stands_below_its_heading():
    card = random_card(("shoulder", "elbow"))
    values = {
        "joint_rate.elbow.peak": (1.5, "rad/s"),
        "joint_rate.elbow.peak_time": (0.25, "s"),
        "joint_rate.elbow.rms": (0.75, "rad/s"),
        "joint_rate_cmd.elbow.peak": (1.625, "rad/s"),
        "joint_rate_cmd.elbow.peak_time": (0.125, "s"),
        "joint_rate_cmd.elbow.rms": (0.875, "rad/s"),
        "joint_acceleration.elbow.peak": (12.5, "rad/s²"),
        "tau.elbow.peak": (2500.0, "N·m"),
    }
    figures = card.figures | {name: Figure(*given, "") for name, given in values.items()}
    lines = tables.markdown(Scorecard("case", card.joints, figures)).splitlines()
    assert (
        "| joint | rate peak rad/s | at s | rms rad/s | command peak rad/s | at s | rms rad/s "
        "| accel. peak rad/s² | torque peak N·m |"
    ) in lines
    assert "| elbow | 1.500 | 0.2500 | 0.7500 | 1.625 | 0.1250 | 0.8750 | 12.50 | 2500 |" in lines


def test_status_has_seconds_and_share_of_the_duration():
    card = random_card(("a",))
    figures = card.figures | {
        "duration": Figure(2.0, "s", ""),
        "status_time.DAMPED": Figure(0.5, "s", ""),
    }
    assert "| DAMPED | 0.5000 | 25.0% |" in tables.markdown(Scorecard("case", ("a",), figures))


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_a_run_without_ticks_shows_dashes(form):
    text = form(random_card(("a", "b"), ticks=0))
    assert "nan" not in text
    assert re.search(r"sigma\.min[ |]+- ", text)
    assert re.search(r"ticks[ |]+0 ", text)


OUTCOMES = {"ticks": Check(above=100), "completed": Check(equals=1, within=0)}


def test_expectations_are_marked_by_words_in_a_terminal():
    card = random_card(("a",))
    text = printed(tables.render(card, check(card, OUTCOMES)))
    assert "ok      ticks: expected above 100, got 200\n" in re.sub(" +\n", "\n", text)
    assert "MISSED  completed: expected 1 within 0, got 0.5, 0.5 too low\n" in re.sub(" +\n", "\n", text)
    assert "Expected" not in printed(tables.render(card))


def test_without_colors_the_text_is_the_same():
    card = random_card(("a",))
    card_and_outcomes = card, check(card, OUTCOMES)
    plain = printed(tables.render(*card_and_outcomes))
    colored = printed(tables.render(*card_and_outcomes), force_terminal=True)
    assert colored != plain
    assert re.sub(r"\x1b\[[0-9;]*m", "", colored) == plain


def test_names_are_not_read_as_markup():
    card = random_card(("[red]", "a|b", "*x*"))
    text = printed(tables.render(card))
    assert all(name in text for name in card.joints)
    text = tables.markdown(card)
    assert all(name in text for name in (r"\[red\]", r"a\|b", r"\*x\*"))
    titled = as_table(Sheet("site [red]tool", ("",), [("1" * 20,)]))
    assert "site [red]tool" in printed(titled)
    columns = {
        len(re.findall(r"(?<!\\)\|", line)) for line in text.splitlines() if line.startswith(r"| a\|b |")
    }
    assert columns == {10}  # nine cells


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (1.0, "1.000"),
        (-1.0, "-1.000"),
        (3.14159, "3.142"),
        (1234.4, "1234"),
        (9999.4, "9999"),
        (9999.6, "1.00e4"),
        (123456.0, "1.23e5"),
        (0.0123456, "0.01235"),
        (0.00123456, "0.00123"),
        (0.000999, "9.99e-4"),
        (1.5e-123, "1.50e-123"),
        (math.inf, "inf"),
        (-math.inf, "-inf"),
        (math.nan, "-"),
    ],
)
def test_numbers_have_three_or_four_digits(value, text):
    figures = {**random_card(("a",)).figures, "new.max": Figure(value, "m", "")}
    shown = tables.markdown(Scorecard("case", ("a",), figures))
    assert number(value) == text
    assert (f"| new.max | {text} | m |" in shown) == ("new.max" in shown) == (not math.isnan(value))


def test_rows_that_say_nothing_are_left_out_unless_they_were_expected():
    card = random_card(("a", "b"))
    none = {name: Figure(0.0, "N·m", "") for name in card if name.startswith("tau") and "joint" not in name}
    none |= {f"secondary_error.{name}": Figure(math.nan, "m, rad", "") for name in ("rms", "max", "end")}
    none |= {f"status_time.{name}": Figure(0.0, "s", "") for name in ("JERK_LIMITED", "JERK_EXCEEDED")}
    none |= {
        "damping.max": Figure(0.0, "1", ""),
        "path_rate.min": Figure(1.0, "1", ""),
        "stuck.longest": Figure(0.0, "s", ""),
    }
    quiet = Scorecard("case", card.joints, card.figures | none)
    groups = (
        "| tau",
        "torque peak",
        "secondary_error",
        "JERK",
        "joint_jerk_cmd",
        "damping",
        "path_rate",
        "stuck",
    )
    assert not [one for one in groups if one in tables.markdown(quiet)]
    assert not [one for one in groups if one not in tables.markdown(card)]
    assert not [
        one for one in groups if one not in tables.markdown(quiet, (), card)
    ]  # what stands beside has them
    assert "joint_jerk_cmd" in tables.markdown(quiet, check(quiet, {"joint_jerk_cmd.peak": Check(above=0)}))
    assert set(quiet) == set(card)


@given(st.floats(1e-99, 1e99))
def test_a_number_of_a_column_has_at_most_seven_characters(value):
    text = number(value)
    # Beyond 1e±9 the exponent takes one more; no arm gets there.
    assert len(text) <= (7 if 1e-9 <= value < 9.99e9 else 8)
    assert float(text) == pytest.approx(value, rel=0.0051)


def test_a_time_late_in_a_run_still_names_its_tick():
    figures = {**random_card(("a",)).figures, "sigma.min_time": Figure(123.4567, "s", "")}
    text = tables.markdown(Scorecard("case", ("a",), figures))
    assert "| sigma.min_time | 123.457 | s |" in text


# Schema -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [80, 120])
def test_the_schema_keeps_every_key_whole_and_every_word(width):
    text = printed(tables.schema(schema_rows()), width)
    lines = text.splitlines()
    assert max(map(len, lines)) <= width
    assert "…" not in text
    keys = [line.split()[0] for line in lines if not line.startswith(" ")]
    assert keys == [row.key for row in schema_rows()]
    # What stands right of the keys, joined again, is every type, default and meaning.
    indent = min(len(line) - len(line.lstrip()) for line in lines if line.startswith(" "))
    right = " ".join(" ".join(line[indent:] for line in lines).split())
    for row in schema_rows():
        assert row.type in right
        assert row.meaning in right


def test_the_schema_breaks_the_meaning_and_not_a_long_key():
    row = SchemaRow("a_key." * 10 + "end", "text", "", "null", "a meaning of some words")
    lines = printed(tables.schema([row])).splitlines()
    assert lines[0].split()[0] == row.key
    assert " ".join(" ".join(line[len(row.key) :] for line in lines).split()) == (
        "text, default null a meaning of some words"
    )
