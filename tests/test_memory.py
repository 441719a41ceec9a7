"""What may be taken of memory: against files that say it."""

import math
import re

import pytest

from project import ROOT
from rmrc.simulation.footprint import LIBRARIES
from rmrc.support import process
from wording import says

GB = 10**9
BASE = f"""
name: long
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{hold: {{for: 8000}}}}]}}
control: {{at_singularity: slow, limits: {{rate: 1}}}}
"""


def put(root, path, text):
    file = root / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)


def test_it_is_what_the_limit_of_a_container_leaves(tmp_path):
    put(tmp_path, "proc/meminfo", "MemAvailable: 8000000 kB\n")
    put(tmp_path, "sys/fs/cgroup/memory.max", "3000000000\n")
    put(tmp_path, "sys/fs/cgroup/memory.current", "2000000000\n")
    put(tmp_path, "sys/fs/cgroup/memory.stat", "anon 1\ninactive_file 500000000\n")  # cached files
    assert process.room(tmp_path) == (3 * GB - 2 * GB + GB / 2, "the container")
    put(tmp_path, "sys/fs/cgroup/memory.max", "max\n")
    assert process.room(tmp_path).bound == "the machine"
    assert process.room(tmp_path / "nothing").size == math.inf


@pytest.fixture
def small(monkeypatch, tmp_path):
    """Leave one gigabyte, and write the scenario."""
    monkeypatch.setattr(process, "room", lambda: process.Room(GB, "the machine"))
    (tmp_path / "long.yaml").write_text(BASE)


# 504 B a tick, by the definition of the columns: nine scalars, 32 of poses and twists, 9 n, 2 k.
LONG = 8_000_001
CASES = {
    "run": (["run", "long.yaml", "--no-record"], "6:10: control.slow.longest: … 80000010 ticks", 10 * LONG * 504),
    "compare": (
        ["compare", "long.yaml", "--no-record", "--vary", "control.feedback=1,2", "--set", "control.at_singularity=damp"],
        "5:16: target.path: … 8000001 ticks … 2 runs", 2 * LONG * 504,
    ),
}  # fmt: skip


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", CASES)
def test_what_does_not_fit_is_refused_before_anything_moves(rmrc, tmp_path, name):
    arguments, said, most = CASES[name]
    code, out, err = rmrc(*arguments)
    assert (code, out) == (2, "")
    assert err == says(f"rmrc: error: long.yaml:{said} … 800 MB … 80% … machine …; …\n")
    size, unit = re.findall(r"([\d.]+) ([MG]B)", err)[0]
    need = float(size) * {"MB": 1e6, "GB": 1e9}[unit]
    assert most <= need <= 3 * most + LIBRARIES
    assert not list(tmp_path.rglob("*.npz")) and not list(tmp_path.rglob("*.parquet"))
