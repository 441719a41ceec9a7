"""Drag mode: the law in real time behind a goal that is moved by hand, within the limits at every tick."""

import itertools
import time

import numpy as np
import pytest

pytest.importorskip("viser")

import rmrc
from oracle_sensing import normals
from project import mostly_long
from rmrc.explore.answer import Explored
from rmrc.explore.drag import LATE, PERIOD, Drag, Reference
from rmrc.scenario.choices import Status
from rmrc.simulation.live import Live
from rmrc.support.spatial import pose_error, quat_from_axis_angle


def dragged(explored, **values):
    return Drag(explored.prepared(values, PERIOD), values, explored.written)


@pytest.fixture
def explored(scenario):
    return Explored(scenario("target.path=[{line: {by: [0.02, 0.0]}}]", "control.limits.rate=3.0"))


def swept(drag, seconds, end, hertz=60):
    """Lead the arm there and back as a mouse does: a pose at each sixtieth of a second; return its ticks."""
    start = drag.goal.copy()
    for i in range(round(seconds * hertz)):
        goal = start.copy()
        goal[:2] += (np.asarray(end) - start[:2]) * 0.5 * (1.0 - np.cos(2.0 * np.pi * i / (seconds * hertz)))
        drag.lead(goal)
        for _ in range(round(1.0 / hertz / drag.period)):
            drag._tick()
    return drag.recent().run


# Commands of the rates: exact, but for the rounding of a scale. Servos of 4 ms follow them within 2 %.
@pytest.mark.parametrize(("plant", "room"), mostly_long([("ideal", 1e-12), ("servo", 0.02)], 2))
def test_a_drag_through_the_singularity_keeps_all_rates_within_limits_at_every_tick(explored, plant, room):
    drag = dragged(explored, **{"plant.kind": plant})
    run = swept(drag, 9.0, (2.2, 0.0))  # 20 cm beyond the reach, at up to 0.5 m/s
    limit = np.array(run.rate_limit)
    assert len(run) > 2000
    assert (np.abs(run["qdot_cmd"]) <= limit * (1.0 + 1e-12)).all()
    assert (np.abs(run["qdot"]) <= limit * (1.0 + room)).all()
    assert run["sigma"][:, -1].min() < 0.01  # it was there
    assert np.nanmax(np.abs(run["qdot_plain"])) > 10.0 * limit.max()  # and the plain inverse would not have
    for _ in range(1000):
        drag._tick()
    assert drag.pose[:2] == pytest.approx(drag.goal[:2], abs=1e-3)  # and it came back


def test_without_limits_the_same_drag_goes_beyond_them(explored):
    given = {"control.limits.on_excess": "none", "control.inverse.method": "pseudoinverse"}
    run = swept(dragged(explored, **given), 9.0, (2.2, 0.0))
    assert np.abs(run["qdot_cmd"]).max() > 3.1


def test_the_loop_is_that_of_a_run_where_it_sees_the_same(scenario):
    # the law of `Controller`, whose chain is not MuJoCo's to the bit, and the plant of a run: rounding
    one = scenario("target.path=[{line: {by: [0.1, 0.1]}}]", "plant.delay=0.004", "plant.lag=0.01")
    prepared = rmrc.prepare(one)
    live, law = Live(prepared, prepared.reference.ticks), rmrc.Controller(prepared.arm, control=one)
    law.reset(prepared.qpos)
    for pose, twist in zip(prepared.reference.pose, prepared.reference.twist, strict=True):
        assert live.sense()
        assert live.obey(law.step(live.q, live.qdot, pose=pose, twist=twist), pose, twist)
    found, run = live.run(prepared.reference.ticks), rmrc.run(one)
    for name in ("q", "qdot", "qdot_cmd", "qdot_arrived", "pose", "sigma", "pose_error"):
        assert np.allclose(found[name], run[name], rtol=0.0, atol=1e-9), name
    assert np.array_equal(found["status"], run["status"])
    assert live.run(10)["time"][-1] == pytest.approx(9 * one.control.period)


@pytest.mark.parametrize("before", ["arm.encoder.noise=0.0", "arm.encoder={noise: 0.1, seed: 7}"])
def test_a_loop_that_takes_over_has_the_noise_of_its_own_seed(scenario, before):
    first, second = (
        Live(rmrc.prepare(scenario(one)), 1) for one in (before, "arm.encoder={noise: 0.01, seed: 3}")
    )
    law, pose = rmrc.Controller(first.prepared.arm, control=first.prepared.scenario), np.eye(7)[3]
    for _ in range(5):  # noise of some ticks is drawn at once: these are among the same
        assert first.sense()
        assert first.obey(law.step(first.q, first.qdot, twist=np.zeros(6)), pose, np.zeros(6))
    second.take_over(first)
    assert second.sense()
    off = second.q - first._qpos[0]
    assert np.allclose(off, 0.01 * normals(3, 5, len(off)), rtol=0.0, atol=1e-14)


