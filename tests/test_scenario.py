# ruff: noqa: E501 (a message that is asserted in full is one line)
import json
import math
import os
import pickle
import re
import time
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from rmrc import scenario as module
from rmrc.errors import ScenarioError
from rmrc.scenario import (
    HoldSegment,
    LineSegment,
    Scenario,
    TurnSegment,
    json_schema,
    load,
    loads,
    schema_rows,
)

MINIMAL = """\
name: x
arm: {model: arm.xml, site: tip}
target:
  path:
    - line: {by: [0.1, 0.0]}
"""

# Section 5 of the design, with what is not built yet left in the comments.
EXAMPLE = """\
# The 2-link arm is driven straight through full reach and back; watch sigma and qdot.
name: approach_singularity
arm: {model: arm.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
control:
  period: 0.001
  inverse: {method: damped, damping: {schedule: smallest_singular_value, maximum: 0.1, below: 0.3}}
  feedback: 20
  nullspace: {objective: none}
  limits: {rate: 3.0, on_excess: scale}        # scale | clamp | none
  at_singularity: damp                         # damp | slow | stop
target:
  path: [{line: {to: [1.99, 0.0]}}, {line: {to: [1.0, 0.0]}}]
  limits: {velocity: 0.5, acceleration: 2.0, jerk: 20.0}
plant: {kind: servo, kv: 1000, timestep: 0.001}
expect:
  joint_rate.peak: {below: 3.0}
  position_error.end: {below: 0.001}
"""

# Every key of a scenario has a value here; the schema test holds it against the schema.
FULL = """\
name: full
arm: {model: arm.xml, site: tip, start: [60 deg, 0.5], joints: [a, b]}
task: {axes: [x, y], length: 0.5, weights: [1.0, 2.0]}
control:
  period: 0.002
  inverse: {method: pseudoinverse, tolerance: 0.001,
            damping: {schedule: constant, maximum: 0.2, below: 0.4}}
  feedback: 3.0
  feedforward: false
  joint_weights: [1.0, 4.0]
  nullspace: {objective: posture, gain: 2.0, posture: [0.1, 10 deg]}
  limits: {rate: [1.0, 2.0], on_excess: clamp}
  at_singularity: damp
target:
  path:
    - line: {to: [1.0, 0.0], turn: {axis: [0, 0, 2], angle: 30 deg}}
    - line: {by: [0.0, 0.1, 0.2], turn: {to: [1, 0, 0, 0]}}
    - arc: {center: [0.5, 0.0], axis: [0, 0, 1], angle: -360 deg, turn: {axis: z, angle: 0.1}}
    - arc: {center: [0.5, 0.0], angle: 1.0, turn: {axis: [1, 0, 0], angle: 0.1}}
    - arc: {center: [0.5, 0.0], angle: 1.0, turn: {to: [0, 1, 0, 0]}}
    - turn: {axis: [0, 1, 0], angle: 1.0}
    - turn: {to: [0.5, 0.5, 0.5, 0.5]}
    - hold: {for: 0.5}
  limits: {velocity: 1.0, acceleration: 2.0, jerk: 3.0,
           angular_velocity: 4.0, angular_acceleration: 5.0, angular_jerk: 6.0}
plant: {kind: torque, kv: 10.0, bandwidth: 20.0, timestep: 0.001, gravity_compensation: false,
        wrench: [1, 2, 3, 4, 5, 6]}
expect:
  joint_rate.peak: {below: 3.0, above: 1.0}
  position_error.end: {equals: 0.0, within: 0.001}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A working directory with a model; no test here loads it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    return tmp_path


def problems(text, *overrides):
    with pytest.raises(ScenarioError) as caught:
        loads(text, "x.yaml", overrides)
    return list(caught.value.problems)


# What a scenario is ------------------------------------------------------------------------------


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
    assert (scenario.control.inverse.damping.maximum, scenario.control.inverse.damping.below) == (
        0.1,
        0.3,
    )
    assert (scenario.plant.kind, scenario.plant.kv, scenario.plant.timestep) == (
        "servo",
        1000.0,
        0.001,
    )
    assert scenario.expect == {}


def test_each_kind_of_segment_is_told_by_its_key():
    path = loads(FULL).target.path
    assert isinstance(path[0], LineSegment)
    assert path[0].line.turn.angle == math.radians(30)
    assert path[2].arc.angle == -2 * math.pi
    assert path[3].arc.axis == "z"
    assert isinstance(path[6], TurnSegment)
    assert path[6].turn.to == (0.5, 0.5, 0.5, 0.5)
    assert isinstance(path[7], HoldSegment)
    assert path[7].hold.duration == 0.5


@pytest.mark.parametrize(
    ("text", "radians"),
    [
        ("1", 1.0),
        ("-0.5", -0.5),
        ("60 deg", math.pi / 3),
        ("60deg", math.pi / 3),
        ("-1.5e1 deg", -math.pi / 12),
        ("' 180  deg '", math.pi),
        ("0.5 rad", 0.5),
        ("1e-3 rad", 0.001),
    ],
)
def test_an_angle_is_radians_or_a_number_with_a_unit(text, radians):
    # One rounding in the product with pi/180.
    assert loads(MINIMAL, overrides=[f"arm.start=[{text}]"]).arm.start[0] == pytest.approx(radians, rel=1e-15)


def test_axes_are_kept_in_row_order_and_weights_follow_them():
    task = loads(MINIMAL, overrides=["task.axes=[rz, x]", "task.weights=[5, 7]"]).task
    assert task.axes == ("x", "rz")
    assert task.weights == (7.0, 5.0)


def test_a_scenario_is_frozen():
    with pytest.raises(ValueError, match="frozen"):
        loads(MINIMAL).control.feedback = 1.0


def test_a_model_path_starts_at_the_folder_of_the_file(folder):
    (folder / "scenarios").mkdir()
    (folder / "scenarios/x.yaml").write_text(MINIMAL.replace("arm.xml", "../arm.xml"))
    assert load("scenarios/x.yaml").arm.model == folder / "arm.xml"
    assert load(Path("scenarios/x.yaml"), ["control.feedback=3"]).control.feedback == 3.0


def test_a_merge_key_takes_what_is_not_said():
    text = MINIMAL.replace("by: [0.1, 0.0]", "by: [0.1, 0.0], turn: &t {axis: z, angle: 1}")
    text += "    - turn: {<<: *t, angle: 2}\n"
    scenario = loads(text, "x.yaml")
    turn = scenario.target.path[1].turn
    assert (turn.axis, turn.angle) == ("z", 2.0)
    assert scenario.locate("target.path[1].turn.angle") == "x.yaml:6:29: target.path[1].turn.angle"
    assert scenario.locate("target.path[1].turn.axis") == "x.yaml:5:46: target.path[1].turn.axis"


def test_an_alias_is_a_copy():
    text = MINIMAL + "control: {joint_weights: &w [1.0, 2.0], nullspace: {posture: *w}}\n"
    scenario = loads(text, overrides=["control.joint_weights[0]=9"])
    assert scenario.control.joint_weights == (9.0, 2.0)
    assert scenario.control.nullspace.posture == (1.0, 2.0)


# Round trip --------------------------------------------------------------------------------------

numbers = st.floats(-1e6, 1e6)
positive = st.floats(1e-6, 1e6)
names = st.text(min_size=1, max_size=8).filter(lambda text: text.isprintable())
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
    st.fixed_dictionaries({"kv": positive, "wrench": st.lists(numbers, min_size=6, max_size=6)}),
    st.dictionaries(texts, checks, max_size=3),
)


@settings(max_examples=60, deadline=None)
@given(scenarios)
def test_a_scenario_reads_back_from_its_yaml_equal(data):
    scenario = Scenario.model_validate(data)
    assert loads(scenario.to_yaml()) == scenario
    assert Scenario.model_validate(json.loads(json.dumps(scenario.model_dump(mode="json")))) == (scenario)


# A short path, because PyYAML breaks lines at 80 columns.
COMPLETE = """\
name: x
arm: {model: /arm.xml, site: tip, start: home, joints: null}
task:
  axes: [x, y, z, rx, ry, rz]
  length: 1.0
  weights: null
