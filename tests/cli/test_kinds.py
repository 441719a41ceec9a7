"""Files of another kind than a verb takes: one line, which names the verb that does."""

import pytest

from project import ROOT
from wording import says

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
SCENARIO_VERBS = ("run", "compare", "sweep", "tune", "margins")
MODEL_VERBS = ("check", "new", "inspect", "statics", "ik", "workspace")
CASES = [
    *((verb, "model.xml", "… model … scenario; … `rmrc inspect model.xml` … `arm: {model: model.xml, site: ...}`") for verb in SCENARIO_VERBS),
    *((verb, "quick.yaml", "… scenario … model; … `rmrc run quick.yaml`; … arm.model …") for verb in MODEL_VERBS),
    ("run", "plain", "… model … scenario; … `rmrc inspect plain` … `arm: {model: plain, site: ...}`"),
    ("run", "named.xml.yaml", "… model … scenario; … `rmrc inspect named.xml.yaml` … `arm: {model: named.xml.yaml, site: ...}`"),
    ("run", "x.rrd", "… recording … scenario; … `rmrc replay x.rrd`"),
    ("run", "x.npz", "… columns of a run … scenario; … `rmrc plot x.npz`"),
    ("run", "x.parquet", "… rows of a sweep … scenario; … report x.parquet`"),
    ("run", "x.json", "… a scorecard, not a scenario; … Python … json.load"),
    ("run", "x.png", "… picture … scenario"),
    ("inspect", "x.rrd", "… recording … model; … `rmrc replay x.rrd`"),
    ("replay", "quick.yaml", "… scenario … recording; … `rmrc run quick.yaml` …"),
    ("replay", "model.xml", "… model … recording; … `rmrc inspect model.xml`"),
    ("run", ".", "… folder … scenario; … named.xml.yaml, quick.yaml"),
    ("inspect", ".", "… folder … model; … model.xml"),
]  # fmt: skip


@pytest.fixture(autouse=True)
def files(tmp_path):
    for name, content in CONTENTS.items():
        (tmp_path / name).write_bytes(content)


@pytest.mark.parametrize(("verb", "name", "message"), CASES)
def test_a_file_of_another_kind_is_told_with_the_verb_for_it(rmrc, verb, name, message):
    needed = {"statics": ["--wrench", "1,2,3"], "ik": ["--to", "1,1"]}
    code, out, err = rmrc(verb, name, *needed.get(verb, []))
    assert (code, out, err) == (2, "", says(f"rmrc: error: {name}: {message}\n"))


CALLS = {
    "no verb": (["quick.yaml"], "'quick.yaml'; … rmrc run quick.yaml; … rmrc --help"),
    "a key as an option": (
        ["run", "quick.yaml", "--method", "damped"],
        "; … --set control.inverse.method=VALUE; … rmrc run --help",
    ),
    "an option of another verb": (
        ["run", "quick.yaml", "--vary", "control.feedback=1,2"],
        "--vary; … compare and sweep; … rmrc run --help",
    ),
    "nothing": (["run"], "'scenario'; … rmrc run --help"),
    "no number": (["tune", "quick.yaml", "--perturbed", "x" * 500], "; … rmrc tune --help"),
}  # fmt: skip


@pytest.mark.parametrize("case", CALLS)
def test_a_wrong_call_is_one_line_and_a_hint(rmrc, case):
    arguments, end = CALLS[case]
    code, out, err = rmrc(*arguments)
    assert (code, out) == (2, "")
    assert err == says(f"rmrc: error: … {end}\n") and len(err) < 300


STARTS = {
    "degrees": ("[60, -120]", [
        'arm.start[0]: joint "shoulder" … [-2.96706, 2.96706] rad … 60; … 60 deg',
        'arm.start[1]: joint "elbow" … [-2.79253, 2.79253] rad … -120; … -120 deg',
    ]),
    "zero": ("zero", ['keyframe "zero" … home; … [0, 0] …']),
    "an angle": ("60 deg", ['keyframe "60 deg" … home; … [60 deg, 60 deg] …']),
}  # fmt: skip


@pytest.mark.parametrize("case", STARTS)
def test_a_start_that_was_meant_otherwise_is_one_line_with_what_to_write(rmrc, tmp_path, case):
    start, ends = STARTS[case]
    (tmp_path / "quick.yaml").write_text(SCENARIO.replace("[60 deg, -120 deg]", start))
    code, out, err = rmrc("run", "quick.yaml")
    assert (code, out) == (2, "")
    assert err.splitlines() == [says(f"rmrc: error: quick.yaml:3:… {end}") for end in ends]


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
    assert err == says(f"rmrc: warning: quick.yaml:3:{column}: arm.start[0]: 60 rad … 9.55 turns; … 60 deg\n")
    _, _, err = rmrc("inspect", "model.xml", "--q", "60,0")
    assert err.splitlines()[0] == says("rmrc: warning: --q, shoulder: 60 rad … 9.55 turns; … 60 deg")
    _, _, err = rmrc("inspect", "model.xml", "--q", "60 rad,0")
    assert "turns" not in err


def test_a_loop_that_is_slower_than_robots_is_warned_of(rmrc, tmp_path):
    (tmp_path / "quick.yaml").write_text(SCENARIO + "plant: {lag: [0.1, 8]}\n")
    code, _, err = rmrc("run", "quick.yaml", "--no-record", "-q", "--set", "plant.jitter=0.6")
    assert (code, err.splitlines()) == (0, [
        says("rmrc: warning: --set plant.jitter: 0.6 s … 0.6 ms write 0.0006"),
        says("rmrc: warning: quick.yaml:… plant.lag: 8 s … 8 ms write 0.008"),
    ])  # fmt: skip
    _, _, err = rmrc("run", "quick.yaml", "--no-record", "-q", "--set", "plant.lag=0.5")
    assert err == ""


def test_a_model_that_is_only_named_is_found_in_the_folder_of_models(rmrc, tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "models/ur5e.xml").write_text("<mujoco/>")
    _, _, err = rmrc("run", "quick.yaml", "--set", "arm.model=ur5e")
    assert err == says(f'rmrc: error: --set arm.model: … "{tmp_path}/ur5e"; … "models/ur5e.xml"…\n')
    _, _, err = rmrc("run", "quick.yaml", "--set", "arm.model=panda")
    assert err == says('rmrc: error: --set arm.model: … "… /panda"; … MJCF … scenario\'s folder\n')
