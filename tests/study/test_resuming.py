"""A sweep resumes from the rows that are there, if they are its own; whatever else is there is a line."""

import os
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from project import ROOT
from rmrc.study.sweep import Sweep
from rmrc.support.errors import RmrcError
from wording import says

TEXT = """
name: quick
arm: {model: arm.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
target: {path: [{line: {by: [0.004, 0.0]}}]}
expect: {joint_rate.peak: {below: 1}}
sweep: {draw: {control.feedback: [1, 20], control.period: [0.001, 0.002]}, samples: 32}
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """(scenario, all rows' file)."""
    folder = tmp_path_factory.mktemp("whole")
    path = folder / "quick.yaml"
    path.write_text(TEXT)
    (folder / "common").mkdir()
    shutil.copy(ROOT / "models/common/world.xml", folder / "common/world.xml")
    shutil.copy(ROOT / "models/planar_2link.xml", folder / "arm.xml")
    sweep = Sweep(path, folder=folder, threads=1)
    sweep.run()
    return path, sweep.dataset.file


@pytest.fixture
def begun(whole, tmp_path):
    """The folder of a sweep of which some rows are there, as if it had been killed."""
    sweep = Sweep(whole[0], folder=tmp_path)
    sweep.check()
    rows = pq.read_table(whole[1]).to_pylist()
    for some in (rows[:5], rows[9:20:2]):
        sweep.dataset.add(some)
    return sweep.dataset.folder


def refused(whole, tmp_path, *overrides):
    """Return what the same command says."""
    with pytest.raises((RmrcError, OSError)) as caught:
        Sweep(whole[0], overrides, tmp_path, threads=1).run(lambda _: pytest.fail("a run was started"))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_only_what_is_missing_is_run_and_the_file_is_the_same(whole, begun, tmp_path):
    sweep, counted = Sweep(whole[0], folder=tmp_path, threads=2), []
    assert len(sweep.dataset.done) == 11
    (begun / "notes.txt").write_text("mine")
    sweep.run(counted.append)
    assert (sum(counted), len(sweep.dataset.done)) == (21, 32)
    assert (tmp_path / "quick.sweep.parquet").read_bytes() == whole[1].read_bytes()
    assert [path.name for path in begun.iterdir()] == ["notes.txt"]  # of others, and kept
    Sweep(whole[0], folder=tmp_path).run(lambda _: pytest.fail("a run was started"))


@pytest.mark.parametrize("place", ["part", "file"])
@pytest.mark.parametrize(
    ("override", "what"),
    [
        ("sweep.seed=5", "sweep"),
        ("control.limits.rate=1", "control"),
        ("expect.joint_rate.peak.below=4", "expect"),
        ("sweep.draw={control.period: [0.001, 0.002], control.feedback: [1, 20]}", "sweep"),
    ],
)
@pytest.mark.usefixtures("begun")
def test_another_sweep_in_the_same_place_is_refused_with_what_differs(whole, tmp_path, place, override, what):
    if place == "file":
        shutil.copy(whole[1], tmp_path)
    assert refused(whole, tmp_path, override) == says(f"{tmp_path}/quick.sweep…: … ({what} … --out")


def test_a_changed_file_is_another_sweep(whole, begun, tmp_path):
    file = whole[0].with_name("common") / "world.xml"
    text = file.read_text()
    file.write_text(text.replace("<mujoco", "<!-- changed --><mujoco", 1))
    try:
        assert refused(whole, tmp_path) == says(f"{begun}/…: … (files … --out")
    finally:
        file.write_text(text)
    assert len(Sweep(whole[0], folder=tmp_path).dataset.done) == 11  # negative control


def test_a_damaged_part_is_named_and_the_way_out_leads_out(whole, begun, tmp_path):
    part = min(begun.iterdir())
    data = part.read_bytes()
    for damaged in (b"", b"PAR1", data[: len(data) // 2], b"\0" * len(data)):
        part.write_bytes(damaged)
        assert refused(whole, tmp_path) == says(f"{part}: … --out")
    part.unlink()
    Sweep(whole[0], folder=tmp_path, threads=1).run()
    assert (tmp_path / "quick.sweep.parquet").read_bytes() == whole[1].read_bytes()


@pytest.mark.skipif(os.name != "posix", reason="pipes")
@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir])
def test_a_pipe_or_a_folder_in_place_of_the_file_is_refused(whole, tmp_path, make):
    make(tmp_path / "quick.sweep.parquet")
    assert refused(whole, tmp_path) == says(f"{tmp_path}/quick.sweep.parquet: … --out")


def test_something_else_in_the_place_of_rows_is_refused(whole, tmp_path):
    (tmp_path / "quick.sweep").write_text("mine")
    assert refused(whole, tmp_path) == says(f"… Not a directory: … {tmp_path}/quick.sweep/part…")
    (tmp_path / "quick.sweep.parquet").write_text("mine")
    assert refused(whole, tmp_path) == says(f"{tmp_path}/quick.sweep.parquet: … --out")
