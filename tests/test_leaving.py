"""Files that a verb leaves: tried before anything moves; one that fails does not take the others along."""

import errno
import json
import os
import shutil
import subprocess
import sys
from collections import namedtuple

import pytest
from numpy.testing import assert_array_equal

from project import ROOT
from rmrc.recording.stream import RecordingError, Stream
from rmrc.results.columns import COLUMNS
from rmrc.results.leaving import array_size
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
    "run": (["run", "quick.yaml"], ["quick.rrd", "quick.npz", "quick.json"]),
    "compare": (
        ["compare", "quick.yaml", "--vary", "control.feedback=1,2"],
        [f"quick.compare{kind}" for kind in (".rrd", ".npz", ".json")],
    ),
    "sweep": (["sweep", "quick.yaml", "--vary", "control.feedback=1,2"], ["quick.sweep.parquet"]),
    "tune": (["tune", "quick.yaml"], ["quick.tune.yaml", "quick.tune.png", "quick.tune.parquet"]),
    "workspace": (
        ["workspace", f"{ROOT}/models/planar_2link.xml"],
        ["planar_2link.workspace.png", "planar_2link.workspace.npz"],
    ),
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
    reason = "… sweep… --out" if verb == "sweep" else "… directory"
    assert err == says(f"rmrc: error: recordings/{name}: {reason}\n")
    assert left(quick) == [name]


def test_a_folder_that_cannot_be_written_is_told_before_anything_moves(rmrc, quick, monkeypatch):
    # not by its mode, which root does not heed: the system's answer is put in
    def touch(self, *_, **__):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))

    monkeypatch.setattr("pathlib.Path.touch", touch)
    said = "rmrc: error: recordings/quick.rrd: permission denied\n"
    assert rmrc("run", "quick.yaml") == (2, "", said)
    monkeypatch.undo()
    monkeypatch.chdir(quick)
    (quick / "file").write_text("")
    code, out, err = rmrc("run", "quick.yaml", "--out", "file/folder")
    assert (code, out) == (2, "") and err in (
        "rmrc: error: file/folder: not a directory\n",
        "rmrc: error: file/folder/quick.rrd: not a directory\n",
    )


def test_a_disk_without_room_for_the_arrays_is_told_before_anything_moves(rmrc, quick, monkeypatch):
    rmrc("run", "quick.yaml", "--no-record", "-q", "--out", "first")
    run = Run.read(quick / "first/quick.npz")
    arrays = sum(run[name].nbytes for name in COLUMNS)
    assert array_size(len(run), 2, 2, 2) == arrays <= (quick / "first/quick.npz").stat().st_size
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**9, 10**9 - arrays + 1, arrays - 1))
    code, out, err = rmrc("run", "quick.yaml")
    assert (code, out) == (2, "") and left(quick) == []
    size = f"{arrays / 1e6:.3g} MB"
    assert err == (
        f"rmrc: error: recordings/quick.rrd: takes {size} at least, and the disk has {size} free; free some space, give another folder with --out"
        ", or shorten target.path\n"
    )
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**9, 10**9 - arrays, arrays))
    assert rmrc("run", "quick.yaml", "-q") == (0, "", "")


def fails_from(call, monkeypatch):
    """Have the disk full from the n-th piece on."""
    flush, calls = Stream.flush, []

    def full(self):
        calls.append(self)
        if len(calls) >= call:
            raise RecordingError(f"{self.part_path}: cannot write the recording: is the disk full?")
        flush(self)

    monkeypatch.setattr(Stream, "flush", full)
    return calls


def test_a_recording_that_fails_midway_leaves_arrays_and_scorecard_of_the_whole_run(rmrc, quick, monkeypatch):
    rmrc("run", "quick.yaml", "-q", "--out", "whole")
    want = Run.read(quick / "whole/quick.npz")
    assert len(want) > 3000  # more than three pieces
    calls = fails_from(2, monkeypatch)
    code, out, err = rmrc("run", "quick.yaml")
    assert (code, len(calls)) == (2, 2)  # it is not tried again
    assert err == ("rmrc: error: recordings/quick.rrd.part: cannot write the recording: is the disk full?\n")
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
    assert left(quick) == ["quick.json", "quick.npz", "quick.rrd.part"]


