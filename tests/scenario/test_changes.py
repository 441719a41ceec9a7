"""A change is the edited file: from a text of the command line as from Python."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenario_texts import EXAMPLE, FULL, MINIMAL, problems

from project import examples
from rmrc.scenario import Change, Scenario, grid, inline, loads
from rmrc.scenario.changes import changes_of
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Origin
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
        ("expect.a.b.below=3", ["expect", "a.b"], {"below": 3.0}),
        ("baseline.control.feedback=3", ["baseline", "control.feedback"], 3),
    ],
)
def test_an_override_replaces_one_value_and_no_other(override, steps, value):
    one = loads(FULL)
    expected = json.loads(one.model_dump_json())
    node = expected
    for step in steps[:-1]:
        node = node[step]
    node[steps[-1]] = value
    before = one.model_dump(mode="json")
    assert before != expected == loads(FULL, overrides=[override]).model_dump(mode="json")
    assert loads(FULL).model_dump(mode="json") == before


VALUES = {
    "control.feedback": st.sampled_from([0.5, 3, -1, "foo", None]),
    "control.limits": st.sampled_from([{"rate": 2}, {"foo": 1}]),
    "control.limits.rate[0]": st.sampled_from([1.5, 0]),
    "task.axes": st.sampled_from([["y", "x"], ["z"], []]),
    "target.path[0]": st.sampled_from([{"line": {"by": [0.1, 0.0]}}, {"line": {}}]),
    "arm.start[1]": st.sampled_from([0.2, "10 deg", True]),
    "plant": st.sampled_from([{"kind": "ideal"}, 3]),
}
changes = st.fixed_dictionaries({}, optional=VALUES)


def outcome(make):
    """Return a scenario, or all that is wrong with it."""
    try:
        return make()
    except ScenarioError as error:
        return error.problems


@examples(5, 100)
@given(changes)
def test_typed_changes_are_what_texts_are(values):
    texts = [f"{key}={inline(value)}" for key, value in values.items()]
    by_text = outcome(lambda: loads(EXAMPLE, overrides=texts))
    typed = outcome(lambda: loads(EXAMPLE).changed(*changes_of(values, "--set")))
    assert typed == by_text
    if isinstance(typed, Scenario):
        assert typed.draft.value == by_text.draft.value
        assert all(typed.locate(key) == by_text.locate(key) for key in VALUES)


def test_an_item_of_a_list_that_is_not_written_is_set_in_its_default():
    moved = loads(MINIMAL, overrides=["target.offset[1]=0.02", "plant.wrench[5]=3"])
    assert (moved.target.offset, moved.plant.wrench) == ((0.0, 0.02, 0.0), (0.0,) * 5 + (3.0,))
    assert problems(MINIMAL, "target.offset[3]=1") == [says("--set target.offset[3]: target.offset … 3 … 0")]


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("foo", "--set foo: … KEY=VALUE … control.feedback=10"),
        ("a..b=1", "--set a..b=1: … KEY=VALUE … control.feedback=10"),
        ("\x1b[0m=1", r"--set \x1b[0m=1: … KEY=VALUE … control.feedback=10"),
        ("control.invers.method=inverse", '--set control.invers.method: control.invers: … "inverse"…'),
        ("control={invers: {}}", '--set control: control.invers: … "inverse"…'),
        ("control.feedback=-1", "--set control.feedback: must be >= 0, got -1"),
        ("arm.start[5]=1", "--set arm.start[5]: arm.start … 2 … 0"),
        ("arm.site[0]=1", '--set arm.site[0]: arm.site … "tip" … list'),
        ("task.weights[0]=1", "--set task.weights[0]: task.weights … nothing … list"),
        ("plant.kv.x=1", "--set plant.kv.x: plant.kv … 1000 … mapping"),
        ("arm.start=[1", "--set arm.start: … YAML: … bracket … not closed …"),
        ("arm.start=# x", "--set arm.start: … empty"),
        ("arm.site=!!python/name:os.system x", "--set arm.site: … !!python/name:os.system …"),
        ("plant.kv=1\n---\n2", "--set plant.kv: … YAML: … second scenario …"),
    ],
)
def test_a_wrong_override_is_told_by_its_key(override, line):
    assert problems(EXAMPLE, override) == [says(line)]


def test_all_that_is_wrong_is_told_at_once_with_key_and_origin():
    wrong = Change(("plant", "kv"), -2, Origin("--vary plant.kv", key="plant.kv"))
    with pytest.raises(ScenarioError) as caught:
        loads(FULL, "x.yaml").changed(Change(("control", "feedback"), -1), wrong)
    assert str(caught.value).splitlines() == [
        "control.feedback: must be >= 0, got -1", says("--vary plant.kv: … 0 … -2"),
    ]  # fmt: skip


def test_values_of_python_and_numpy_are_taken_as_a_file_would_have_them():
    values = {
        "arm.start": np.array([0.5, 1.0]),
        "control.limits": {"rate": (1, np.float64(2))},
        "task.axes": ("x",),
    }
    one = loads(MINIMAL).set(values)
    assert (one.arm.start, one.control.limits.rate, one.task.axes) == ((0.5, 1.0), (1.0, 2.0), ("x",))
    section = one.control.model_copy(update={"feedback": 9.0})
    by_section = one.set({"control": section, "control.period": 0.004}).control
    assert (by_section.feedback, by_section.period, by_section.limits.rate) == (9.0, 0.004, (1.0, 2.0))
    with pytest.raises(ValueError, match=r"'a\.\.b' .* key"):
        one.set({"a..b": 1})
    with pytest.raises(ScenarioError, match=r'^control\.feedback: .* number, .*"<object object at '):
        one.set({"control.feedback": object()})


def test_a_scenario_made_in_python_can_be_changed_and_named_in_messages():
    one = Scenario.model_validate(loads(FULL).model_dump())
    assert one.set({"arm.start[1]": "10 deg"}).arm.start[1] == math.radians(10)
    with pytest.raises(ScenarioError, match=r"^arm\.start: .* list"):
        one.set({"arm.start": 3})
    other = loads(FULL, "x.yaml").model_copy(update={"name": "other"})
    assert other.set({"control.feedback": 1}).name == "other"


@pytest.mark.parametrize("order", [1, -1])
def test_of_changes_that_are_given_together_the_deeper_one_wins(order):
    values = dict([("control.limits", {"rate": 2}), ("control.limits.rate", 3), ("arm.start[1]", 0.7),
                   ("arm.start", [0.1, 0.2])][::order])  # fmt: skip
    both = loads(MINIMAL).set(values)
    assert (both.control.limits.rate, both.arm.start) == (3.0, (0.1, 0.7))
    beside = loads(MINIMAL).set({"baseline": values})
    assert beside.changed(*beside.baseline_changes).control.limits.rate == 3.0
    first, *_ = grid({key: [value, None] for key, value in values.items() if "limits" in key})
    assert loads(MINIMAL).changed(*first.changes).control.limits.rate == 3.0


def test_a_variant_is_made_fast_as_it_shares_all_that_its_changes_leave_alone():
    one = loads(FULL, "x.yaml")
    other = one.set({"control.feedback": 9, "plant.payload": 2})
    assert other.draft.places is one.draft.places
    assert other.draft.value["target"] is one.draft.value["target"]
    assert other.locate("plant.payload") == "plant.payload" and other.locate("plant.kv").startswith("x.yaml:")
