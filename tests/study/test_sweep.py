"""A sweep: each row is what its run gives alone, whatever the threads, the batches and the interrupts."""

import json
import math

import numpy as np
import pyarrow.parquet as pq
import pytest

from project import ROOT, mostly_long
from rmrc.results.expectations import check
from rmrc.results.scorecard import scorecard
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.sweep import Sweep
from rmrc.study.swept import Swept
from rmrc.support.errors import ScenarioError
from wording import says

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg], encoder: {{deviation: 0.1 deg}}}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.004, 0.0]}}}}]}}
expect: {{joint_rate.peak: {{below: 0.05}}}}
sweep:
  vary:
    control.inverse.method: [damped, inverse]
    control.limits.rate: [null, 2.0]
    plant.wrench: [[0, 0, 0, 0, 0, 0], [0, 1.0e+15, 0, 0, 0, 0]]
  draw: {{control.feedback: [1, 20], "arm.start[0]": [59 deg, 61 deg]}}
  samples: 2
  repeat: 2
"""
RUNS = 2 * 2 * 2 * 2 * 2


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "quick.yaml"
    path.write_text(TEXT)
    return path


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """(sweep, its table)."""
    folder = tmp_path_factory.mktemp("swept")
    (folder / "quick.yaml").write_text(TEXT)
    sweep = Sweep(folder / "quick.yaml", folder=folder / "out", threads=1)
    counted = []
    sweep.run(counted.append)
    assert (sum(counted), len(sweep.dataset.done), len(sweep)) == (RUNS, RUNS, RUNS)
    assert [entry.name for entry in (folder / "out").iterdir()] == ["quick.sweep.parquet"]
    return sweep, pq.read_table(sweep.dataset.file)


def same(a, b):
    return a == b or (a is not None and b is not None and math.isnan(a) and math.isnan(b))


def test_each_row_has_the_bits_of_its_run_alone(swept):
    sweep, table = swept
    rows = table.to_pylist()
    assert [row["index"] for row in rows] == list(range(RUNS))
    path = sweep.dataset.file.parent.parent / "quick.yaml"
    for row in rows[::3]:
        prepared = prepare(load(path, [str(change) for change in sweep.plan.changes(row["index"])]))
        (run,) = Simulation([prepared]).run()
        card = scorecard(run)
        figures = {name: figure.value for name, figure in card.items() if name not in ("wall_time", "speed")}
        assert set(figures) <= set(row)
        assert [
            name
            for name, value in figures.items()
            if not (row[name] is None if value == "" else same(row[name], value))
        ] == []
        assert row["met"] == all(one.ok for one in check(card, sweep.scenario.expect))
    assert {row["met"] for row in rows} == {True, False}
    assert len({row["position_error.max"] for row in rows}) > 4  # negative control: the rows do differ


def test_a_run_that_diverges_is_a_row_like_others(swept):
    sweep, table = swept
    for row in table.to_pylist():
        pushed = row["plant.wrench"] == "[0, 1000000000000000.0, 0, 0, 0, 0]"
        assert row["status"] == ("diverged" if pushed else "complete")
        assert (row["divergence"] or "").startswith("diverged at tick" if pushed else "")
        assert (row["divergence"] is None) != pushed
    ends, extremes = Swept.of(sweep.dataset.file).sheets()
    assert ends.rows[:2] == [("complete", str(RUNS // 2)), ("diverged", str(RUNS // 2))]
    for name, least, first, most, last in extremes.rows:
        values = np.array(table[name.partition(" [")[0]].to_pylist())
        assert [float(least), float(most)] == pytest.approx([np.nanmin(values), np.nanmax(values)], 1e-3)
        assert [int(first), int(last)] == [np.nanargmin(values), np.nanargmax(values)]


def test_columns_are_typed_and_tell_unit_and_meaning(swept):
    sweep, table = swept
    schema = table.schema
    assert schema.names[:11] == [
        "index", "control.inverse.method", "control.limits.rate", "plant.wrench", "control.feedback",
        "arm.start[0]", "seed", "status", "divergence", "met", "joint_rate.peak",
    ]  # fmt: skip
    types = ["int64", "string", "double", "string", "double", "double", "int64", "string", "string", "bool"]
    assert [str(type_) for type_ in schema.types[:10]] == types
    assert table["control.limits.rate"].to_pylist()[:8] == [None] * 8
    assert schema.field("arm.start[0]").metadata[b"unit"] == b"rad or m"
    assert schema.field("control.feedback").metadata == {
        b"unit": b"1/s",
        b"meaning": b"K: feedback gain from pose error to twist",
    }
    assert schema.field("joint_rate.peak").metadata[b"unit"] == b"rad/s"
    assert str(schema.field("joint_rate.peak_joint").type) == "string"
    assert all(schema.field(name).metadata[b"meaning"] for name in schema.names)
    assert not {"wall_time", "speed"} & set(schema.names)
    assert json.loads(table["versions"][0].as_py())["rmrc"]


@pytest.mark.parametrize("threads", mostly_long([3, 2], 2))
def test_threads_change_no_bit_of_the_file(swept, path, tmp_path, threads):
    sweep, _ = swept
    other = Sweep(path, folder=tmp_path / "out", threads=threads)
    other.run()
    assert other.dataset.file.read_bytes() == sweep.dataset.file.read_bytes()


def test_a_scenario_that_is_edited_meanwhile_changes_no_row(swept, path, tmp_path):
    sweep = Sweep(path, folder=tmp_path)
    sweep.check()
    path.write_text("name: gone")
    sweep.run()
    assert sweep.dataset.file.read_bytes() == swept[0].dataset.file.read_bytes()


def test_what_is_wrong_with_any_run_is_told_at_once_and_nothing_starts(path, tmp_path):
    overrides = [
        "sweep.vary={control.feedback: [5, -1, -2], control.joint_weights: [null, [1.0]], task.axes: [[x, y]]}",
        "sweep.draw={}",
        "sweep.repeat=1",
    ]
    sweep = Sweep(path, overrides, tmp_path / "out")
    with pytest.raises(ScenarioError) as caught:
        sweep.check()
    run, vary = (
        "control.joint_weights=null, task.axes=[x, y]) and 1 more: --set sweep.vary: sweep.vary",
        "sweep.vary",
    )
    wanted = (
        "run 1 (control.feedback=5, control.joint_weights=[1.0], task.axes=[x, y]): "
        f"--set {vary}: {vary}.control.joint_weights: … 2 … (shoulder, elbow) … 1",
        f"run 2 (control.feedback=-1, {run}.control.feedback: … 0 … -1",
        f"run 4 (control.feedback=-2, {run}.control.feedback: … 0 … -2",
    )
    assert str(caught.value).splitlines() == list(map(says, wanted))
    assert not (tmp_path / "out").exists()


def test_a_problem_of_the_file_has_its_place_and_many_are_not_all_told(path, tmp_path):
    path.write_text(
        TEXT.replace("control.feedback: [1, 20]", "control.feedback: [-9, -8]").replace(
            "samples: 2", "samples: 22"
        )
    )
    with pytest.raises(ScenarioError) as caught:
        Sweep(path, folder=tmp_path / "out").check()
    problems = str(caught.value).splitlines()
    assert len(problems) == 21
    assert problems[0] == says(f"… {path}:12:28: sweep.draw.control.feedback: … 0 … -8.…")
    # of 22 samples 20 are told
    assert problems[-1] == says("… 2 more …")


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["sweep={}"], "--set sweep: … 2 runs … 1; … --vary control.inverse.method=damped,pseudoinverse"),
        # runs have this seed and the three behind it
        (["sweep.seed=9223372036854775805"],
         "… sweep: … 9223372036854775804 … 9223372036854775805; … sweep.seed"),
        (["arm.encoder.seed=9223372036854775807"],
         "… sweep: … 9223372036854775804 … 9223372036854775807; … sweep.seed"),
        (["sweep={draw: {control.feedback: [1, 2]}, samples: 99999999999999999999}"],
         "--set sweep: … 10000000 runs … 99999999999999999999; … sweep.samples or .repeat"),
        (["sweep.vary.name=[a, b]"], "--set sweep.vary.name: …"),
    ],
)  # fmt: skip
def test_a_plan_that_makes_no_sense_is_refused(path, tmp_path, overrides, line):
    with pytest.raises(ScenarioError) as caught:
        Sweep(path, overrides, tmp_path / "out")
    assert str(caught.value) == says(line.format(path=path))


def test_models_are_varied_too_and_a_joint_that_one_lacks_is_nan(path, tmp_path):
    models = f"[{ROOT}/models/planar_2link.xml, {ROOT}/models/planar_3link.xml, {ROOT}/models/none.xml]"
    sweep = f"sweep={{vary: {{arm.model: {models}}}}}"
    more = ["arm.start=home", "target.path=[{line: {by: [-0.004, 0.004]}}]"]
    with pytest.raises(ScenarioError, match=r'run 2 .* ".*/models/none.xml"'):
        Sweep(path, [*more, sweep], tmp_path / "out").check()
    work = Sweep(path, [*more, sweep.replace(f", {ROOT}/models/none.xml", "")], tmp_path / "out")
    work.run()
    two, three = pq.read_table(work.dataset.file).to_pylist()
    names = {name for name in two if name.startswith("joint_rate.") and name.count(".") == 2}
    lacking = {name for name in names if math.isnan(two[name])}
    assert lacking and lacking < names
    assert not any(math.isnan(three[name]) for name in names & lacking)
    assert (two["status"], three["status"]) == ("complete", "complete")


def test_the_offset_of_a_target_can_be_drawn_though_it_is_not_written(tmp_path):
    path = tmp_path / "quick.yaml"
    path.write_text(TEXT.partition("sweep:")[0].replace("by: [0.004, 0.0]", "to: [1.004, 0.0]"))
    draw = ["sweep.draw.target.offset[0]=[-0.002, 0.002]", "sweep.samples=3"]
    sweep = Sweep(path, draw, tmp_path / "out", threads=1)
    sweep.run()
    rows = pq.read_table(sweep.dataset.file).to_pylist()
    offsets = [row["target.offset[0]"] for row in rows]
    assert len(set(offsets)) == 3
    # at 0.25 m/s and less, a longer line takes longer
    assert [row["duration"] for row in sorted(rows, key=lambda row: row["target.offset[0]"])] == sorted(
        row["duration"] for row in rows
    )
    field = pq.read_schema(sweep.dataset.file).field("target.offset[0]")
    assert (str(field.type), field.metadata[b"unit"]) == ("double", b"m")
