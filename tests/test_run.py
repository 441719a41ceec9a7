import os
import stat
import threading
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rmrc.results.columns import COLUMNS, Divergence
from rmrc.results.run import Run
from rmrc.support.files import written_whole


def make_run(ticks=4, **given):
    rng = np.random.default_rng(1)
    width = {"n": 3, "k": 2, "nq": 4, "6": 6, "7": 7}
    columns = {
        name: rng.normal(size=(ticks, width[column.width]) if column.width else ticks)
        for name, column in COLUMNS.items()
    }
    columns["status"] = np.arange(ticks)
    columns["path_time"] = np.arange(ticks) * (1e-3 / 3.0)
    facts = {
        "name": "case",
        "joints": ("base", "µ elbow", "d3"),
        "is_slide": (False, False, True),
        "axes": ("x", "rz"),
        "length": 0.1,
        "weights": (0.1 + 0.2, 7.0),
        "torque_limit": (100.0, np.inf, 1e-3 / 3.0),
        "period": 1e-3 / 3.0,  # not a short decimal: every bit must come back
        "columns": columns,
        "planned": ticks,
    }
    return Run(**(facts | given))


@pytest.mark.parametrize("ticks", [0, 50])
@pytest.mark.parametrize("divergence", [None, Divergence(3, 0.003, "µ elbow", "rate is not finite")])
def test_what_is_saved_is_read_back_bit_for_bit(tmp_path, ticks, divergence):
    run = make_run(ticks, planned=60, divergence=divergence, wall_time=0.1 + 0.2)
    if ticks:
        run["condition"][0] = np.inf
        run["tau"][0, 0] = np.nan
        run["q"][0, 0] = -0.0
    path = tmp_path / "new" / "folder" / "run.npz"
    run.save(path)
    back = Run.read(path)
    for field in fields(Run):
        if field.name != "columns":  # repr: equal in value and in type, tuples' items included
            assert repr(getattr(back, field.name)) == repr(getattr(run, field.name)), field.name
    assert list(back.columns) == list(COLUMNS)
    for name in COLUMNS:
        assert back[name].dtype == run[name].dtype
        np.testing.assert_array_equal(back[name], run[name], strict=True)
        assert back[name].tobytes() == run[name].tobytes(), name
    assert len(back) == ticks and not back.is_complete


@given(st.text(st.characters(exclude_categories=["Cs"])), st.floats(-1e99, 1e99))
def test_any_name_and_any_number_come_back(tmp_path_factory, text, number):
    path = tmp_path_factory.mktemp("runs") / "run.npz"
    make_run(name=text, length=number).save(path)
    back = Run.read(path)
    assert (back.name, back.length) == (text, number)


def test_a_file_says_the_unit_of_every_column(tmp_path):
    # For a reader without rmrc: numpy and json are enough.
    make_run().save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz", allow_pickle=False) as file:
        assert set(file) == {*COLUMNS, "facts"}
        for name, column in COLUMNS.items():
            assert f'"{name}": ' in str(file["facts"])
            assert column.unit


def test_a_run_is_complete_when_its_path_was_recorded_to_the_end():
    assert make_run(4, planned=4).is_complete
    assert not make_run(3, planned=4).is_complete
    assert [make_run(ticks, planned=4).completed for ticks in (0, 3)] == [0.0, 0.75]
    slowed = make_run(4, planned=4)  # more ticks than planned, and still on its way
    slowed.columns["path_time"][:] *= 0.5
    assert slowed.completed == 0.625
    assert not slowed.is_complete
    assert [slowed.joint_unit(j) for j in range(3)] == ["rad", "rad", "m"]


def test_a_divergence_is_one_line_that_names_tick_time_joint_and_reason():
    text = 'diverged at tick 12 (0.0120 s) at joint "elbow": rate is not finite'
    assert str(Divergence(12, 0.012, "elbow", "rate is not finite")) == text
    assert str(Divergence(12, 0.012, "", "rate is not finite")) == text.replace(' at joint "elbow"', "")


# Files ------------------------------------------------------------------------------------------


class Crash(BaseException):
    """Like KeyboardInterrupt: not an Exception."""


@pytest.mark.parametrize("old", [None, b"old"])
@pytest.mark.parametrize("crash", [Crash, OSError])
def test_a_crash_while_writing_leaves_the_old_file_and_no_other(tmp_path, old, crash):
    path = tmp_path / "run.npz"
    if old is not None:
        path.write_bytes(old)

    def write():
        with written_whole(path) as temporary:
            temporary.write_bytes(b"half")
            raise crash

    with pytest.raises(crash):
        write()
    assert [file.name for file in tmp_path.iterdir()] == ([] if old is None else ["run.npz"])
    if old is not None:
        assert path.read_bytes() == old


def test_a_run_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    make_run(name="first").save(path)

    def full(file, **_arrays):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(OSError, match=r"^\[Errno 28\] No space left on device: ") as caught:
        make_run(name="second").save(path)
    assert caught.value.filename == str(path)  # which the command line tells, where it has a trace for bugs
    monkeypatch.undo()
    assert Run.read(path).name == "first"
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]


def test_two_writers_of_one_path_do_not_mix_and_a_reader_sees_whole_files(tmp_path):
    path = tmp_path / "run.npz"
    path.write_bytes(b"old")
    with written_whole(path) as first:
        first.write_bytes(b"first")
        with written_whole(path) as second:
            second.write_bytes(b"second")
            assert path.read_bytes() == b"old"
        assert path.read_bytes() == b"second"
        # a rename is atomic only within a file system; programs choose a format by the suffix
        assert (first.parent, first.name[:5], first.suffix) == (tmp_path, ".run-", ".npz")
    assert path.read_bytes() == b"first"
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]


@pytest.mark.parametrize("umask", [0o022, 0o077])
def test_the_mode_is_what_the_umask_allows(tmp_path, umask):
    path = tmp_path / "run.npz"
    before = os.umask(umask)
    try:
        with written_whole(path) as temporary:
            temporary.write_bytes(b"new")
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~umask


def test_what_cannot_be_written_is_named_as_it_was_asked_for(tmp_path):
    path = tmp_path / ("x" * 250 + ".png")  # the temporary name is too long
    with pytest.raises(OSError, match="name too long") as caught, written_whole(path):
        pass
    assert caught.value.filename == str(path)


def test_writing_does_not_touch_the_umask_of_other_threads(tmp_path, monkeypatch):
    def umask(_mask):
        raise AssertionError(f"umask changed in {threading.current_thread().name}")

    monkeypatch.setattr(os, "umask", umask)
    with written_whole(tmp_path / "run.npz") as temporary:
        temporary.write_bytes(b"new")
