"""`rmrc.run`, `rmrc.compare`, `rmrc.sweep` and a baseline: each run is as it is alone; nothing is written unless asked."""

import json
import signal

import numpy as np
import pyarrow.parquet as pq
import pytest

import rmrc
import rrd
from project import ROOT
from rmrc.results.columns import COLUMNS
from rmrc.results.run import Run, read_runs
from rmrc.results.scorecard import scorecard
from rmrc.study.study import Study
from rmrc.study.sweep import Sweep
from wording import says

SHORT = f"""
name: short
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.05, 0.0]}}}}, {{line: {{by: [-0.05, 0.0]}}}}]}}
expect: {{position_error.max: {{below: 0.001}}}}
"""
DAMPINGS = [{"maximum": 0.5, "below": 2}, {"maximum": 0.01, "below": 2}]
VARY = {"control.inverse.method": ["damped", "inverse"], "control.inverse.damping": DAMPINGS}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Be in an empty folder, and see that nothing is left in it."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    yield
    assert list((tmp_path / "here").iterdir()) == []


def short():
    return rmrc.loads(SHORT)


def same(one, other):
    return all(one[name].tobytes() == other[name].tobytes() for name in one.columns)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_path_a_name_and_an_object_give_the_same_run_which_is_written_if_it_is_asked_for(tmp_path):
    scenario = rmrc.load(ROOT / "scenarios/line_tracking.yaml")
    assert scenario == rmrc.load("line_tracking")
    runs = [rmrc.run(each) for each in ("line_tracking", scenario)]
    assert same(*runs) and not same(runs[0], rmrc.run(scenario.set({"control.feedback": 21})))
    run = rmrc.run(short(), out=tmp_path / "out")
    assert names(tmp_path / "out") == ["short.json", "short.npz", "short.rrd"]
    assert same(Run.read(tmp_path / "out/short.npz"), run)


def test_each_variant_has_the_bits_of_its_scenario_run_alone_also_in_both_files_and_its_facts(tmp_path):
    runs = rmrc.compare(short(), VARY, out=tmp_path)
    labels = [
        f"{method}, {{maximum: {most}, below: 2}}" for method in ("damped", "inverse") for most in (0.5, 0.01)
    ]
    assert names(tmp_path) == ["here", "short.compare.json", "short.compare.npz", "short.compare.rrd"]
    saved = read_runs(tmp_path / "short.compare.npz")
    assert list(runs) == list(saved) == labels
    facts = json.loads((tmp_path / "short.compare.json").read_text())["variants"]
    for i, (label, known) in enumerate(zip(labels, facts, strict=True)):
        changes = {"control.inverse.method": label.split(",")[0], "control.inverse.damping": DAMPINGS[i % 2]}
        alone = rmrc.run(short().set(changes))
        recorded = rrd.table(tmp_path / "short.compare.rrd", rrd.prefix_of(label))
        for name in COLUMNS:
            for columns in (runs[label], saved[label], recorded):
                np.testing.assert_array_equal(columns[name], alone[name], strict=True)
        assert (known["label"], known["status"], known["divergence"]) == (label, "complete", None)
        assert known["scorecard"]["joint_rate"]["peak"] == np.abs(alone["qdot"]).max()
        assert [outcome["ok"] for outcome in known["expect"]] == [i > 0]
    assert len({run["q"].tobytes() for run in runs.values()}) == 3  # the inverse knows no damping


