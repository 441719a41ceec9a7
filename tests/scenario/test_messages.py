import pytest
from scenario_texts import MINIMAL, problems

METHODS = (
    "inverse", "pseudoinverse", "truncated", "transpose", "damped", "filtered", "selectively_damped", "jparse",
)  # fmt: skip
CHOICE = "must be one of " + ", ".join(f'"{name}"' for name in METHODS)
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
        ("name", "a" * 101, f'must have at most 100 characters, got "{"a" * 38}…{"a" * 38}" (101 characters)'),
        ("arm", "3", "must be a mapping, got 3"),
        ("arm.model", "3", "must be text, got 3; put it in quotes"),
        ("arm.site", "[a]", 'must be text, got ["a"]'),
        ("arm.start", "5", "must be the name of a keyframe or a list of joint positions, got 5"),
        ("arm.start", "[]", "must have at least 1 item, got 0"),
        ("arm.stretch.link_1", "x", 'must be a number, got the text "x"'),
        ("arm.joints", "[a, a]", 'must not repeat, got "a" 2 times'),
        ("arm.joints", "a", 'must be a list, got "a"; write [a]'),
        ("arm.encoder.seed", "1.0", "must be a whole number without a dot, got 1"),
        ("arm.encoder.seed", "-1", "must be >= 0, got -1"),
        ("arm.encoder.deviation", "-1", "must be >= 0, got -1"),
        ("arm.encoder.deviation", "[1, -1 rad]", "arm.encoder.deviation[1]: must be >= 0, got -1"),
        ("arm.encoder.offset", "[]", "must have at least 1 item, got 0"),
        ("arm.encoder.offset", "much", 'must be a number (radians) or an angle such as "60 deg", got the text "much"'),
        ("task.axes", "[x, x]", 'must not repeat, got "x" 2 times'),
        ("task.weights", "[1]", "must have one weight for each of task.axes, got 1 for the 6 axes x, y, z, rx, ry, rz"),
        ("task.length", "0", "must be > 0, got 0"),
        ("control.period", "1e-3", 'must be a number, got the text "1e-3": YAML 1.1 needs a dot, write 1.0e-3'),
        ("control.period", "1.0e3", 'must be a number, got the text "1.0e3": YAML 1.1 needs a sign in the exponent, write 1.0e+3'),
        ("control.period", "1E3", 'must be a number, got the text "1E3": YAML 1.1 needs a dot and a sign in the exponent, write 1.0e+3'),
        ("control.period", '"1.0"', 'must be a number, got the text "1.0": remove the quotes'),
        ("control.period", '"1.0e-3"', 'must be a number, got the text "1.0e-3": remove the quotes'),
        ("control.period", "10 deg", 'must be a number, got the text "10 deg": it is 0.1745329 rad, and the key is in s'),
        ("control.period", "yes", "must be a number, got true"),
        ("control.period", "[1]", "must be a number, got [1]"),
        ("control.period", "", "must be a number, got nothing"),
        ("control.period", ".inf", "must be finite, got inf"),
        ("control.period", "9" * 400, "must be a number, got a huge integer"),
        ("control.period", "0.0015", "must be an integer multiple of plant.timestep, got 0.0015 and 0.001"),
        ("control.period", "0.0001", "must be an integer multiple of plant.timestep, got 0.0001 and 0.001"),
        ("control.feedback", "-1", "must be >= 0, got -1"),
        ("control.feedforward", "1", "must be true or false, got 1; write true"),
        ("control.inverse", "damped", 'must be a mapping, got "damped"; write {method: damped}'),
        ("control.inverse.method", "dampd", f'{CHOICE}, got "dampd"; did you mean "damped"?'),
        ("control.inverse.method", "7", f"{CHOICE}, got 7"),
        ("control.inverse.tolerance", "1", "must be < 1, got 1"),
        ("control.at_singularity", "halt", 'must be one of "damp", "slow", "stop", got "halt"; write stop'),
        ("control.slow.longest", "0.5", "must be >= 1, got 0.5"),
        ("control.slow.longest", "1001", "must be <= 1000, got 1001"),
        ("control.nullspace", "{objective: rates}", "control.nullspace.rates: must be given for the objective rates, one rate a joint"),
        ("control.nullspace.secondary", "{axes: [y], to: [1, 2]}", "control.nullspace.secondary.to: must have one value for each of axes, got 2 for the 1 axes y"),
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
        ("plant.kv", "stiff", 'must be a number, got the text "stiff"'),
        ("plant.kv", "[]", "must have at least 1 item, got 0"),
        ("plant.kv", "[1, 0]", "plant.kv[1]: must be > 0, got 0"),
        ("plant.wrench", "[1]", "must have 6 items, got 1"),
        ("expect", "[]", "must be a mapping, got []"),
        ("expect.<line>", "{below: x}", 'expect.<line>.below: must be a number, got the text "x"'),
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
        ("{turn: {axis: x, angle: 60 degrees}}", '.turn.angle: must be a number (radians) or an angle such as "60 deg", got the text "60 degrees": write 60 deg'),
        ("{turn: {axis: x, angle: pi/2}}", '.turn.angle: must be a number (radians) or an angle such as "60 deg", got the text "pi/2": write 90 deg'),
        ("{turn: {axis: x, angle: 1e-3}}", '.turn.angle: must be a number, got the text "1e-3": YAML 1.1 needs a dot, write 1.0e-3'),
        ("{turn: {axis: x, angle: nan deg}}", ".turn.angle: must be finite, got nan"),
        ("{hold: {for: 0}}", ".hold.for: must be > 0, got 0"),
        ("{hold: {}}", ".hold.for: is required: how long"),
        ("{hold: {for: 1, duration: 1}}", '.hold.duration: unknown key; it is called "for"'),
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
        " joint_weights, nullspace, limits, at_singularity, slow, stop",
        "x.yaml:9:11: control.period: must be an integer multiple of plant.timestep, got 0.0015 and 0.001",
        "x.yaml:11:3: control.feedback: is given twice, first in line 10",
        "x.yaml:11:13: control.feedback: must be >= 0, got -1",
        f'x.yaml:12:21: control.inverse.method: {CHOICE}, got "dampd"; did you mean "damped"?',
        "x.yaml:12:47: control.inverse.damping.maximum: must be > 0, got -1",
        "x.yaml:13:16: control.feedforward: the tag !!python/object:os.system is not supported",
        "x.yaml:14:31: task.weights: must have one weight for each of task.axes, got 1 for the 2 axes x, y",
        "x.yaml:15:1: a key must be text, got 1",
        "--set plant.kv: must be > 0, got 0",
    ]
