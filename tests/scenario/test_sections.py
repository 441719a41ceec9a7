import json
import math
import pickle
import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scenario_texts import EXAMPLE, FULL, MINIMAL, problems

from rmrc.scenario import HoldSegment, LineSegment, Scenario, TurnSegment, load, loads
from rmrc.support.errors import ScenarioError
from wording import says


def test_the_example_of_the_design_is_read_as_written(folder):
    scenario = loads(EXAMPLE)
    assert scenario.name == "approach_singularity"
    assert scenario.arm.model == folder / "arm.xml"
    assert scenario.arm.start == (math.pi / 3, -2 * math.pi / 3)
    assert scenario.task.axes == ("x", "y")
    assert scenario.control.feedback == 20.0
    assert scenario.control.limits.rate == 3.0
    assert [segment.line.to for segment in scenario.target.path] == [(1.99, 0.0), (1.0, 0.0)]
    assert scenario.expect["joint_rate.peak"].below == 3.0


def test_the_defaults_are_those_of_the_contract():
    scenario = loads(MINIMAL)
    assert scenario.arm.start == "home"
    assert scenario.task.axes == ("x", "y", "z", "rx", "ry", "rz")
    assert (scenario.control.period, scenario.control.feedback) == (0.001, 20.0)
    assert scenario.control.inverse.method == "damped"
    assert (scenario.control.inverse.damping.maximum, scenario.control.inverse.damping.below) == (None, None)
    assert scenario.task.length is None
    assert (scenario.plant.kind, scenario.plant.kv, scenario.plant.timestep) == ("servo", None, None)
    assert scenario.expect == {}


def test_each_kind_of_segment_is_told_by_its_key():
    path = loads(FULL).target.path
    assert isinstance(path[0], LineSegment)
    assert path[0].line.turn.angle == math.radians(30)
    assert path[2].arc.angle == -2 * math.pi
    assert path[3].arc.axis == "z"
    assert isinstance(path[6], TurnSegment)
    assert path[6].turn.to == (0.5, 0.5, 0.5, 0.5)
    assert path[12].tilt.to == (0, 0, -1)
    assert path[13].set.to == (0.5, 0.1) and path[13].set.duration == 0.5
    assert path[16].configurations == ("home", (0.1, math.radians(10)))
    assert path[17].file.speed == 0.5
    assert isinstance(path[-1], HoldSegment)
    assert path[-1].hold.duration == 0.5


def test_axes_are_kept_in_row_order_and_weights_follow_them():
    task = loads(MINIMAL, overrides=["task.axes=[rz, x]", "task.weights=[5, 7]"]).task
    assert task.axes == ("x", "rz")
    assert task.weights == (7.0, 5.0)


def test_axes_of_a_second_task_are_kept_in_row_order_and_its_values_follow_them():
    text = "control.nullspace.secondary={axes: [rz, x], to: [10 deg, 0.5]}"
    second = loads(MINIMAL, overrides=[text]).control.nullspace.secondary
    assert second.axes == ("x", "rz")
    assert second.to == (0.5, math.radians(10))


def test_a_scenario_is_frozen():
    with pytest.raises(ValueError, match="frozen"):
        loads(MINIMAL).control.feedback = 1.0


def test_a_model_path_starts_at_the_folder_of_the_file(folder):
    (folder / "scenarios").mkdir()
    (folder / "scenarios/x.yaml").write_text(MINIMAL.replace("arm.xml", "../arm.xml"))
    assert load("scenarios/x.yaml").arm.model == folder / "arm.xml"
    assert load(Path("scenarios/x.yaml"), ["control.feedback=3"]).control.feedback == 3.0


@pytest.mark.parametrize(
    ("period", "timestep", "kind"),
    [("0.003", "0.001", "servo"), ("0.1", "1.0e-4", "torque"), ("0.0015", "0.001", "ideal")],
)
def test_a_period_of_whole_steps_is_accepted_and_an_ideal_plant_has_no_steps(period, timestep, kind):
    overrides = [f"control.period={period}", f"plant.timestep={timestep}", f"plant.kind={kind}"]
    assert loads(MINIMAL, overrides=overrides).control.period == float(period)


