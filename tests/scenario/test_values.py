import math

import pytest
from scenario_texts import FULL, MINIMAL, full_number_keys, problems

from rmrc.scenario import loads
from rmrc.support.errors import ScenarioError
from wording import says


@pytest.mark.parametrize(
    ("text", "radians"),
    [
        ("-0.5", -0.5),
        ("60 deg", math.pi / 3),
        ("-1.5e1 deg", -math.pi / 12),
        ("' 180  deg '", math.pi),
        ("1e-3 rad", 0.001),
    ],
)
def test_an_angle_is_radians_or_a_number_with_a_unit(text, radians):
    # One rounding in the product with pi/180.
    assert loads(MINIMAL, overrides=[f"arm.start=[{text}]"]).arm.start[0] == pytest.approx(radians, rel=1e-15)


def test_an_angle_of_many_digits_is_refused_at_once():
    # Digits that could stand on both sides of a dot that is not there took the square of their number: minutes of these.
    with pytest.raises(ScenarioError, match="number"):
        loads(MINIMAL, overrides=[f"arm.start=[{'1' * 100_000} degrees]"])


def test_a_model_that_is_not_there_is_told_with_its_neighbor(folder):
    assert problems(MINIMAL.replace("arm.xml", "amr.xml")) == [
        says(f'x.yaml:2:14: arm.model: … "{folder}/amr.xml"; … "arm.xml"…')
    ]
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