control:
  period: 0.001
  inverse:
    method: damped
    tolerance: 1.0e-06
    damping: {schedule: smallest_singular_value, maximum: 0.1, below: 0.3}
  feedback: 20.0
  feedforward: true
  joint_weights: null
  nullspace: {objective: none, gain: 1.0, posture: null}
  limits: {rate: null, on_excess: scale}
  at_singularity: damp
target:
  path:
  - line:
      by: [0.1, 0.0]
  limits: {velocity: 0.25, acceleration: 1.0, jerk: 10.0, angular_velocity: 1.0, angular_acceleration: 4.0,
    angular_jerk: 40.0}
plant:
  kind: servo
  kv: 1000.0
  bandwidth: 500.0
  timestep: 0.001
  gravity_compensation: true
  wrench: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
expect: {}
"""


def test_the_yaml_of_a_scenario_is_complete_and_normalized():
    arm = loads(MINIMAL).arm.model_copy(update={"model": Path("/arm.xml")})
    assert loads(MINIMAL).model_copy(update={"arm": arm}).to_yaml() == COMPLETE


def test_the_place_of_a_value_is_no_part_of_a_scenario():
    assert loads(MINIMAL) == loads("# a comment\n" + MINIMAL)
    assert loads(MINIMAL) != loads(MINIMAL, overrides=["control.feedback=1"])  # negative control


def test_a_scenario_survives_the_way_to_a_worker_process_with_its_places():
    scenario = loads(FULL, "x.yaml")
    back = pickle.loads(pickle.dumps(scenario))
    assert back == scenario
    assert back.locate("arm.start[1]") == "x.yaml:2:50: arm.start[1]"


# Places and overrides ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "place"),
    [
        ("control.inverse.damping.maximum", "x.yaml:7:83: control.inverse.damping.maximum"),
        ("arm.start[1]", "x.yaml:3:50: arm.start[1]"),
        ("control.feedback", "x.yaml:8:13: control.feedback"),
        ("target.path[1].line.to[0]", "x.yaml:13:50: target.path[1].line.to[0]"),
        ("expect.joint_rate.peak", "x.yaml:17:20: expect.joint_rate.peak"),
        ("expect.joint_rate.peak.below", "x.yaml:17:28: expect.joint_rate.peak.below"),
        ("plant.wrench[2]", "x.yaml:15:8: plant.wrench[2]"),  # the nearest parent
        ("nothing.like.that", "x.yaml:2:1: nothing.like.that"),
        ("plant.kv", "--set plant.kv"),
        ("arm.joints[1]", "--set arm.joints: arm.joints[1]"),
    ],
)
def test_locate_says_where_a_value_is(key, place):
    scenario = loads(EXAMPLE, "x.yaml", ["plant.kv=1", "arm.joints=[a, b]"])
    assert scenario.locate(key) == place


def test_what_was_replaced_leaves_no_place_behind():
    scenario = loads(FULL, "x.yaml", ["control.limits={on_excess: none}"])
    assert scenario.locate("control.limits.rate[1]") == ("--set control.limits: control.limits.rate[1]")
    text = MINIMAL.replace("by: [0.1, 0.0]", "by: [0.1, 0.0], turn: &t {axis: [1, 0, 0], angle: 1}")
    merged = loads(text + "    - turn: {<<: *t, axis: z}\n", "x.yaml")
    assert merged.locate("target.path[1].turn.axis[2]") == ("x.yaml:6:28: target.path[1].turn.axis[2]")


def test_a_scenario_made_in_python_has_no_places():
    scenario = Scenario.model_validate(loads(MINIMAL).model_dump())
    assert scenario.locate("arm.start[1]") == "arm.start[1]"


@pytest.mark.parametrize(
    ("override", "steps", "value"),
    [
        ("control.inverse.method=inverse", ["control", "inverse", "method"], "inverse"),
        (" control.feedback = 4 ", ["control", "feedback"], 4.0),
        ("arm.start[1]=10 deg", ["arm", "start", 1], math.radians(10)),
        ("target.path[0].line.to=[2,0]", ["target", "path", 0, "line", "to"], [2.0, 0.0]),
        ("task.weights=", ["task", "weights"], None),
        ("control.limits={rate: 2}", ["control", "limits"], {"rate": 2.0, "on_excess": "scale"}),
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


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("foo", "--set foo: must be KEY=VALUE, for example control.feedback=10"),
        ("=1", "--set =1: must be KEY=VALUE, for example control.feedback=10"),
        ("a..b=1", "--set a..b=1: must be KEY=VALUE, for example control.feedback=10"),
        ("\x1b[0m=1", r"--set \x1b[0m=1: must be KEY=VALUE, for example control.feedback=10"),
        (
            "control.invers.method=inverse",
            '--set control.invers.method: control.invers: unknown key; did you mean "inverse"?',
        ),
        (
            "control={invers: {}}",
            '--set control: control.invers: unknown key; did you mean "inverse"?',
        ),
        ("control.feedback=-1", "--set control.feedback: must be >= 0, got -1"),
        ("arm.start[5]=1", "--set arm.start[5]: arm.start has 2 items, counted from 0"),
        ("arm.site[0]=1", '--set arm.site[0]: arm.site is "tip", not a list'),
        ("task.weights[0]=1", "--set task.weights[0]: task.weights is nothing, not a list"),
        ("plant.kv.x=1", "--set plant.kv.x: plant.kv is 1000, not a mapping"),
        (
            "arm.start=[1",
            "--set arm.start: is not valid YAML: expected ',' or ']', but got '<stream end>'",
        ),
        ("arm.start=# x", "--set arm.start: is empty"),
        (
            "arm.site=!!python/name:os.system x",
            "--set arm.site: the tag !!python/name:os.system is not supported",
        ),
        ("plant.kv=1\n---\n2", "--set plant.kv: holds more than one YAML document"),
    ],
)
def test_a_wrong_override_is_told_by_its_key(override, line):
    assert problems(EXAMPLE, override) == [line]


# Mistakes in values ------------------------------------------------------------------------------

CHOICE = 'must be one of "inverse", "pseudoinverse", "damped"'
ONE_OF = "must have exactly one of line, arc, turn, hold"
FORM = "must have either axis and angle, or to"


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("name", "a b", 'must be made of letters, digits, "_" and "-", got "a b"'),
        ("name", "../x", 'must be made of letters, digits, "_" and "-", got "../x"'),
        ("name", '"a\\n"', 'must be made of letters, digits, "_" and "-", got "a\\n"'),
        ("name", "''", 'must not be empty, got ""'),
        ("name", "3", "must be text, got 3; put it in quotes"),
        ("name", "yes", "must be text, got true; put it in quotes"),
        ("name", "a" * 101, f'must have at most 100 characters, got "{"a" * 76}...'),
        ("arm", "3", "must be a mapping, got 3"),
        ("arm.model", "3", "must be text, got 3; put it in quotes"),
        ("arm.site", "[a]", 'must be text, got ["a"]'),
        ("arm.start", "5", "must be the name of a keyframe or a list of joint positions, got 5"),
        ("arm.start", "[]", "must have at least 1 item, got 0"),
        ("arm.joints", "[a, a]", 'must not repeat, got "a" 2 times'),
        ("arm.joints", "a", 'must be a list, got "a"'),
        ("task.axes", "[x, x]", 'must not repeat, got "x" 2 times'),
        ("task.weights", "[1]", "must have one weight for each of task.axes, got 1 for the 6 axes x, y, z, rx, ry, rz"),
        ("task.length", "0", "must be > 0, got 0"),
        ("control.period", "1e-3", 'must be a number, got the text "1e-3": YAML 1.1 needs a dot, write 1.0e-3'),
        ("control.period", "1.0e3", 'must be a number, got the text "1.0e3": YAML 1.1 needs a sign in the exponent, write 1.0e+3'),
        ("control.period", "1E3", 'must be a number, got the text "1E3": YAML 1.1 needs a dot and a sign in the exponent, write 1.0e+3'),
        ("control.period", '"1.0"', 'must be a number, got the text "1.0": remove the quotes'),
        ("control.period", '"1.0e-3"', 'must be a number, got the text "1.0e-3": remove the quotes'),
        ("control.period", "10 deg", 'must be a number, got the text "10 deg"'),
        ("control.period", "yes", "must be a number, got true"),
        ("control.period", "[1]", "must be a number, got [1]"),
        ("control.period", "", "must be a number, got nothing"),
        ("control.period", ".inf", "must be finite, got inf"),
        ("control.period", "9" * 400, "must be a number, got a huge integer"),
        ("control.period", "0.0015", "must be an integer multiple of plant.timestep, got 0.0015 and 0.001"),
        ("control.period", "0.0001", "must be an integer multiple of plant.timestep, got 0.0001 and 0.001"),
        ("control.feedback", "-1", "must be >= 0, got -1"),
        ("control.feedforward", "1", "must be true or false, got 1"),
        ("control.inverse", "damped", 'must be a mapping, got "damped"'),
        ("control.inverse.method", "dampd", f'{CHOICE}, got "dampd"; did you mean "damped"?'),
        ("control.inverse.method", "7", f"{CHOICE}, got 7"),
        ("control.inverse.tolerance", "1", "must be < 1, got 1"),
        ("control.at_singularity", "slow", 'must be "damp", got "slow"'),
        ("control.nullspace.gain", "-0.5", "must be >= 0, got -0.5"),
        ("control.limits.rate", "fast", 'must be a number, got the text "fast"'),
        ("control.limits.rate", "[]", "must have at least 1 item, got 0"),
        ("target.path", "[]", "must have at least 1 item, got 0"),
        ("target.path[0]", "{lien: {}}", f'{ONE_OF}, got lien; did you mean "line"?'),
        ("target.path[0]", "{hold: {for: 1}, arc: {}}", f"{ONE_OF}, got hold and arc"),
        ("target.path[0]", "{}", f"{ONE_OF}, got none of them"),
        ("target.path[0]", "hold", f'{ONE_OF}, got "hold"'),
        ("target.path[0].line", "{}", "must have exactly one of to, by, got none of them"),
        ("target.path[0].line", "{to: [1, 0], by: [1, 0]}", "must have exactly one of to, by, got to and by"),
        ("target.path[0].line.by", "[1]", "must have 2 or 3 items, got 1"),
        ("target.path[0].line.by", "[1, 2, 3, 4]", "must have 2 or 3 items, got 4"),
        ("target.path[0].line.turn", "{}", f"{FORM}, got none of them"),
        ("target.path[0].line.turn", "{axis: x}", f"{FORM}, got axis"),
        ("target.path[0].line.turn", "{axis: x, angle: 1, to: [1, 0, 0, 0]}", f"{FORM}, got axis and angle and to"),
        ("plant.kind", "idael", 'must be one of "ideal", "servo", "torque", got "idael"; did you mean "ideal"?'),
        ("plant.wrench", "[1]", "must have 6 items, got 1"),
        ("expect", "[]", "must be a mapping, got []"),
        ("expect.a.b", "{}", "must have at least one of below, above, equals, got none of them"),
        ("expect.a.b", "{equals: 1}", "equals needs within, how far from it the figure may be"),
        ("expect.a.b", "{within: 1}", "within needs equals"),
        ("expect.a.b", "{below: 1, above: 2}", "above must be less than below, got above 2 and below 1"),
    ],
)  # fmt: skip
def test_a_wrong_value_gets_one_line_with_value_bound_and_way_out(key, value, message):
    assert problems(MINIMAL, f"{key}={value}") == [f"--set {key}: {message}"]


@pytest.mark.parametrize(
    ("segment", "line"),
    [
        ("{arc: {angle: 1}}", ".arc.center: is required: the center: [x, y], which keeps z, or [x, y, z]"),
        ("{arc: {center: [0, 0], angle: 0 deg}}", ".arc.angle: must not be 0"),
        ("{arc: {center: [0, 0], angle: 1, axis: [0, 0, 0]}}", ".arc.axis: must not be zero, got [0, 0, 0]"),
        ("{arc: {center: [0, 0], angle: 1, axis: w}}", '.arc.axis: must be one of "x", "y", "z", got "w"'),
        ("{arc: {center: [0, 0], angle: 1, axis: 3}}", '.arc.axis: must be one of "x", "y", "z" or a list of 3 numbers, got 3'),
        ("{arc: {center: [0, 0], angle: 1, axis: [0, 1]}}", ".arc.axis: must have 3 items, got 2"),
        ("{turn: {to: [0, 0, 0, 0]}}", ".turn.to: must not be zero, got [0, 0, 0, 0]"),
        ("{turn: {to: [1, 0, 0]}}", ".turn.to: must have 4 items, got 3"),
        ("{turn: {axis: x, angle: 60 degrees}}", '.turn.angle: must be a number (radians) or an angle such as "60 deg", got the text "60 degrees"'),
        ("{turn: {axis: x, angle: pi/2}}", '.turn.angle: must be a number (radians) or an angle such as "60 deg", got the text "pi/2"'),
        ("{turn: {axis: x, angle: 1e-3}}", '.turn.angle: must be a number, got the text "1e-3": YAML 1.1 needs a dot, write 1.0e-3'),
        ("{turn: {axis: x, angle: nan deg}}", ".turn.angle: must be finite, got nan"),
        ("{hold: {for: 0}}", ".hold.for: must be > 0, got 0"),
        ("{hold: {}}", ".hold.for: is required: how long"),
        ("{hold: {for: 1, duration: 1}}", ".hold.duration: unknown key; the keys are for"),
    ],
)  # fmt: skip
def test_a_wrong_segment_is_told_by_its_key(segment, line):
    key = "target.path[0]"
    assert problems(MINIMAL, f"{key}={segment}") == [f"--set {key}: {key}{line}"]


def test_all_mistakes_are_told_at_once_sorted_by_line():
    text = """\
