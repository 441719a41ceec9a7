import json

import pytest
from scenario_texts import EXAMPLE, FULL, MINIMAL

from rmrc.scenario import Scenario, loads


@pytest.mark.parametrize(
    ("key", "place"),
    [
        ("control.inverse.damping.maximum", "x.yaml:7:83: control.inverse.damping.maximum"),
        ("arm.start[1]", "x.yaml:3:50: arm.start[1]"),
        ("control.feedback", "x.yaml:8:13: control.feedback"),
        ("target.path[1].line.to[0]", "x.yaml:13:50: target.path[1].line.to[0]"),
        ("expect.joint_rate.peak", "x.yaml:17:20: expect.joint_rate.peak"),
        ("expect.joint_rate.peak.below", "x.yaml:17:28: expect.joint_rate.peak.below"),
        ("plant.wrench[2]", "x.yaml:15:8: plant.wrench[2]"),  # the nearest parent
        ("nothing.like.that", "x.yaml:2:1: nothing.like.that"),
        ("plant.kv", "--set plant.kv"),
        ("arm.joints[1]", "--set arm.joints: arm.joints[1]"),
    ],
)
def test_locate_says_where_a_value_is(key, place):
    scenario = loads(EXAMPLE, "x.yaml", ["plant.kv=1", "arm.joints=[a, b]"])
    assert scenario.locate(key) == place


@pytest.mark.parametrize(
    "figure", ["joint_rate.peak", "joint_rate.upper arm.peak", "a[0]..b = c", "x", "below"]
)
def test_locate_finds_a_figure_whatever_its_name_is_made_of(figure):
    scenario = loads(f"{MINIMAL}expect:\n  {json.dumps(figure)}: {{below: 3}}\n", "x.yaml")
    column = len(json.dumps(figure)) + 5
    assert scenario.locate(f"expect.{figure}") == f"x.yaml:7:{column}: expect.{figure}"
    assert scenario.locate(f"expect.{figure}.below") == f"x.yaml:7:{column + 8}: expect.{figure}.below"


def test_locate_refuses_what_is_no_key():
    with pytest.raises(ValueError, match=r"^'a\.\.b' .* control\.feedback or arm\.start\[1\]$"):
        loads(MINIMAL).locate("a..b")


def test_a_mapping_made_for_an_override_has_no_place_of_its_own():
    scenario = loads(MINIMAL, "x.yaml", ["plant.kv=1"])
    assert scenario.locate("plant") == "--set plant.kv: plant"
    assert scenario.locate("plant.timestep") == "x.yaml:1:1: plant.timestep"


def test_what_was_replaced_leaves_no_place_behind():
    scenario = loads(FULL, "x.yaml", ["control.limits={on_excess: none}"])
    assert scenario.locate("control.limits.rate[1]") == ("--set control.limits: control.limits.rate[1]")
    text = MINIMAL.replace("by: [0.1, 0.0]", "by: [0.1, 0.0], turn: &t {axis: [1, 0, 0], angle: 1}")
    merged = loads(text + "    - turn: {<<: *t, axis: z}\n", "x.yaml")
    assert merged.locate("target.path[1].turn.axis[2]") == ("x.yaml:6:28: target.path[1].turn.axis[2]")


def test_a_scenario_made_in_python_has_no_places():
    scenario = Scenario.model_validate(loads(MINIMAL).model_dump())
    assert scenario.locate("arm.start[1]") == "arm.start[1]"
