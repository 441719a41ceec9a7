"""What may be taken of memory: against files that say it; what runs take: against what the system counts."""

import math
import os
import re
import resource
import subprocess
import sys

import numpy as np
import pytest

from project import ROOT
from rmrc.results.columns import COLUMNS, widths
from rmrc.simulation.footprint import LIBRARIES, excess, footprint
from rmrc.simulation.prepare import prepare
from rmrc.support import memory
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


def test_it_is_what_the_machine_has_left(tmp_path):
    put(tmp_path, "proc/meminfo", "MemTotal: 16000000 kB\nMemFree: 1 kB\nMemAvailable:   8000000 kB\n")
    assert memory.room(tmp_path) == (8_000_000 * 1024, "the machine")


def test_without_proc_it_is_what_the_machine_has(tmp_path):
    assert memory.room(tmp_path).size == os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.parametrize(
    ("own", "files"),
    [
        (
            "0::/work.slice/run.scope\n",
            {
                "sys/fs/cgroup/work.slice/run.scope/memory.max": "max\n",
                "sys/fs/cgroup/work.slice/run.scope/memory.current": "1500000000\n",
                # the limit is that of the group around it, some of which is cached files
                "sys/fs/cgroup/work.slice/memory.max": "3000000000\n",
                "sys/fs/cgroup/work.slice/memory.current": "2000000000\n",
                "sys/fs/cgroup/work.slice/memory.stat": "anon 1\ninactive_file 500000000\n",
            },
        ),
        (
            "9:name=systemd:/\n4:cpu,memory:/docker/abc\n0::/\n",
            {  # in a container, the group's path is mostly not there, and its own is the root
                "sys/fs/cgroup/memory/docker/memory.limit_in_bytes": "9223372036854771712\n",  # none
                "sys/fs/cgroup/memory/memory.limit_in_bytes": "3000000000\n",
                "sys/fs/cgroup/memory/memory.usage_in_bytes": "2000000000\n",
                "sys/fs/cgroup/memory/memory.stat": "cache 7\ntotal_inactive_file 500000000\n",
            },
        ),
    ],
    ids=["version 2", "version 1"],
)
def test_it_is_what_the_limit_of_a_cgroup_leaves(tmp_path, own, files):
    put(tmp_path, "proc/meminfo", "MemAvailable: 8000000 kB\n")
    put(tmp_path, "proc/self/cgroup", own)
    for path, text in files.items():
        put(tmp_path, path, text)
    assert memory.room(tmp_path) == (3 * GB - 2 * GB + GB / 2, "the memory limit of its cgroup")


def test_it_is_what_ulimit_leaves(tmp_path, monkeypatch):
    assert memory.address_room(tmp_path).size == math.inf  # the tests run without
    monkeypatch.setattr(resource, "getrlimit", lambda _: (4 * GB, 4 * GB))
    put(tmp_path, "proc/self/statm", "250000 99 9 9 0 9 0\n")
    used = 250_000 * os.sysconf("SC_PAGE_SIZE")
    assert memory.address_room(tmp_path) == (4 * GB - used, "ulimit -v")


def test_the_least_counts_and_a_share_of_it_may_be_taken(monkeypatch):
    monkeypatch.setattr(memory, "room", lambda: memory.Room(10 * GB, "the machine"))
    monkeypatch.setattr(memory, "address_room", lambda: memory.Room(20 * GB, "ulimit -v"))
    assert memory.excess(8 * GB) is None
    said = "8.01 GB of memory, and 8 GB may be taken: 80% of the memory that the machine leaves"
    assert memory.excess(8.01 * GB) == said
    # what is hardly touched counts for ulimit only
    assert memory.excess(8 * GB, 8 * GB) is None
    said = "17 GB of memory, and 16 GB may be taken: 80% of the memory that ulimit -v leaves"
    assert memory.excess(8 * GB, 9 * GB) == said


@pytest.fixture
def small(monkeypatch, tmp_path):
    """Leave one gigabyte, and write the scenario."""
    monkeypatch.setattr(memory, "room", lambda: memory.Room(GB, "the machine"))
    (tmp_path / "long.yaml").write_text(BASE)