name: a b
arm:
  model: arm.xml
  start: [1, .nan]
control:
  invers: {method: dampd}
  feedbak: 3
  zzz: 3
  period: 0.0015
  feedback: 1
  feedback: -1
  inverse: {method: dampd, damping: {maximum: -1}}
  feedforward: !!python/object:os.system {}
task: {axes: [x, y], weights: [1]}
1: 2
"""
    assert problems(text, "plant.kv=0") == [
        "x.yaml:1:1: target: is required: where the site shall go",
        'x.yaml:1:7: name: must be made of letters, digits, "_" and "-", got "a b"',
        "x.yaml:3:3: arm.site: is required: the MuJoCo site that is controlled",
        "x.yaml:4:14: arm.start[1]: must be finite, got nan",
        'x.yaml:6:3: control.invers: unknown key; did you mean "inverse"?',
        'x.yaml:7:3: control.feedbak: unknown key; did you mean "feedback"?',
        "x.yaml:8:3: control.zzz: unknown key; the keys are period, inverse, feedback, feedforward,"
        " joint_weights, nullspace, limits, at_singularity",
        "x.yaml:9:11: control.period: must be an integer multiple of plant.timestep, got 0.0015 and 0.001",
        "x.yaml:11:3: control.feedback: is given twice, first in line 10",
        "x.yaml:11:13: control.feedback: must be >= 0, got -1",
        'x.yaml:12:21: control.inverse.method: must be one of "inverse", "pseudoinverse", "damped",'
        ' got "dampd"; did you mean "damped"?',
        "x.yaml:12:47: control.inverse.damping.maximum: must be > 0, got -1",
        "x.yaml:13:16: control.feedforward: the tag !!python/object:os.system is not supported",
        "x.yaml:14:31: task.weights: must have one weight for each of task.axes, got 1 for the 2 axes x, y",
        "x.yaml:15:1: a key must be text, got 1",
        "--set plant.kv: must be > 0, got 0",
    ]


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
        "--set control.period: must be an integer multiple of plant.timestep,"
        f" got {float(period)} and {float(timestep)}"
    ]


def test_a_model_that_is_not_there_is_told_with_its_neighbor(folder):
    assert problems(MINIMAL.replace("arm.xml", "amr.xml")) == [
        f'x.yaml:2:14: arm.model: no such file "{folder}/amr.xml"; did you mean "arm.xml"?'
    ]
    assert problems(MINIMAL.replace("arm.xml", ".")) == [f'x.yaml:2:14: arm.model: is not a file: "{folder}"']
    assert problems(MINIMAL.replace("arm.xml", '"a\\0b"')) == [
        r'x.yaml:2:14: arm.model: cannot be read (embedded null byte), got "a\u0000b"'
    ]
    (folder / "loop").symlink_to("loop")
    assert len(problems(MINIMAL.replace("arm.xml", "loop"))) == 1


# Numbers that are not finite ---------------------------------------------------------------------


def number_keys(value, key=""):
    """Walk plain data to the key of every number in it."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from number_keys(inner, f"{key}.{name}".removeprefix("."))
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from number_keys(inner, f"{key}[{i}]")
    elif isinstance(value, float):
        yield key


