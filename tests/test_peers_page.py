"""The scoreboard of benchmarks/peers.py: its arms, its measures, and what it says who leads."""

import csv
import itertools
import re
import sys

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT, mostly_long

sys.path.insert(0, str(ROOT / "benchmarks"))

import peer_cases
import peer_loops

import peers

with peers.CSV.open(encoding="utf-8", newline="") as opened:
    ROWS = list(csv.DictReader(opened))
# As the file has them, which takes no time; the last test compares them with those that there are.
NAMES = list(dict.fromkeys(row["case"] for row in ROWS))


def named(name):
    return next(case for case in peer_cases.cases() if case.name == name)


@pytest.mark.parametrize("name", mostly_long(NAMES, 4))
def test_a_path_starts_where_the_arm_is_and_returns_and_its_twists_are_its_slopes(name):
    case = named(name)
    site = case.arm.at(case.start).site(case.arm.site)
    for pose in (case.poses[0], case.poses[-1]):
        assert_allclose(
            peer_cases.pose_error(pose.p, pose.T[:3, :3], site.xpos, site.xmat.reshape(3, 3)), 0, atol=1e-8
        )
    for k in range(0, case.ticks, 97):
        before, after = case.poses[k], case.poses[k + 1]
        moved = peer_cases.pose_error(after.p, after.T[:3, :3], before.p, before.T[:3, :3])
        # A turn takes the tool along an arc, of which the twist is the tangent at its start: 0.5 |ω| |v| T² beside it.
        arc = np.linalg.norm(case.twists[k, :3]) * np.linalg.norm(case.twists[k, 3:]) * peer_cases.PERIOD**2
        assert_allclose(moved, case.twists[k] * peer_cases.PERIOD, atol=arc + 1e-12)


def test_the_loop_in_numpy_and_ours_are_the_same_law():
    """Two implementations of damped least squares with one λ and the same feedback: the same commands."""
    case, setting = named("wrist 1°, UR5e"), {"gain": 10.0, "damping": 0.2, **peers.CONSTANT}
    own = next(peer for _, peer in peers.peers() if peer.name == peers.OURS)
    ours = peer_cases.drive(case, own.start(case, setting))
    theirs = peer_cases.drive(case, peer_loops.Numpy(case.arm, case.start, 10.0, 0.2).step)
    # Rounding of 1e-16 grows by 1/λ² a tick at most, and feedback takes it away.
    assert_allclose(ours.command, theirs.command, atol=1e-9)
    damped = peer_cases.drive(case, peer_loops.Numpy(case.arm, case.start, 10.0, 0.21).step)
    assert np.abs(ours.command - damped.command).max() > 1e-3


def test_a_target_is_reached_as_in_mink_s_own_test():
    """tests/test_solve_ik.py of mink: a UR5e at home, 0.1 m away, π rad/s, at most 19 steps of 5 ms, ever nearer."""
    arm, q = peer_cases.arm("ur5e", (np.pi,) * 6), np.radians([-90, -90, 90, -90, -90, 0])
    site = arm.at(q).site(arm.site)
    R = site.xmat.reshape(3, 3).copy()
    target = np.concatenate([site.xpos + 0.1 * R[:, 2], np.zeros(4)])
    mujoco.mju_mat2Quat(target[3:], R.ravel())
    pose = peer_cases.Pose(target[:3], target[3:], np.eye(4), target)
    setting = {"gain": 1 / peer_cases.PERIOD, "damping": 1e-4}
    loop, errors = peer_loops.Rmrc(arm, q, peers.control(setting)), []
    for _ in range(int(19 * 0.005 / peer_cases.PERIOD)):
        rates = loop.step(q, np.zeros(6), pose, np.zeros(6), pose)
        assert np.abs(rates).max() <= np.pi * (1 + 1e-12)
        q = q + peer_cases.PERIOD * rates
        site = arm.at(q).site(arm.site)
        error = peer_cases.pose_error(target[:3], R, site.xpos, site.xmat.reshape(3, 3))
        errors.append(float(np.linalg.norm(error)))
    assert errors[-1] < 1e-5
    assert all(later < sooner or sooner < 1e-9 for sooner, later in itertools.pairwise(errors))


def test_figures_of_a_run():
    case = named("far, UR5e")
    ticks, n = case.ticks, 6
    command, error, q = np.zeros((ticks, n)), np.zeros((ticks, n)), np.tile(case.start, (ticks, 1))
    command[1:5, 2] = [0.1, -0.1, 0.1, -0.1]
    error[7], error[-1], q[3, 0] = [3e-3, 0, 4e-3, 0, 0.02, 0], [0, 1e-3, 0, 0, 0, 0], 2 * np.pi + 0.05
    got = peer_cases.measure(case, peer_cases.Track(q, np.zeros_like(q), command, error))
    assert got["peak rate"] == 0.1 and got["rate over"] < 0
    assert_allclose([got["mm"], got["mrad"], got["end mm"], got["end mrad"]], [5, 20, 1, 0])
    # jumps of 0.1, 0.2, 0.2, 0.2 and 0.1 rad/s, each reversing the one before
    assert_allclose([got["peak acc"], got["chatter"]], [0.2 / 0.002, 4 / (ticks * 0.002)])
    assert got["rms acc"] == pytest.approx(np.sqrt(0.14 / 0.002**2 / ticks))
    assert got["over"] == pytest.approx(50 - 1e3 * (case.arm.model.jnt_range[0, 1] - 2 * np.pi))


