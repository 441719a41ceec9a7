"""Recorded motions that are no smooth curves: rows that lack, steps of a policy, the noise of a headset.

Held targets are compared with `Controller` in a loop of its own, gaps with sums and limits by numpy.
"""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from loops import controller_of
from paths import acceleration
from project import ROOT
from rmrc.scenario import TargetSection, loads
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.simulation.trajectory import Places, make_reference
from rmrc.support.errors import ScenarioError

NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz")
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
PERIOD = 0.002


def write(path, time, rows, names=NAMES):
    np.savetxt(path, np.column_stack([time, rows]), "%.9g", ",", header=",".join(("t", *names)), comments="")
    return str(path)


def circle(time, duration):
    """Return the poses of a circle of 0.12 m with a swing about z, from rest to rest with the least jerk, and its speeds."""
    s = np.clip(time / duration, 0.0, 1.0)
    angle = 2 * np.pi * (10 * s**3 - 15 * s**4 + 6 * s**5)
    half, nothing = 0.15 * np.sin(angle), np.zeros(len(time))
    # the hand points downwards: half a turn about x, and then the swing
    quat = np.column_stack([nothing, np.cos(half), np.sin(half), nothing])
    return np.column_stack(
        [0.45 + 0.12 * np.sin(angle), 0.2 + 0.12 * (1 - np.cos(angle)), 0.35 + nothing, quat]
    )


# Gaps --------------------------------------------------------------------------------------------

LIMITS = {
    "velocity": 0.4, "acceleration": 1.5, "jerk": 15.0, "angular_velocity": 1.0, "angular_acceleration": 4.0,
}  # fmt: skip
START = circle(np.zeros(1), 1.0)[0]


def reference(file, start=START, limits=LIMITS, **keys):
    section = TargetSection.model_validate({"path": [{"file": {"path": file, **keys}}], "limits": limits})
    return make_reference(section, start, PERIOD, Places())


def test_a_joystick_without_rows_stops_where_it_was_last_heard(tmp_path):
    """Along x the sum of h (v₀ + v₁)/2 over the rows: 0.78 s of 0.1 m/s and half a row; over the gap a line adds 0.052 m."""
    time = np.round(np.arange(0.0, 4.0 + 1e-9, 0.02), 3)
    twist = np.zeros((len(time), 6))
    twist[(time >= 0.2) & (time < 1.0), 0] = 0.1
    twist[(time >= 2.2) & (time < 3.2), 1] = 0.05
    heard = (time < 0.99) | (time > 2.01)
    file = write(tmp_path / "joystick.csv", time[heard], twist[heard], TWIST)
    loose = {"velocity": 0.6, "acceleration": 20.0, "jerk": 2000.0}
    path = reference(file, limits=loose)
    assert path.notes == ("joystick.csv: no rows for 1.04 s after 0.98 s: the target stops there",)
    assert_allclose(path.pose[-1, :2] - START[:2], [0.079, 0.05], rtol=0, atol=1e-9)
    in_gap = (path.time > 1.1) & (path.time < 2.0)
    assert_allclose(path.pose[in_gap, 0] - START[0], 0.079, rtol=0, atol=1e-9)
    assert_allclose(path.twist[in_gap], 0, rtol=0, atol=1e-9)
    through = reference(file, limits=loose, gaps="interpolate")
    assert_allclose(through.pose[-1, 0] - START[0], 0.079 + 0.1 * 1.04 / 2, rtol=0, atol=1e-9)


def test_a_moving_hand_that_is_lost_stops_within_the_limits_and_goes_on_through_all_rows(tmp_path):
    """The gaps leave a part that is shorter than a stop, and at most a row alone."""
    time, gaps = np.arange(0.0, 6.0 + 1e-9, 1.0 / 72), [(2.0, 2.5), (2.7, 3.3), (3.301, 4.2)]
    seen = ~np.any([(time > first) & (time < last) for first, last in gaps], axis=0)
    time, poses = time[seen], circle(time, 6.0)[seen]
    path = reference(write(tmp_path / "hand.csv", time, poses))
    (note,) = path.notes
    assert note.startswith("hand.csv: no rows for ") and note.endswith(" s: the target stops there")
    assert note.count(" after ") == np.count_nonzero(np.diff(time) > 0.1)
    for rows, most in ((path.twist, (0.4, 1.0)), (acceleration(path), (1.5, 4.0))):
        peaks = [np.linalg.norm(part, axis=1).max() for part in (rows[:, :3], rows[:, 3:])]
        assert (np.array(peaks) <= 1.02 * np.array(most)).all()
    last = time[: np.argmax(np.diff(time) > 0.1) + 1][-1]
    before_next = last + 0.1 + np.diff(time).max() / 2 < path.time
    rests = before_next & (path.time < time[time > last][0])
    assert_allclose(path.twist[rests], 0, rtol=0, atol=1e-9)
    assert_allclose(
        path.pose[rests], np.tile(circle(np.array([last]), 6.0), (rests.sum(), 1)), rtol=0, atol=1e-8
    )
    # between two ticks the target moves by less than the limit allows, so no row is farther than half of that
    near = [np.linalg.norm(path.pose[:, :3] - pose[:3], axis=1).min() for pose in poses]
    assert max(near) <= 0.4 * PERIOD / 2
    assert_allclose(path.pose[-1], poses[-1], rtol=0, atol=1e-8)


