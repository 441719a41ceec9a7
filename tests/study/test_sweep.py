"""A sweep: each row is what its run gives alone, whatever the threads and the interrupts; it resumes from its rows."""

import json
import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

from project import ROOT
from rmrc.results.expectations import check
from rmrc.results.scorecard import scorecard
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.dataset import read_table
from rmrc.study.sweep import Sweep, Swept
from rmrc.support.errors import RmrcError, ScenarioError
from wording import says

TEXT = """
name: quick
arm: {model: arm.xml, site: tip, start: [60 deg, -120 deg], encoder: {deviation: 0.1 deg}}
task: {axes: [x, y]}
target: {path: [{line: {by: [0.004, 0.0]}}]}
expect: {joint_rate.peak: {below: 0.05}}
sweep:
  vary:
    control.inverse.method: [damped, inverse]
    control.limits.rate: [null, 2.0]
    plant.wrench: [[0, 0, 0, 0, 0, 0], [0, 1.0e+15, 0, 0, 0, 0]]
  draw: {control.feedback: [1, 20], "arm.start[0]": [59 deg, 61 deg]}
  samples: 2
  repeat: 2
"""
RUNS = 2 * 2 * 2 * 2 * 2


def fail(_):
    pytest.fail("a run was started")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Return a scenario beside its model, which includes a file."""
    folder = tmp_path_factory.mktemp("project")
    (folder / "common").mkdir()
    shutil.copy(ROOT / "models/common/world.xml", folder / "common/world.xml")
    shutil.copy(ROOT / "models/planar_2link.xml", folder / "arm.xml")
    (folder / "quick.yaml").write_text(TEXT)
    return folder / "quick.yaml"


@pytest.fixture(scope="module")
def swept(path):
    """(sweep by one thread, its table)."""
    sweep, counted = Sweep(path, folder=path.parent / "out", threads=1), []
    sweep.run(counted.append)
    assert (sum(counted), len(sweep.dataset.done), len(sweep)) == (RUNS, RUNS, RUNS)
    assert [entry.name for entry in (path.parent / "out").iterdir()] == ["quick.sweep.parquet"]
    return sweep, pq.read_table(sweep.dataset.file)


def test_each_row_has_the_bits_of_its_run_alone(swept, path):
    sweep, table = swept
    rows = table.to_pylist()
    assert [row["index"] for row in rows] == list(range(RUNS))
    for row in rows[::5]:
        prepared = prepare(load(path, [str(change) for change in sweep.plan.changes(row["index"])]))
        card = scorecard(Simulation([prepared]).run()[0])
        figures = {name: figure.value for name, figure in card.items() if name not in ("wall_time", "speed")}
        for name, value in figures.items():
            np.testing.assert_equal(row[name], None if value == "" else value)  # NaN among them
        assert row["met"] == all(one.ok for one in check(card, sweep.scenario.expect))
    assert {row["met"] for row in rows} == {True, False}
    assert len({row["position_error.max"] for row in rows}) > 4  # negative control: the rows do differ


def test_a_run_that_diverges_is_a_row_like_others_and_tables_sum_up(swept):
    sweep, table = swept
    for row in table.to_pylist():
        pushed = row["plant.wrench"] == "[0, 1000000000000000.0, 0, 0, 0, 0]"
        assert row["status"] == ("diverged" if pushed else "complete")
        assert (row["divergence"] is not None) == pushed
    swept = Swept.of(sweep.dataset.file)
    assert swept.varied == [*sweep.plan.vary, *sweep.plan.draw]
    ends, extremes = swept.sheets()
    assert ends.rows[:2] == [("complete", str(RUNS // 2)), ("diverged", str(RUNS // 2))]
    for name, least, first, most, last in extremes.rows:
        values = np.array(table[name.partition(" [")[0]].to_pylist())
        assert [float(least), float(most)] == pytest.approx([np.nanmin(values), np.nanmax(values)], 1e-3)
        assert [int(first), int(last)] == [np.nanargmin(values), np.nanargmax(values)]


def test_columns_are_typed_and_tell_unit_and_meaning(swept):
    schema, table = swept[1].schema, swept[1]
    types = {"index": "int64", "control.inverse.method": "string", "control.limits.rate": "double",
             "plant.wrench": "string", "control.feedback": "double", "arm.start[0]": "double", "seed": "int64",
             "status": "string", "divergence": "string", "met": "bool"}  # fmt: skip
    assert dict(zip(schema.names[:10], map(str, schema.types), strict=False)) == types
    assert table["control.limits.rate"].to_pylist()[:8] == [None] * 8
    units = {"arm.start[0]": "rad or m", "control.feedback": "1/s", "joint_rate.peak": "rad/s"}
    assert {name: schema.field(name).metadata[b"unit"].decode() for name in units} == units
    assert all(schema.field(name).metadata[b"meaning"] for name in schema.names)
    assert json.loads(table["versions"][0].as_py())["rmrc"]


def test_threads_and_edits_meanwhile_change_no_bit_and_a_sweep_resumes_from_its_rows(swept, path, tmp_path):
    rows = swept[1].to_pylist()
    begun = Sweep(path, folder=tmp_path)
    begun.check()
    for some in (rows[:5], rows[9:20:2]):
        begun.dataset.add(some)
    (begun.dataset.folder / "notes.txt").write_text("mine")
    sweep, counted = Sweep(path, folder=tmp_path, threads=3), []
    sweep.check()
    assert len(sweep.dataset.done) == 11
    path.write_text("name: gone")
    try:
        sweep.run(counted.append)
    finally:
        path.write_text(TEXT)
    assert (sum(counted), len(sweep.dataset.done)) == (RUNS - 11, RUNS)
    assert sweep.dataset.file.read_bytes() == swept[0].dataset.file.read_bytes()
    assert [entry.name for entry in begun.dataset.folder.iterdir()] == ["notes.txt"]  # of others, and kept
    Sweep(path, folder=tmp_path).run(fail)


def refused(path, folder, *overrides):
    """Return what the same command says."""
    with pytest.raises((RmrcError, OSError)) as caught:
        Sweep(path, overrides, folder, threads=1).run(fail)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_another_sweep_in_the_same_place_and_a_damaged_part_are_refused(swept, path, tmp_path):
    begun = Sweep(path, folder=tmp_path)
    begun.check()
    begun.dataset.add(swept[1].to_pylist()[:5])
    assert refused(path, tmp_path, "sweep.seed=5") == says(f"{tmp_path}/quick.sweep…: … (sweep … --out")
    assert refused(path, tmp_path, "control.limits.jerk=900") == says(
        f"{tmp_path}/quick.sweep…: … (control … --out"
    )
    world = path.with_name("common") / "world.xml"
    text = world.read_text()
    world.write_text(text.replace("<mujoco", "<!-- changed --><mujoco", 1))
    try:
        assert refused(path, tmp_path) == says(f"{begun.dataset.folder}/…: … (files … --out")
    finally:
        world.write_text(text)
    (part,) = begun.dataset.folder.iterdir()
    data = part.read_bytes()
    for damaged in (b"", data[: len(data) // 2], b"\0" * len(data)):
        part.write_bytes(damaged)
        assert refused(path, tmp_path) == says(f"{part}: … --out")
    part.write_bytes(data)
    assert len(Sweep(path, folder=tmp_path).dataset.done) == 5  # negative control
    (tmp_path / "quick.sweep.parquet").write_text("mine")
    assert refused(path, tmp_path) == says(f"{tmp_path}/quick.sweep.parquet: … --out")


def test_the_name_of_a_folder_need_not_be_utf_8(swept, path, tmp_path):
    begun, rows = Sweep(path, folder=tmp_path / "\udced"), swept[1].to_pylist()
    begun.check()
    begun.dataset.add(rows[:5])
    again = Sweep(path, folder=tmp_path / "\udced").dataset
    assert len(again.done) == 5
    again.add(rows[5:])
    again.merge()
    assert read_table(again.file)["index"].to_pylist() == [*range(RUNS)]


def test_what_is_wrong_with_any_run_is_told_at_once_and_nothing_starts(path, tmp_path):
    vary = "{control.feedback: [5, -1, -2], control.joint_weights: [null, [1.0]], task.axes: [[x, y]]}"
    with pytest.raises(ScenarioError) as caught:
        Sweep(path, [f"sweep.vary={vary}", "sweep.draw={}", "sweep.repeat=1"], tmp_path / "out").check()
    wanted = (
        "run 1 (control.feedback=5, control.joint_weights=[1.0]…: … sweep.vary.control.joint_weights: … 2 … 1",
        "run 2 (control.feedback=-1, … and 1 more: --set sweep.vary: sweep.vary.control.feedback: … 0 … -1",
        "run 4 (control.feedback=-2, … and 1 more: --set sweep.vary: sweep.vary.control.feedback: … 0 … -2",
    )
    assert str(caught.value).splitlines() == list(map(says, wanted))
    assert not (tmp_path / "out").exists()