def as_row(key):
    """Return the key under which the schema lists a key of FULL."""
    key = re.sub(r"(target\.path)\[\d+\]", r"\1[]", key)
    key = re.sub(r"^expect\..*\.(\w+)$", r"expect.<figure>.\1", key)
    return re.sub(r"\[\d+\]$", "", key)


def full_number_keys():
    Path("arm.xml").write_text("<mujoco/>")
    return sorted(number_keys(loads(FULL).model_dump(mode="json")))


def test_no_number_of_a_scenario_may_be_nan_or_infinite():
    for key in full_number_keys():
        for text, shown in ((".nan", "nan"), (".inf", "inf"), ("-.inf", "-inf")):
            found = problems(FULL, f"{key}={text}")
            assert found[0] == f"--set {key}: must be finite, got {shown}"


def test_the_walk_over_numbers_reaches_every_number_of_the_schema():
    listed = {row.key for row in schema_rows() if re.search("number|angle", row.type)}
    assert {as_row(key) for key in full_number_keys()} == listed
    assert len(listed) > 35  # negative control: an empty walk over an empty schema would agree


# Files -------------------------------------------------------------------------------------------


def file_problem(path):
    start = time.perf_counter()
    with pytest.raises(ScenarioError) as caught:
        load(path)
    assert time.perf_counter() - start < 5  # a bound on hangs; the slowest takes 0.6 s
    (line,) = caught.value.problems
    return line


