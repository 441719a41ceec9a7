"""A sweep: each row is what its run gives alone, whatever the threads, the batches and the interrupts."""

import json
import math
import pickle
import shutil
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

from project import ROOT, mostly_long
from rmrc.results.expectations import check
from rmrc.results.run import Run
from rmrc.results.scorecard import scorecard
from rmrc.scenario import Scenario, load, loads, schema_rows
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.dataset import as_parquet
from rmrc.study.executors import threads
from rmrc.study.picks import Choice
from rmrc.study.rows import AsRows, fingerprint
from rmrc.study.study import Check, Runs, Study
from rmrc.study.sweep import Sweep
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
    done = sweep.run(counted.append)
    assert (sum(counted), done.done, done.interrupted, len(sweep)) == (RUNS, RUNS, False, RUNS)
    assert [entry.name for entry in (folder / "out").iterdir()] == ["quick.sweep.parquet"]
    return sweep, pq.read_table(sweep.dataset.file)


def same(a, b):
    return a == b or (a is not None and b is not None and math.isnan(a) and math.isnan(b))


# Two values of each key of the loop around the law, and what else it needs; the first is not the default.
LOOP = {
    "arm.encoder.offset": ("[1 deg, -1 deg]", "0.01"), "arm.encoder.deviation": ("1 deg", "[0.01, 0.02]"),
    "arm.encoder.noise": ("1.0e-4", "[0, 1.0e-5]"), "arm.encoder.resolution": ("1.0e-4", "[0, 1.0e-5]"),
    "arm.encoder.delay": ("0.002", "0.0025"),
    "control.state": ("integrated", "measured"), "control.rate_filter": ("0.01", "0.02"),
    "plant.kind": ("torque", "ideal"), "plant.kv": ("500", "[900, 800]"), "plant.bandwidth": ("20", "30"),
    "plant.timestep": ("0.0005", "0.001"), "plant.gravity_compensation": ("false", "true"),
    "plant.friction_compensation": ("false", "true"), "plant.payload": ("1", "0.5"),
    "plant.gravity": ("[0, -9.81, 0]", "[0, 0, 0]"), "plant.wrench": ("[1, 0, 0, 0, 0, 1]", "[0, 0, 0, 0, 0, 0]"),
    "plant.delay": ("0.002", "0.0025"), "plant.jitter": ("0.002", "0.004"), "plant.loss": ("0.5", "0.1"),
    "plant.lag": ("0.01", "[0, 0.02]"), "plant.resonance.frequency": ("12", "null"),
    "plant.resonance.damping": ("0.2", "0.3"), "plant.backlash": ("0.001", "[0, 0.01]"),
    "plant.friction.coulomb": ("1", "[0.1, 0]"), "plant.friction.viscous": ("1", "[0.1, 0]"),
    "plant.stretch.<body>": ("1.01", "0.99"), "plant.joint_offset": ("0.01", "[0, 0.01]"),
}  # fmt: skip
BESIDE = {
    "plant.bandwidth": "plant.kind=torque", "plant.resonance.damping": "plant.resonance.frequency=12",
    "plant.kv": "plant.wrench=[0, 9, 0, 0, 0, 0]",
}  # fmt: skip


def test_every_key_of_the_loop_around_the_law_is_one_of_these():
    parts = "plant.", "arm.encoder.", "control.state", "control.rate_filter"
    keys = {row.key for row in schema_rows() if row.key.startswith(parts)}
    assert set(LOOP) == keys - {"arm.encoder.seed", "plant.seed"}  # which a sweep counts up from run to run


@pytest.mark.parametrize("key", mostly_long(list(LOOP), 3))
def test_every_key_of_the_loop_around_the_law_can_be_swept(tmp_path, key):
    text = TEXT.split("expect:", maxsplit=1)[0].replace("0.004, 0.0", "0.02, 0.0")
    written = key.replace("<body>", "link_1")
    sets = [f"sweep.vary.{written}=[{', '.join(LOOP[key])}]", *([BESIDE[key]] if key in BESIDE else [])]
    sweep = Sweep(loads(text, overrides=sets), folder=tmp_path, threads=1)
    assert sweep.run().done == 2
    first, second = pq.read_table(sweep.dataset.file).to_pylist()
    # it does something: negative control of a key that is read and forgotten
    without = "control.rate_filter", "plant.gravity_compensation", "plant.friction_compensation"
    if key not in without:  # noise, weight and friction
        assert any(first[name] != second[name] for name in first if "rms" in name)


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
        whole = prepared.scenario.model_dump(
            mode="json", exclude={"name", "expect", "look", "sweep", "tune", "baseline"}
        )
        whole["arm"]["model"] = fingerprint(prepared.arm)
        assert sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest().startswith(row["scenario"])
    assert {row["met"] for row in rows} == {True, False}
    assert len({row["position_error.max"] for row in rows}) > 4  # negative control: the rows do differ


