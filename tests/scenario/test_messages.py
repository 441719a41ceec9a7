"""What is wrong with a value is one printable line, which names the way out."""

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
        ("arm={site: tip}", "--set arm: arm.model: … required: MJCF or URDF file…"),
        ("control.inverse.method=dampd", '… one of "inverse", … "damped"?'),
        ("control.inverse.method=dls", "… write damped"),
        ("arm.site=2024", "… text, … quotes … got 2024"),
        ("plant=servo", '… mapping, got "servo"; … keys … kind, …'),
        ("task.axes=x", '… list … "x"'),
        ("target.offset=[1, 2, 3, 4]", "… 3 … items, got [1, 2, 3, 4]"),
        ("target.path=[]", "… 1 … items, got []"),
        ("target.path=[{go: {to: [1, 0]}}]", "… key; the keys are line, arc, …"),
        ("target.path=[{}]", "… target.path[0]: must have exactly one of line, arc, … got none"),
        ("target.limits.velocity=250 mm/s", '… number, got "250 mm/s"; write … in m/s'),
        ("control.feedback=1e1", '… "1e1"; write 10, in 1/s'),
        ("control.slow.longest=0", "… >= 1, got 0"),
        ("control.feedforward=1", "… true or false, got 1"),
        ("plant.seed=1.5", "… whole number … 1.5"),
        ("expect={sigma.min: < 3.3}", '… mapping, such as {below: 1}, got "< 3.3"'),
        ("control.inverse={feedback: 20}", "… key; … key of control: indent it less"),
        ("plant={kind ideal}", "… key; write a colon: kind: ideal"),
        ("control.method=damped", "… key; … key of control.inverse: put it there"),
        ("control={inverse.method: damped}", "… write inverse: {method: ...}"),
        ("target.limits={velocity:0.2}", "… space after the colon: velocity: 0.2"),
        ("target.path={line: {by: [1, 0]}}", "… begin each item with a dash"),
        ("control.period=1 ms", '… got "1 ms"; write 0.001, in s'),
        ("target.limits.velocity=0,25", '… got "0,25"; write 0.25, in m/s'),
        ("expect.joint_rate.peak={}", "… must have at least one of below, above, equals, got none"),
        ("expect.joint_rate.peak={equals: 1}", "… equals needs within"),
        ("sweep.vary.look=[1, 2]", "--set sweep.vary.look: cannot be changed here…"),
        ("sweep.draw.plant.seed=[0, 9]", "… cannot be changed here… sweep.repeat and sweep.seed…"),
        ("sweep={vary: {plant.kv: [1, 2]}, draw: {plant.kv: [1, 2]}}", "… in vary or in draw, got both"),
        ("control.nullspace.objective=rates", "… control.nullspace.rates: must be given …"),
        ("task={axes: [x], weights: [1, 2]}", "--set task: task.weights: … one value for each of axes, got 2 … x"),
        ("arm.body=b", "… must have at most one of site, body, tool, got site and body"),
        ("arm={model: arm.xml, tool: {center: [0, 0, 1]}}", "… center needs mass"),
        ("arm={model: arm.xml, tool: {model: arm.xml, mass: 1}}", "… must have at most one of mass, model, …"),
        ("foo", "--set foo: … KEY=VALUE … control.feedback=10"),
        ("\x1b[0m=1", r"--set \x1b[0m=1: … KEY=VALUE … control.feedback=10"),
        ("arm.site[0]=1", '--set arm.site[0]: arm.site … "tip" … list'),
        ("plant.kv.x=1", '--set plant.kv.x: … number … {"x": 1}'),
        ("target.offset[3]=1", "--set target.offset[3]: target.offset … 3 … 0"),
        ("arm.start=[1", "--set arm.start: … YAML: … bracket … not closed …"),
        ("arm.start=# x", "--set arm.start: … empty"),
        ("arm.site=!!python/name:os.system x", "--set arm.site: … !!python/name:os.system …"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_with_the_way_out(override, line):
    (problem,) = problems(MINIMAL, override)
    assert problem == says(line), problem


@pytest.mark.parametrize(
    ("lines", "where", "why"),
    [
        ("control:\n  period: 0.01\n    feedback: 20\n", "3:13", "indented too far"),
        ("control:\n  period: 0.01\n feedback: 20\n", "3:2", "not indented as the lines beside it"),
        ("plant:\n  seed: 1\n  kind ideal\n  loss: 0\n", "3:3", "without a colon"),
        ("plant:\n\tkind: ideal\n", "2:1", "a tab; indent with spaces"),
        ("task: {axes: [x, y}\n", "1:14", "bracket that is not closed"),
        ('plant: {kind: "ideal}\n', "1:15", "quote that is not closed"),
    ],
)
def test_a_mistake_in_the_layout_is_told_where_it_is_and_not_where_yaml_notices_it(lines, where, why):
    (problem,) = problems(lines)
    assert problem.startswith(f"x.yaml:{where}: is not valid YAML: ") and why in problem


def test_other_names_of_choices_are_no_names_of_ours():
    names = {name for choices in (PLANTS, *CHOICES) for name in choices.names}
    assert names.issuperset(ALIASES.values()) and not names & ALIASES.keys()


def test_no_control_character_of_a_file_stands_in_an_error():
    evil = "\x1b]0;evil\x07\x9b31m\u202e"
    escaped = evil.encode("unicode_escape").decode()
    text = (
        MINIMAL.replace("arm.xml", f'"{escaped}"') + f'"{escaped}": {{damping: "\\e]0;evil\\a\\e[31mred"}}\n'
    )
    for overrides in ((), (f"plant.{evil}=1",), (evil,)):
        with pytest.raises(ScenarioError) as caught:
            loads(text, f"{evil}.yaml", overrides)
        assert str(caught.value).replace("\n", "").isprintable()
    with pytest.raises(ScenarioError) as caught:
        load(f"{evil}.yaml")
    assert str(caught.value).isprintable()
