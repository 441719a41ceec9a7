"""`rmrc.run`, `rmrc.compare`, `rmrc.sweep`: of a path, a name or an object, and nothing is written unless asked."""

import json
import signal

import numpy as np
import pyarrow.parquet as pq
import pytest

import rmrc
from project import ROOT
from rmrc.results.run import Run
from rmrc.study.study import Study
from rmrc.study.sweep import Sweep
from wording import says

LINE = ROOT / "scenarios/line_tracking.yaml"
SHORT = """
name: short
arm: {model: models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
target: {path: [{line: {by: [0.05, 0.0]}}]}
"""
VARY = {"control.inverse.method": ["inverse", "damped"], "control.feedback": np.array([5.0, 20.0])}
LABELS = ["inverse, 5.0", "inverse, 20.0", "damped, 5.0", "damped, 20.0"]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Be in an empty folder, and see that nothing is left in it unless a test says so."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    yield tmp_path / "here"
    assert list((tmp_path / "here").iterdir()) == []


@pytest.fixture
def short(monkeypatch):
    with monkeypatch.context() as patched:
        patched.chdir(ROOT)
        return rmrc.loads(SHORT)


def same(one, other):
    return all(one[name].tobytes() == other[name].tobytes() for name in one.columns)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_path_a_name_and_an_object_give_the_same_run_which_is_written_if_it_is_asked_for(short, tmp_path):
    scenario = rmrc.load(LINE)
    assert scenario == rmrc.load(str(LINE)) == rmrc.load("line_tracking")
    runs = [rmrc.run(one) for one in ("line_tracking", scenario)]
    assert same(*runs) and not same(runs[0], rmrc.run(scenario.set({"control.feedback": 21})))
    found = rmrc.run(short, out=tmp_path / "out")
    assert names(tmp_path / "out") == ["short.json", "short.npz", "short.rrd"]
    assert same(Run.read(tmp_path / "out/short.npz"), found)
    rmrc.run(short, out=str(tmp_path / "less"), record=False)
    assert names(tmp_path / "less") == ["short.json", "short.npz"]


def test_compare_gives_runs_by_label_each_as_it_is_alone_and_writes_if_it_is_asked_to(short, tmp_path):
    runs = rmrc.compare(short, VARY, out=tmp_path / "out", record=False)
    assert list(runs) == LABELS and same(runs[LABELS[3]], rmrc.compare(short, VARY)[LABELS[3]])
    for label, found in runs.items():
        method, feedback = label.split(", ")
        alone = rmrc.run(short.set({"control.inverse.method": method, "control.feedback": float(feedback)}))
        assert same(found, alone)
    assert not same(*list(runs.values())[:2])
    assert names(tmp_path / "out") == ["short.compare.json", "short.compare.npz"]
    facts = json.loads((tmp_path / "out/short.compare.json").read_text())
    assert [one["label"] for one in facts["variants"]] == LABELS


@pytest.mark.parametrize("drawn", [{}, {"random": {"control.feedback": (5, 40)}}])
def test_sweep_gives_the_rows_of_the_verb_and_writes_them_if_it_is_asked_to(short, tmp_path, drawn):
    methods, done = {"control.inverse.method": ["inverse", "damped"]}, []
    more = {"samples": 3} if drawn else {}
    rows = rmrc.sweep(short, methods, **drawn, **more, seed=7, out=tmp_path / "out", on_runs=done.append)
    drawing = (
        ["sweep.draw.control.feedback=[5, 40]", "sweep.sampler=random", "sweep.samples=3"] if drawn else []
    )
    texts = ["sweep.vary.control.inverse.method=[inverse, damped]", "sweep.seed=7", *drawing]
    work = Sweep(short, texts, tmp_path / "verb")
    work.run()
    for theirs in map(pq.read_table, (work.dataset.file, tmp_path / "out/short.sweep.parquet")):
        assert repr(rows.to_pylist()) == repr(theirs.to_pylist())  # NaN among them
        assert rows.schema.equals(theirs.schema)
    assert rows.num_rows == sum(done) == (6 if drawn else 2)
    assert rows.schema.field("tau.peak").metadata[b"unit"] == "N·m".encode()


WRONG = {
    "one variant": (lambda one: rmrc.compare(one, {"control.feedback": [5]}), "vary: … 2 variants … 1; … {…"),
    "a text": (lambda one: rmrc.compare(one, {"control.inverse.method": "damped"}), "vary control.inverse.method: … list … 'damped'"),
    "a run": (lambda one: rmrc.sweep(one, {"control.feedback": [5, -5]}), "run 1 (control.feedback=-5): sweep.vary.control.feedback: … 0 … -5"),
    "both": (lambda one: rmrc.sweep(one, random={"plant.payload": (0, 1)}, sobol={"plant.payload": (0, 1)}), "sobol: … random …"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_told_before_anything_moves(short, case):
    call, said = WRONG[case]
    with pytest.raises(rmrc.ScenarioError) as caught:
        call(short)
    assert str(caught.value) == says(said)


@pytest.mark.parametrize("verb", ["run", "compare"])
def test_an_interrupt_is_raised_once_the_files_are_there(short, tmp_path, monkeypatch, verb):
    step = Study.step

    def interrupted(*arguments):
        signal.raise_signal(signal.SIGINT)
        return step(*arguments)

    monkeypatch.setattr(Study, "step", interrupted)
    more = [{"control.feedback": [5, 20]}] if verb == "compare" else []
    with pytest.raises(KeyboardInterrupt):
        getattr(rmrc, verb)(short, *more, out=tmp_path / "out")
    assert [name.rpartition(".")[2] for name in names(tmp_path / "out")] == ["json", "npz"]  # it has no tick