DEEP = "is nested more than 50 deep"
MANY = "has more than 10000 values, aliases counted as often as they are used"
BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join(['*' + old] * 10)}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", ": is empty"),
        (b"# only a comment\n", ": is empty"),
        (b"\xff\xfe\x00\x01", ": is not UTF-8 text: byte 0xff at offset 0"),
        (b"name: a\n\x00\x01", ":2:1: is not a text file: it holds the character U+0000"),
        (b"name: \x1b[31m", ":1:7: is not a text file: it holds the character U+001B"),
        (b"- a\n- b\n", ":1:1: must be a mapping of keys, got [\"a\", \"b\"]"),
        (b"---\n...\n", ":2:1: must be a mapping of keys, got nothing"),
        (b"a: [1, 2\nb: 3", ":2:2: is not valid YAML: expected ',' or ']', but got ':'"),
        (b"a: b: c", ":1:5: is not valid YAML: mapping values are not allowed here"),
        (b"a:\n\tb: 1", ":2:1: is not valid YAML: a tab cannot stand here, use spaces"),
        (b"a: *b", ":1:4: is not valid YAML: found undefined alias 'b'"),
        (b"a: 1\n---\nb: 1\n", ":2:1: holds more than one YAML document"),
        (b"[" * 500_000, f":1:51: {DEEP}"),
        (b"- " * 500_000, f":1:101: {DEEP}"),
        (b"a: &a [*a]", f":1:4: {DEEP}"),
        (b"a: &a {<<: *a}", f":1:4: {DEEP}"),
        (b"[" + b"1," * 400_000 + b"]", f":1:20000: {MANY}"),
        (BOMB.encode(), f":1:35: {MANY}"),
    ],
)  # fmt: skip
def test_a_broken_or_hostile_file_gets_one_line(content, problem):
    Path("x.yaml").write_bytes(content)
    assert file_problem("x.yaml") == f"x.yaml{problem}"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("1: a", "x.yaml:6:1: a key must be text, got 1"),
        ("no: a", "x.yaml:6:1: a key must be text, got no"),
        ("? [a]\n: b", "x.yaml:6:3: a key must be text, got a list"),
        ("? {a: b}\n: c", "x.yaml:6:3: a key must be text, got a mapping"),
        ('"\\ud800": 1', r"x.yaml:6:1: a key must be text, got \ud800"),
        ("name: x", "x.yaml:6:1: name: is given twice, first in line 1"),
        ("plant: {<<: 3}", "x.yaml:6:13: plant: << must name a mapping, got 3"),
        ("plant: !!set {a}", "x.yaml:6:8: plant: the tag !!set is not supported"),
        ("plant: !mine {kv: 1}", "x.yaml:6:8: plant: the tag !mine is not supported"),
        ("plant: {kv: !!int abc}", "x.yaml:6:13: plant.kv: cannot be read as !!int, got abc"),
        ("plant: {kv: 0x_}", "x.yaml:6:13: plant.kv: cannot be read as !!int, got 0x_"),
        (
            "plant: {kv: !!python/object/apply:os.system [ls]}",
            "x.yaml:6:13: plant.kv: the tag !!python/object/apply:os.system is not supported",
        ),
        (
            "<line>: 1",
            "x.yaml:6:1: <line>: unknown key; the keys are name, arm, task, control, target, plant, expect",
        ),
        (
            '"a\\nb": 1',
            r"x.yaml:6:1: a\nb: unknown key;"
            " the keys are name, arm, task, control, target, plant, expect",
        ),
    ],
)
def test_yaml_that_is_no_plain_value_gets_one_line(text, line):
    assert problems(MINIMAL + text) == [line]


