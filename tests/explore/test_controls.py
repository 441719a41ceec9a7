"""Controls: each is a key, offers what its declaration has, and its ends are values that a scenario takes."""

import pytest

from rmrc.explore.answer import Explored
from rmrc.explore.controls import DELAY, EXCESS, FEEDBACK, METHOD, OBJECTIVE, POLICY, RATE, SCHEDULE, read_of
from rmrc.scenario import schema_rows
from rmrc.scenario.choices import INVERSES, LIMITS, OBJECTIVES, POLICIES, SCHEDULES

MENUS = {METHOD: INVERSES, SCHEDULE: SCHEDULES, POLICY: POLICIES, EXCESS: LIMITS, OBJECTIVE: OBJECTIVES}


@pytest.fixture
def explored(scenario):
    return Explored(scenario("target.path=[{line: {by: [0.02, 0.0]}}]"))


def test_each_control_is_a_key_with_its_meaning_and_unit(explored):
    rows = {row.key: row for row in schema_rows()}
    for one in explored.controls:
        assert (one.meaning, one.unit) == (rows[one.key].meaning, rows[one.key].unit)
        assert one.key == f"{one.section}.{one.label}"
    assert len({one.key for one in explored.controls}) == len(explored.controls)


def test_each_menu_has_all_that_is_declared(explored):
    found = {one.key: one.options for one in explored.controls if one.options}
    assert {key: found[key] for key in MENUS} == {key: choices.names for key, choices in MENUS.items()}


def test_a_scenario_takes_both_ends_of_each_slider_and_has_its_written_value_between(explored):
    written = explored.written.prepared.scenario
    sliders = [one for one in explored.controls if one.step]
    assert {FEEDBACK, RATE, DELAY, "control.inverse.damping.maximum"} <= {one.key for one in sliders}
    for one in sliders:
        assert one.low <= one.written <= one.high
        for value in (one.low, one.high):
            written.set({one.key: value})


def test_round_values_are_on_the_steps_of_each_slider(explored):
    # 200 steps of an end of 1, 2 or 5 times a power of ten: a tenth of the end is on one
    for one in explored.controls:
        if one.step:
            assert one.high / one.step == pytest.approx(200.0, rel=1e-9)


def test_what_no_choice_reads_is_not_shown(explored):
    written = {one.key: one.written for one in explored.controls}
    assert written[METHOD] == "damped"
    damped, jparse = read_of(written, {}), read_of(written, {METHOD: "jparse"})
    assert {SCHEDULE, "control.inverse.damping.maximum"} <= damped
    assert "control.inverse.gamma" in jparse - damped
    assert SCHEDULE in damped - jparse
    assert RATE not in read_of(written, {EXCESS: "none"})


def test_a_number_of_the_page_has_no_digits_of_binary_fractions(explored):
    (feedback,) = (one for one in explored.controls if one.key == FEEDBACK)
    assert feedback.parsed(0.1 + 0.2) == 0.3
