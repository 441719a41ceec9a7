"""Files of another kind than a verb takes: one line, which names the verb that does."""

import pytest

from project import ROOT

TWO = ROOT / "models/planar_2link.xml"
SCENARIO = f"""
name: quick
arm: {{model: {TWO}, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.05, 0.0]}}}}]}}
"""
CONTENTS = {
    "quick.yaml": SCENARIO.encode(),
    "model.xml": TWO.read_bytes(),
    "plain": TWO.read_bytes(),
    "x.rrd": b"RRF2" + bytes(60),
    "x.npz": b"PK\x03\x04",
    "x.parquet": b"PAR1",
    "x.json": b"{}",
    "x.png": b"\x89PNG",
    "named.xml.yaml": TWO.read_bytes(),
}
SCENARIO_VERBS = ("run", "compare", "sweep", "tune")
MODEL_VERBS = ("check", "new", "inspect", "statics", "ik", "workspace")
CASES = [
    *((verb, "model.xml", "is a model, not a scenario; take it with `rmrc inspect model.xml`, or name it in a scenario: `arm: {model: model.xml, site: ...}`") for verb in SCENARIO_VERBS),
    *((verb, "quick.yaml", "is a scenario, not a model; take it with `rmrc run quick.yaml`; or give the model that its arm.model names") for verb in MODEL_VERBS),
    ("run", "plain", "is a model, not a scenario; take it with `rmrc inspect plain`, or name it in a scenario: `arm: {model: plain, site: ...}`"),
    ("run", "named.xml.yaml", "is a model, not a scenario; take it with `rmrc inspect named.xml.yaml`, or name it in a scenario: `arm: {model: named.xml.yaml, site: ...}`"),
    ("run", "x.rrd", "is a recording, not a scenario; take it with `rmrc replay x.rrd`"),
    ("run", "x.npz", "is the columns of a run, not a scenario; read it in Python with rmrc.Run.read"),
    ("run", "x.parquet", "is the rows of a sweep, not a scenario; read it in Python with pandas.read_parquet"),
    ("run", "x.json", "is the figures of a run, not a scenario; read it in Python with json.load"),
    ("run", "x.png", "is a picture, not a scenario"),
    ("inspect", "x.rrd", "is a recording, not a model; take it with `rmrc replay x.rrd`"),
    ("replay", "quick.yaml", "is a scenario, not a recording; take it with `rmrc run quick.yaml`, which leaves a recording"),
    ("replay", "model.xml", "is a model, not a recording; take it with `rmrc inspect model.xml`"),
    ("run", ".", "is a folder, give a scenario; it has named.xml.yaml, quick.yaml"),
    ("inspect", ".", "is a folder, give a model; it has model.xml"),
]  # fmt: skip


@pytest.fixture(autouse=True)
def files(tmp_path):
    for name, content in CONTENTS.items():
        (tmp_path / name).write_bytes(content)


@pytest.mark.parametrize(("verb", "name", "message"), CASES)
def test_a_file_of_another_kind_is_told_with_the_verb_for_it(rmrc, verb, name, message):
    needed = {"statics": ["--wrench", "1,2,3"], "ik": ["--to", "1,1"]}
    code, out, err = rmrc(verb, name, *needed.get(verb, []))
    assert (code, out, err) == (2, "", f"rmrc: error: {name}: {message}\n")


CALLS = {
    "no verb": (["quick.yaml"], "No such command 'quick.yaml'; a verb comes first: rmrc run quick.yaml; see rmrc --help"),
    "a key as an option": (
        ["run", "quick.yaml", "--method", "damped"],
        "; a key of the scenario is set by --set control.inverse.method=VALUE; see rmrc run --help",
    ),
    "an option of another verb": (
        ["run", "quick.yaml", "--vary", "control.feedback=1,2"],
        "No such option: --vary; it is an option of compare and sweep; see rmrc run --help",
    ),
    "nothing": (["run"], "Missing argument 'scenario'; see rmrc run --help"),
    "no number": (["tune", "quick.yaml", "--copies", "x" * 500], "; see rmrc tune --help"),
}  # fmt: skip


