"""A comparison: its runs are those of `run`, and its files say so."""

import json

import numpy as np
import pytest

from project import ROOT, undrawn
from rmrc.recording.single import read_columns
from rmrc.results.columns import COLUMNS
from rmrc.results.scorecard import scorecard
from rmrc.scenario import load, variants
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.compare import Comparison

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
    """(path of the scenario, left)."""
    folder = tmp_path_factory.mktemp("compared")
    (folder / "quick.yaml").write_text(TEXT)
    counted = []
    comparison = Comparison(folder / "quick.yaml", variants(GRID), SET, folder / "new" / "out")
    with undrawn():
        left = comparison.run(counted.append)
    assert sum(counted) == comparison.ticks
    return folder / "quick.yaml", left


def test_each_variant_has_the_bits_of_its_scenario_run_alone(compared):
    path, left = compared
    for one in left.results:
        (alone,) = Simulation([prepare(load(path, [*SET, *map(str, one.variant.changes)]))]).run()
        for name in COLUMNS:
            np.testing.assert_array_equal(one.run[name], alone[name], strict=True)
    assert len({one.run["q"].tobytes() for one in left.results}) == 3  # the inverse knows no damping


def test_results_are_complete_and_in_the_order_of_the_grid(compared):
    _, left = compared
    labels = [one.variant.label for one in left.results]
    much, little = "{maximum: 0.5, below: 2}", "{maximum: 0.01, below: 2}"
    assert labels == [
        f"{method}, {damping}" for method in ("damped", "inverse") for damping in (much, little)
    ]
    assert {one.status for one in left.results} == {"complete"}
    assert [[outcome.ok for outcome in one.outcomes] for one in left.results] == [[False], [True], [], []]
    assert not left.interrupted


def test_the_files_are_named_after_the_scenario_and_all_there(compared):
    path, left = compared
    folder = path.parent / "new" / "out"
    names = [f"other.compare{kind}" for kind in (".rrd", ".npz", ".json", ".png", ".svg")]
    assert list(left.files) == [folder / name for name in names]
    assert sorted(folder.iterdir()) == sorted(left.files)


def test_the_recording_has_every_variant(compared):
    _, left = compared
    for one in left.results:
        columns = read_columns(left.files[0], one.variant.label)
        for name in COLUMNS:
            np.testing.assert_array_equal(columns[name], one.run[name], strict=True)


def test_the_facts_are_those_of_each_variant(compared):
    path, left = compared
    facts = json.loads(left.files[2].read_text())
    assert (facts["name"], facts["overrides"]) == ("other", SET)
    assert {"python", "rmrc", "mujoco", "matplotlib"} < set(facts["versions"])
    for known, one in zip(facts["variants"], left.results, strict=True):
        assert known["label"] == one.variant.label
        assert known["overrides"] == [str(change) for change in one.variant.changes]
        assert (known["status"], known["divergence"]) == ("complete", None)
        figures = scorecard(one.run)
        assert known["scorecard"]["joint_rate"]["peak"] == np.abs(one.run["qdot"]).max()
        assert known["scorecard"]["return"]["joint_change"] == figures["return.joint_change"].value
        assert [outcome["ok"] for outcome in known["expect"]] == [outcome.ok for outcome in one.outcomes]
        expected = load(path, [*SET, *map(str, one.variant.changes)])
        assert known["scenario"] == prepare(expected).scenario.model_dump(mode="json")


@pytest.mark.usefixtures("undrawn")
def test_variants_may_have_different_arms_and_be_of_different_length(tmp_path):
    (tmp_path / "quick.yaml").write_text(TEXT.replace("start: [60 deg, -120 deg]", "start: home"))
    models = f"arm.model={ROOT}/models/planar_2link.xml,{ROOT}/models/planar_3link.xml"
    varied = [models, "target.limits.velocity=0.25,0.05"]
    left = Comparison(tmp_path / "quick.yaml", variants(varied), folder=tmp_path, record=False).run()
    assert [one.run["q"].shape[1] for one in left.results] == [2, 2, 3, 3]
    assert len({len(one.run) for one in left.results}) > 1
    assert [path.suffix for path in left.files] == [".npz", ".json", ".png", ".svg"]


@pytest.fixture
def without_pictures(monkeypatch):
    """They take longer than the runs."""
    monkeypatch.setattr(Comparison, "_draw", lambda *_: [])


def counted(path, varied, overrides=()):
    """Return of each variant the names of the expectations that count, and what the others were stated for."""
    left = Comparison(path, variants(varied), overrides, path.parent, record=False).run()
    return {
        one.variant.label: ([outcome.name for outcome in one.outcomes], dict(one.stated_for))
        for one in left.results
    }


SHORT = TEXT.replace("{by: [0.05, 0.0]}}, {line: {by: [-0.05, 0.0]}", "{by: [0.01, 0.0]}")
EXPECTED = ["position_error.max"]


@pytest.mark.usefixtures("without_pictures")
@pytest.mark.parametrize(
    ("key", "as_written", "others"),
    [
        ("control.inverse.method", "damped", "inverse,jparse"),
        ("control.inverse.damping.schedule", "smallest_singular_value", "constant"),
        ("control.nullspace.objective", "none", "joint_limits"),
        ("control.limits.on_excess", "scale", "clamp"),
        ("control.at_singularity", "damp", "slow"),
    ],
)
def test_what_is_expected_of_one_law_is_not_counted_for_others(tmp_path, key, as_written, others):
    (tmp_path / "quick.yaml").write_text(SHORT)
    wanted = {as_written: (EXPECTED, {})} | {one: ([], {key: as_written}) for one in others.split(",")}
    assert counted(tmp_path / "quick.yaml", [f"{key}={as_written},{others}"]) == wanted
    facts = json.loads((tmp_path / "quick.compare.json").read_text())["variants"]
    assert [one["expected_of_others"] for one in facts] == [stated for _, stated in wanted.values()]
    assert [len(one["expect"]) for one in facts] == [len(names) for names, _ in wanted.values()]


@pytest.mark.usefixtures("without_pictures")
def test_numbers_of_the_same_law_are_held_against_what_is_expected_of_it(tmp_path):
    (tmp_path / "quick.yaml").write_text(SHORT)
    found = counted(tmp_path / "quick.yaml", ["control.feedback=1,40"])
    assert found == {"feedback=1": (EXPECTED, {}), "feedback=40": (EXPECTED, {})}


@pytest.mark.usefixtures("without_pictures")
def test_expectations_of_a_file_are_for_its_own_law_and_those_of_the_command_for_all(tmp_path):
    path = tmp_path / "quick.yaml"
    path.write_text(SHORT)
    other = {"control.inverse.method": "damped"}
    found = counted(path, ["control.feedback=5,6"], ["control.inverse.method=inverse"])
    assert list(found.values()) == [([], other)] * 2
    asked = ["control.inverse.method=inverse", "expect.joint_rate.peak={below: 9}"]
    found = counted(path, ["control.feedback=5,6"], asked)
    assert list(found.values()) == [(["joint_rate.peak"], other)] * 2
    # what a file lacks is given by the command: nothing is left that the file could mean
    path.write_text(SHORT.replace(f"model: {ROOT}/models/planar_2link.xml, ", ""))
    model = f"arm.model={ROOT}/models/planar_2link.xml"
    found = counted(path, ["control.feedback=5,6"], [model, "control.inverse.method=inverse"])
    assert list(found.values()) == [(EXPECTED, {})] * 2