def figures(**values):
    return (
        dict.fromkeys(peers.COLUMNS, 1.0)
        | {"rate over": 0.0, "chatter": 0.0, "end mm": 0.0, "end mrad": 0.0, "over": 0.0}
        | values
    )


def test_the_best_setting_has_the_least_error_and_of_alike_ones_is_the_smoothest():
    rough, alike, far = (
        figures(mm=1.0, mrad=0.0, **{"peak acc": 9.0}),
        figures(mm=1.01, mrad=0.0),
        figures(mm=2.0, mrad=0.0),
    )
    too_fast = figures(mm=0.1, mrad=0.0, **{"rate over": 0.5})
    assert peers.best([rough, alike, far, too_fast]) == 1
    assert peers.best([too_fast]) == 0


def test_a_setting_becomes_a_section():
    assert peers.control({}) == {}
    assert peers.control({"gain": 5.0, "limits.position": False, "limits.acceleration": 3.0}) == {
        "feedback": 5.0,
        "limits": {"position": False, "acceleration": 3.0},
    }
    got = peers.control({"damping": 0.1, "inverse.damping.schedule": "constant"})
    assert got["inverse"] == {"gamma": 0.1, "damping": {"maximum": 0.1, "below": 0.2, "schedule": "constant"}}


def rows_of(*theirs):
    peer = next(peer for _, peer in peers.peers() if peer.name == "numpy DLS")
    own = next(peer for _, peer in peers.peers() if peer.name == peers.OURS)
    ours = peers.Row(own, {}, figures(mm=2.0, mrad=0.0))
    return ours, [peers.Row(peer, {}, figures(**values)) for values in theirs]


def test_the_setting_that_leaves_a_peer_fewest_columns_is_found():
    ours, (row,) = rows_of({"mm": 1.0, "mrad": 0.0, "peak acc": 0.5})
    half = {"gain": 5.0}, figures(mm=1.0, mrad=0.0)
    whole = {"gain": 7.0}, row.figures
    assert peers.verdict(row, ours, [half]) == "ahead: peak acc"
    assert peers.verdict(row, ours, [half, whole]) == "setting: gain 7"
    assert peers.verdict(row, ours._replace(figures=row.figures), [half]) == "our row"


def test_the_page_has_the_tables_and_the_counts_of_its_file():
    words, _, tables = peers.PAGE.read_text("utf-8").partition(f"## {next(iter(peers.SITUATIONS))}\n")
    assert peers.tables(ROWS) == f"## {next(iter(peers.SITUATIONS))}\n{tables}"
    assert [case.name for case in peer_cases.cases()] == NAMES
    assert {row["row"] for row in ROWS} == {peer.name for _, peer in peers.peers()}
    shown = [begin for begins in peers.SITUATIONS.values() for begin in begins]
    assert all(sum(name.startswith(begin) for begin in shown) == 1 for name in NAMES)
    # who leads, by the columns of the file alone: within 2 % of three printed digits
    ours = {row["case"]: row for row in ROWS if row["row"] == peers.OURS}
    for row in ROWS:
        if row["verdict"] == "our row":
            theirs, own = (
                {name: float(one[name]) for name in peers.COLUMNS} for one in (row, ours[row["case"]])
            )
            assert all(
                own[name] <= 1.02 * theirs[name] * 1.01 + floor for name, floor in peers.COLUMNS.items()
            )
    # what the words conclude
    counts = peers.counts(ROWS)
    found = [[int(number) for number in re.findall(r"\b\d+\b", line)] for line in words.splitlines()]
    task, others = counts["task"], counts["others"]
    assert [sum(task.values()), 2, *task.values()] in found and [
        sum(others.values()),
        *others.values(),
    ] in found
    assert f"{sum(task.values()) + sum(others.values())} rows in {len(NAMES)} cases" in words
    for name in {row["row"] for row in ROWS if not row["setting"]}:
        stops = sum(row["row"] == name and not row["setting"] for row in ROWS)
        assert f"{name} stops with an error at every setting in {stops} of {len(NAMES)} cases" in words
    past = [
        row
        for row in ROWS
        if row["setting"] and row["row"] in peers.SHOWN and float(row["over"]) > peers.OUTSIDE
    ]
    assert f"by up to {max(float(row['over']) for row in past):g} mrad" in words
