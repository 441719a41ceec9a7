"""The declarations of choices hold together, and what is derived from them has all of it and no more."""

from operator import attrgetter

import numpy as np
import pytest
from scenario_texts import FULL, MINIMAL

from rmrc.scenario import loads
from rmrc.scenario.choices import CHOICES, PARAMETERS, Scales, record_fields, write_choices


@pytest.mark.parametrize("each", [one for one in PARAMETERS if one.range], ids=lambda each: each.field)
def test_what_is_searched_is_a_key_s_value_and_grows_with_the_scales(each):
    scales = Scales(sigma=2.0, manipulability=3.0, start=0.5, slowest=0.1, fastest=4.0)
    low, high = each.range(scales)
    assert low < high
    for number in (low, high):
        loads(MINIMAL.replace("arm.xml", __file__)).set({f"control.{each.key}": number})
    wider = each.range(Scales(*(10 * scale for scale in scales)))
    factor = 1 if each.key == "inverse.gamma" else 10  # which is relative to σ₁
    assert wider == pytest.approx((factor * low, factor * high), rel=1e-12)


@pytest.mark.parametrize("text", [FULL, MINIMAL], ids=["full", "minimal"])
def test_the_record_has_what_the_scenario_says(text):
    kinds = [(name, kind, (3,) if each else ()) for name, kind, each in record_fields()]
    control, world = loads(text).control, np.zeros(1, np.dtype([*kinds, ("other", float)]))
    world["other"] = 7.0
    write_choices(world, control)
    assert world["other"][0] == 7.0
    for choices in CHOICES:
        assert choices.names[world[choices.field][0]] == attrgetter(choices.key)(control)
    for each in PARAMETERS:
        value, got = attrgetter(each.key)(control), world[each.field][0]
        if isinstance(value, tuple):
            assert got[: len(value)].tolist() == list(value)
        else:
            np.testing.assert_array_equal(got, each.null if value is None else value)