@pytest.mark.parametrize("case", CALLS)
def test_a_wrong_call_is_one_line_and_a_hint(rmrc, case):
    arguments, end = CALLS[case]
    code, out, err = rmrc(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("rmrc: error: ") and err.count("\n") == 1 and len(err) < 300
    assert err.endswith(f"{end}\n")


STARTS = {
    "degrees": ("[60, -120]", [
        'quick.yaml:3:START: arm.start[0]: joint "shoulder" must start within its limits [-2.96706, 2.96706] rad, got 60; for degrees write 60 deg',
        'arm.start[1]: joint "elbow" must start within its limits [-2.79253, 2.79253] rad, got -120; for degrees write -120 deg',
    ]),
    "zero": ("zero", ['has no keyframe "zero"; its keyframes: home; write [0, 0] for all joints at zero']),
    "an angle": ("60 deg", ['has no keyframe "60 deg"; its keyframes: home; write [60 deg, 60 deg], a position for each joint']),
}  # fmt: skip


@pytest.mark.parametrize("case", STARTS)
def test_a_start_that_was_meant_otherwise_is_one_line_with_what_to_write(rmrc, tmp_path, case):
    start, ends = STARTS[case]
    (tmp_path / "quick.yaml").write_text(SCENARIO.replace("[60 deg, -120 deg]", start))
    code, out, err = rmrc("run", "quick.yaml")
    assert (code, out) == (2, "")
    lines = err.splitlines()
    assert len(lines) == len(ends)
    for line, end in zip(lines, ends, strict=True):
        assert line.startswith("rmrc: error: quick.yaml:3:") and line.endswith(
            end.partition("START: ")[2] or end
        )


@pytest.mark.parametrize("verb", [["run", "--no-record"], ["sweep", "--vary", "control.feedback=5,10"]])
def test_a_joint_without_limits_that_starts_beyond_a_turn_is_warned_of_once(rmrc, tmp_path, verb):
    limited = 'name="shoulder" range="-2.9670597 2.9670597"'
    whole = TWO.read_text("utf-8").replace("common/", f"{ROOT}/models/common/")
    assert limited in whole
    model = whole.replace(limited, 'name="shoulder" limited="false"')
    (tmp_path / "model.xml").write_text(model)
    text = SCENARIO.replace(str(TWO), "model.xml").replace("[60 deg, -120 deg]", "[60, -120 deg]")
    (tmp_path / "quick.yaml").write_text(text)
    code, _, err = rmrc(verb[0], "quick.yaml", *verb[1:], "-q")
    assert code == 0
    column = text.splitlines()[2].index("[") + 2
    assert err == (
        f"rmrc: warning: quick.yaml:3:{column}: arm.start[0]: 60 rad are 9.55 turns; for degrees write 60 deg\n"
    )
    _, _, err = rmrc("inspect", "model.xml", "--q", "60,0")
    assert "rmrc: warning: --q, shoulder: 60 rad are 9.55 turns; for degrees write 60 deg\n" in err
    _, _, err = rmrc("inspect", "model.xml", "--q", "60 rad,0")
    assert "turns" not in err


def test_a_model_that_is_only_named_is_found_in_the_folder_of_models(rmrc, tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "models/ur5e.xml").write_text("<mujoco/>")
    _, _, err = rmrc("run", "quick.yaml", "--set", "arm.model=ur5e")
    assert (
        err
        == f'rmrc: error: --set arm.model: no such file "{tmp_path}/ur5e"; did you mean "models/ur5e.xml"?\n'
    )
    _, _, err = rmrc("run", "quick.yaml", "--set", "arm.model=panda")
    assert err.endswith("/panda\"; give the path of an MJCF file, from the scenario's folder\n")
