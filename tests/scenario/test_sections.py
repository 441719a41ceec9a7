import json
import math
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenario_texts import FULL, MINIMAL, problems

from rmrc.scenario import Scenario, draft_of, load, loads
from rmrc.support.errors import ScenarioError
from wording import says


def test_defaults_and_segments_are_those_of_the_contract():
    scenario, path = loads(MINIMAL), loads(FULL).target.path
    assert (scenario.arm.start, scenario.task.axes) == ("home", ("x", "y", "z", "rx", "ry", "rz"))
    assert (scenario.control.period, scenario.control.inverse.method) == (0.001, "damped")
    assert (scenario.plant.kind, scenario.plant.timestep, scenario.expect) == ("servo", None, {})
    assert [path[i].name for i in (0, 2, 5, 12, 13, 16, 17, 18)] == [
        "line", "arc", "turn", "tilt", "set", "configurations", "file", "hold",
    ]  # fmt: skip
    assert path[0].line.turn.angle == math.radians(30) and path[2].arc.angle == -2 * math.pi
    assert path[13].set.duration == 0.5 and path[16].configurations == ("home", (0.1, math.radians(10)))


def test_axes_are_kept_in_row_order_and_their_values_follow_them():
    texts = [
        "task={axes: [rz, x], weights: [5, 7]}",
        "control.nullspace.secondary={axes: [rz, x], to: [10 deg, 0.5]}",
    ]
    scenario = loads(MINIMAL, overrides=texts)
    second = scenario.control.nullspace.secondary
    assert (scenario.task.axes, scenario.task.weights) == (("x", "rz"), (7.0, 5.0))
    assert (second.axes, second.to) == (("x", "rz"), (0.5, math.radians(10)))
    assert scenario.set({"task.weights": [1, 2]}).task.weights == (2.0, 1.0)  # as they were written


def test_files_start_at_the_folder_of_the_scenario_or_below_a_root_that_they_moved_to(folder):
    (folder / "here/pkg").mkdir(parents=True)
    text = MINIMAL.replace("arm.xml, site: tip", "../arm.xml, packages: {a: pkg}")
    more = "sweep: {vary: {'target.path[0]': [{file: {path: a.csv}}, {hold: {for: 1}}], expect.profile: [ur5e, own.yaml]}}"
    (folder / "here/x.yaml").write_text(f"{text}{more}\n")
    scenario = load("here/x.yaml")
    assert (scenario.arm.model, scenario.arm.packages) == (folder / "arm.xml", {"a": folder / "here/pkg"})
    draft, root = draft_of("here/x.yaml"), folder / "there"
    named = [folder / one for one in ("arm.xml", "here/pkg", "here/a.csv", "here/own.yaml")]
    assert sorted(draft.files()) == sorted(named)
    moved = draft.moved(root)
    with pytest.raises(ScenarioError, match=rf'no such file "{root}'):
        moved.scenario()
    for path in named:
        there = root / path.relative_to(path.anchor)
        there.parent.mkdir(parents=True, exist_ok=True)
        there.mkdir(exist_ok=True) if path.name == "pkg" else there.write_text("<mujoco/>")
    assert moved.scenario().arm.model == root / scenario.arm.model.relative_to("/")
    assert moved.files() == draft.files()
    (folder / "here/pkg").rmdir()
    with pytest.raises(ScenarioError, match=r'arm\.packages\.a: no such folder ".*here/pkg"'):
        load("here/x.yaml")


@pytest.mark.parametrize(
    ("period", "timestep", "kind", "is_whole"),
    [
        ("0.003", "0.001", "servo", True), ("0.1", "1.0e-4", "torque", True), ("0.0015", "0.001", "ideal", True),
        ("0.0333", "0.001", "servo", False), ("0.001", "0.002", "servo", False),
        ("1.0e+300", "1.0e-300", "servo", False),
    ],
)  # fmt: skip
def test_a_period_is_a_whole_number_of_steps_where_there_are_steps(period, timestep, kind, is_whole):
    texts = [f"control.period={period}", f"plant.timestep={timestep}", f"plant.kind={kind}"]
    if is_whole:
        assert loads(MINIMAL, overrides=texts).control.period == float(period)
    else:
        wanted = f"--set control.period: … plant.timestep … {float(period)} and {float(timestep)}; write plant.timestep: null"
        assert problems(MINIMAL, *texts) == [says(wanted)]


def test_a_tool_turns_as_urdf_does():
    tool = loads(MINIMAL.replace("site: tip", "tool: {orientation: [90 deg, 0, 90 deg]}")).arm.tool
    # about x first, then about z, both fixed: x goes to y, y to z, z to x
    assert tool.rotation == pytest.approx((0.5, 0.5, 0.5, 0.5), abs=1e-15)


# Round trip: each draws a few values of a section that the whole of FULL does not have
numbers, positive = st.floats(-1e6, 1e6), st.floats(1e-6, 1e6)
tricky = st.sampled_from(
    ["1e-3", "010", "yes", "null", "2020-01-01", "=", "<<", "~", "0x1", "a: b", "é\u2028"]
)
vectors = st.lists(numbers, min_size=2, max_size=3)


@given(tricky, vectors, st.lists(st.sampled_from(["x", "y", "rx", "rz"]), min_size=1, unique=True), positive)
def test_a_scenario_reads_back_from_its_yaml_equal(text, vector, axes, number):
    scenario = Scenario.model_validate({
        "name": "generated", "arm": {"model": __file__, "site": text, "joints": [text]},
        "task": {"axes": axes, "weights": [2.0 + i for i in range(len(axes))]},
        "target": {"path": [{"line": {"to": vector}}, {"set": {"by": vector, "for": number}}]},
        "control": {"feedback": number, "limits": {"rate": [number]}}, "plant": {"kind": "ideal"},
        "expect": {text: {"equals": number, "within": number}},
    })  # fmt: skip
    assert loads(scenario.to_yaml()) == scenario
    assert Scenario.model_validate(json.loads(json.dumps(scenario.model_dump(mode="json")))) == scenario


def test_a_scenario_is_frozen_and_its_places_are_no_part_of_it_but_survive_the_way_to_a_worker():
    scenario = loads(FULL, "x.yaml")
    assert loads(scenario.to_yaml()) == scenario == loads("# a comment\n" + FULL)
    assert scenario != loads(FULL, overrides=["control.feedback=1"])  # negative control
    back = pickle.loads(pickle.dumps(scenario))
    assert back == scenario
    assert back.locate("arm.start[1]") == "x.yaml:3:50: arm.start[1]"
    with pytest.raises(ValueError, match="frozen"):
        scenario.control.feedback = 1.0
