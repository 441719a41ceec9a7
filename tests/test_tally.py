"""The running sums against numpy over whole columns, and their promise: pieces do not matter."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from rmrc.law.record import tick_type
from rmrc.results.tally import ERRORS, EXTREMES, JOINTS, adder, begin
from rmrc.scenario.choices import IN_RUNS, Status

N, K, LENGTH, PERIOD = 4, 3, 0.7, 0.002
AXES, ROWS, WEIGHTS = ("x", "z", "ry"), [0, 2, 4], (0.3, 2.0, 5.0)
SCALE = np.sqrt(WEIGHTS) / [LENGTH, LENGTH, 1.0]


def random_ticks(rng, ticks, special=0.0):
    """Return records of random numbers; a share of the entries is NaN, infinite, or equal to others."""
    records = np.zeros((1, ticks), tick_type(N))
    for name in records.dtype.names:
        field = records[name]
        if name == "status":
            field[...] = rng.integers(0, 2 ** len(IN_RUNS), field.shape)
            continue
        field[...] = rng.normal(size=field.shape)
        chosen = rng.random(field.shape) < special
        field[chosen] = rng.choice([math.nan, math.inf, -math.inf, 3.0, -3.0, 0.0, -0.0], chosen.sum())
    records["time"][0] = np.arange(ticks) * PERIOD
    return records


def tally_of(records, rows=None, pieces=()):
    """Return the tally of records that are handed over in pieces, through a ring of some rows."""
    tally = begin(N, [AXES], [LENGTH], [WEIGHTS], [PERIOD])
    ring = np.zeros((1, rows or records.size), records.dtype)
    add, done = adder(tally, ring), 0
    for piece in [*pieces, *[ring.size] * records.size]:
        count = min(piece, ring.size, records.size - done)
        for t in range(done, done + count):
            ring[:, t % ring.size] = records[:, t]
        done += count
        add(np.array([done]))
    return tally[0]


@given(st.integers(0, 2**32), st.integers(1, 40), st.integers(1, 50), st.lists(st.integers(0, 20)))
def test_pieces_of_any_size_through_rings_of_any_size_give_the_same_bits(seed, ticks, rows, pieces):
    records = random_ticks(np.random.default_rng(seed), ticks, 0.1)
    assert tally_of(records, rows, pieces).tobytes() == tally_of(records).tobytes()


def test_worlds_beside_it_do_not_matter():
    records = [random_ticks(np.random.default_rng(seed), 50, 0.05) for seed in range(5)]
    tallies = begin(N, [AXES] * 5, [LENGTH] * 5, [WEIGHTS] * 5, [PERIOD] * 5)
    adder(tallies, np.concatenate(records))(np.array([50, 0, 13, 50, 1]))
    for tally, own, end in zip(tallies, records, [50, 0, 13, 50, 1], strict=True):
        if end:
            assert tally.tobytes() == tally_of(own[:, :end]).tobytes()
    assert tallies[1]["ticks"] == 0 and np.isnan(tallies[1]["peak"]).all()


def from_rest(column):
    """Return the difference quotient of a column before which all was at rest."""
    return np.diff(column, axis=0, prepend=0.0) / PERIOD


def columns_by_numpy(records):
    """Return magnitudes and values by name, computed from whole columns."""
    one = records[0]
    e, u = one["pose_error"][:, ROWS], one["u_min"][:, ROWS]
    along = u * np.sum(u * SCALE * e, axis=1, keepdims=True) / SCALE
    across = e - along
    joints = {
        "joint_rate": one["qdot"], "joint_rate_cmd": one["qdot_cmd"],
        "joint_rate_plain": one["qdot_plain"],
        "joint_acceleration": np.diff(one["qdot"], axis=0) / PERIOD, "joint_acceleration_cmd": from_rest(one["qdot_cmd"]),
        "joint_jerk_cmd": from_rest(from_rest(one["qdot_cmd"])), "tau": one["tau"],
        "tau_total": one["tau"] + one["tau_gravity"],
    }  # fmt: skip
    # two rows are translations and one is a rotation
    errors = {
        "position_error": np.linalg.norm(e[:, :2], axis=1), "orientation_error": np.abs(e[:, 2]),
        "position_error_along": np.linalg.norm(along[:, :2], axis=1), "orientation_error_along": np.abs(along[:, 2]),
        "position_error_across": np.linalg.norm(across[:, :2], axis=1), "orientation_error_across": np.abs(across[:, 2]),
        "secondary_error": np.abs(one["secondary_error"]),
    }  # fmt: skip
    extremes = {
        "sigma": -one["sigma"][:, K - 1], "manipulability": -one["manipulability"], "path_rate": -one["path_rate"],
        "secondary_sigma": -one["secondary_sigma"], "condition": one["condition"], "damping": one["damping"],
    }  # fmt: skip
    return {name: np.abs(column[:, :N]) for name, column in joints.items()}, errors, extremes


@pytest.mark.parametrize("special", [0.0, 0.02, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_sums_and_extremes_are_those_that_numpy_finds_in_whole_columns(seed, special):
    records = random_ticks(np.random.default_rng(seed), 400, special)
    time, tally = records["time"][0], tally_of(records)
    with np.errstate(invalid="ignore"):
        joints, errors, extremes = columns_by_numpy(records)
    assert list(joints) == list(JOINTS) and list(errors) == list(ERRORS) and list(extremes) == list(EXTREMES)
    # 400 squares, summed in another order: each rounding 1e-16 of the sum. Errors add up six products first.
    rounding = {"rtol": 1e-12}
    for row, size in enumerate(joints.values()):
        where = size.argmax(axis=0)  # the first NaN, if there is one
        assert_array_equal(tally["peak"][row, :N], size[where, range(N)])
        assert_array_equal(tally["peak_time"][row, :N], time[len(time) - len(size) :][where])
        assert_allclose(tally["square"][row, :N], np.square(size).sum(axis=0), **rounding)
    for row, size in enumerate(errors.values()):
        assert_allclose(tally["error_max"][row], size.max(), **rounding)
        assert tally["error_max_time"][row] == time[size.argmax()]
        assert_allclose(tally["error_end"][row], size[-1], **rounding)
        assert_allclose(tally["error_square"][row], np.square(size).sum(), **rounding)
    for row, value in enumerate(extremes.values()):
        assert_array_equal(tally["extreme"][row], value.max())
        assert tally["extreme_time"][row] == time[value.argmax()]
    status = records["status"][0]
    wanted = [np.count_nonzero(status & one if one else status == 0) for one in (Status.OK, *IN_RUNS)]
    assert tally["status"].tolist() == wanted
    met = [status & one if one else status == 0 for one in (Status.OK, *IN_RUNS)]
    assert_array_equal(
        tally["status_time"], [time[np.flatnonzero(one)[0]] if any(one) else np.nan for one in met]
    )
    stretches = [len(one) for one in "".join(".#"[bool(s & Status.STUCK)] for s in status).split(".")]
    first = "".join(".#"[bool(s & Status.STUCK)] for s in status).index("#" * max(stretches))
    assert (tally["stuck_longest"], tally["stuck_time"]) == (max(stretches), time[first])
