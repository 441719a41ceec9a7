"""A change is the edited file: from a text of the command line as from Python; several values make variants."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenario_texts import FULL, MINIMAL

from project import examples
from rmrc.scenario import Scenario, draft_of, grid, inline, loads, variants
from rmrc.scenario.changes import changes_of
from rmrc.support.errors import ScenarioError
from wording import says

METHOD, MAXIMUM = "control.inverse.method", "control.inverse.damping.maximum"


@pytest.mark.parametrize(
    ("override", "steps", "value"),
    [
        (" control.feedback = 4 ", ["control", "feedback"], 4.0),
        ("arm.start[1]=10 deg", ["arm", "start", 1], math.radians(10)),
        ("target.path[0].line.to=[2,0]", ["target", "path", 0, "line", "to"], [2.0, 0.0]),
        ("task={axes: [z]}", ["task"], {"axes": ["z"], "frame": "world", "length": None, "weights": None}),
        ("expect.a.b.below=3", ["expect", "a.b"], {"below": 3.0}),
        ("baseline.control.feedback=3", ["baseline", "control.feedback"], 3),
    ],
)
def test_an_override_replaces_one_value_and_no_other(override, steps, value):
    scenario = loads(FULL)
    expected = json.loads(scenario.model_dump_json())
    node = expected
    for step in steps[:-1]:
        node = node[step]
    node[steps[-1]] = value
    before = scenario.model_dump(mode="json")
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


def outcome(make):
    """Return a scenario, or all that is wrong with it."""
    try:
        return make()
    except ScenarioError as error:
        return error.problems


@examples(5, 100)
@given(st.fixed_dictionaries({}, optional=VALUES).map(lambda values: dict(sorted(values.items()))))
def test_typed_changes_are_what_texts_are(values):
    texts = [f"{key}={inline(value)}" for key, value in values.items()]
    by_text = outcome(lambda: loads(FULL, overrides=texts))
    typed = outcome(lambda: loads(FULL).changed(*changes_of(values, "--set")))
    assert typed == by_text
    if isinstance(typed, Scenario):
        assert typed.draft.value == by_text.draft.value
        assert all(typed.locate(key) == by_text.locate(key) for key in VALUES)


def test_an_item_of_a_list_that_is_not_written_is_set_in_its_default():
    moved = loads(MINIMAL, overrides=["target.offset[1]=0.02", "plant.wrench[5]=3"])
    assert (moved.target.offset, moved.plant.wrench) == ((0.0, 0.02, 0.0), (0.0,) * 5 + (3.0,))


def test_values_of_python_and_numpy_are_taken_as_a_file_would_have_them():
    limits = {"rate": (1, np.float64(2))}
    changed = loads(MINIMAL).set(
        {"arm.start": np.array([0.5, 1.0]), "control.limits": limits, "task.axes": ("x",)}
    )
    assert (changed.arm.start, changed.control.limits.rate) == ((0.5, 1.0), (1.0, 2.0))
    section = changed.control.model_copy(update={"feedback": 9.0})
    by_section = changed.set({"control": section, "control.period": 0.004}).control
    assert (by_section.feedback, by_section.period, by_section.limits.rate) == (9.0, 0.004, (1.0, 2.0))
    with pytest.raises(ValueError, match=r"'a\.\.b' .* key"):
        changed.set({"a..b": 1})
    with pytest.raises(ScenarioError, match=r'^control\.feedback: .* number, .*"<object object at '):
        changed.set({"control.feedback": object()})
    made = Scenario.model_validate(changed.model_dump()).model_copy(update={"name": "other"})
    assert made.set({"control.feedback": 1}).name == "other"


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


def labels(*texts):
    return [variant.label for variant in variants(texts)]


def test_several_keys_give_every_combination_and_the_last_changes_fastest():
    texts = f"{METHOD}=inverse,damped", f"{MAXIMUM}=0.1,0.2"
    assert labels(*texts) == ["inverse, 0.1", "inverse, 0.2", "damped, 0.1", "damped, 0.2"]
    assert tuple(map(str, variants(texts)[2].changes)) == (f"{METHOD}=damped", f"{MAXIMUM}=0.1")
    assert [each.label for each in grid({METHOD: ["inverse", "damped"], MAXIMUM: [0.1, 0.2]})] == labels(
        *texts
    )
    assert len(variants(["a=0,1,2,3,4", "b=0,1,2,3,4,5,6,7,8,9"])) == 50


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"{MAXIMUM}=0.05,1.0e-1", ["maximum=0.05", "maximum=0.1"]),
        ("arm.start[1]=60 deg,-0.5", ["start[1]=60 deg", "start[1]=-0.5"]),
        ("arm.start=home,[0, 1]", ["home", "start=[0, 1]"]),
        ("""arm.site="a, b",'c'""", ["a, b", "c"]),
    ],
)  # fmt: skip
def test_only_commas_outside_of_brackets_and_quotes_part_values(text, expected):
    assert labels(text) == expected


def test_a_variant_is_the_scenario_with_its_changes_on_top(folder):
    (folder / "x.yaml").write_text(MINIMAL)
    draft = draft_of("x.yaml", [f"{METHOD}=pseudoinverse", "control.feedback=3"])
    damped, _ = variants([f"{METHOD}=damped,inverse"])
    top = draft.changed(*damped.changes).scenario()
    assert (top.control.inverse.method, top.control.feedback) == ("damped", 3.0)
    assert [top.locate(key) for key in (METHOD, "control.feedback")] == [
        f"--vary {METHOD}",
        "--set control.feedback",
    ]
    wrong, _ = variants([f"{MAXIMUM}=-2,-3"])
    with pytest.raises(ScenarioError) as caught:
        draft.overridden(["plant.kv=-1"]).changed(*wrong.changes).scenario()
    wanted = f"--vary {MAXIMUM}: … 0 … -2", "--set plant.kv: … 0 … -1"
    assert list(map(str, caught.value.problems)) == list(map(says, wanted))


@pytest.mark.parametrize(
    ("texts", "line"),
    [
        (["a=1"], "--vary: … 2 variants to 50, got 1; … --vary control.inverse.method=inverse,damped"),
        (["a=0,1,2,3,4,5,6", "b=0,1,2,3,4,5,6,7"], "--vary: … 2 variants to 50, got 56; …"),
        (["a=1,2", "a=3,4"], "--vary a: … twice"),
        (["foo"], "--vary foo: … KEY=V1,V2,... … control.inverse.method=inverse,damped"),
    ],
)  # fmt: skip
def test_what_cannot_be_varied_is_said_at_once(texts, line):
    with pytest.raises(ScenarioError) as caught:
        variants(texts)
    assert str(caught.value) == says(line)
