"""Verdicts: short, and never what the columns deny; of shipped scenarios in test_scenarios.py."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rmrc.results.columns import COLUMNS, Divergence
from rmrc.results.run import Run
from rmrc.results.verdict import warnings
from rmrc.scenario.choices import IN_RUNS, Status
from verdicts import denied

JOINTS = ("shoulder", "µ_elbow", "boom")
COUNTED = 1 + 2 + 4 + 8 + 16 + 32 + 64 + 128 + 256 + 512 + 8192


def made(seed, ticks, *, baseline=True):
    """Return a run by chance, of any sizes, statuses, limits and ends, often with a baseline."""
    rng = np.random.default_rng(seed)
    width = {"n": 3, "k": 2, "nq": 3, "6": 6, "7": 7}
    columns = {
        name: 10.0 ** rng.uniform(-4, 4) * rng.normal(size=(ticks, width[column.width]) if column.width else ticks)
        for name, column in COLUMNS.items()
    }  # fmt: skip
    columns["time"] = np.arange(ticks) * 1e-3
    columns["path_time"] = columns["time"] * rng.choice([1.0, 0.77])
    bits = [int(one) for one in IN_RUNS if int(one) & COUNTED]
    kept = rng.choice(bits, size=rng.integers(0, 5))
    columns["status"] = sum(
        ((rng.random(ticks) < rng.choice([0.1, 1.0])) * bit for bit in set(kept)), np.zeros(ticks, int)
    )
    columns["condition"] = 1.0 + 10.0 ** rng.uniform(-1, 6) * rng.random(ticks)
    columns["damping"] = np.abs(columns["damping"]) * rng.choice([0.0, 1.0])
    if rng.random() < 0.3:
        columns["qdot_plain"] = columns["qdot_cmd"].copy()
    limits = [(), (np.inf,) * 3, (2.0, np.inf, 0.3), (1.0, 2.0, 3.0)][rng.integers(4)]
    diverged = Divergence(ticks, ticks * 1e-3, str(rng.choice(["", "shoulder"])), "too fast")
    return Run(
        "case", JOINTS, (False, False, True), [("x", "y"), ("rz",), ("x", "z", "ry")][rng.integers(3)],
        length=1.0, period=1e-3, columns=columns, planned=ticks, rate_limit=limits,
        divergence=diverged if rng.random() < 0.2 else None,
        baseline=made(seed + 1, ticks, baseline=False) if baseline and rng.random() < 0.5 else None,
    )  # fmt: skip


@given(st.integers(0, 2**32), st.integers(1, 30))
def test_a_verdict_says_nothing_that_its_columns_deny(seed, ticks):
    run = made(seed, ticks)
    assert denied(run.verdict, run) == [], run.verdict


@pytest.mark.parametrize(
    ("column", "what"), [("condition", "κ"), ("qdot_cmd", "rate"), ("pose_error", "error in mm")]
)
def test_the_search_for_what_is_denied_finds_what_other_columns_deny(column, what):
    run = dataclasses.replace(made(3, 20), divergence=None, axes=("x", "y"), baseline=None)
    run.columns["status"][:] = 0
    other = dataclasses.replace(run, columns={**run.columns, column: 1.02 * run[column]})
    assert what not in denied(run.verdict, run) and what in denied(run.verdict, other)


def test_of_a_run_without_a_tick_it_says_that():
    run = dataclasses.replace(made(3, 20, baseline=False), divergence=None)
    nothing = {name: column[:0] for name, column in run.columns.items()}
    assert dataclasses.replace(run, columns=nothing).verdict == "Ended before the first tick was recorded."


def test_events_are_told_in_a_line_each_unless_they_are_expected():
    run = made(3, 20, baseline=False)
    run.columns["status"][:] = 0
    assert list(warnings(run.scorecard, ())) == []
    run = dataclasses.replace(run, torque_limit=(1.0, 1.0, 1.0), touching=("link", "floor"))
    run.columns["status"][5:] = Status.STUCK | Status.CONTACT | Status.TORQUE_LIMITED | Status.SLIPPED
    lines = list(warnings(run.scorecard, ()))
    assert [line.split(": ")[1] for line in lines] == ["STUCK", "CONTACT", "TORQUE_LIMITED", "SLIPPED"]
    assert "stuck.longest 0.015" in lines[0] and "contact.first_bodies link – floor" in lines[1]
    assert all("expect" in line for line in lines)
    expected = ["stuck.longest", "contact.time", "torque_limited.time", "status_time.SLIPPED"]
    assert list(warnings(run.scorecard, expected)) == []
