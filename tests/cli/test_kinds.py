"""Files of another kind than a verb takes, and wrong calls: one line, which names the way out."""

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
}
CASES = [
    ("run", "plain", "… model … scenario; … `rmrc inspect plain` … `arm: {model: plain, site: ...}`"),
    ("sweep", "model.xml", "… model … scenario; … `rmrc inspect model.xml` …"),
    ("check", "quick.yaml", "… scenario … model; … `rmrc run quick.yaml`; … arm.model …"),
    ("run", "x.npz", "… columns of a run … scenario; … `rmrc plot x.npz`"),
    ("run", "x.parquet", "… rows of a sweep … scenario; … report x.parquet`"),
    ("run", "x.json", "… a scorecard, not a scenario; … Python … json.load"),
    ("inspect", "x.rrd", "… recording … model; … `rmrc replay x.rrd`"),
    ("replay", "quick.yaml", "… scenario … recording; … `rmrc run quick.yaml` …"),
    ("run", ".", "… folder … scenario; … quick.yaml"),
]


@pytest.fixture(autouse=True)
def files(tmp_path):
    for name, content in CONTENTS.items():
        (tmp_path / name).write_bytes(content)


@pytest.mark.parametrize(("verb", "name", "message"), CASES)
def test_a_file_of_another_kind_is_told_with_the_verb_for_it(rmrc, verb, name, message):
    assert rmrc(verb, name) == (2, "", says(f"rmrc: error: {name}: {message}\n"))


CALLS = {
    "no verb": (["quick.yaml"], "'quick.yaml'; … rmrc run quick.yaml; … rmrc --help"),
    "a key as an option": (["run", "quick.yaml", "--method", "x"], "; … --set KEY=VALUE; … rmrc run --help"),
    "an option of another verb": (
        ["run", "quick.yaml", "--vary", "control.feedback=1,2"], "--vary; … compare and sweep; … rmrc run --help",
    ),
    "no number": (["tune", "quick.yaml", "--perturbed", "x" * 500], "; … rmrc tune --help"),
}  # fmt: skip


@pytest.mark.parametrize("case", CALLS)
def test_a_wrong_call_is_one_line_and_a_hint(rmrc, case):
    arguments, end = CALLS[case]
    code, out, err = rmrc(*arguments)
    assert (code, out) == (2, "")
    assert err == says(f"rmrc: error: … {end}\n") and len(err) < 300


STARTS = {
    "[60, -120]": [
        'arm.start[0]: joint "shoulder" … [-2.96706, 2.96706] rad … 60; … 60 deg',
        'arm.start[1]: joint "elbow" … [-2.79253, 2.79253] rad … -120; … -120 deg',
    ],
    "zero": ['keyframe "zero" … home; … [0, 0] …'],
}


@pytest.mark.parametrize("start", STARTS)
def test_a_start_that_was_meant_otherwise_is_one_line_with_what_to_write(rmrc, tmp_path, start):
    (tmp_path / "quick.yaml").write_text(SCENARIO.replace("[60 deg, -120 deg]", start))
    code, out, err = rmrc("run", "quick.yaml")
    assert (code, out) == (2, "")
    assert err.splitlines() == [says(f"rmrc: error: quick.yaml:3:… {end}") for end in STARTS[start]]
