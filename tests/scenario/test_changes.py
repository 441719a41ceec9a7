"""A typed change is what the text of the command line is: the same scenario, or the same words of refusal."""

import os
import pickle

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scenario_texts import FULL, MINIMAL

from project import ROOT, examples
from rmrc.scenario import Change, Scenario, draft_of, inline, load, loads
from rmrc.scenario import draft as drafts
from rmrc.scenario.changes import changes_of
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Origin, Problem
from wording import says

NAMES = ("approach_singularity", "stanford_line", "null_space", "stop_and_wait", "encoder_offsets")
DRAFTS = {name: draft_of(ROOT / f"scenarios/{name}.yaml") for name in NAMES}
SCENARIOS = {name: draft.scenario() for name, draft in DRAFTS.items()}

MODEL = os.path.relpath(ROOT / "models/planar_2link.xml", ROOT / "scenarios")
positive = st.sampled_from([0.002, 0.5, 1, 2.5, 40])
wrong = st.sampled_from([-1.0, 0, None, True, "foo", "60 deg", [0.1], [], {}, {"foo": 1}, [0.1] * 6])

# What mostly fits each key, so that most changes are made; `wrong` fits hardly any.
FITTING = {
    "control.feedback": positive,
    "control.inverse.method": st.sampled_from(["damped", "jparse", "transpose"]),
    "control.inverse.damping.maximum": positive,
    "control.inverse.damping": st.just({"maximum": 0.2, "schedule": "constant"}),
    "control.inverse": st.just({"method": "truncated"}),
    "control.limits.rate": positive | st.lists(positive, min_size=2, max_size=2),
    "control.limits.rate[0]": positive,
    "control.nullspace.objective": st.sampled_from(["none", "rates", "posture"]),
    "control.nullspace.rates": st.lists(positive, min_size=1, max_size=3),
    "control.nullspace.secondary.to[0]": positive,
    "control.nullspace.secondary.axes": st.just(["z", "x"]),
    "control.period": st.sampled_from([0.001, 0.002, 0.0015]),
    "control": st.just({"feedback": 3, "inverse": {"method": "inverse"}}),
    "plant.kind": st.sampled_from(["ideal", "servo", "torque", "model"]),
    "plant.wrench[3]": positive,
    "plant.gravity": st.just([0, 0, -1.62]),
    "plant": st.just({"kind": "ideal"}),
    "task.axes": st.sampled_from([["y", "x"], ["x", "y"], ["z"]]),
    "task.axes[0]": st.sampled_from(["x", "rz"]),
    "task.weights": st.lists(positive, min_size=1, max_size=3),
    "task.length": positive,
    "task": st.just({"axes": ["y", "x"], "weights": [1, 2]}),
    "target.offset[1]": positive,
    "target.path[0]": st.just({"line": {"by": [0.1, 0.0]}}),
    "target.path[0].line.to[0]": positive,
    "target.limits.velocity": positive,
    "arm.start": st.sampled_from(["home", [1.0, "-30 deg"]]),
    "arm.start[1]": positive | st.just("10 deg"),
    "arm.encoder.seed": st.integers(0, 9),
    "arm.encoder": st.just({"deviation": 0.1}),
    "arm.stretch.link_1": positive,
    "arm": st.just({"model": MODEL, "site": "tip"}),
    "expect.joint_rate.peak.below": positive,
    "expect.joint_rate.peak": st.just({"above": 0.1}),
    "name": st.just("other"),
    "control.fedback": positive,
}

changed = st.lists(
    st.sampled_from(sorted(FITTING)).flatmap(
        lambda key: st.tuples(st.just(key), st.one_of(*[FITTING[key]] * 5, wrong))
    ),
    min_size=1,
    max_size=4,
    unique_by=lambda pair: pair[0],
).map(dict)


def outcome(make):
    """Return a scenario, or all that is wrong with it."""
    try:
        return make()
    except ScenarioError as error:
        return error.problems


@examples(3, 200)
@given(st.sampled_from(NAMES), changed)
@example("approach_singularity", {"control.limits": {"rate": 2}, "control.limits.rate": 1, "control": {}})
@example("approach_singularity", {"control.limits.rate[0]": 1, "control.limits.rate": 2})
@example("approach_singularity", {"arm": {"model": MODEL, "site": "tip"}, "arm.encoder.seed": 3})
@example("stanford_line", {"task.axes": ["y", "x"], "task.weights": [1, 2]})
def test_typed_changes_are_what_texts_are(name, values):
    texts = [f"{key}={inline(value)}" for key, value in values.items()]
    by_text = outcome(lambda: DRAFTS[name].overridden(texts).scenario())
    typed = outcome(lambda: SCENARIOS[name].changed(*changes_of(values, "--set")))
    assert typed == by_text
    assert repr(typed) == repr(by_text)  # which tells 0.0 from -0.0
    if isinstance(typed, Scenario):
        assert typed.draft.values() == by_text.draft.values()
        assert all(typed.locate(key) == by_text.locate(key) for key in FITTING)


