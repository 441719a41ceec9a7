import json
import math

import pytest
from scenario_texts import EXAMPLE, FULL, MINIMAL, problems

from rmrc.scenario import loads
from wording import says


@pytest.mark.parametrize(
    ("override", "steps", "value"),
    [
        ("control.inverse.method=inverse", ["control", "inverse", "method"], "inverse"),
        (" control.feedback = 4 ", ["control", "feedback"], 4.0),
        ("arm.start[1]=10 deg", ["arm", "start", 1], math.radians(10)),
        ("target.path[0].line.to=[2,0]", ["target", "path", 0, "line", "to"], [2.0, 0.0]),
        ("task.weights=", ["task", "weights"], None),
        ("task={axes: [z]}", ["task"], {"axes": ["z"], "frame": "world", "length": None, "weights": None}),
    ],
)
def test_an_override_replaces_one_value_and_no_other(override, steps, value):
    before = loads(FULL).model_dump(mode="json")
    expected = json.loads(json.dumps(before))
    node = expected
    for step in steps[:-1]:
        node = node[step]
    node[steps[-1]] = value
    assert before != expected
    assert loads(FULL, overrides=[override]).model_dump(mode="json") == expected


def test_an_override_of_a_figure_keeps_the_dots_of_its_name():
    expect = loads(MINIMAL, overrides=["expect.a.b.below=3", "expect.c.d={above: 1}"]).expect
    assert expect["a.b"].below == 3.0
    assert expect["c.d"].above == 1.0


def test_an_override_is_the_same_as_the_edited_file():
    edited = EXAMPLE.replace("feedback: 20", "feedback: 7").replace("kv: 1000", "kv: 5")
    assert loads(EXAMPLE, overrides=["control.feedback=7", "plant.kv=5"]) == loads(edited)


def test_an_item_of_a_list_that_is_not_written_is_set_in_its_default():
    plain = loads(MINIMAL)
    moved = loads(MINIMAL, overrides=["target.offset[1]=0.02", "plant.wrench[5]=3"])
    assert (plain.target.offset, plain.plant.wrench) == ((0.0,) * 3, (0.0,) * 6)
    assert (moved.target.offset, moved.plant.wrench) == ((0.0, 0.02, 0.0), (0.0,) * 5 + (3.0,))
    assert problems(MINIMAL, "target.offset[3]=1") == [says("--set target.offset[3]: target.offset … 3 … 0")]


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("foo", "--set foo: … KEY=VALUE … control.feedback=10"),
        ("=1", "--set =1: … KEY=VALUE … control.feedback=10"),
        ("a..b=1", "--set a..b=1: … KEY=VALUE … control.feedback=10"),
        ("\x1b[0m=1", r"--set \x1b[0m=1: … KEY=VALUE … control.feedback=10"),
        ("control.invers.method=inverse", '--set control.invers.method: control.invers: … "inverse"…'),
        ("control={invers: {}}", '--set control: control.invers: … "inverse"…'),
        ("control.feedback=-1", "--set control.feedback: must be >= 0, got -1"),
        ("arm.start[5]=1", "--set arm.start[5]: arm.start … 2 … 0"),
        ("arm.site[0]=1", '--set arm.site[0]: arm.site … "tip" … list'),
        ("task.weights[0]=1", "--set task.weights[0]: task.weights … nothing … list"),
        ("plant.kv.x=1", "--set plant.kv.x: plant.kv … 1000 … mapping"),
        ("arm.start=[1", "--set arm.start: … YAML: … ']' … '<stream end>'"),
        ("arm.start=# x", "--set arm.start: … empty"),
        ("arm.site=!!python/name:os.system x", "--set arm.site: … !!python/name:os.system …"),
        ("plant.kv=1\n---\n2", "--set plant.kv: … single document …"),
    ],
)
def test_a_wrong_override_is_told_by_its_key(override, line):
    assert problems(EXAMPLE, override) == [says(line)]