# Held targets ------------------------------------------------------------------------------------


def policy(_):
    """Return a policy at 30 Hz, held in a file of 120 Hz."""
    held = np.floor(np.arange(0.0, 5.0, 1 / 120) * 30 + 1e-9) / 30
    return np.arange(0.0, 5.0, 1 / 120).round(5), circle(held, 4.0)


def headset(rng):
    """Return a headset at 72 Hz with noise of 1 mm and 5 mrad; it loses a fifth of its rows, once seven in a row."""
    time = np.arange(0.0, 5.0, 1 / 72)
    rows = circle(time, 4.0) + np.hstack(
        [rng.normal(scale=1e-3, size=(360, 3)), rng.normal(scale=2.5e-3, size=(360, 4))]
    )
    rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    arrives = rng.random(360) > 0.2
    arrives[150:158], arrives[[0, -1]] = False, True
    return time[arrives], rows[arrives]


STREAMS = {"policy": policy, "headset": headset}


@pytest.fixture
def prepared(tmp_path, monkeypatch):
    """Return a function: name of a stream, keys of its file, overrides -> prepared scenario."""
    monkeypatch.chdir(ROOT)

    def prepare_stream(name, keys="", *overrides):
        time, rows = STREAMS[name](np.random.default_rng(5))
        file = write(tmp_path / f"{name}.csv", time, rows)
        text = f"""
name: {name}
arm: {{model: models/ur5e.xml, site: tool, start: [-20 deg, -100 deg, 110 deg, -100 deg, -90 deg, 0],
  pose: {{position: [0.45, 0.2, 0.35], orientation: [180 deg, 0, 0]}}}}
control: {{feedback: 10, period: {PERIOD}, limits: {{rate: 1.5, acceleration: 8, jerk: 200}}}}
target:
  path: [{{file: {{path: {file}{keys}}}}}, {{hold: {{for: 1.5}}}}]
  limits: {{velocity: 0.6, acceleration: 2.0, angular_velocity: 2, angular_acceleration: 8}}
"""
        return prepare(loads(text, overrides=overrides))

    return prepare_stream


@pytest.mark.parametrize(("name", "plant"), [("policy", "servo"), ("headset", "ideal")])
def test_held_targets_are_followed_within_the_limits_of_the_joints_as_controller_follows_them(
    prepared, name, plant
):
    scenario = prepared(name, "" if name == "policy" else ", interpolation: hold", f"plant.kind={plant}")
    run = Simulation([scenario]).run()[0]
    time, rows = STREAMS[name](np.random.default_rng(5))
    held = "policy.csv: its rows repeat like those of a held signal, so interpolation: hold"
    assert (held in scenario.reference.notes) == (name == "policy")  # the other is asked to hold
    lost = [note for note in scenario.reference.notes if "no rows for" in note]
    assert len(lost) == (name == "headset") and all(note.endswith("the target stays there") for note in lost)

    # the target is the newest row, after the way to the first one
    way = scenario.reference.ticks - 1 - round((time[-1] + 1.5) / PERIOD)
    newest = np.searchsorted(time, PERIOD * np.arange(math.floor(time[-1] / PERIOD)) + 1e-6, "right") - 1
    stays = slice(way + 2, way + len(newest))
    shift = np.abs(run["pose_ref"][stays, :3] - rows[newest, :3][2:]).max()
    assert shift <= 1e-8 or name == "headset"
    assert_array_equal(run["twist_ref"][stays], 0)

    rate = run["qdot_cmd"]
    change = np.diff(rate, axis=0, prepend=0 * rate[:1]) / PERIOD
    jerk = np.diff(change, axis=0, prepend=0 * rate[:1]) / PERIOD
    for values, limit in ((rate, 1.5), (change, 8.0), (jerk, 200.0)):
        assert np.abs(values).max() <= limit * (1 + 1e-9)
    assert np.abs(jerk).max() > 199  # the limits are at work

    controller = controller_of(scenario)
    for t, (q, qdot, pose, twist) in enumerate(
        zip(run["q"], run["qdot"], run["pose_ref"], run["twist_ref"], strict=True)
    ):
        out = controller.step(q, qdot, pose=pose, twist=twist if t < way + 2 else None)
        assert_allclose(out.qdot_cmd, rate[t], rtol=0, atol=1e-9)
    assert run["pose_error"][-1] == pytest.approx(0, abs=1e-4)


def test_what_is_neither_smooth_nor_held_is_refused_with_the_way_out(prepared):
    for name, keys in (("headset", ""), ("policy", ", interpolation: spline")):
        with pytest.raises(
            ScenarioError, match=r"write speed: 0\.\d+ or speed: auto, or interpolation: hold"
        ):
            prepared(name, keys)