def test_a_reference_follows_a_jump_within_speed_and_acceleration(explored):
    limits, period = explored.written.prepared.scenario.target.limits, 0.004
    start = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    goal = np.array([0.4, 0.3, 0.0, *quat_from_axis_angle([0.0, 0.0, 1.0], 2.0)])
    reference = Reference(start, limits)
    poses, twists = [start], [np.zeros(6)]
    for _ in range(2000):
        reference.step(goal, period, 1.0)
        poses.append(reference.pose.copy())
        twists.append(reference.twist.copy())
    twists, poses = np.array(twists), np.array(poses)
    for rows, speed, acceleration in (
        (np.s_[:3], limits.velocity, limits.acceleration),
        (np.s_[3:], limits.angular_velocity, limits.angular_acceleration),
    ):
        assert np.linalg.norm(twists[:, rows], axis=1).max() <= speed * (1.0 + 1e-12)
        changes = np.linalg.norm(np.diff(twists[:, rows], axis=0), axis=1) / period
        assert changes.max() <= acceleration * (1.0 + 1e-9)
    # the twist is the derivative of the pose, and the end is the goal
    assert np.allclose(pose_error(poses[1:], poses[:-1]) / period, twists[1:], atol=1e-9)
    assert np.allclose(pose_error(goal, poses[-1]), 0.0, atol=1e-6)


def test_a_joint_goes_where_its_slider_is_within_its_limit_and_the_others_stay(explored):
    drag = dragged(explored)
    start = drag.q.copy()
    drag.jog(0, start[0] + 1.0)
    for _ in range(round(3.0 / PERIOD)):
        drag._tick()
    run = drag.recent().run
    assert drag.q == pytest.approx([start[0] + 1.0, start[1]], abs=1e-3)
    assert np.abs(run["qdot_cmd"]).max() <= 3.0
    assert np.abs(run["qdot_cmd"][:, 0]).max() > 0.5
    assert np.abs(run["q"][:, 1] - start[1]).max() < 1e-3
    goal = drag.pose
    drag.lead(goal)  # the end effector then stays where the joints took it
    for _ in range(250):
        drag._tick()
    assert drag.pose[:3] == pytest.approx(goal[:3], abs=1e-3)


def test_a_new_setting_acts_at_once_and_the_commands_go_on(explored):
    drag = dragged(explored)
    drag.lead(drag.goal + np.array([0.5, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0]))
    for _ in range(100):
        drag._tick()
    before = drag.recent().run
    other = Drag(
        explored.prepared({"control.limits.rate": 2.5, "plant.kind": "ideal"}, PERIOD),
        {}, explored.written, drag,
    )  # fmt: skip
    run = other.recent().run
    assert len(run) == len(before) + 1
    for name in ("qdot_cmd", "pose"):
        steps = np.abs(np.diff(before[name][-10:], axis=0)).max()
        assert np.abs(run[name][-1] - before[name][-1]).max() < 5.0 * steps
    assert np.array_equal(run["q"][:-1], before["q"])
    alone = Drag(other.prepared, {}, explored.written)  # from the start, and at rest
    assert np.abs(alone.recent().run["qdot_cmd"][-1]).max() < 1e-9


def test_time_is_real_and_what_is_late_is_dropped(explored, monkeypatch):
    drag = dragged(explored)
    clock = itertools.count()
    monkeypatch.setattr(time, "perf_counter", lambda: 1e-6 * next(clock))
    first = drag._live.done
    for _ in range(120):
        drag.advance(1.0 / 30.0)
    assert drag._live.done - first == pytest.approx(4.0 / PERIOD, abs=1)
    assert drag.factor == pytest.approx(1.0, abs=0.05)
    first = drag._live.done
    drag.advance(5.0)  # a machine that slept
    assert drag._live.done - first <= LATE / PERIOD + 1
    # each look at the clock, and so each tick, takes 10 ms
    monkeypatch.setattr(time, "perf_counter", lambda: 1e-2 * next(clock))
    for _ in range(90):
        drag.advance(1.0 / 30.0)
    assert drag.factor < 0.5


def test_an_arm_at_rest_is_still_after_its_last_seconds_are_out_of_sight(explored, monkeypatch):
    monkeypatch.setattr("rmrc.explore.drag.RECENT", 2.0)
    drag = dragged(explored)
    for _ in range(round(2.0 / PERIOD) - 250):
        drag._tick()
    assert not drag.is_still
    for _ in range(500):
        drag._tick()
    assert drag.is_still
    drag.lead(drag.goal)
    assert not drag.is_still


def test_the_policy_stop_waits_and_goes_on_when_it_is_led_back(explored):
    drag = dragged(explored, **{"control.at_singularity": "stop"})
    swept(drag, 9.0, (2.2, 0.0))
    run = drag.recent().run
    assert (run["status"].astype(int) & int(Status.STOPPED)).any()
    assert np.abs(run["qdot_cmd"]).max() <= 3.0


def test_a_period_that_nothing_else_fits_is_the_scenarios(scenario):
    fast = Explored(scenario("target.path=[{line: {by: [0.02, 0.0]}}]"))
    assert fast.prepared({}, PERIOD).scenario.control.period == PERIOD
    slow = Explored(scenario("target.path=[{line: {by: [0.02, 0.0]}}]", "control.period=0.01"))
    assert slow.prepared({}, PERIOD).scenario.control.period == 0.01
