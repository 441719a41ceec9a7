"""The verb `sweep`: options become the section of the file, tables say what came out, mistakes are a line each."""

import json
import shlex
import signal

import pyarrow.parquet as pq
import pytest

from project import ROOT
from rmrc.study import dask as cluster
from rmrc.study.sweep import Sweep
from wording import says

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.01, 0.0]}}}}]}}
expect: {{joint_rate.peak: {{below: 0.2}}}}
"""


@pytest.fixture(autouse=True)
def quick(tmp_path):
    (tmp_path / "quick.yaml").write_text(TEXT)


def test_a_grid_is_run_and_summed_up_and_a_printed_command_repeats_a_run(rmrc, tmp_path):
    grid = ["--vary", "control.feedback=5,10", "--vary", "control.inverse.method=damped,inverse"]
    code, out, err = rmrc("sweep", "quick.yaml", *grid, "--threads", "1")
    assert (code, err) == (0, "")
    rows = pq.read_table(tmp_path / "recordings/quick.sweep.parquet").to_pylist()
    assert [(row["control.feedback"], row["control.inverse.method"]) for row in rows] == [
        (5.0, "damped"), (5.0, "inverse"), (10.0, "damped"), (10.0, "inverse"),
    ]  # fmt: skip
    worst = max(rows, key=lambda row: (row["joint_rate.peak"], -row["index"]))["index"]
    lines = [" ".join(line.split()) for line in out.splitlines() if line.strip()]
    assert lines[:3] == ["quick: 4 runs", "complete 4", "all expectations met 4"]
    assert any(line.startswith("joint_rate.peak [rad/s] 0.") for line in lines)
    assert lines[-1] == "wrote recordings/quick.sweep.parquet"
    (repeats,) = (line for line in lines if line.startswith(f"run {worst}: "))
    words = shlex.split(repeats)
    assert rmrc(*words[words.index("run", 1) :])[0] == 0
    facts = json.loads((tmp_path / "recordings/quick.json").read_text())
    assert facts["scorecard"]["joint_rate"]["peak"] == rows[worst]["joint_rate.peak"]


def test_options_override_the_section(rmrc, tmp_path):
    section = (
        "sweep: {draw: {control.feedback: [1, 2]}, samples: 3, vary: {control.feedforward: [true, false]}}"
    )
    (tmp_path / "quick.yaml").write_text(TEXT + section)
    options = ["--sobol", "control.feedback=5..20", "--samples", "4", "--seed", "9", "--quiet"]
    assert rmrc("sweep", "quick.yaml", *options) == (0, "", "")
    rows = pq.read_table(tmp_path / "recordings/quick.sweep.parquet").to_pylist()
    assert [row["seed"] for row in rows] == [9, 10, 11, 12] * 2
    assert [row["control.feedforward"] for row in rows] == [True] * 4 + [False] * 4
    # Sobol's points are one in each quarter
    assert sorted(int((row["control.feedback"] - 5) / 3.75) for row in rows[:4]) == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ([], "quick.yaml:2:1: sweep: … 2 runs … 1; … --vary control.inverse.method=damped,pseudoinverse"),
        (["--random", "control.feedback=5"], "--random control.feedback=5: … KEY=LOW..HIGH … control.feedback=5..20"),
        (["--vary", "control.feedback=5,-6"], "run 1 (control.feedback=-6): --vary control.feedback: … 0 … -6"),
        (["--vary", "control.feedback=5,6", "--cluster", ""],  # of a variable of the shell that is not set
         "--cluster: … tcp://HOST:PORT or tls://HOST:PORT … local:N … ''"),
        (["--vary", "control.feedback=5,6", "--cluster", "local:2", "--threads", "2"], "--threads: … --cluster …"),
    ],
)  # fmt: skip
def test_bad_input_is_a_line_exit_2_and_nothing_is_run(rmrc, tmp_path, options, line):
    assert rmrc("sweep", "quick.yaml", *options) == (2, "", says(f"rmrc: error: {line}\n"))
    assert not list(tmp_path.rglob("*.parquet"))


def test_ctrl_c_keeps_what_ran_and_the_command_resumes(rmrc, monkeypatch):
    options = ("sweep", "quick.yaml", "--vary", "control.feedback=5,6")
    stopped = (130, "", "rmrc: interrupted after 0 of 2 runs; rerun the command to resume\n")

    def waits(*_):
        signal.raise_signal(signal.SIGINT)
        return iter(())

    with monkeypatch.context() as patch:
        patch.setattr(cluster, "results", waits)
        assert rmrc(*options, "--cluster", "local:1") == stopped
    with monkeypatch.context() as patch:
        patch.setattr(Sweep, "check", waits)
        assert rmrc(*options) == (130, "", "rmrc: interrupted\n")
    assert rmrc(*options)[0] == 0
