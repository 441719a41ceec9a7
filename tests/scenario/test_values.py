"""Values: numbers with units, files, and where in a file or on a command line a value was written."""

import math

import pytest
from scenario_texts import FULL, MINIMAL, full_number_keys, problems

from rmrc.scenario import Scenario, loads
from rmrc.support.errors import ScenarioError
from wording import says


@pytest.mark.parametrize(
    ("override", "key", "value"),
    [
        ("arm.start=[-1.5e1 deg]", "arm.start", (-math.pi / 12,)),
        ("arm.start=[' 180  deg ', 1e-3 rad, -0.5]", "arm.start", (math.pi, 0.001, -0.5)),
        ("control.limits.rate=180 deg/s", "control.limits.rate", math.pi),
        ("control.limits.acceleration=[90 deg/s², 1]", "control.limits.acceleration", (math.pi / 2, 1)),
        ("control.limits.jerk=900 deg/s^3", "control.limits.jerk", 5 * math.pi),
        ("control.period=30 Hz", "control.period", 1 / 30),
        ("control.period=1/240", "control.period", 1 / 240),
    ],
)
def test_a_number_may_have_a_unit(override, key, value):
    found = loads(MINIMAL, overrides=[override])
    for name in key.split("."):
        found = getattr(found, name)
    assert found == pytest.approx(value, rel=1e-15)  # one rounding in the product with pi/180


@pytest.mark.parametrize("override", ["control.limits.rate=180 deg", "control.period=30 ms", "control.period=1/0",
                                      f"arm.start=[{'1' * 100_000} degrees]"])  # fmt: skip
def test_another_unit_is_refused_at_once(override):
    """Digits that could stand on both sides of a dot that is not there took the square of their number: minutes."""
    with pytest.raises(ScenarioError, match="number"):
        loads(MINIMAL, overrides=[override])


def test_a_model_that_is_not_there_is_told_with_its_neighbor(folder):
    (line,) = problems(MINIMAL.replace("arm.xml", "amr.xml"))
    assert line == says(f'x.yaml:2:14: arm.model: … "{folder}/amr.xml"; … "arm.xml"…')
    (folder / "loop").symlink_to("loop")
    for name in (".", '"a\\0b"', "loop"):
        (line,) = problems(MINIMAL.replace("arm.xml", name))
        assert line == says(f'x.yaml:2:14: arm.model: … file "{folder}…')


@pytest.mark.parametrize(("text", "shown"), [(".nan", "nan"), ("-.inf", "-inf")])
def test_no_number_of_a_scenario_may_be_nan_or_infinite(text, shown):
    # those of a sweep aside, whose own keys have dots and brackets
    keys = [key for key in full_number_keys() if not key.startswith("sweep.")]
    assert len(keys) > 50
    lines = problems(FULL, *(f"{key}={text}" for key in keys))
    assert [key for key in keys if says(f"--set {key}: … finite … {shown}") not in lines] == []


@pytest.mark.parametrize(
    ("key", "place"),
    [
        ("target.path[0].line.by[1]", "x.yaml:5:24: target.path[0].line.by[1]"),
        ("arm.start[1]", "x.yaml:2:6: arm.start[1]"),  # the nearest parent
        ("expect.a[0]..b = c.below", "x.yaml:7:26: expect.a[0]..b = c.below"),
        ("plant.kv", "--set plant.kv"),
        ("plant", "--set plant.kv: plant"),
        ("arm.joints[1]", "--set arm.joints: arm.joints[1]"),
    ],
)
def test_locate_says_where_a_value_is(key, place):
    text = f'{MINIMAL}expect:\n  "a[0]..b = c": {{below: 3}}\n'
    assert loads(text, "x.yaml", ["plant.kv=1", "arm.joints=[a, b]"]).locate(key) == place
    made = Scenario.model_validate(loads(MINIMAL).model_dump())
    assert made.locate(key) == key  # made in Python