def test_a_run_that_diverges_is_a_row_like_others(swept):
    sweep, table = swept
    for row in table.to_pylist():
        pushed = row["plant.wrench"] == "[0, 1000000000000000.0, 0, 0, 0, 0]"
        assert row["status"] == ("diverged" if pushed else "complete")
        assert (row["divergence"] or "").startswith("diverged at tick" if pushed else "")
        assert (row["divergence"] is None) != pushed
    assert sweep.summary().statuses == {"complete": RUNS // 2, "diverged": RUNS // 2}


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
    # one scenario, one hash: rows that differ in what they do differ in it
    assert len(set(table["scenario"].to_pylist())) == RUNS


@pytest.mark.parametrize("threads", mostly_long([3, 2], 2))
def test_threads_change_no_bit_of_the_file(swept, path, tmp_path, threads):
    sweep, _ = swept
    other = Sweep(path, folder=tmp_path / "out", threads=threads)
    other.run()
    assert other.dataset.file.read_bytes() == sweep.dataset.file.read_bytes()


def test_only_what_is_missing_is_run_and_the_file_is_the_same(swept, path, tmp_path):
    whole, table = swept
    sweep = Sweep(path, folder=tmp_path, threads=1)
    contents = sweep.check()
    for part in (1, 4):
        rows = table.slice(contents.indices(part).start, contents.batch).to_pylist()
        sweep.dataset.keep(part, as_parquet(contents.columns, rows), contents)
    stamps = {one: one.stat().st_mtime_ns for one in sweep.dataset.folder.glob("part-*")}
    # valid while it is not finished
    assert ds.dataset(sweep.dataset.folder).count_rows() == 2 * contents.batch
    again = Sweep(path, folder=tmp_path, threads=2)
    assert (again.is_checked, again.done) == (True, 2 * contents.batch)
    counted = []
    again.dataset.merge, merge = (lambda _: None), again.dataset.merge
    again.run(counted.append)
    assert sum(counted) == RUNS - 2 * contents.batch
    assert {one: one.stat().st_mtime_ns for one in stamps} == stamps
    merge(contents)
    assert again.dataset.file.read_bytes() == whole.dataset.file.read_bytes()
    assert not again.dataset.folder.exists()
    nothing = []
    assert Sweep(path, folder=tmp_path).run(nothing.append).done == RUNS
    assert nothing == []


def test_another_sweep_in_the_same_place_is_refused_in_one_line(path, tmp_path):
    out = tmp_path / "out"
    sweep = Sweep(path, folder=out)
    sweep.check()
    cases = {
        "sweep.seed=5": "sweep",
        "control.period=0.002": "scenario",
        "expect.joint_rate.peak.below=4": "expect",
    }
    for override, what in cases.items():
        with pytest.raises(ScenarioError) as caught:
            Sweep(path, [override], out)
        assert str(caught.value) == says(f"{out}/quick.sweep: … ({what} … --out")
    for text in ("{}", '{"identity": [], "runs": 2, "batch": 1, "columns": []}'):
        (out / "quick.sweep/_plan.json").write_text(text)
        with pytest.raises(ScenarioError) as caught:
            Sweep(path, folder=out)
        assert str(caught.value) == says(f"{out}/quick.sweep: … --out")
    shutil.rmtree(out / "quick.sweep")
    for make in (lambda file: file.mkdir(), lambda file: file.rmdir() or file.write_text("no Parquet")):
        make(out / "quick.sweep.parquet")
        with pytest.raises(ScenarioError) as caught:
            Sweep(path, folder=out)
        assert str(caught.value) == says(f"{out}/quick.sweep.parquet: … --out")


@pytest.mark.parametrize("section", ["vary", "draw"])
def test_the_same_keys_in_another_order_are_another_sweep(path, tmp_path, section):
    """Which run an index is depends on it: rows of both in one dataset would be doubled, and others lost."""
    texts = {
        "vary": ["sweep.vary.task.axes=[[x, y], [x]]", "sweep.vary.control.feedback=[5, 6]"],
        "draw": [
            "sweep.draw.control.limits.rate=[2, 3]",
            "sweep.draw.control.feedback=[5, 6]",
            "sweep.samples=4",
        ],
    }[section]
    path.write_text(TEXT[: TEXT.index("sweep:")])
    first = Sweep(path, texts, tmp_path)
    first.check()
    assert Sweep(path, texts, tmp_path).is_checked
    texts[:2] = texts[1::-1]
    with pytest.raises(ScenarioError) as caught:
        Sweep(path, texts, tmp_path)
    assert str(caught.value) == says(f"{tmp_path}/quick.sweep: … (sweep … --out")


def test_a_part_that_a_power_failure_emptied_is_run_again_and_one_that_is_damaged_is_named(
    swept, path, tmp_path
):
    whole, table = swept
    sweep = Sweep(path, folder=tmp_path, threads=1)
    contents = sweep.check()
    for part in range(contents.parts):
        rows = table.slice(contents.indices(part).start, contents.batch).to_pylist()
        sweep.dataset.keep(part, as_parquet(contents.columns, rows), contents)
    empty, damaged = (sweep.dataset.folder / f"part-0000000{part}.parquet" for part in (1, 3))
    empty.write_bytes(b"")
    data = damaged.read_bytes()
    damaged.write_bytes(data[:-20])
    with pytest.raises(ScenarioError) as caught:
        sweep.run()
    assert str(caught.value) == says(f"{damaged}: … damaged; …")
    damaged.unlink()
    assert Sweep(path, folder=tmp_path, threads=1).run().done == RUNS
    assert sweep.dataset.file.read_bytes() == whole.dataset.file.read_bytes()


def test_a_second_ctrl_c_while_threads_end_leaves_the_interpreter_as_it_was(monkeypatch, swept):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(ThreadPoolExecutor, "shutdown", interrupted)
    before = sys.getswitchinterval()
    with pytest.raises(KeyboardInterrupt), threads(1, swept[0]._study):
        assert sys.getswitchinterval() != before
    assert sys.getswitchinterval() == before


@pytest.mark.parametrize("has_file", mostly_long([False, True], 2))
def test_a_sweep_of_a_scenario_object_has_the_rows_of_its_file(swept, path, tmp_path, has_file):
    one = load(path) if has_file else Scenario.model_validate(load(path).model_dump())
    assert Sweep(one, folder=tmp_path).run().done == RUNS
    assert (tmp_path / "quick.sweep.parquet").read_bytes() == swept[0].dataset.file.read_bytes()


def test_what_a_crew_does_survives_the_way_to_another_machine(swept):
    sweep, _ = swept
    columns = sweep.check().columns
    work = Runs(sweep.plan, AsRows(sweep.plan, sweep.scenario, columns))
    there = pickle.loads(pickle.dumps((work, Check(sweep.plan), sweep.scenario)))
    study, piece = Study(there[2]), range(3, 7)
    data = there[0](study, piece, threading.Event())
    assert data == work(Study(sweep.scenario), piece, threading.Event())
    assert pq.read_table(pa.BufferReader(data))["index"].to_pylist() == list(piece)
    found = there[1](study, piece, threading.Event())
    assert (found.runs, found.problems) == (4, {})
    (stop := threading.Event()).set()
    assert (there[0](study, piece, stop), there[1](study, piece, stop)) == (None, None)


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
    run, vary = "control.joint_weights=null, task.axes=[x, y]): --set sweep.vary: sweep.vary", "sweep.vary"
    wanted = (
        "run 1 (control.feedback=5, control.joint_weights=[1.0], task.axes=[x, y]): "
        f"--set {vary}: {vary}.control.joint_weights: … 2 … (shoulder, elbow) … 1",
        f"2 runs … run 2 (control.feedback=-1, {run}.control.feedback: … 0 … -1",
        f"2 runs … run 4 (control.feedback=-2, {run}.control.feedback: … 0 … -2",
    )
    assert str(caught.value).splitlines() == list(map(says, wanted))
    assert not (tmp_path / "out/quick.sweep").exists()


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
    # of 22 samples 20 are told, and each is in 16 runs
    assert problems[-1] == says("… 32 more …")


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["sweep={}"], "--set sweep: … 2 runs … 1; … --vary control.inverse.method=damped,pseudoinverse"),
        (["arm.encoder={}"], "{path}:14:11: sweep.repeat: … 1 … 2; … arm.encoder.deviation, arm.encoder.noise, plant.jitter or plant.loss"),
        # runs have this seed and the three behind it
        (["sweep.seed=9223372036854775805"],
         "--set sweep.seed: … 9223372036854775804 … 9223372036854775805"),
        (["arm.encoder.seed=9223372036854775807"],
         "--set arm.encoder.seed: … 9223372036854775804 … 9223372036854775807"),
        (["sweep={draw: {control.feedback: [1, 2]}, samples: 99999999999999999999}"],
         "--set sweep: … 1000000000 runs … 99999999999999999999; … sweep.samples or sweep.repeat"),
        (["sweep.vary.name=[a, b]"], "--set sweep.vary.name: …"),
    ],
)  # fmt: skip
def test_a_plan_that_makes_no_sense_is_refused(path, tmp_path, overrides, line):
    with pytest.raises(ScenarioError) as caught:
        Sweep(path, overrides, tmp_path / "out")
    assert str(caught.value) == says(line.format(path=path))


