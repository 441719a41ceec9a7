"""A comparison: its runs are those of `run`, and its files say so."""

import json

import numpy as np
import pytest

import rrd
from project import ROOT
from rmrc.results.columns import COLUMNS
from rmrc.results.run import read_runs
from rmrc.results.scorecard import scorecard
from rmrc.scenario import load, variants
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.run import Job

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.05, 0.0]}}}}, {{line: {{by: [-0.05, 0.0]}}}}]}}
expect: {{position_error.max: {{below: 0.001}}}}
"""
GRID = (
    "control.inverse.method=damped,inverse",
    "control.inverse.damping={maximum: 0.5, below: 2},{maximum: 0.01, below: 2}",
)
SET = ["control.feedback=11", "name=other"]


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """(path of the scenario, finished job)."""
    folder = tmp_path_factory.mktemp("compared")
    (folder / "quick.yaml").write_text(TEXT)
    counted = []
    job = Job(folder / "quick.yaml", folder / "new" / "out", variants=variants(GRID), overrides=SET)
    job.run(counted.append)
    assert sum(counted) == sum(one.reference.ticks for one in job.worlds)
    return folder / "quick.yaml", job


def test_each_variant_has_the_bits_of_its_scenario_run_alone_also_in_both_files(compared):
    path, job = compared
    much, little = "{maximum: 0.5, below: 2}", "{maximum: 0.01, below: 2}"
    labels = [f"{method}, {damping}" for method in ("damped", "inverse") for damping in (much, little)]
    saved = read_runs(job.files[1])
    assert list(job.runs) == list(saved) == labels
    for variant in job.variants:
        (alone,) = Simulation([prepare(load(path, [*SET, *map(str, variant.changes)]))]).run()
        recorded = rrd.table(job.files[0], rrd.prefix_of(variant.label))
        for name in COLUMNS:
            for columns in (job.runs[variant.label], saved[variant.label], recorded):
                np.testing.assert_array_equal(columns[name], alone[name], strict=True)
    assert len({run["q"].tobytes() for run in job.runs.values()}) == 3  # the inverse knows no damping


def test_the_files_are_named_after_the_scenario_and_have_the_facts_of_each_variant(compared):
    path, job = compared
    folder = path.parent / "new" / "out"
    assert job.files == [folder / f"other.compare{kind}" for kind in (".rrd", ".npz", ".json")]
    assert sorted(folder.iterdir()) == sorted(job.files)
    assert not (job.interrupted or job.failures)
    facts = json.loads(job.files[2].read_text())
    assert (facts["name"], facts["overrides"]) == ("other", SET)
    assert {"python", "rmrc", "mujoco"} < set(facts["versions"])
    expected = [[False], [True], [True], [True]]
    for variant, one, known, met in zip(job.variants, job.results, facts["variants"], expected, strict=True):
        assert (known["label"], known["overrides"]) == (variant.label, [str(one) for one in variant.changes])
        assert (known["status"], known["divergence"]) == ("complete", None)
        assert known["scorecard"]["joint_rate"]["peak"] == np.abs(one.run["qdot"]).max()
        closed = scorecard(one.run)["return.joint_change"].value
        assert known["scorecard"]["return"]["joint_change"] == closed
        assert [outcome["ok"] for outcome in known["expect"]] == met
        assert known["scenario"] == one.prepared.scenario.model_dump(mode="json")


def test_variants_may_have_different_arms_and_be_of_different_length(tmp_path):
    (tmp_path / "quick.yaml").write_text(TEXT.replace("start: [60 deg, -120 deg]", "start: home"))
    models = f"arm.model={ROOT}/models/planar_2link.xml,{ROOT}/models/planar_3link.xml"
    varied = [models, "target.limits.velocity=0.25,0.05"]
    job = Job(tmp_path / "quick.yaml", tmp_path, record=False, variants=variants(varied))
    job.run()
    assert [run["q"].shape[1] for run in job.runs.values()] == [2, 2, 3, 3]
    assert len(set(map(len, job.runs.values()))) > 1
    assert [path.suffix for path in job.files] == [".npz", ".json"]
