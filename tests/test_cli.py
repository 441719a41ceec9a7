"""The command line: what it leaves, what it says, and its exit codes."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

import rrd
from processes import TELLS_OF_TICKS
from project import ROOT
from rmrc.results.columns import COLUMNS
from rmrc.results.run import Run
from wording import says

QUICK = """
name: quick
arm: {model: MODELS/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
target: {path: [{line: {by: [0.05, 0.0]}}]}
expect: {position_error.max: {below: 0.001}}
""".replace("MODELS", str(ROOT / "models"))


@pytest.fixture(autouse=True)
def quick(tmp_path):
    (tmp_path / "quick.yaml").write_text(QUICK)


def test_run_leaves_recording_columns_and_scorecard(rmrc, tmp_path):
    code, out, err = rmrc("run", "quick.yaml")
    assert (code, err) == (0, "")
    assert "position_error" in out and "joint_rate" in out
    folder = tmp_path / "recordings"
    assert sorted(p.name for p in folder.iterdir()) == ["quick.json", "quick.npz", "quick.rrd"]
    run = Run.read(folder / "quick.npz")
    assert run.is_complete and set(run.columns) == set(COLUMNS)
    facts = json.loads((folder / "quick.json").read_text())
    assert facts["status"] == "complete"
    assert facts["scenario"]["control"]["inverse"]["method"] == "damped"
    assert facts["expect"][0]["ok"] is True
    assert set(facts["versions"]) == {"python", "rmrc", "mujoco", "numba", "numpy", "ruckig", "rerun-sdk"}
    peak = np.abs(run["qdot"]).max()
    assert facts["scorecard"]["joint_rate"]["peak"] == pytest.approx(peak, rel=1e-12)


def test_no_record_and_out_and_set_and_quiet(rmrc, tmp_path):
    code, out, err = rmrc("run", "quick.yaml", "--no-record", "--out", "a/b", "--set", "name=other", "-q")
    assert (code, out, err) == (0, "", "")
    assert sorted(p.name for p in (tmp_path / "a/b").iterdir()) == ["other.json", "other.npz"]


def test_a_missed_expectation_exits_1_and_says_by_how_much(rmrc, tmp_path):
    code, _, err = rmrc(
        "run",
        "quick.yaml",
        "--no-record",
        "--set",
        "expect={ticks: {equals: 3, within: 1}, duration: {above: 0.1}}",
    )
    assert code == 1
    ticks = len(Run.read(tmp_path / "recordings/quick.npz"))
    assert err == f"rmrc: missed: ticks: expected 3 within 1, got {ticks}, {ticks - 4} too high\n"


def test_a_path_that_was_not_finished_is_told(rmrc, tmp_path):
    slow = ("--set", "control.at_singularity=slow", "--set", "control.limits.rate=0.05")
    code, out, err = rmrc("run", "quick.yaml", "-q", "--no-record", *slow, "--set", "control.slow.longest=1")
    run = Run.read(tmp_path / "recordings/quick.npz")
    assert 0.0 < run.completed < 1.0 and len(run) == run.planned
    assert json.loads((tmp_path / "recordings/quick.json").read_text())["status"] == "unfinished"
    assert (code, out) == (0, "")
    share = f"{run.completed:.0%}"
    assert err == says(f"rmrc: quick … {share} … path … {len(run)} ticks … control.slow.longest …\n")


def test_divergence_exits_3_with_tick_time_and_joint_and_keeps_what_it_has(rmrc, tmp_path):
    code, _, err = rmrc("run", "quick.yaml", "--no-record", "--set", "plant.wrench=[0, 1.0e+15, 0, 0, 0, 0]")
    assert code == 3
    run = Run.read(tmp_path / "recordings/quick.npz")
    # The undefined figures of so short a run are misses as well, but divergence is the graver news.
    assert err.splitlines()[-1] == f"rmrc: error: quick {run.divergence}"
    assert json.loads((tmp_path / "recordings/quick.json").read_text())["status"] == "diverged"


MISTAKES = {
    "two at once": (
        ["control.inverse.methd=inverse", "plant.kv=-1"],
        ['--set control.inverse.methd: … key … "method"…', "--set plant.kv: … 0 … -1"],
    ),
    "site": (["arm.site=tpi"], ['--set arm.site: {model}: … site "tpi" … "tip"… tip']),
    "start outside limits": (
        ["arm.start=[400, 40000 deg]"],
        [
            '--set arm.start: arm.start[0]: joint "shoulder" … [-2.96706, 2.96706] rad … 400',
            '--set arm.start: arm.start[1]: joint "elbow" … [-2.79253, 2.79253] rad … 698.132',
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_one_line_each_and_exit_2_before_anything_moves(rmrc, tmp_path, case):
    settings, lines = MISTAKES[case]
    code, out, err = rmrc("run", "quick.yaml", *[word for text in settings for word in ("--set", text)])
    assert (code, out) == (2, "")
    model = str(ROOT / "models/planar_2link.xml")
    assert err.splitlines() == [says(f"rmrc: error: {line.format(model=model)}") for line in lines]
    assert not (tmp_path / "recordings").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "quik.yaml"], 'quik.yaml: … file … "quick.yaml"…'),
        (["run", "quick.yaml", "--out", "quick.yaml"], "quick.yaml/quick.rrd: not a directory"),
        (["run", "quick.yaml", "--out", "quick.yaml/x"], "quick.yaml/x/quick.rrd: not a directory"),
    ],
)
def test_a_file_that_will_not_do_is_one_line(rmrc, arguments, message):
    code, out, err = rmrc(*arguments)
    assert (code, out) == (2, "")
    assert err == says(f"rmrc: error: {message}\n")


VARY = ("--vary", "control.inverse.method=inverse,damped")


def test_compare_leaves_recording_facts_and_pictures_and_prints_a_row_for_each_variant(rmrc, tmp_path):
    code, out, err = rmrc(
        "compare", "quick.yaml", *VARY, "--set", "control.inverse.damping={maximum: 0.5, below: 2}"
    )
    assert (code, err) == (0, "")
    rows = [line.split() for line in out.splitlines()]
    variants = [cells[0] for cells in rows if cells[:1] in (["inverse"], ["damped"])]
    assert variants[:2] == ["inverse", "damped"]
    ends = {cells[0]: cells[-1] for cells in rows if cells}  # of the last table
    assert (ends["inverse"], ends["damped"]) == ("met", "1")  # the command damps too much
    files = [f"quick.compare.{kind}" for kind in ("rrd", "npz", "json")]
    assert [cells[1] for cells in rows if cells[:1] == ["wrote"]] == [f"recordings/{name}" for name in files]
    assert sorted(p.name for p in (tmp_path / "recordings").iterdir()) == sorted(files)
    assert out.splitlines()[-1] == "look at it: rmrc replay recordings/quick.compare.rrd"


def test_a_variant_that_diverges_exits_3_by_its_name_and_the_others_are_kept(rmrc, tmp_path):
    force = "plant.wrench=[0,0,0,0,0,0],[0,1.0e+15,0,0,0,0]"
    code, out, err = rmrc("compare", "quick.yaml", "--no-record", "--vary", force)
    assert code == 3
    facts = json.loads((tmp_path / "recordings/quick.compare.json").read_text())
    good, bad = facts["variants"]
    assert (good["status"], bad["status"]) == ("complete", "diverged")
    assert good["scorecard"]["completed"] == 1
    at = bad["divergence"]
    assert err == (
        'rmrc: error: variant "wrench=[0, 1000000000000000.0, 0, 0, 0, 0]" diverged at tick '
        f'{at["tick"]} ({at["time"]:.4f} s) at joint "{at["joint"]}": {at["reason"]}\n'
    )
    assert "diverged at" in out


METHODS = "control.inverse.method="
COMPARE_MISTAKES = {
    "no file: once, as it is wrong for all": (
        ["--set", "arm.model=none.xml", "--vary", f"{METHODS}inverse,damped"],
        ['--set arm.model: … "{here}/none.xml"'],
    ),
    "some variants": (
        ["--vary", f"{METHODS}inverse,dampd", "--vary", "plant.kv=1,-1,-2"],
        [
            'variant "inverse, -1" and 1 more: --vary plant.kv: … 0 … -1',
            'variant "inverse, -2" and 1 more: --vary plant.kv: … 0 … -2',
            'variant "dampd, 1" and 2 more: --vary control.inverse.method: … "dampd" … "damped"…',
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", COMPARE_MISTAKES)
def test_mistakes_of_all_variants_are_told_at_once_before_anything_moves(rmrc, tmp_path, case):
    arguments, lines = COMPARE_MISTAKES[case]
    code, out, err = rmrc("compare", "quick.yaml", *arguments)
    assert (code, out) == (2, "")
    names = {"model": str(ROOT / "models/planar_2link.xml"), "here": str(tmp_path)}
    wanted = sorted(says(f"rmrc: error: {line.format(**names)}") for line in lines)
    assert sorted(err.splitlines()) == wanted
    assert not (tmp_path / "recordings").exists()


def test_a_reader_that_has_enough_is_no_error():
    piped = f"{sys.executable} -m rmrc schema --json | head -1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", piped], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("{\n", "")
    assert done.returncode in (0, 141)  # 0 where the pipe took all before head had enough


def test_ctrl_c_exits_130_and_leaves_readable_files(tmp_path):
    (tmp_path / "long.yaml").write_text(QUICK.replace("name: quick", "name: long"))
    process = subprocess.Popen(
        [sys.executable, "-c", TELLS_OF_TICKS, "run", "long.yaml", "--set", "target.path=[{hold: {for: 600}}]"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip
    assert process.stdout.readline() == "moves\n", process.communicate()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=240)
    assert process.returncode == 130, err
    assert "rmrc: interrupted at tick " in err and "Traceback" not in err
    run = Run.read(tmp_path / "recordings/long.npz")
    assert 0 < len(run) < run.planned
    np.testing.assert_array_equal(rrd.table(tmp_path / "recordings/long.rrd")["q"], run["q"])
    assert json.loads((tmp_path / "recordings/long.json").read_text())["status"] == "interrupted"
    assert sorted(p.name for p in (tmp_path / "recordings").iterdir()) == [
        "long.json",
        "long.npz",
        "long.rrd",
    ]


def test_a_command_to_copy_begins_as_the_program_was_called(tmp_path):
    """A fresh clone has no `rmrc` that a shell finds: what is printed after `python -m rmrc` must work as it is."""
    words = ["run", f"{ROOT}/scenarios/line_tracking.yaml"]
    done = subprocess.run(
        [sys.executable, "-m", "rmrc", *words], cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("look at it: "))
    assert line == f"look at it: {sys.executable} -m rmrc replay recordings/line_tracking.rrd"
