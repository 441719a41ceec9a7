"""Verdicts: short, and never what the columns deny; of shipped scenarios in test_scenarios.py."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from project import ROOT
from rmrc.arm import load as load_arm
from rmrc.results.columns import COLUMNS, Divergence
from rmrc.results.run import Run
from rmrc.scenario.choices import IN_RUNS, Status
from verdicts import denied

JOINTS = ("shoulder", "µ_elbow", "a_name_of_a_joint_that_is_much_too_long_for_a_line")
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
    diverged = (
        Divergence(ticks, ticks * 1e-3, str(rng.choice(["", "shoulder"])), "too fast")
        if rng.random() < 0.2
        else None
    )
    axes = [("x", "y"), ("rz",), ("x", "z", "ry")][rng.integers(3)]
    beside = made(seed + 1, ticks, baseline=False) if baseline and rng.random() < 0.5 else None
    return Run(
        "case",
        JOINTS,
        (False, False, True),
        axes,
        1.0,
        1e-3,
        columns,
        ticks,
        diverged,
        rate_limit=limits,
        baseline=beside,
    )


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


def stretched(**changes):
    """Return a run of a planar arm with links of 1 m, at full reach along x at all ticks but the first."""
    run = dataclasses.replace(made(3, 20, baseline=False), divergence=None, axes=("x", "y"), rate_limit=())
    pose = np.tile([2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (20, 1))
    lost = np.tile([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], (20, 1))
    status = np.where(np.arange(20) > 0, int(Status.SINGULAR), 0)
    columns = {**run.columns, "pose": pose, "u_min": lost, "status": status, **changes.pop("columns", {})}
    return dataclasses.replace(run, columns=columns, **({"shoulder": (0.0,) * 3, "reach": 2.0} | changes))


def test_full_reach_is_told_of_an_arm_that_is_stretched_out_and_has_lost_that_direction():
    run = stretched()
    assert run.verdict.startswith("Came to full reach (κ ") and denied(run.verdict, run) == []
    always = stretched(columns={"status": np.full(20, int(Status.SINGULAR))})
    assert always.verdict.startswith("Stayed at full reach")
    shorter = dataclasses.replace(run, reach=2.1)
    assert "full reach" in denied(run.verdict, shorter)


INNER = {
    "folded": {"columns": {"pose": np.zeros((20, 7))}},
    "sideways": {"columns": {"u_min": np.tile([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], (20, 1))}},
    "a turn": {"columns": {"u_min": np.tile([0.1, 0.0, 0.0, 0.0, 0.0, 0.99], (20, 1))}},
    "1 % before": {"reach": 2.02},
    "not known": {"reach": 0.0, "shoulder": ()},
    "another shoulder": {"shoulder": (0.5, 0.0, 0.0)},
}


@pytest.mark.parametrize("case", INNER)
def test_full_reach_is_not_told_of_other_singularities(case):
    run = stretched(**INNER[case])
    assert run.verdict.startswith("Came to a singularity"), run.verdict


@pytest.mark.parametrize("name", ["planar_2link", "planar_3link", "puma560", "ur5e", "fr3", "torus_3r"])
def test_no_arm_gets_farther_from_its_shoulder_than_its_reach(name):
    arm = load_arm(ROOT / f"models/{name}.xml")
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (200, arm.n))
    away = [np.linalg.norm(arm.pose(one)[:3] - arm.chain.step[0]) for one in q]
    assert max(away) <= arm.chain.reach * (1.0 + 1e-12)  # rounding
    straight = np.linalg.norm(arm.pose(np.zeros(arm.n))[:3] - arm.chain.step[0])
    assert not name.startswith("planar") or straight == pytest.approx(arm.chain.reach, rel=1e-12)


def test_of_an_arm_with_a_joint_that_slides_no_reach_is_known():
    assert load_arm(ROOT / "models/stanford.xml").chain.reach == 0.0