def test_most_changes_are_made_without_the_whole_scenario(monkeypatch):
    """Negative control: the comparison above is not one of a way with itself."""
    monkeypatch.setattr(drafts.Draft, "scenario", lambda _: pytest.fail("it was checked as a whole"))
    base = SCENARIOS["approach_singularity"]
    for values in ({"control.feedback": 7}, {"arm": {"model": MODEL, "site": "tip"}, "arm.encoder.seed": 3}):
        assert base.set(values) != base


def test_a_key_within_another_is_put_into_its_value():
    one = loads(MINIMAL).set({"control": {"feedback": 3}, "control.inverse.method": "jparse"})
    assert (one.control.feedback, one.control.inverse.method) == (3.0, "jparse")
    assert one.control.inverse.damping == loads(MINIMAL).control.inverse.damping


def test_sorted_axes_are_told_with_what_was_written_beside_them():
    one = loads(MINIMAL, overrides=["task.axes=[rz, x]", "task.weights=[5, 7]"])
    assert one.set({"task.weights": [1, 2]}).task.weights == (2.0, 1.0)
    assert one.set({"task.weights[0]": 9}).task.weights == (7.0, 9.0)


def test_all_that_is_wrong_is_told_at_once_with_key_and_origin():
    one = loads(FULL, "x.yaml")
    with pytest.raises(ScenarioError) as caught:
        one.changed(
            Change(("control", "feedback"), -1),
            Change(("plant", "kv"), -2, Origin("--vary plant.kv", key="plant.kv")),
        )
    assert [(one.key, one.origin) for one in caught.value.problems] == [
        (("control", "feedback"), Origin()),
        (("plant", "kv"), Origin("--vary plant.kv", key="plant.kv")),
    ]
    assert all(isinstance(one, Problem) for one in caught.value.problems)
    assert str(caught.value).splitlines()[1] == says("--vary plant.kv: … 0 … -2")


def test_values_of_python_and_numpy_are_taken_as_a_file_would_have_them():
    one = loads(MINIMAL).set(
        {
            "arm.start": np.array([0.5, 1.0]),
            "control.limits": {"rate": (1, np.float64(2))},
            "task.axes": ("x",),
        }
    )
    assert (one.arm.start, one.control.limits.rate, one.task.axes) == ((0.5, 1.0), (1.0, 2.0), ("x",))
    with pytest.raises(ValueError, match=r"'a\.\.b' .* key"):
        one.set({"a..b": 1})


def test_a_scenario_made_in_python_can_be_changed_and_named_in_messages():
    one = Scenario.model_validate(loads(FULL).model_dump())
    assert (
        one.set({"arm.start[1]": "10 deg"}).arm.start
        == loads(FULL, overrides=["arm.start[1]=10 deg"]).arm.start
    )
    with pytest.raises(ScenarioError, match=r"^arm\.start: .* list"):
        one.set({"arm.start": 3})


def test_a_section_is_a_value_as_any_other(monkeypatch):
    one = loads(FULL)
    control = one.control.model_copy(update={"feedback": 9.0})
    by_section = one.set({"control": control, "control.period": 0.004})
    assert (by_section.control.feedback, by_section.control.period) == (9.0, 0.004)
    monkeypatch.setattr(drafts, "_changed", lambda *_: (_ for _ in ()).throw(drafts._RefusedError))
    assert one.set({"control": control, "control.period": 0.004}) == by_section  # as a whole


def test_what_no_file_could_have_is_refused_in_our_words():
    with pytest.raises(ScenarioError, match=r'^control\.feedback: .* number, .*"<object object at '):
        loads(MINIMAL).set({"control.feedback": object()})


def test_a_copy_with_other_values_is_made_of_these():
    one = loads(FULL, "x.yaml")
    other = one.model_copy(update={"name": "other"})
    assert (other.draft.scenario().name, one.draft.scenario().name) == ("other", "full")
    assert other.set({"control.feedback": 1}).draft.scenario().name == "other"
    assert one.model_copy().locate("name") == one.locate("name")  # negative control


def test_many_changes_one_after_the_other_are_the_last_of_them():
    one = loads(FULL)
    for feedback in range(300):
        one = one.set({"control.feedback": feedback})
    assert one == loads(FULL, overrides=["control.feedback=299"])
    assert one.draft.scenario() == one
    assert len(one.draft._changes) <= 101


def test_changes_leave_the_scenario_as_it_was():
    one = loads(FULL)
    before, written = repr(one), one.draft.values()
    one.set({"control.limits.rate[0]": 7, "plant": {"kind": "ideal"}})
    assert (repr(one), one.draft.values()) == (before, written)


def test_a_changed_scenario_survives_the_way_to_a_worker():
    one = load(ROOT / "scenarios/approach_singularity.yaml").set({"control.feedback": 7})
    back = pickle.loads(pickle.dumps(one))
    assert back == one
    assert back.locate("task.axes") == one.locate("task.axes")
    assert back.set({"control.feedback": 20}) == load(ROOT / "scenarios/approach_singularity.yaml")