@pytest.mark.parametrize(("period", "timestep"), [("1.0e+300", "1.0e-300"), ("1.0e-300", "1.0e+300")])
def test_a_period_of_no_or_of_uncountable_steps_is_refused(period, timestep):
    assert problems(MINIMAL, f"control.period={period}", f"plant.timestep={timestep}") == [
        says(f"--set control.period: … plant.timestep … {float(period)} and {float(timestep)} …")
    ]


@pytest.mark.parametrize(
    ("period", "timestep", "nearest"),
    [
        ("0.0333", "0.001", (0.0333 / 33, 0.033)),
        ("0.001", "0.002", (0.001, 0.002)),
        ("0.01", "0.0035", (0.01 / 3, 0.0105)),
    ],
)
def test_a_period_that_no_step_divides_is_refused_with_the_nearest_numbers_which_are_accepted(
    period, timestep, nearest
):
    (line,) = problems(MINIMAL, f"control.period={period}", f"plant.timestep={timestep}")
    written = re.search(r"write plant.timestep: (\S+), control.period: (\S+), or plant.timestep: null", line)
    assert list(map(float, written.groups())) == pytest.approx(nearest, rel=1e-11)  # of twelve digits
    for one in ((period, written[1]), (written[2], timestep), (period, "null")):
        loads(MINIMAL, overrides=[f"control.period={one[0]}", f"plant.timestep={one[1]}"])


@pytest.mark.parametrize(
    ("text", "period"),
    [("30 Hz", 1 / 30), ("62.5Hz", 0.016), ("1/240", 1 / 240), ("1 / 300 s", 1 / 300), ("2.0e+2 Hz", 0.005)],
)
def test_a_period_may_be_written_as_a_rate(text, period):
    assert loads(MINIMAL, overrides=[f"control.period={text}"]).control.period == period
    assert loads(MINIMAL).set({"control.period": text}).control.period == period


@pytest.mark.parametrize("text", ["0 Hz", "-30 Hz", "30 hertz", "1/0", "2/60", "30 ms"])
def test_a_text_that_is_no_rate_is_no_period(text):
    (line,) = problems(MINIMAL, f"control.period={text}")
    assert line == says(f'--set control.period: must be a number … "{text}" …')


# Round trip --------------------------------------------------------------------------------------

numbers = st.floats(-1e6, 1e6)
positive = st.floats(1e-6, 1e6)
# all of UTF-8, the default, which hypothesis takes seconds to find out in a new clone
ANY = st.characters(exclude_categories=["Cs"])
names = st.text(ANY, min_size=1, max_size=8).filter(lambda text: text.isprintable())
tricky = st.sampled_from(["1e-3", "010", "yes", "null", "2020-01-01", "=", "<<", "~", "0x1", "a: b"])
texts = names | tricky
vectors = st.lists(numbers, min_size=2, max_size=3)
directions = st.sampled_from(["x", "y", "z"]) | st.lists(positive, min_size=3, max_size=3)
turns = st.fixed_dictionaries({"axis": directions, "angle": numbers}) | st.fixed_dictionaries(
    {"to": st.lists(positive, min_size=4, max_size=4)}
)
maybe_turn = {"turn": turns}
segments = st.one_of(
    st.fixed_dictionaries({"to": vectors}, optional=maybe_turn).map(lambda v: {"line": v}),
    st.fixed_dictionaries({"by": vectors}, optional=maybe_turn).map(lambda v: {"line": v}),
    st.fixed_dictionaries({"center": vectors, "angle": positive}, optional=maybe_turn).map(
        lambda v: {"arc": v}
    ),
    turns.map(lambda v: {"turn": v}),
    st.fixed_dictionaries({"for": positive}).map(lambda v: {"hold": v}),
)
checks = st.one_of(
    st.fixed_dictionaries({"below": numbers}),
    st.fixed_dictionaries({"above": numbers}),
    st.fixed_dictionaries({"equals": numbers, "within": positive}),
)
weights = st.none() | st.lists(positive, min_size=1, max_size=7)
scenarios = st.builds(
    lambda arm, path, axes, control, rate, posture, plant, expect: {
        "name": "generated",
        "arm": arm,
        "task": {"axes": axes, "weights": [2.0 + i for i in range(len(axes))]},
        "target": {"path": path},
        "control": control | {"limits": {"rate": rate}, "nullspace": {"posture": posture}},
        "plant": plant | {"kind": "ideal"},
        "expect": expect,
    },
    st.fixed_dictionaries(
        {"model": st.just(__file__), "site": texts},
        optional={
            "start": texts | st.lists(numbers, min_size=1),
            "joints": st.lists(texts, min_size=1, unique=True),
        },
    ),
    st.lists(segments, min_size=1, max_size=4),
    st.lists(st.sampled_from(["x", "y", "z", "rx", "ry", "rz"]), min_size=1, unique=True),
    st.fixed_dictionaries(
        {"period": positive, "feedback": positive, "joint_weights": weights},
        optional={"feedforward": st.booleans()},
    ),
    positive | weights,
    weights,
    st.fixed_dictionaries({"kv": positive | weights, "wrench": st.lists(numbers, min_size=6, max_size=6)}),
    st.dictionaries(texts, checks, max_size=3),
)


