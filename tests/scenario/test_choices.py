"""The declarations of choices hold together, and what is derived from them has all of it and no more."""

import keyword
import re
from operator import attrgetter

import numpy as np
import pytest
from scenario_texts import FULL, MINIMAL

from rmrc.scenario import loads, schema_rows
from rmrc.scenario.choices import CHOICES, GROUPS, INVERSES, PARAMETERS, Scales, record_fields, write_choices

READ = {one for choices in CHOICES for option in choices.options for one in option.parameters}


def test_every_parameter_is_read_by_a_choice_and_every_one_that_is_read_is_a_key():
    assert set(PARAMETERS) == READ
    keys = [one.key for one in (*CHOICES, *PARAMETERS)]
    assert len(set(keys)) == len(keys) > 20
    assert {f"control.{key}" for key in keys} <= {row.key for row in schema_rows()}


@pytest.mark.parametrize("choices", CHOICES, ids=lambda choices: choices.field)
def test_names_are_names_of_functions_and_each_has_its_own_code(choices):
    assert [choices.code(name) for name in choices.names] == list(range(len(choices.options)))
    assert len(set(choices.names)) == len(choices.names) > 1
    assert all(name.isidentifier() and not keyword.iskeyword(name) for name in choices.names)
    assert choices.default in choices.names and all(choices[name].name == name for name in choices.names)
    assert all(one.meaning for one in choices.options)


def test_inverses_are_preferred_in_an_order():
    assert sorted(one.preference for one in INVERSES.options) == list(range(len(INVERSES.options)))


SCALES = Scales(sigma=2.0, manipulability=3.0, start=0.5, slowest=0.1, fastest=4.0)


@pytest.mark.parametrize("one", PARAMETERS, ids=lambda one: one.field)
def test_defaults_and_what_is_searched_are_within_bounds(one):
    b = one.bounds
    numbers = [one.default] if one.default is not None else []
    assert numbers or one.null is not None
    if one.range is not None:
        low, high = one.range(SCALES)
        assert low < high
        numbers += [low, high]
    for number in numbers:
        assert b.gt is None or number > b.gt
        assert b.ge is None or number >= b.ge
        assert b.lt is None or number < b.lt
        assert b.le is None or number <= b.le
    # of values above all scales a range says another thing
    if one.range is not None and one.name != "gamma":
        wider = one.range(Scales(*(10 * scale for scale in SCALES)))
        assert wider == pytest.approx((10 * low, 10 * high), rel=1e-12)


def test_every_key_of_two_steps_has_its_section():
    made = {one.key for one in GROUPS}
    below = {one.place for one in (*CHOICES, *PARAMETERS)} - {"", "inverse", "nullspace", "limits"}
    assert below == made


def as_record(joints=3):
    kinds = [(name, kind, (joints,) if each else ()) for name, kind, each in record_fields()]
    return np.dtype([*kinds, ("other", float)])


@pytest.mark.parametrize("text", [FULL, MINIMAL], ids=["full", "minimal"])
def test_the_record_has_what_the_scenario_says(text):
    control = loads(text).control
    pattern = np.full(as_record().itemsize, 0xA5, np.uint8)
    world = pattern.view(as_record())
    untouched = float(world["other"][0])
    write_choices(world, control)
    assert world["other"][0] == untouched
    for choices in CHOICES:
        name = attrgetter(choices.key)(control)
        assert world[choices.field][0] == choices.names.index(name)
    for one in PARAMETERS:
        value, got = attrgetter(one.key)(control), world[one.field][0]
        if isinstance(value, tuple):
            assert got[: len(value)].tolist() == list(value)
        else:
            np.testing.assert_array_equal(got, one.null if value is None else value)
    alone = np.zeros(1, as_record())[0]  # a record by itself is written alike
    write_choices(alone, control)
    for name, _, each in record_fields():
        if not each:
            np.testing.assert_array_equal(alone[name], world[name][0])


def test_a_name_that_there_is_not_has_no_code():
    with pytest.raises(ValueError, match=re.escape("tuple.index(x): x not in tuple")):
        INVERSES.code("dampd")
