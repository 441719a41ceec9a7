"""What is wrong with a value is one printable line, which names the way out: that is then accepted."""

import math

import pytest
from scenario_texts import MINIMAL, problems

from rmrc.scenario import load, loads
from rmrc.scenario.choices import CHOICES, PLANTS
from rmrc.scenario.messages import ALIASES
from rmrc.support.errors import ScenarioError
from wording import says


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("control.feedbak=1", '… key; … "feedback"?'),
        ("task.size=1", "… key; … axes, frame, length, weights"),
        ("arm.model=null", "… text, … got nothing"),
        ("arm={site: tip}", "--set arm: arm.model: … required: MJCF or URDF file…"),
        ("control.inverse.method=dampd", '… one of "inverse", … "damped"?'),
        ("arm.site=2024", "… text, … quotes … got 2024"),
        ("plant=servo", '… mapping, got "servo"; … keys … kind, …'),
        ("arm.encoder=3", "… mapping, got 3; … keys … offset, deviation, …"),
        ("task.axes=x", '… list … "x"'),
        ("target.offset=[1, 2, 3, 4]", "… 3 … items, got [1, 2, 3, 4]"),
        ("target.path=[]", "… 1 … items, got []"),
        ("target.path=[{go: {to: [1, 0]}}]", "… key; the keys are line, arc, …"),
        ("target.limits.velocity=250 mm/s", '… number, got "250 mm/s"; write … in m/s'),
        ("arm.start=[60 degrees]", '… "60 degrees"; write … in rad or m'),
        ("control.feedback=1e1", '… "1e1"; write 10, in 1/s'),
        ("control.slow.longest=0", "… >= 1, got 0"),
        ("control.feedforward=1", "… true or false, got 1"),
        ("plant.seed=1.5", "… whole number … 1.5"),
        ("expect={sigma.min: {less: 3.3}}", "… key; write below; … below, above, equals, within"),
        ("expect={sigma.min: < 3.3}", '… mapping, such as {below: 1}, got "< 3.3"'),
        ("control.inverse={feedback: 20}", "… key; … key of control: indent it less"),
        ("plant={kind ideal}", "… key; write a colon: kind: ideal"),
        ("control.plant={kind: ideal}", "… key; … whole scenario: indent it less"),
        ("control.method=damped", "… key; … key of control.inverse: put it there"),
        ("control={inverse.method: damped}", "… write inverse: {method: ...}"),
        ("target.limits={velocity:0.2}", "… space after the colon: velocity: 0.2"),
        ("plant=kind ideal", '… got "kind ideal"; write kind: ideal'),
        ("target.path={line: {by: [1, 0]}}", "… begin each item with a dash"),
        ("control.period=1 ms", '… got "1 ms"; write 0.001, in s'),
        ("target.limits.velocity=0,25", '… got "0,25"; write 0.25, in m/s'),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_with_the_way_out(override, line):
    (problem,) = problems(MINIMAL, override)
    assert problem.startswith("--set ") and problem == says(line), problem


@pytest.mark.parametrize(
    ("lines", "where", "why"),
    [
        ("control:\n  period: 0.01\n    feedback: 20\n", "3:13", "indented too far"),
        ("control:\n  period: 0.01\n feedback: 20\n", "3:2", "not indented as the lines beside it"),
        ("plant:\n  seed: 1\n  kind ideal\n  loss: 0\n", "3:3", "without a colon"),
        ("plant:\n  kind ideal\n  seed: 1\n", "3:7", "below a line without its colon"),
        ("plant:\n\tkind: ideal\n", "2:1", "a tab; indent with spaces"),
        ("task: {axes: [x, y}\n", "1:14", "bracket that is not closed"),
        ("task: {axes: [x, y]}}\n", "1:21", "bracket that was not opened"),
        ('plant: {kind: "ideal}\n', "1:15", "quote that is not closed"),
        ("name: @x\n", "1:7", "in quotes"),
    ],
)
def test_a_mistake_in_the_layout_is_told_where_it_is_and_not_where_yaml_notices_it(lines, where, why):
    (problem,) = problems(lines)
    assert problem.startswith(f"x.yaml:{where}: is not valid YAML: ") and why in problem


def test_rates_may_be_in_degrees_and_each_unit_has_its_own_key():
    limits = "control.limits={rate: 180 deg/s, acceleration: [90 deg/s², 1], jerk: 900 deg/s^3}"
    read = loads(MINIMAL, overrides=[limits, "target.limits.angular_velocity=90 deg/s"])
    assert read.control.limits.rate == pytest.approx(math.pi)
    assert read.control.limits.acceleration == pytest.approx((math.pi / 2, 1))
    assert read.control.limits.jerk == pytest.approx(5 * math.pi)
    assert read.target.limits.angular_velocity == pytest.approx(math.pi / 2)
    (problem,) = problems(MINIMAL, "control.limits.rate=180 deg")
    assert "number" in problem


def test_another_name_of_a_choice_is_told_as_ours():
    assert problems(MINIMAL, "control.inverse.method=dls") == [says("… write damped")]
    names = {name for choices in (PLANTS, *CHOICES) for name in choices.names}
    assert names.issuperset(ALIASES.values()) and not names & ALIASES.keys()


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