def test_seeds_may_reach_the_last_and_whole_arms_that_vary_may_have_chance(path, tmp_path):
    seeds = [9223372036854775804 + i for i in range(4)]
    arm = f"{{model: {ROOT}/models/planar_2link.xml, site: tip, encoder: {{deviation: 0.1}}, start: [1, START]}}"
    arms = ", ".join(arm.replace("START", start) for start in ("-2", "-1"))
    path.write_text(TEXT[: TEXT.index("sweep:")].replace(", encoder: {deviation: 0.1 deg}", ""))
    overrides = [f"sweep.vary.arm=[{arms}]", "sweep.repeat=4", f"sweep.seed={seeds[0]}"]
    sweep = Sweep(path, overrides, tmp_path)
    sweep.run()
    assert pq.read_table(sweep.dataset.file)["seed"].to_pylist() == seeds * 2


def test_the_worst_rows_are_chosen_by_what_is_expected_and_recorded_with_their_bits(swept, tmp_path, path):
    sweep, table = swept
    rates = table["joint_rate.peak"].to_pylist()
    order = sorted(range(RUNS), key=lambda i: (-rates[i], i))
    assert sweep.chosen(Choice.read("worst:3")) == order[:3]
    assert sweep.chosen(Choice.read("best:2:sigma.min")) == sorted(
        range(RUNS), key=lambda i: (-table["sigma.min"][i].as_py(), i)
    )[:2]  # fmt: skip
    other = Sweep(path, folder=tmp_path, threads=1)
    (index,) = other_choice = sweep.chosen(Choice.read("best:1:position_error.max"))
    job = other.job(index)
    job.run()
    run = Run.read(tmp_path / f"quick-{index}.npz")
    assert scorecard(run)["position_error.max"].value == table["position_error.max"][other_choice[0]].as_py()
    assert (tmp_path / f"quick-{index}.rrd").exists()


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("worst", "--record: … worst:N or best:N … 1 to 100 … :METRIC … worst"),
        ("best:0", "--record: … worst:N or best:N … 1 to 100 … :METRIC … best:0"),
        ("worst:1:joint_rate.peek", '--record: … joint_rate.peek … "joint_rate.peak"…'),
        ("worst:1:joint_rate.peak_joint", '--record: … joint_rate.peak_joint … "joint_rate.peak"…'),
    ],
)  # fmt: skip
def test_a_choice_that_is_none_is_refused(swept, text, line):
    with pytest.raises(ScenarioError) as caught:
        swept[0].chosen(Choice.read(text))
    assert str(caught.value) == says(line)


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
