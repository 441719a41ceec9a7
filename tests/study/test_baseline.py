"""A baseline runs beside its scenario, is what its changes say, and changes nothing of the scenario."""

import json

import numpy as np
import pytest

import rmrc
from project import ROOT
from rmrc.recording.single import read_columns
from rmrc.results.run import Run
from rmrc.results.scorecard import scorecard
from rmrc.study.run import Job
from wording import says

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


def same(one, other):
    return all(one[name].tobytes() == other[name].tobytes() for name in one.columns)


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
    row = next(line for line in out.splitlines() if line.startswith("joint_rate_cmd "))
    assert float(row.split()[-1]) == pytest.approx(np.abs(run.baseline["qdot_cmd"]).max(), rel=1e-3)
    recorded = read_columns(folder / "near.rrd", baseline=True)
    for name, column in run.baseline.columns.items():
        np.testing.assert_array_equal(recorded[name], column)


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ({"control.inverse.metod": "x"}, 'baseline.control.inverse.metod: … key … "method"?'),
        ({"task.axes": ["x", "y", "rz"], **PLAIN}, 'baseline.control.inverse.method: "inverse" … 3 axes … 2 joints…'),
        ({"target.path": [{"line": {"to": [9, 9, 9, 9]}}]}, "baseline.target.path: target.path[0].line.to: … [9, 9, 9, 9]"),
        ({"sweep.repeat": 1}, "baseline.sweep.repeat: … cannot be changed…"),
        ({"plant[0": 1}, "baseline.plant[0: is not a key …"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_baseline_is_told_in_one_line_before_anything_moves(written, told):
    with pytest.raises(rmrc.ScenarioError) as caught:
        rmrc.run(near(baseline=written))
    assert str(caught.value) == says(told)


def test_comparisons_and_sweeps_leave_it_out():
    vary = {"control.feedback": [5, 10]}
    assert len(Job(near(baseline=PLAIN), variants=rmrc.scenario.grid(vary)).worlds) == 2
    rows = [rmrc.sweep(each, vary) for each in (near(baseline=PLAIN), near())]
    assert repr(rows[0].to_pylist()) == repr(rows[1].to_pylist())
