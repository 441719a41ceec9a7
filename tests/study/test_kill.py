"""A sweep that is interrupted, killed, or loses its scheduler goes on where it was: real processes."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pyarrow.dataset as ds
import pytest

from project import ROOT, told
from rmrc.study.sweep import Sweep

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(os.name != "posix", reason="signals"),
    pytest.mark.xdist_group("cluster"),
]

RUNS = 1200
TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.3, 0.2]}}}}]}}
sweep: {{draw: {{control.feedback: [1, 20]}}, samples: {RUNS}}}
"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "quick.yaml"
    path.write_text(TEXT)
    (tmp_path / "temporary").mkdir()
    return path


def started(path, *options):
    """Start the verb in a process group of its own, as a terminal does."""
    words = ["-m", "rmrc", "sweep", str(path), *options]
    return subprocess.Popen(
        [sys.executable, *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, cwd=path.parent,
        env={**os.environ, "TMPDIR": str(path.parent / "temporary")},
    )  # fmt: skip


def wait_for(process, folder, parts):
    """Wait until so many batches are finished."""
    until = time.monotonic() + 240
    while len(list(folder.glob("part-*.parquet"))) < parts:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.002)


def ended(process, timeout=240):
    """Return (exit code, stdout, stderr) once a verb has ended."""
    out, err = process.communicate(timeout=timeout)
    return process.returncode, out, told(err)


@pytest.mark.parametrize("how", [("--threads", "1"), ("--cluster", "local:2")])
def test_interrupted_with_its_group_then_killed_then_gone_on_with_gives_the_file_of_one_go(path, how):
    folder = path.parent / "recordings/quick.sweep"

    process = started(path, *how)
    wait_for(process, folder, 2)
    family = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
    connections = [connection for member in family for connection in member.net_connections()]
    listens = {each.laddr.ip for each in connections if each.status == psutil.CONN_LISTEN}
    assert listens == ({"127.0.0.1"} if "local:2" in how else set())
    os.killpg(process.pid, signal.SIGINT)
    code, out, err = ended(process)
    rows = ds.dataset(folder).count_rows()  # valid
    assert (code, out) == (130, "")
    assert err == f"rmrc: interrupted after {rows} of {RUNS} runs; rerun the command to resume\n"
    assert 0 < rows < RUNS
    stamps = {part: part.stat().st_mtime_ns for part in folder.glob("part-*.parquet")}

    process = started(path, *how)
    wait_for(process, folder, len(stamps) + 1)
    children = psutil.Process(process.pid).children(recursive=True)
    process.kill()
    process.communicate()
    _, alive = psutil.wait_procs(children, timeout=10)
    assert alive == []
    assert {part: part.stat().st_mtime_ns for part in stamps} == stamps  # what was done is not done again

    process = started(path, *how)
    code, out, err = ended(process)
    assert (code, err) == (0, "")
    Sweep(path, folder=path.parent / "whole").run()
    whole = (path.parent / "whole/quick.sweep.parquet").read_bytes()
    assert (path.parent / "recordings/quick.sweep.parquet").read_bytes() == whole
    assert not folder.exists()
