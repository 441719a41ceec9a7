from dataclasses import fields

import numpy as np
import pytest

from rmrc.results.columns import COLUMNS, Divergence
from rmrc.results.run import Run
from standing import make_run, random_columns


def random_run(ticks=4, **given):
    """Return a run of random numbers with names, limits and a period of many digits."""
    facts = {
        "weights": (0.1 + 0.2, 7.0),
        "torque_limit": (100.0, np.inf, 1e-3 / 3.0),
        "is_slide": (False, False, True),
    }
    columns = random_columns(np.random.default_rng(1), ticks, 3, 2) | {"status": np.arange(ticks)}
    period = 1e-3 / 3.0  # not a short decimal: every bit must come back
    return make_run(ticks, ("base", "µ elbow", "d3"), ("x", "rz"), period, **(facts | columns | given))


@pytest.mark.parametrize("ticks", [0, 50])
@pytest.mark.parametrize("divergence", [None, Divergence(3, 0.003, "µ elbow", "rate is not finite")])
def test_what_is_saved_is_read_back_bit_for_bit(tmp_path, ticks, divergence):
    run = random_run(ticks, planned=60, divergence=divergence, wall_time=0.1 + 0.2)
    if ticks:
        run["condition"][0] = np.inf
        run["tau"][0, 0] = np.nan
        run["q"][0, 0] = -0.0
    path = tmp_path / "new" / "folder" / "run.npz"
    run.save(str(path))
    back = Run.read(str(path))  # a text is a path as well
    for field in fields(Run):
        if field.name != "columns":  # repr: equal in value and in type, tuples' items included
            assert repr(getattr(back, field.name)) == repr(getattr(run, field.name)), field.name
    assert list(back.columns) == list(COLUMNS)
    for name in COLUMNS:
        assert back[name].dtype == run[name].dtype
        np.testing.assert_array_equal(back[name], run[name], strict=True)
        assert back[name].tobytes() == run[name].tobytes(), name
    assert len(back) == ticks and not back.is_complete


def test_a_run_is_complete_when_its_path_was_recorded_to_the_end():
    runs = [random_run(ticks, planned=4) for ticks in (0, 3, 4)]
    assert [(run.completed, run.is_complete) for run in runs] == [(0.0, False), (0.75, False), (1.0, True)]
    slowed = random_run(4, planned=4)  # more ticks than planned, and still on its way
    slowed.columns["path_time"][:] *= 0.5
    assert slowed.completed == 0.625
    assert not slowed.is_complete
    assert [slowed.joint_unit(j) for j in range(3)] == ["rad", "rad", "m"]


# Files ------------------------------------------------------------------------------------------


def test_a_run_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    random_run(name="first").save(path)

    def full(file, **_arrays):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(OSError, match=r"^\[Errno 28\] No space left on device: ") as caught:
        random_run(name="second").save(path)
    assert caught.value.filename == str(path)  # which the command line tells, where it has a trace for bugs
    monkeypatch.undo()
    assert Run.read(path).name == "first"
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]