def test_a_file_that_is_not_there_is_told_with_its_neighbor():
    Path("approach.yaml").write_text(MINIMAL)
    assert file_problem("aproach.yaml") == ('aproach.yaml: no such file; did you mean "approach.yaml"?')
    assert file_problem("nowhere/zzz.yaml") == "nowhere/zzz.yaml: no such file"
    assert file_problem("approach.yaml/x") == "approach.yaml/x: cannot be read: not a directory"
    assert file_problem("a\nb\0") == r"a\nb\x00: cannot be read: a path must not hold a NUL"


def test_what_is_no_file_is_not_read():
    assert file_problem(".") == ".: is a directory, not a YAML file"
    os.mkfifo("pipe.yaml")  # reading it would wait for ever
    assert file_problem("pipe.yaml") == "pipe.yaml: is not a regular file"


def test_a_file_that_may_not_be_read_gets_one_line(monkeypatch):
    def refuse(*_args):
        raise PermissionError(13, "Permission denied")

    Path("x.yaml").write_text(MINIMAL)
    monkeypatch.setattr(module, "open", refuse, raising=False)  # root may read any file
    assert file_problem("x.yaml") == "x.yaml: cannot be read: permission denied"


def test_a_huge_file_is_refused_by_its_size_without_reading(monkeypatch):
    with open("big.yaml", "wb") as file:
        file.truncate(100_000_000)
    monkeypatch.setattr(module, "open", None, raising=False)  # opening it would be a TypeError
    assert file_problem("big.yaml") == ("big.yaml: is 100.0 MB, more than the 1 MiB a scenario may have")
    assert problems("#" * (2**20 + 1)) == ["x.yaml: is 1.0 MB, more than the 1 MiB a scenario may have"]