@given(scenarios)
def test_a_scenario_reads_back_from_its_yaml_equal(data):
    scenario = Scenario.model_validate(data)
    assert loads(scenario.to_yaml()) == scenario
    assert Scenario.model_validate(json.loads(json.dumps(scenario.model_dump(mode="json")))) == (scenario)


def test_the_yaml_of_a_scenario_is_complete_and_normalized():
    scenario = loads(MINIMAL)
    assert yaml.safe_load(scenario.to_yaml()) == scenario.model_dump(mode="json", by_alias=True)


def test_the_place_of_a_value_is_no_part_of_a_scenario():
    assert loads(MINIMAL) == loads("# a comment\n" + MINIMAL)
    assert loads(MINIMAL) != loads(MINIMAL, overrides=["control.feedback=1"])  # negative control


def test_a_scenario_survives_the_way_to_a_worker_process_with_its_places():
    scenario = loads(FULL, "x.yaml")
    back = pickle.loads(pickle.dumps(scenario))
    assert back == scenario
    assert back.locate("arm.start[1]") == "x.yaml:2:50: arm.start[1]"


@pytest.mark.parametrize(
    ("arm", "says"),
    [
        ("site: tip, body: b", "must have at most one of site, body and tool, got site and body"),
        ("body: b, tool: {}", "must have at most one of site, body and tool, got body and tool"),
        ("tool: {quat: [1, 0, 0, 0], rpy: [0, 0, 0]}", "tool: must have quat or rpy, got both"),
        ("tool: {model: arm.xml, mass: 1}", "must have mass or model, which has a mass of its own; got both"),
        ("tool: {center: [0, 0, 1]}", "center needs mass"),
        ("tool: {site: tip}", "site needs model, which contains it; remove site, or use arm.site"),
        (
            "tool: {mass: 1, inertia: [1, 2, 4]}",
            "inertia must have no moment above the sum of the two others, got [1, 2, 4]",
        ),
        ("tool: {mass: -1}", "arm.tool.mass: must be >= 0, got -1"),
        ("base: floating", 'arm.base: must be one of "fixed", "free", got "floating"'),
    ],
)
def test_a_frame_is_named_once_and_a_tool_fits_together(arm, says):
    (problem,) = problems(MINIMAL.replace("site: tip", arm))
    assert problem.startswith("x.yaml:2:") and says in problem


def test_without_a_frame_the_hand_is_controlled_and_a_tool_turns_as_urdf_does():
    assert loads(MINIMAL.replace(", site: tip", "")).arm.site is None
    tool = loads(MINIMAL.replace("site: tip", "tool: {rpy: [90 deg, 0, 90 deg]}")).arm.tool
    # about x first, then about z, both fixed: x goes to y, y to z, z to x
    assert tool.rotation == pytest.approx((0.5, 0.5, 0.5, 0.5), abs=1e-15)


def test_folders_of_packages_start_at_the_scenario(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "here/pkg").mkdir(parents=True)
    (tmp_path / "here/arm.xml").write_text("<mujoco/>")
    text = MINIMAL.replace("site: tip", "packages: {a: pkg}")
    (tmp_path / "here/x.yaml").write_text(text)
    assert load("here/x.yaml").arm.packages == {"a": tmp_path / "here/pkg"}
    (tmp_path / "here/x.yaml").write_text(text.replace("pkg", "gone"))
    with pytest.raises(ScenarioError, match=r'arm\.packages\.a: no such folder ".*here/gone"'):
        load("here/x.yaml")