def test_sweep_gives_the_rows_of_the_verb_and_writes_them_if_it_is_asked_to(tmp_path):
    methods, done = {"control.inverse.method": ["inverse", "damped"]}, []
    random = {"control.feedback": (5, 40)}
    rows = rmrc.sweep(
        short(), methods, random=random, samples=3, seed=7, out=tmp_path / "out", on_runs=done.append
    )
    texts = ["sweep.vary.control.inverse.method=[inverse, damped]", "sweep.seed=7", "sweep.samples=3",
             "sweep.draw.control.feedback=[5, 40]", "sweep.sampler=random"]  # fmt: skip
    work = Sweep(short(), texts, tmp_path / "verb")
    work.run()
    for theirs in map(pq.read_table, (work.dataset.file, tmp_path / "out/short.sweep.parquet")):
        assert repr(rows.to_pylist()) == repr(theirs.to_pylist())  # NaN among them
        assert rows.schema.equals(theirs.schema)
    assert rows.num_rows == sum(done) == 6


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: rmrc.compare(short(), {"control.feedback": [5]}), "vary: … 2 variants … 1; … {…"),
        (lambda: rmrc.sweep(short(), {"control.feedback": [5, -5]}), "run 1 (control.feedback=-5): sweep.vary.control.feedback: … 0 … -5"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_before_anything_moves(call, line):
    with pytest.raises(rmrc.ScenarioError) as caught:
        call()
    assert str(caught.value) == says(line)


@pytest.mark.parametrize("verb", ["run", "compare"])
def test_an_interrupt_is_raised_once_the_files_are_there(tmp_path, monkeypatch, verb):
    step = Study.step

    def interrupted(*arguments):
        signal.raise_signal(signal.SIGINT)
        return step(*arguments)

    monkeypatch.setattr(Study, "step", interrupted)
    more = [{"control.feedback": [5, 20]}] if verb == "compare" else []
    with pytest.raises(KeyboardInterrupt):
        getattr(rmrc, verb)(short(), *more, out=tmp_path / "out")
    assert [name.rpartition(".")[2] for name in names(tmp_path / "out")] == ["json", "npz"]  # it has no tick


# 3 mm beyond full reach, from near it.
NEAR = f"""
name: near
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [5 deg, -10 deg]}}
task: {{axes: [x, y]}}
control: {{period: 0.005, limits: {{rate: 3.0, on_excess: scale}}, feedback: 20}}
target: {{path: [{{line: {{to: [2.003, 0.0]}}}}]}}
plant: {{kind: ideal}}
expect: {{joint_rate_cmd.peak: {{below: 3.001}}}}
"""
PLAIN = {"control.inverse.method": "inverse", "control.limits.on_excess": "none"}


def near(**more):
    return rmrc.loads(NEAR, "near.yaml").set(more)


def test_a_baseline_is_the_scenario_with_its_changes_and_leaves_the_scenario_as_it_is():
    run = rmrc.run(near(baseline=PLAIN))
    assert same(run, rmrc.run(near())) and same(run.baseline, rmrc.run(near(**PLAIN)))
    peak, of_scenario = (np.abs(each["qdot_cmd"]).max() for each in (run.baseline, run))
    assert peak > 3.001 > of_scenario  # of another rate limit
    changes = near(baseline={"arm.start[1]": -0.2})
    assert changes.changed(*changes.baseline_changes).arm.start[1] == -0.2
    assert not near().baseline_changes


def test_columns_and_facts_of_both_are_kept_and_the_exit_code_is_that_of_the_scenario(rmrc, tmp_path):
    (tmp_path / "near.yaml").write_text(NEAR + f"baseline: {json.dumps(PLAIN)}\n")
    code, out, err = rmrc("run", "near.yaml")
    folder = tmp_path / "recordings"
    assert code == 0 and "missed" not in err  # the baseline would miss what is expected
    run, facts = Run.read(folder / "near.npz"), json.loads((folder / "near.json").read_text())
    its = facts["baseline"]
    assert "expect" not in its and its["changes"] == PLAIN and its["status"] == "complete"
    for each, told in ((run, facts), (run.baseline, its)):
        peak = float(scorecard(each)["joint_rate_cmd.peak"].value)
        assert told["scorecard"]["joint_rate_cmd"]["peak"] == peak == np.abs(each["qdot_cmd"]).max()
    assert facts["verdict"] == run.verdict and run.verdict in " ".join(out.split())
    row = next(line for line in out.splitlines() if line.startswith("joint_rate_cmd.peak "))
    assert float(row.split()[-1]) == pytest.approx(np.abs(run.baseline["qdot_cmd"]).max(), rel=1e-3)
    recorded = rrd.table(folder / "near.rrd", "baseline/")
    for name, column in run.baseline.columns.items():
        np.testing.assert_array_equal(recorded[name], column)


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ({"control.inverse.metod": "x"}, 'baseline.control.inverse.metod: … key … "method"?'),
        ({"task.axes": ["x", "y", "rz"], **PLAIN}, 'baseline.control.inverse.method: "inverse" … 3 axes … 2 joints…'),
        ({"target.path": [{"line": {"to": [9, 9, 9, 9]}}]}, "baseline.target.path: target.path[0].line.to: … [9, 9, 9, 9]"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_baseline_is_told_in_one_line_before_anything_moves(written, told):
    with pytest.raises(rmrc.ScenarioError) as caught:
        rmrc.run(near(baseline=written))
    assert str(caught.value) == says(told)
