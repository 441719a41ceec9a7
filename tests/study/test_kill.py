"""A sweep that is killed, or interrupted, goes on where it was: real processes, real signals."""

import os
import signal
import subprocess
import sys
import time

import pyarrow.dataset as ds
import pytest

from project import ROOT, told
from rmrc.study.sweep import Sweep

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.3, 0.2]}}}}]}}
sweep: {{draw: {{control.feedback: [1, 20]}}, samples: 600}}
"""


def started(path, out):
    """Start the verb, as a user would, but for a terminal; one thread, so that it takes its time."""
    words = ["-m", "rmrc", "sweep", str(path), "--out", str(out), "--threads", "1"]
    return subprocess.Popen(
        [sys.executable, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def wait_for(process, folder, parts):
    """Wait until so many batches are finished."""
    until = time.monotonic() + 240
    while len(list(folder.glob("part-*.parquet"))) < parts:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.005)


@pytest.mark.long  # test_resuming.py goes on with what is there, in one process
@pytest.mark.parametrize("interrupted", [False, True])
@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_killed_interrupted_and_gone_on_with_it_gives_the_file_of_one_go(tmp_path, interrupted):
    path = tmp_path / "quick.yaml"
    path.write_text(TEXT)
    Sweep(path, folder=tmp_path / "whole").run()
    folder, file = tmp_path / "out/quick.sweep", tmp_path / "out/quick.sweep.parquet"

    process = started(path, tmp_path / "out")
    wait_for(process, folder, 3)
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    kept = ds.dataset(folder).to_table()  # valid, and lost at most what was in flight
    done = len(list(folder.glob("part-*.parquet")))
    assert done >= 3
    assert 0 < len(kept) < 600
    stamps = {one: one.stat().st_mtime_ns for one in folder.glob("part-*.parquet")}

    if interrupted:
        process = started(path, tmp_path / "out")
        wait_for(process, folder, done + 2)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=240)
        assert process.returncode == 130
        rows = ds.dataset(folder).count_rows()
        assert rows < 600
        assert told(err) == f"rmrc: interrupted after {rows} of 600 runs; rerun the command to resume\n"
        assert {one: one.stat().st_mtime_ns for one in stamps} == stamps  # what was done is not done again

    Sweep(path, folder=tmp_path / "out").run()
    assert file.read_bytes() == (tmp_path / "whole/quick.sweep.parquet").read_bytes()
    assert not folder.exists()
