"""Files that a verb leaves: tried before anything moves; one that fails does not take the others along."""

import pytest
from numpy.testing import assert_array_equal

from project import ROOT
from rmrc.results.columns import COLUMNS
from rmrc.results.run import Run
from wording import says

SCENARIO = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{hold: {{for: 3}}}}, {{line: {{by: [0.05, 0.0]}}}}]}}
"""


@pytest.fixture(autouse=True)
def quick(tmp_path):
    (tmp_path / "quick.yaml").write_text(SCENARIO)
    return tmp_path


def left(folder):
    return sorted(path.name for path in (folder / "recordings").rglob("*"))


VERBS = {
    "quick.json": ["run", "quick.yaml"],
    "quick.compare.npz": ["compare", "quick.yaml", "--vary", "control.feedback=1,2"],
    "quick.sweep.parquet": ["sweep", "quick.yaml", "--vary", "control.feedback=1,2"],
    "quick.tune.yaml": ["tune", "quick.yaml"],
    "planar_2link.workspace.png": ["workspace", f"{ROOT}/models/planar_2link.xml"],
}


@pytest.mark.parametrize("name", VERBS)
def test_a_directory_in_the_way_of_a_file_is_told_before_anything_moves(rmrc, quick, monkeypatch, name):
    def moves(*_, **__):
        raise AssertionError("it moves")

    monkeypatch.setattr("rmrc.simulation.simulation.Simulation.step", moves)
    monkeypatch.setattr("rmrc.analysis.workspace.workspace", moves)
    (quick / "recordings" / name).mkdir(parents=True)
    code, out, err = rmrc(*VERBS[name])
    assert (code, out) == (2, "")
    reason = "… not a regular file… --out" if VERBS[name][0] == "sweep" else "… directory"
    assert err == says(f"rmrc: error: recordings/{name}: {reason}\n")
    assert left(quick) == [name]


def test_a_recording_that_fails_midway_leaves_arrays_and_scorecard_of_the_whole_run(rmrc, quick, monkeypatch):
    def fails(_, path, *__):
        path.write_bytes(b"half of it")
        raise RuntimeError("a writer of rerun\nhas ended")

    rmrc("run", "quick.yaml", "-q", "--out", "whole")
    want = Run.read(quick / "whole/quick.npz")
    monkeypatch.setattr("rmrc.recording.recorder._write", fails)
    code, out, err = rmrc("run", "quick.yaml")
    said = "cannot write the recording: a writer of rerun has ended"
    assert (code, err) == (2, f"rmrc: error: recordings/quick.rrd: {said}\n")
    assert "wrote recordings/quick.npz\nwrote recordings/quick.json\n" in out
    assert "quick.rrd" not in out and "look at it" not in out
    run = Run.read(quick / "recordings/quick.npz")
    for name in COLUMNS:
        assert_array_equal(run[name], want[name])

    assert left(quick) == ["quick.json", "quick.npz"]