def test_where_there_is_no_room_for_both_the_arrays_are_kept_and_not_half_a_recording(
    rmrc, quick, monkeypatch
):
    fails_from(2, monkeypatch)
    save, part = Run.save, quick / "recordings/quick.rrd.part"

    def full(self, path):
        if part.exists():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        save(self, path)

    monkeypatch.setattr(Run, "save", full)
    code, _, err = rmrc("run", "quick.yaml", "-q")
    assert code == 2 and err.count("\n") == 1 and "quick.rrd.part: cannot write" in err
    assert left(quick) == ["quick.json", "quick.npz"]


def test_arrays_that_cannot_be_written_do_not_take_scorecard_and_recording_along(rmrc, quick, monkeypatch):
    def full(_, path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(Run, "save", full)
    code, out, err = rmrc("run", "quick.yaml")
    assert (code, err) == (2, "rmrc: error: recordings/quick.npz: no space left on device\n")
    assert "wrote recordings/quick.rrd\nwrote recordings/quick.json\n" in out
    assert left(quick) == ["quick.json", "quick.rrd"]


def test_a_comparison_whose_recording_fails_midway_leaves_the_rest(rmrc, quick, monkeypatch):
    fails_from(3, monkeypatch)
    code, out, err = rmrc("compare", "quick.yaml", "--vary", "control.feedback=1,2")
    assert code == 2
    assert err == (
        "rmrc: error: recordings/quick.compare.rrd.part: cannot write the recording: is the disk full?\n"
    )
    assert out.endswith("".join(f"wrote recordings/quick.compare{kind}\n" for kind in (".npz", ".json")))
    facts = json.loads((quick / "recordings/quick.compare.json").read_text())
    assert [one["status"] for one in facts["variants"]] == ["complete"] * 2


def test_a_recording_that_lost_its_end_is_no_finished_one(rmrc, quick, monkeypatch):
    # As when the disk is full for what rerun writes last; it only logs that.
    def cut(stream, close=Stream.close):
        was_open = stream.is_open
        close(stream)
        if was_open:
            os.truncate(stream.part_path, stream.part_path.stat().st_size - 20)

    monkeypatch.setattr(Stream, "close", cut)
    code, _, err = rmrc("run", "quick.yaml")
    part = "recordings/quick.rrd.part"
    assert (code, err) == (
        2, f"rmrc: error: {part}: cannot write the recording: its end is missing; is the disk full?\n",
    )  # fmt: skip
    assert left(quick) == ["quick.json", "quick.npz", "quick.rrd.part"]


FULL = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most}))
from rmrc.cli import main
main()
"""


@pytest.mark.long  # rerun may first have to be waited for
def test_a_real_writer_that_can_go_no_further_costs_the_recording_alone(quick):
    # The system refuses to let a file grow further: the recording, which is larger than the arrays. Both are
    # measured first.
    where = ["run", "quick.yaml", "-q", "--set", "target.path=[{line: {by: [0.05, 0.05]}}]"]
    command = [sys.executable, "-m", "rmrc", *where, "--out", "whole"]
    subprocess.run(command, cwd=quick, check=True, timeout=120)
    recording, arrays = (
        (quick / "whole/quick").with_suffix(kind).stat().st_size for kind in (".rrd", ".npz")
    )
    assert recording > 1.2 * arrays
    code = FULL.format(most=int(1.05 * arrays))
    done = subprocess.run(
        [sys.executable, "-c", code, *where],
        cwd=quick,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("rmrc: error: recordings/quick.rrd.part: cannot write the recording: ")
    assert done.stderr.count("\n") == 1
    assert (quick / "recordings/quick.npz").stat().st_size <= 1.05 * arrays
    want = Run.read(quick / "whole/quick.npz")
    for name in COLUMNS:
        assert_array_equal(Run.read(quick / "recordings/quick.npz")[name], want[name])
