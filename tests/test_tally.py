"""The tally of a run against numpy over whole columns, and its promise: pieces do not matter."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from rmrc.results.columns import COLUMNS
from rmrc.results.run import Run
from rmrc.results.scorecard import figures
from rmrc.results.tally import ERRORS, HIGHEST, JOINTS, LOWEST, SQUARED, Tally
from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.scenario.profile import Profile

N, K, LENGTH, PERIOD = 4, 3, 0.7, 0.002
AXES, ROWS, WEIGHTS = ("x", "z", "ry"), [0, 2, 4], (0.3, 2.0, 5.0)
SCALE = np.sqrt(WEIGHTS) / [LENGTH, LENGTH, 1.0]


WIDTH = {"n": N, "k": K, "nq": N, "6": 6, "7": 7}


def random_run(rng, ticks, special=0.0):
    """Return a run of random numbers; a share of the entries is NaN, infinite, or equal to others."""
    columns = {}
    for name, column in COLUMNS.items():
        values = rng.normal(size=(ticks, WIDTH[column.width]) if column.width else ticks)
        chosen = rng.random(values.shape) < special
        values[chosen] = rng.choice([math.nan, math.inf, -math.inf, 3.0, -3.0, 0.0, -0.0], chosen.sum())
        columns[name] = values
    columns["time"] = columns["path_time"] = np.arange(ticks) * PERIOD
    columns["status"] = rng.integers(0, 2 ** len(IN_RUNS), ticks) & rng.integers(0, 2 ** len(IN_RUNS), ticks)
    joints, limit = tuple("abcd"), (2.0, 1.5, math.inf, 1.0)
    rate = {"source": "here", "value": (2.5,) * N}
    return Run(
        "random", joints, (False,) * N, AXES, LENGTH, PERIOD, columns, ticks, weights=WEIGHTS,
        torque_limit=limit, profile=Profile(robot="any", joints=N, rate=rate),
    )  # fmt: skip


def tally_of(run, pieces=()):
    """Return the tally of a run that is added in pieces of some lengths, and then the remaining ticks."""
    tally, done = Tally(run), 0
    for piece in (*pieces, len(run)):
        tally.add({name: values[done : done + piece] for name, values in run.columns.items()})
        done += piece
    return tally


@given(st.integers(0, 2**32), st.integers(0, 40), st.lists(st.integers(0, 20)), st.sampled_from([0.0, 0.1]))
def test_pieces_of_any_length_give_the_same_metrics(seed, ticks, pieces, special):
    run = random_run(np.random.default_rng(seed), ticks, special)
    run.columns["q"][:] = 0.0  # the way back from an infinite position is no number
    cards = [figures(run, tally_of(run, cut)) for cut in ((), pieces, [1] * ticks)]
    assert cards[0]["ticks"].value == ticks
    assert repr(list(cards[0].items())) == repr(list(cards[1].items())) == repr(list(cards[2].items()))


def from_rest(column):
    """Return the difference quotient of a column before which all was at rest."""
    return np.diff(column, axis=0, prepend=0.0) / PERIOD


def defined(time, value):
    """Return the time of a value, NaN where the value is."""
    return np.where(np.isnan(value), math.nan, time)


def columns_by_numpy(one):
    """Return magnitudes and values by name, computed from whole columns."""
    e, u = one["pose_error"][:, ROWS], one["u_min"][:, ROWS]
    parts = []
    for rows in ([0, 1], [2]):
        lost = (SCALE * u)[:, rows]
        is_lost = np.linalg.norm(u[:, rows], axis=1, keepdims=True) > 1e-9
        direction = np.where(is_lost, lost / np.linalg.norm(lost, axis=1, keepdims=True), 0.0)
        along = np.sum(direction * e[:, rows], axis=1)
        size, across = np.linalg.norm(e[:, rows], axis=1), e[:, rows] - direction * along[:, None]
        parts += [size, np.minimum(np.abs(along), size), np.minimum(np.linalg.norm(across, axis=1), size)]
    joints = {
        "joint_rate": one["qdot"], "joint_rate_cmd": one["qdot_cmd"],
        "joint_rate_plain": one["qdot_plain"],
        "joint_acceleration": np.diff(one["qdot"], axis=0) / PERIOD, "joint_acceleration_cmd": from_rest(one["qdot_cmd"]),
        "joint_jerk_cmd": from_rest(from_rest(one["qdot_cmd"])), "tau": one["tau"],
        "tau_total": one["tau"] + one["tau_gravity"],
    }  # fmt: skip
    errors = {
        "position_error": parts[0], "orientation_error": parts[3],
        "position_error_along": parts[1], "orientation_error_along": parts[4],
        "position_error_across": parts[2], "orientation_error_across": parts[5],
        "secondary_error": np.abs(one["secondary_error"]),
    }  # fmt: skip
    lowest = {name: one[name] for name in LOWEST} | {"sigma": one["sigma"][:, K - 1]}
    return {name: np.abs(column) for name, column in joints.items()}, errors, lowest


@pytest.mark.parametrize("special", [0.0, 0.02, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_means_extremes_and_times_are_those_of_whole_columns(seed, special):
    run = random_run(np.random.default_rng(seed), 400, special)
    time, tally = run["time"], tally_of(run, (7, 100, 200))
    with np.errstate(invalid="ignore"):
        joints, errors, lowest = columns_by_numpy(run)
    assert set(joints) == set(JOINTS) and list(errors) == list(ERRORS)
    # 400 squares, summed in another order: each rounding 1e-16 of the sum. Errors add up six products first.
    rounding = {"rtol": 1e-12}
    for name, size in joints.items():
        where, peak = size.argmax(axis=0), tally.peak(name)  # the first NaN, if there is one
        assert_array_equal(peak.value, size[where, range(N)])
        assert_array_equal(peak.time, defined(time[len(time) - len(size) :][where], peak.value))
        if name in JOINTS[:SQUARED]:
            assert_allclose(tally.rms(name), np.sqrt(np.square(size).mean(axis=0)), **rounding)
    for name, size in errors.items():
        assert_allclose(tally.peak(name).value, size.max(), **rounding)
        assert_array_equal(tally.peak(name).time, defined(time[size.argmax()], tally.peak(name).value))
        assert_allclose(tally.last(name), size[-1], **rounding)
        assert_allclose(tally.rms(name), math.sqrt(np.square(size).mean()), **rounding)
    for name, value in lowest.items():
        assert_array_equal(tally.extreme(name), (value.min(), defined(time[value.argmin()], value.min())))
    for name in HIGHEST:
        most, when = run[name].max(), time[run[name].argmax()]
        assert_array_equal(tally.extreme(name), (most, defined(when, most)))
    status = run["status"]
    for one in (Status.OK, *IN_RUNS):
        occurs = status & one != 0 if one else status == 0
        assert tally.statuses.count(one) == np.count_nonzero(occurs)
        first = time[occurs.argmax()] if occurs.any() else math.nan
        assert_array_equal(tally.statuses.first_time(one), first)
    stretches = "".join(".#"[bool(s & Status.STUCK)] for s in status).split(".")
    longest = max(map(len, stretches))
    first = "".join(".#"[bool(s & Status.STUCK)] for s in status).index("#" * longest)
    assert (tally.standstill.longest, tally.standstill.time) == (longest, time[first])
