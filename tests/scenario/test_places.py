import pytest
from scenario_texts import EXAMPLE, FULL, MINIMAL

from rmrc.scenario import Scenario, loads


@pytest.mark.parametrize(
    ("key", "place"),
    [
        ("control.inverse.damping.maximum", "x.yaml:7:83: control.inverse.damping.maximum"),
        ("arm.start[1]", "x.yaml:3:50: arm.start[1]"),
        ("expect.joint_rate.peak.below", "x.yaml:17:28: expect.joint_rate.peak.below"),
        ("plant.wrench[2]", "x.yaml:15:8: plant.wrench[2]"),  # the nearest parent
        ("plant.kv", "--set plant.kv"),
        ("arm.joints[1]", "--set arm.joints: arm.joints[1]"),
    ],
)
def test_locate_says_where_a_value_is(key, place):
    scenario = loads(EXAMPLE, "x.yaml", ["plant.kv=1", "arm.joints=[a, b]"])
    assert scenario.locate(key) == place


def test_locate_finds_a_figure_whatever_its_name_is_made_of():
    scenario = loads(f'{MINIMAL}expect:\n  "a[0]..b = c": {{below: 3}}\n', "x.yaml")
    assert scenario.locate("expect.a[0]..b = c.below") == "x.yaml:7:26: expect.a[0]..b = c.below"
    assert scenario.locate("expect.") == "x.yaml:7:3: expect."  # an empty name is refused as a figure
    with pytest.raises(ValueError, match=r"^'a\.\.b' .* control\.feedback or arm\.start\[1\]$"):
        scenario.locate("a..b")


def test_a_replaced_value_has_the_place_of_its_override_and_one_made_in_python_has_none():
    scenario = loads(MINIMAL, "x.yaml", ["plant.kv=1"])
    assert scenario.locate("plant") == "--set plant.kv: plant"
    assert scenario.locate("plant.timestep") == "x.yaml:1:1: plant.timestep"
    scenario = loads(FULL, "x.yaml", ["control.limits={on_excess: none}"])
    assert scenario.locate("control.limits.rate[1]") == "--set control.limits: control.limits.rate[1]"
    made = Scenario.model_validate(loads(MINIMAL).model_dump())
    assert made.locate("arm.start[1]") == "arm.start[1]"