def test_a_byte_order_mark_and_windows_line_ends_are_accepted():
    Path("x.yaml").write_bytes(b"\xef\xbb\xbf" + MINIMAL.replace("\n", "\r\n").encode())
    assert load("x.yaml") == loads(MINIMAL)


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=60) | st.lists(st.sampled_from("ab:-[]{},&*!|>'\"\n #?1.<=%"), max_size=30))
def test_any_text_gives_a_scenario_error_of_whole_lines(text):
    with pytest.raises(ScenarioError) as caught:
        loads("".join(text), "x.yaml")
    for line in caught.value.problems:
        assert line.startswith("x.yaml:")
        assert line.isprintable()


# Schema ------------------------------------------------------------------------------------------


def test_the_schema_lists_every_key_once_with_meaning_and_numbers_with_unit():
    def leaves(value, key=""):
        if isinstance(value, dict):
            for name, inner in value.items():
                yield from leaves(inner, f"{key}.{name}".removeprefix("."))
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for i, inner in enumerate(value):
                yield from leaves(inner, f"{key}[{i}]")
        else:
            yield as_row(key)

    rows = schema_rows()
    assert [row.key for row in rows] == list(dict.fromkeys(row.key for row in rows))
    assert {row.key for row in rows} == set(leaves(loads(FULL).model_dump(mode="json")))
    assert all(row.meaning for row in rows)
    assert [row.key for row in rows if re.search("number|angle", row.type) and not row.unit] == []


def test_the_full_scenario_of_these_tests_uses_every_field():
    """Keeps the test above honest: FULL and the schema are both held against the classes."""
    sections = {
        kind for kind in vars(module).values() if isinstance(kind, type) and issubclass(kind, module.Section)
    }
    seen = {kind: set() for kind in sections}

    def visit(value):
        if isinstance(value, module.Section):
            for name in type(value).model_fields:
                inner = getattr(value, name)
                if inner is not None:
                    seen[type(value)].add(name)
                visit(inner)
        elif isinstance(value, tuple | dict):
            for inner in value.values() if isinstance(value, dict) else value:
                visit(inner)

    visit(loads(FULL))
    assert {kind: names for kind, names in seen.items() if names} == {
        kind: set(kind.model_fields) for kind in sections if kind.model_fields
    }


