"""What the program wrote, and what it is given, is read or refused in one line: never a traceback, never a wait."""

import os
import random
import shutil
import signal
import threading

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import project
import rmrc as package
from project import ROOT

SCENARIO = f"""
name: u
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
control: {{period: 0.01, feedback: 5}}
target: {{path: [{{line: {{by: [0.05, 0.0]}}}}], limits: {{velocity: 0.5}}}}
plant: {{kind: ideal}}
"""
# For each file: the verb that reads it, and the file that is damaged beside it.
READERS = {
    "u.npz": ["report", "u.npz"],
    "u.json": ["report", "u.json"],
    "u.npz plotted": ["plot", "u.npz", "-o", "plot.png"],
    "u.sweep.parquet": ["report", "u.sweep.parquet"],
    "u.tune.parquet": ["report", "u.tune.parquet"],
    "log.parquet": ["identify", "log.parquet"],
    "log.csv": ["identify", "log.csv"],
    "log.npz": ["identify", "log.npz"],
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return a folder with an output of each verb, and a log in each format."""
    folder = tmp_path_factory.mktemp("written")
    (folder / "u.yaml").write_text(SCENARIO)
    with pytest.MonkeyPatch.context() as patch, project.undrawn():
        patch.chdir(folder)
        package.run("u.yaml", out=".", record=False)
        package.sweep("u.yaml", {"control.feedback": [2, 5]}, out=".")
        package.tune("u.yaml", runs=30, perturbed=0, out=".")
    time = np.arange(0.0, 2.0, 0.01)
    log = {"t": time, "q0": 0.1 * np.sin(3 * (time - 0.05)), "qdot_cmd0": 0.3 * np.cos(3 * time)}
    pq.write_table(pa.table(log), folder / "log.parquet")
    np.savez(folder / "log.npz", **log)
    rows = [",".join(log), *(",".join(map(str, row)) for row in zip(*log.values(), strict=True))]
    (folder / "log.csv").write_text("\n".join(rows))
    return folder


@pytest.fixture
def copied(written, tmp_path):
    shutil.copytree(written, tmp_path, dirs_exist_ok=True)
    return tmp_path


def damages(data, seed):
    """Yield damaged copies: cut, with bytes of noise, with a stretch of zeros, with another text inside."""
    chance = random.Random(seed)
    for _ in range(4):
        at, noisy = chance.randrange(len(data)), bytearray(data)
        yield data[:at]
        yield data[:at] + bytes(50) + data[at + 50 :]
        for _ in range(20):
            noisy[chance.randrange(len(data))] = chance.randrange(256)
        yield bytes(noisy)
        yield data.replace(b"1", b"[]", chance.randrange(1, 9)).replace(b'"name"', b'"nema"')


@pytest.mark.parametrize("name", READERS)
def test_a_whole_file_is_read_and_a_damaged_one_gives_one_line(name, copied, rmrc):
    file, arguments = copied / name.split()[0], READERS[name]
    data = file.read_bytes()
    code, _, err = rmrc(*arguments)
    assert code in (0, 1), err  # 1: a log without a delay
    noticed = 0
    for damaged in damages(data, name):
        file.write_bytes(damaged)
        code, out, err = rmrc(*arguments)
        assert code in (0, 1, 2), err
        noticed += code == 2 or "left out" in " ".join(out.split())  # cells of a log that are no number
        if code == 2:
            assert err.startswith("rmrc: error: ") and err.count("\n") == 1 and file.stem in err
    assert noticed > 5  # the test damages what is read


PIPED = [
    ["report", "pipe.npz"], ["identify", "pipe.csv"],
    ["run", "pipe.yaml"], ["check", "pipe.xml"],
    ["sweep", "u.yaml", "--vary", "control.feedback=2,5", "--out", "pipes"],
]  # fmt: skip


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
@pytest.mark.parametrize("arguments", PIPED, ids=" ".join)
def test_a_pipe_in_place_of_a_file_is_refused_and_never_waited_for(arguments, copied, rmrc):
    for suffix in ("npz", "csv", "parquet", "yaml", "xml", "urdf"):
        os.mkfifo(copied / f"pipe.{suffix}")
    (copied / "pipes").mkdir()
    os.mkfifo(copied / "pipes" / "u.sweep.parquet")
    guard = threading.Timer(
        60, os.kill, (os.getpid(), signal.SIGINT)
    )  # a wait fails the test instead of the suite
    guard.start()
    try:
        code, _, err = rmrc(*arguments)
    finally:
        guard.cancel()
    assert code == 2 and err.count("\n") == 1 and ("pipe." in err or "pipes" in err), err
