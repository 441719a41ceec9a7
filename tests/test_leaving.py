"""Files that a verb leaves: tried before anything moves; one that fails does not take the others along."""

import errno
import json
import os

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
    "run": (["run", "quick.yaml"], ["quick.rrd", "quick.json"]),
    "compare": (["compare", "quick.yaml", "--vary", "control.feedback=1,2"], ["quick.compare.npz"]),
    "sweep": (["sweep", "quick.yaml", "--vary", "control.feedback=1,2"], ["quick.sweep.parquet"]),
    "tune": (["tune", "quick.yaml"], ["quick.tune.yaml"]),
    "workspace": (["workspace", f"{ROOT}/models/planar_2link.xml"], ["planar_2link.workspace.png"]),
}


@pytest.mark.parametrize(
    ("verb", "name"), [(verb, name) for verb, (_, names) in VERBS.items() for name in names]
)
def test_a_directory_in_the_way_of_a_file_is_told_before_anything_moves(rmrc, quick, monkeypatch, verb, name):
    def moves(*_, **__):
        raise AssertionError("it moves")

    monkeypatch.setattr("rmrc.simulation.simulation.Simulation.step", moves)
    monkeypatch.setattr("rmrc.analysis.workspace.workspace.workspace", moves)
    (quick / "recordings" / name).mkdir(parents=True)
    arguments, _ = VERBS[verb]
    code, out, err = rmrc(*arguments)
    assert (code, out) == (2, "")
    reason = "… not a regular file… --out" if verb == "sweep" else "… directory"
    assert err == says(f"rmrc: error: recordings/{name}: {reason}\n")
    assert left(quick) == [name]


def test_a_folder_that_cannot_be_written_is_told_before_anything_moves(rmrc, quick, monkeypatch):
    access = os.access  # not by its mode, which root does not heed
    monkeypatch.setattr("os.access", lambda path, mode: not mode & os.W_OK and access(path, mode))
    assert rmrc("run", "quick.yaml") == (2, "", "rmrc: error: recordings/quick.rrd: permission denied\n")
    monkeypatch.undo()
    monkeypatch.chdir(quick)
    (quick / "file").write_text("")
    said = "rmrc: error: file/folder/quick.rrd: not a directory\n"
    assert rmrc("run", "quick.yaml", "--out", "file/folder") == (2, "", said)


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
    card, whole = (
        json.loads((quick / f"{folder}/quick.json").read_text()) for folder in ("recordings", "whole")
    )
    assert card["status"] == "complete"
    for name in ("joint_rate", "position_error", "ticks"):
        assert card["scorecard"][name] == whole["scorecard"][name]
    assert left(quick) == ["quick.json", "quick.npz"]


def test_arrays_that_cannot_be_written_do_not_take_scorecard_and_recording_along(rmrc, quick, monkeypatch):
    def full(_, path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(Run, "save", full)
    code, out, err = rmrc("run", "quick.yaml")
    assert (code, err) == (2, "rmrc: error: recordings/quick.npz: no space left on device\n")
    assert "wrote recordings/quick.rrd\nwrote recordings/quick.json\n" in out
    assert left(quick) == ["quick.json", "quick.rrd"]
