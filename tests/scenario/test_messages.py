"""What is wrong with a value is one printable line, which names the way out: that is then accepted."""

import pytest
from scenario_texts import MINIMAL, problems

from rmrc.scenario import load, loads
from rmrc.scenario.choices import CHOICES, PLANTS
from rmrc.scenario.messages import _ALIASES
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
        ("control.feedback=1e1", '… "1e1"; write one such as 1.0e-3, in 1/s'),
        ("control.slow.longest=0", "… >= 1, got 0"),
        ("control.feedforward=1", "… true or false, got 1"),
        ("plant.seed=1.5", "… whole number … 1.5"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_with_the_way_out(override, line):
    (problem,) = problems(MINIMAL, override)
    assert problem.startswith("--set ") and problem == says(line), problem


def test_another_name_of_a_choice_is_told_as_ours():
    assert problems(MINIMAL, "control.inverse.method=dls") == [says("… write damped")]
    names = {name for choices in (PLANTS, *CHOICES) for name in choices.names}
    assert names.issuperset(_ALIASES.values()) and not names & _ALIASES.keys()


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