# 504 B a tick, by the definition of the columns: nine scalars, 32 of poses and twists, 9 n, 2 k.
LONG = 8_000_001
CASES = {
    "run": (["run", "long.yaml", "--no-record"], "6:10: control.slow.longest: … 80000010 ticks", 10 * LONG * 504),
    "without slow": (
        ["run", "long.yaml", "--no-record", "--set", "control.at_singularity=damp"],
        "5:16: target.path: … 8000001 ticks", LONG * 504,
    ),
    "compare": (
        ["compare", "long.yaml", "--no-record", "--vary", "control.feedback=1,2", "--set", "control.at_singularity=damp"],
        "5:16: target.path: … 8000001 ticks … 2 runs", 2 * LONG * 504,
    ),
    "tune": (["tune", "long.yaml"], "6:10: control.slow.longest: … 80000010 ticks", 10 * LONG * 504),
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


def test_a_sweep_counts_the_runs_at_a_time(rmrc, tmp_path, monkeypatch):
    (tmp_path / "long.yaml").write_text(BASE.replace("8000", "20"))
    # a run holds 20 001 ticks of 504 B and a world: 10.3 MB; two are too much
    monkeypatch.setattr("rmrc.simulation.footprint.LIBRARIES", 0)
    monkeypatch.setattr(memory, "room", lambda: memory.Room(16e6, "the machine"))
    options = (
        "sweep",
        "long.yaml",
        "--vary",
        "control.feedback=1,2",
        "--set",
        "control.slow.longest=1",
        "-q",
    )
    code, out, err = rmrc(*options, "--threads", "2")
    assert (code, out) == (2, "") and not (tmp_path / "recordings").exists()
    wanted = "20001 ticks … 2 … 21 MB … 12.8 MB … 80% … machine …; … control.period … --threads"
    assert err == says(f"rmrc: error: long.yaml:5:16: target.path: … {wanted}\n")
    assert rmrc(*options, "--threads", "1") == (0, "", "")


def test_a_wrench_that_is_held_for_too_long_is_refused(rmrc, monkeypatch):
    monkeypatch.setattr(memory, "room", lambda: memory.Room(GB / 2, "the machine"))
    model = str(ROOT / "models/planar_2link.xml")
    code, out, err = rmrc("statics", model, "--wrench", "0,1,0", "--hold", "1000")
    assert (code, out) == (2, "")
    assert err == says("rmrc: error: --hold: 1000001 ticks … shorter time\n")


@pytest.mark.parametrize(
    ("options", "least"),
    [
        # nodes of a grid of 7200 by 7200: their images, two numbers each, alone
        (["planar_2link.xml", "--cells", "2000"], 7200**2 * 16),
        (["puma560.xml", "--cells", "2000"], 2000**2 * 6 * 8),  # a configuration of six joints for each cell
        (["planar_2link.xml", "--over", "shoulder,elbow", "--cells", "2000"], 2001**2 * 2 * 8),
    ],
)
def test_a_map_that_does_not_fit_is_refused(rmrc, tmp_path, monkeypatch, options, least):
    monkeypatch.setattr(memory, "room", lambda: memory.Room(GB / 4, "the machine"))
    code, out, err = rmrc("workspace", str(ROOT / "models" / options[0]), *options[1:])
    assert (code, out) == (2, "") and not list(tmp_path.rglob("*.png"))
    size, unit = re.findall(r"([\d.]+) ([MG]B)", err)[0]
    assert float(size) * {"MB": 1e6, "GB": 1e9}[unit] >= least + LIBRARIES
    assert err == says("rmrc: error: --cells: 2000 … 200 MB … 80% … machine …; … fewer\n")


def test_memory_that_is_out_all_the_same_is_a_line(rmrc, tmp_path, monkeypatch):
    (tmp_path / "long.yaml").write_text(BASE.replace("8000", "0.1"))

    def out_of_memory(*_):
        raise MemoryError("Unable to allocate 55.4 GiB for an array")

    monkeypatch.setattr("rmrc.simulation.simulation.World", out_of_memory)
    said = says("rmrc: error: … memory (Unable to allocate 55.4 GiB for an array); … memory\n")
    assert rmrc("run", "long.yaml") == (2, "", said)


def test_more_steps_than_a_day_has_are_refused(rmrc, tmp_path):
    (tmp_path / "long.yaml").write_text(BASE)
    code, _, err = rmrc(
        "run", "long.yaml", "--set", "plant.timestep=1.0e-8", "--set", "control.slow.longest=2"
    )
    assert code == 2
    wanted = "1.6e+12 … 1e-08 s … 1e+10; … target.path … control.slow.longest"
    assert err == says(f"rmrc: error: --set plant.timestep: … {wanted}\n")


# Not by `getrusage`, which begins with the peak of the process that started this one.
PROGRAM = """
import re
from pathlib import Path
from rmrc import scenario
from rmrc.simulation.footprint import LIBRARIES, footprint
{load}

def peak():
    return 1024 * int(re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1])

before = peak()
work.compile()
work.run()
print(peak() - before, LIBRARIES + footprint({prepared}, recorded={recorded})[0])
"""
RUN = 'from rmrc.study.run import Job; work = Job(scenario.load(Path("long.yaml"), {overrides}), Path("out"), {recorded})'
COMPARE = (
    "from rmrc.study.run import Job; "
    'work = Job(Path("long.yaml"), Path("out"), {recorded}, scenario.variants(["control.feedback=1,2,3"]), {overrides})'
)


@pytest.mark.long
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc")
@pytest.mark.parametrize("recorded", [False, True])
@pytest.mark.parametrize("load", [RUN, COMPARE], ids=["run", "compare"])
@pytest.mark.parametrize("seconds", [2, 200])
def test_runs_take_no_more_than_their_estimate_and_more_than_a_third_of_it(tmp_path, load, recorded, seconds):
    (tmp_path / "long.yaml").write_text(BASE)
    overrides = ["control.at_singularity=damp", f"target.path=[{{hold: {{for: {seconds}}}}}]"]
    program = PROGRAM.format(
        load=load.format(overrides=overrides, recorded=recorded),
        prepared="work.worlds",
        recorded=recorded,
    )
    for _ in range(2):  # compiling, which only the first may do, takes more
        done = subprocess.run(
            [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True
        )
    grown, estimate = map(int, done.stdout.split()[-2:])
    assert grown <= estimate
    # of a short run it is almost all libraries, more or less of which were loaded before
    assert estimate <= 3 * grown or seconds == 2


def test_an_hour_of_six_joints_fits_into_what_a_laptop_has(scenario, monkeypatch):
    # 3.6 million ticks of 856 B
    monkeypatch.setattr(memory, "room", lambda: memory.Room(8 * GB, "the machine"))
    prepared = prepare(
        scenario("arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home", "task.axes=[x, y, z, rx, ry, rz]",
                 "target.path=[{hold: {for: 3600}}]")
    )  # fmt: skip
    assert excess(footprint([prepared], recorded=True)) is None
    assert 3.0 * GB < footprint([prepared])[0] < 3.2 * GB


def test_a_tick_has_as_many_numbers_as_the_columns_of_a_run(simulate):
    _, run = simulate("target.path=[{hold: {for: 0.01}}]")
    assert widths(2, 2, 2) == {name: np.size(run[name][0]) for name in COLUMNS}


def test_worlds_whose_columns_are_not_kept_take_that_of_the_largest_in_each_thread(scenario):
    short, long = (prepare(scenario(f"target.path=[{{hold: {{for: {time}}}}}]")) for time in (0.1, 100))
    without = footprint([long], keep_columns=False)
    assert (footprint([short, long], keep_columns=False) == without).all()
    assert (footprint([short, long]) == footprint([short]) + footprint([long])).all()
    two = footprint([short, long], keep_columns=False, threads=4)
    assert (two == 2 * without).all()
    assert without[0] > long.most_ticks * sum(widths(2, 2, 0).values()) * 8