def test_rows_of_the_schema_read_as_a_table():
    rows = {row.key: row for row in schema_rows()}
    assert tuple(rows["control.inverse.damping.maximum"]) == (
        "control.inverse.damping.maximum",
        "number > 0",
        "as σ",
        "0.1",
        "λ_max, the largest damping (λ, not λ²)",
    )
    kinds = {
        "name": "text",
        "arm.model": "path",
        "arm.start": "text or list of angles",
        "task.axes": "list of (x | y | z | rx | ry | rz)",
        "control.inverse.method": "inverse | pseudoinverse | damped",
        "control.inverse.tolerance": "number > 0, < 1",
        "control.feedforward": "true | false",
        "control.limits.rate": "number > 0 or list of numbers > 0",
        "target.path[].line.to": "list of 2 or 3 numbers",
        "target.path[].line.turn.axis": "x | y | z or list of 3 numbers",
        "plant.wrench": "list of 6 numbers",
    }
    assert {key: rows[key].type for key in kinds} == kinds
    assert rows["arm.site"].default == "required"
    assert rows["control.inverse.tolerance"].default == "1.0e-06"
    assert rows["task.weights"].default == "null"
    assert rows["target.path[].hold.for"].unit == "s"


def valid(value, schema, root):
    """Say whether a value fits, for the part of JSON Schema that ours uses (no such library here)."""
    known = {"$ref", "$defs", "$schema", "title", "description", "default", "unit", "format"}
    types = {
        "object": dict, "array": list, "string": str, "number": (int, float),
        "boolean": bool, "null": type(None),
    }  # fmt: skip
    items = value if isinstance(value, list) else []
    keys = value if isinstance(value, dict) else {}
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    rules = {
        "type": lambda t: isinstance(value, types[t]) and (t == "boolean") == isinstance(value, bool),
        "const": lambda c: value == c,
        "enum": lambda options: value in options,
        "anyOf": lambda options: any(valid(value, o, root) for o in options),
        "oneOf": lambda options: sum(valid(value, o, root) for o in options) == 1,
        "properties": lambda p: all(valid(v, p[k], root) for k, v in keys.items() if k in p),
        "additionalProperties": lambda a: all(
            a is not False and valid(v, a, root)
            for k, v in keys.items()
            if k not in schema.get("properties", {})
        ),
        "required": lambda names: all(name in keys for name in names),
        "dependentRequired": lambda d: all(n in keys for k in d if k in keys for n in d[k]),
        "maxProperties": lambda n: len(keys) <= n,
        "items": lambda s: all(valid(item, s, root) for item in items),
        "minItems": lambda n: not isinstance(value, list) or len(value) >= n,
        "maxItems": lambda n: not isinstance(value, list) or len(value) <= n,
        "minLength": lambda n: not isinstance(value, str) or len(value) >= n,
        "maxLength": lambda n: not isinstance(value, str) or len(value) <= n,
        "pattern": lambda p: not isinstance(value, str) or bool(re.search(p, value)),
        "minimum": lambda n: not is_number or value >= n,
        "exclusiveMinimum": lambda n: not is_number or value > n,
        "exclusiveMaximum": lambda n: not is_number or value < n,
    }
    if "$ref" in schema and not valid(value, root["$defs"][schema["$ref"].split("/")[-1]], root):
        return False
    return all(rules[k](s) for k, s in schema.items() if k not in known)


def plain(text):
    return yaml.safe_load(text)


@pytest.mark.parametrize("text", [MINIMAL, EXAMPLE, FULL])
def test_the_json_schema_accepts_what_is_read(text):
    schema = json_schema()
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert valid(plain(text), schema, schema)
    assert valid(loads(text).model_dump(mode="json"), schema, schema)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("name: full", "nam: full"),
        ("feedback: 3.0", "feedback: -3.0"),
        ("angle: 30 deg", "angle: 30 degrees"),
        ("hold: {for: 0.5}", "hold: {duration: 0.5}"),
        ("hold: {for: 0.5}", "hold: {for: 0.5}\n      turn: {axis: z, angle: 1}"),
        ("line: {to: [1.0, 0.0],", "line: {to: [1.0, 0.0], by: [1.0, 0.0],"),
        ("turn: {axis: [0, 1, 0], angle: 1.0}", "turn: {axis: [0, 1, 0]}"),
        ("wrench: [1, 2, 3, 4, 5, 6]", "wrench: [1, 2, 3, 4, 5]"),
        ("equals: 0.0, within: 0.001", "equals: 0.0"),
        ("feedforward: false", "feedforward: 0"),
    ],
)
def test_the_json_schema_refuses_what_is_refused(old, new):
    assert old in FULL
    text = FULL.replace(old, new)
    schema = json_schema()
    assert not valid(plain(text), schema, schema)
    with pytest.raises(ScenarioError):
        loads(text)


def test_the_json_schema_gives_editors_units_and_meanings():
    damping = json_schema()["$defs"]["DampingSection"]["properties"]["maximum"]
    assert damping["unit"] == "as σ"
    assert damping["description"] == "λ_max, the largest damping (λ, not λ²)"
    assert damping["exclusiveMinimum"] == 0
