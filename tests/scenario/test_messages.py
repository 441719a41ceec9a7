"""What is wrong with a value is one printable line, which names the way out: that is then accepted."""

import re

import pytest
import yaml
from scenario_texts import MINIMAL, problems

from rmrc.scenario import load, loads
from rmrc.scenario.units import UNITS, instead
from rmrc.support.errors import ScenarioError
from wording import says


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("control.feedbak=1", '… key; … "feedback"?'),
        ("task.size=1", "… key; … axes, frame, length, weights"),
        ("arm.model=null", "… text, got nothing"),
        ("arm={site: tip}", "--set arm: arm.model: … required: MJCF or URDF file…"),
        ("control.inverse.method=dampd", '… one of "inverse", … "damped"?'),
        ("arm.site=2024", "… text, got 2024; … quotes"),
        ("plant=servo", '… mapping, got "servo"; … keys … kind, …'),
        ("arm.encoder=3", "… mapping, got 3; … keys … offset, deviation, …"),
        ("task.axes=x", '… list … "x"'),
        ("target.offset=[1, 2, 3, 4]", "… 3 … items, got [1, 2, 3, 4]"),
        ("target.path=[]", "… 1 … items, got []"),
        ("target.path=[{go: {to: [1, 0]}}]", "… key; the keys are line, arc, …"),
        ("target.limits.velocity=250 mm/s", '… "250 mm/s"; write 0.25, in m/s'),
        ("target.limits.velocity=90 deg/s", "…; it is 1.570796 rad/s, … m/s"),
        ("arm.start=[60 degrees]", '… "60 degrees"; write 60 deg'),
        ("control.feedback=1e1", '… "1e1"; write 10'),
        ("control.slow.longest=0", "… >= 1, got 0"),
        ("control.feedforward=1", "… true or false, got 1"),
        ("plant.seed=1.5", "… whole number … 1.5"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_with_the_way_out(override, line):
    (problem,) = problems(MINIMAL, override)
    assert problem.startswith("--set ") and problem == says(line), problem


@pytest.mark.parametrize("override", ["control.inverse.method=dls", "control.feedback=1e1"])
def test_what_a_message_says_to_write_can_be_written(override):
    (problem,) = problems(MINIMAL, override)
    key = override.partition("=")[0]
    assert loads(MINIMAL, overrides=[f"{key}={problem.partition('; write ')[2]}"])


@pytest.mark.parametrize("unit", UNITS)
def test_a_quantity_in_another_unit_is_told_as_a_number_that_yaml_reads(unit):
    factor, si = UNITS[unit]
    number, degrees = re.fullmatch(r"; write ([\d.e-]+)( deg)?.*", instead(f"3 {unit}", si)).groups()
    factor *= 180 / 3.141592653589793 if degrees else 1
    assert yaml.safe_load(number) == pytest.approx(3 * factor, rel=1e-6)


@pytest.mark.parametrize("text", ["fast", "3 apples", "1/0", "", "1e999 mm", "mm", "--1 mm"])
def test_of_what_is_no_quantity_nothing_is_told(text):
    assert instead(text, "m") == ""


@pytest.mark.parametrize("case", ["value", "every other text"])
def test_no_control_character_of_a_file_stands_in_an_error(case):
    evil = "\x1b]0;evil\x07\x9b31m\u202e"
    text = MINIMAL + 'control: {inverse: {damping: "\\e]0;evil\\a\\e[31mred"}}\n'
    overrides = ()
    if case != "value":
        escaped = evil.encode("unicode_escape").decode()
        text = text.replace("arm.xml", f'"{escaped}"').replace("control:", f'"{escaped}":')
        overrides = f"plant.{evil}=1", f"{evil}"
    for texts in ((), *((override,) for override in overrides)):
        with pytest.raises(ScenarioError) as caught:
            loads(text, f"{evil}.yaml", texts)
        assert str(caught.value).replace("\n", "").isprintable()
    with pytest.raises(ScenarioError) as caught:
        load(f"{evil}.yaml")
    assert str(caught.value).isprintable()
