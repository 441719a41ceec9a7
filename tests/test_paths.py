"""Pieces of a path in any frame, tilts, set-points, configurations and recorded motions, against scipy."""

import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from paths import acceleration, pieces
from project import ROOT
from rmrc.arm import load
from rmrc.logs.columns import TWIST
from rmrc.logs.tables import POSE
from rmrc.scenario import TargetSection
from rmrc.simulation.motion import spline
from rmrc.simulation.trajectory import Places, make_reference
from rmrc.support.errors import TargetError
from rmrc.support.spatial import pose_error

# Paths of a meter and a turn: some dozens of roundings of 1e-16.
ROUNDING = 1e-12

TURN = Rotation.from_rotvec([0.4, -0.7, 0.3])
START = np.array([0.5, 0.1, 0.3, *TURN.as_quat(scalar_first=True)])
BASE = np.array([0.2, -0.3, 0.4, *Rotation.from_rotvec([0.1, 0.5, -0.9]).as_quat(scalar_first=True)])
PERIOD = 0.01


def reference(*path, start=START, places=None, **more):
    section = TargetSection.model_validate({"path": path, **more})
    places = places or Places(BASE)
    return make_reference(section, start, PERIOD, places)


def rotation(pose):
    return Rotation.from_quat(pose[3:], scalar_first=True)


def same(a, b):
    """Say that two references have the same poses, whatever the signs of quaternions, and twists."""
    assert a.ticks == b.ticks
    assert_allclose(pose_error(a.pose, b.pose), 0, rtol=0, atol=ROUNDING)
    assert_allclose(a.twist, b.twist, rtol=0, atol=ROUNDING / PERIOD)


@pytest.mark.parametrize(("frame", "pose"), [("base", BASE), ("start", START), ("site", START)])
def test_a_piece_in_a_frame_is_the_world_piece_seen_from_there(frame, pose):
    R, to_world = rotation(pose), lambda p: (pose[:3] + rotation(pose).apply(p)).tolist()
    turn = {"axis": [0.0, 1.0, 1.0], "angle": 0.6}
    turned = {"axis": R.apply(turn["axis"]).tolist(), "angle": 0.6}
    quat = Rotation.from_rotvec([0.3, 0.2, 0.1])
    for own, world in (
        ({"line": {"by": [0.1, 0.2, 0.3], "turn": turn}}, {"line": {"by": R.apply([0.1, 0.2, 0.3]).tolist(), "turn": turned}}),
        ({"line": {"to": [0.1, 0.2, 0.3]}}, {"line": {"to": to_world([0.1, 0.2, 0.3])}}),
        ({"arc": {"center": [0.1, 0.2, 0.0], "axis": "x", "angle": 1.0}},
         {"arc": {"center": to_world([0.1, 0.2, 0.0]), "axis": R.apply([1, 0, 0]).tolist(), "angle": 1.0}}),
        ({"turn": turn}, {"turn": turned}),
        ({"turn": {"to": quat.as_quat(scalar_first=True).tolist()}},
         {"turn": {"to": (R * quat).as_quat(scalar_first=True).tolist()}}),
        ({"tilt": {"to": [0.2, 0.5, 0.1]}}, {"tilt": {"to": R.apply([0.2, 0.5, 0.1]).tolist()}}),
        ({"set": {"to": [0.1, 0.2, 0.3], "turn": turn, "for": 0.2}},
         {"set": {"to": to_world([0.1, 0.2, 0.3]), "turn": turned, "for": 0.2}}),
    ):  # fmt: skip
        same(reference(own, frame=frame), reference(world))
        ((kind, values),) = own.items()
        same(reference({kind: {**values, "frame": frame}}), reference(world))  # its own key


def test_the_frame_of_the_site_is_where_each_piece_starts_and_that_of_the_start_stays():
    steps = [
        {"line": {"by": [0.1, 0, 0]}},
        {"turn": {"axis": "z", "angle": "90 deg"}},
        {"line": {"by": [0.1, 0, 0]}},
    ]
    own = rotation(START).inv().apply(reference(*steps, frame="site").pose[-1, :3] - START[:3])
    assert_allclose(own, [0.1, 0.1, 0], rtol=0, atol=ROUNDING)
    own = rotation(START).inv().apply(reference(*steps, frame="start").pose[-1, :3] - START[:3])
    assert_allclose(own, [0.2, 0, 0], rtol=0, atol=ROUNDING)


def test_an_offset_moves_the_points_of_a_frame_that_stands_and_no_others():
    ends = {}
    for frame in ("world", "base", "site", "start"):
        path = {"line": {"to": [0.1, 0.2, 0.3]}}
        with_it = reference(path, frame=frame, offset=[0.0, 0.05, 0.0]).pose[-1, :3]
        ends[frame] = with_it - reference(path, frame=frame).pose[-1, :3]
    assert_allclose(ends["world"], [0, 0.05, 0], rtol=0, atol=ROUNDING)
    assert_allclose(ends["base"], rotation(BASE).apply([0, 0.05, 0]), rtol=0, atol=ROUNDING)
    assert_array_equal([ends["site"], ends["start"]], np.zeros((2, 3)))


@pytest.mark.parametrize(
    ("axis", "to"), [("z", [0, 0, -1.0]), ([1.0, 2.0, -1.0], [0.3, -0.2, 0.9]), ("y", "x")]
)
def test_a_tilt_brings_the_axis_there_by_the_shortest_turn(axis, to):
    unit = lambda d: np.eye(3)["xyz".index(d)] if isinstance(d, str) else np.array(d) / np.linalg.norm(d)  # noqa: E731
    for path in (
        {"tilt": {"axis": axis, "to": to}},
        {"line": {"by": [0.1, 0, 0], "tilt": {"axis": axis, "to": to}}},
    ):
        got = reference(path)
        end = rotation(got.pose[-1])
        assert_allclose(end.apply(unit(axis)), unit(to), rtol=0, atol=ROUNDING)
        angle = (end * TURN.inv()).magnitude()
        assert angle == pytest.approx(
            math.acos(TURN.apply(unit(axis)) @ unit(to)), abs=1e-9
        )  # of acos near 1


def test_a_set_point_is_a_step_that_stays():
    got = reference(
        {"hold": {"for": 0.1}}, {"set": {"by": [0.1, 0, 0], "tilt": {"to": [0, 0, 1]}, "for": 0.2}}
    )
    assert_array_equal(pieces(got), [0] * 10 + [1] * 21)
    assert_array_equal(got.pose[:10], np.tile(START, (10, 1)))
    assert_allclose(
        got.pose[10:, :3], np.tile(START[:3] + np.array([0.1, 0, 0]), (21, 1)), rtol=0, atol=ROUNDING
    )
    assert_allclose(rotation(got.pose[-1]).apply([0, 0, 1]), [0, 0, 1], rtol=0, atol=ROUNDING)
    assert_array_equal(got.twist, np.zeros((31, 6)))


ARM = load(ROOT / "models/puma560.xml")
HOME = ARM.configuration("home")[ARM.wiring.qpos]
READY = [0.3, -0.9, 3.0, 0.2, 0.9, 0.3]


def pose_at(q):
    return ARM.pose(ARM.configuration(q)[ARM.wiring.qpos] if isinstance(q, str) else q)


PUMA = Places(ARM.base_pose, ARM.joints, pose_at)


def test_configurations_are_the_poses_of_the_site_in_turn():
    start = pose_at(HOME)
    path = {"configurations": ["home", READY, "home"]}
    got = reference(path, start=start, places=PUMA)
    assert_allclose(pose_error(got.pose[-1], start), 0, rtol=0, atol=ROUNDING)
    near = np.linalg.norm(pose_error(got.pose, pose_at(READY)), axis=1)
    assert near.min() < 1e-3  # a tick lies within a hundredth of a second of the rest there
    with pytest.raises(TargetError, match=r"target.path\[0\].configurations: has length 0"):
        reference({"configurations": ["home"]}, start=start, places=PUMA)


# Recorded motions --------------------------------------------------------------------------------


def write(path, columns):
    if path.suffix == ".parquet":
        pq.write_table(pa.table(columns), path)
    else:
        rows = np.column_stack(list(columns.values()))
        np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    return str(path)


def as_columns(time, rows, names):
    return {"t": time, **dict(zip(names, rows.T, strict=True))}


@pytest.fixture
def line():
    """Return a reference at 10 ms: a line with a turn, and back."""
    return reference(
        {"line": {"by": [0.1, 0.05, 0], "turn": {"axis": "z", "angle": 0.5}}},
        {"line": {"by": [-0.1, 0, 0.1]}},
    )


@pytest.mark.parametrize("name", ["motion.csv", "motion.parquet"])
def test_a_recorded_reference_is_followed_again(tmp_path, line, name):
    file = write(tmp_path / name, as_columns(line.time, line.pose, POSE))
    again = reference({"file": {"path": file}})
    assert_allclose(
        again.pose, line.pose, rtol=0, atol=1e-9
    )  # at the rows themselves, but for the rounding of times
    # between them the error of a cubic spline of a motion with steps of jerk J is below J h³/8: 1e-5 m
    fine = TargetSection.model_validate({"path": [{"file": {"path": file}}]})
    dense = make_reference(fine, START, PERIOD / 4, Places())
    spline = CubicSpline(line.time, line.pose[:, :3], bc_type="clamped")
    assert_allclose(dense.pose[:, :3], spline(dense.time), rtol=0, atol=ROUNDING)
    assert_allclose(dense.twist[:, :3], spline(dense.time, 1), rtol=0, atol=1e-10)
    # at the last tick the path is at rest
    assert_allclose(acceleration(dense)[:-1, :3], spline(dense.time[:-1], 2), rtol=0, atol=1e-8)


def test_the_twist_of_a_recorded_motion_is_the_derivative_of_its_poses():
    """By central differences of scipy's rotations: h² of motions of some rad/s³ is 1e-7."""
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.1, 0.3, 8)) - 0.1
    turns = Rotation.from_rotvec(np.cumsum(rng.uniform(-0.4, 0.4, (8, 3)), axis=0))
    pose = np.hstack([rng.normal(size=(8, 3)), turns.as_quat(scalar_first=True)])
    motion, h = spline(time - time[0], pose), 1e-4
    t = rng.uniform(0.05, time[-1] - time[0] - 0.05, 30)
    before, now, after = (motion.at(t + shift) for shift in (-h, 0.0, h))
    turned = [(Rotation.from_quat(b[3:7], scalar_first=True) * Rotation.from_quat(a[3:7], scalar_first=True).inv()).as_rotvec()
              for a, b in zip(before, after, strict=True)]  # fmt: skip
    assert_allclose(np.array(turned) / (2 * h), now[:, 10:13], rtol=0, atol=1e-5)
    assert_allclose((after[:, 7:13] - before[:, 7:13]) / (2 * h), now[:, 13:19], rtol=0, atol=1e-4)


def test_joint_positions_and_twists_lead_along_the_same_poses(tmp_path):
    """q by forward kinematics, and the twists of it integrated: 2nd order in 2 ms of a motion of 1 rad/s²: 1e-6."""
    time = np.arange(0, 1.0005, 0.002)
    s = (1 - np.cos(np.pi * time)) / 2
    q = HOME + 0.2 * s[:, None] * np.array([1, -1, 1, 0.5, 1, -1])
    rates = 0.1 * np.pi * np.sin(np.pi * time)[:, None] * np.array([1, -1, 1, 0.5, 1, -1])
    twist = np.array([ARM.jacobian(a) @ b for a, b in zip(q, rates, strict=True)])
    by_q = write(tmp_path / "q.csv", as_columns(time, q, ARM.joints))
    by_twist = write(tmp_path / "twist.csv", as_columns(time, twist, TWIST))
    start, loose = (
        pose_at(HOME),
        {"velocity": 5, "acceleration": 50, "angular_velocity": 5, "angular_acceleration": 50},
    )
    first, second = (
        reference({"file": {"path": file}}, start=start, places=PUMA, limits=loose)
        for file in (by_q, by_twist)
    )
    want = np.array([pose_at(one) for one in q[:: round(PERIOD / 0.002)]])
    assert_allclose(pose_error(first.pose, want), 0, rtol=0, atol=1e-7)
    assert_allclose(pose_error(second.pose, want), 0, rtol=0, atol=1e-5)


def test_a_motion_begins_with_a_way_to_it_or_is_carried_to_the_start(tmp_path, line):
    shift = np.array([0.3, 0, 0.1])
    moved = np.hstack([line.pose[:, :3] + shift, line.pose[:, 3:]])
    file = write(tmp_path / "motion.csv", as_columns(line.time, moved, POSE))
    carried = reference({"file": {"path": file, "from": "start"}})
    assert_allclose(pose_error(carried.pose, line.pose), 0, rtol=0, atol=1e-9)
    led = reference({"file": {"path": file}})
    way = reference({"line": {"by": shift.tolist()}})
    assert_allclose(led.pose[: way.ticks - 1], way.pose[:-1], rtol=0, atol=ROUNDING)
    assert_allclose(pose_error(led.pose[-1], moved[-1]), 0, rtol=0, atol=ROUNDING)
    assert_allclose(led.twist[-1], 0, rtol=0, atol=ROUNDING)


def test_a_motion_that_is_too_fast_is_refused_with_the_speed_that_is_not(tmp_path, line):
    file = write(tmp_path / "motion.csv", as_columns(line.time / 2, line.pose, POSE))
    with pytest.raises(
        TargetError, match=r"target.path\[0\].file: asks for .* m/s.* write speed: (0\.\d+) or"
    ) as caught:
        reference({"file": {"path": file}})
    speed = float(str(caught.value).split("write speed: ")[1].split()[0])
    assert 0.45 < speed < 0.5  # the motion was at its limits, and its spline is a little above
    slow = reference({"file": {"path": file, "speed": speed}})
    auto = reference({"file": {"path": file, "speed": "auto"}})
    assert slow.duration == pytest.approx(auto.duration, rel=0.01)
    for one in (slow, auto):
        assert np.linalg.norm(one.twist[:, :3], axis=1).max() <= 0.25 * 1.01
        assert np.linalg.norm(acceleration(one)[:, :3], axis=1).max() <= 1.0 * 1.02
    assert reference({"file": {"path": file, "speed": 0.25}}).duration == pytest.approx(
        2 * line.duration, abs=PERIOD
    )


def test_an_acceleration_that_jumps_is_refused_by_its_jerk(tmp_path):
    time = np.arange(0.0, 0.8, 0.004)
    t, pose = np.clip(time - 0.2, 0.0, 0.4), np.tile(START, (len(time), 1))
    # from rest to 0.9 m/s² in no time, and to as much less
    pose[:, 0] += 0.45 * np.where(t < 0.2, t**2, 2 * 0.2**2 - (0.4 - t) ** 2)
    file = write(tmp_path / "jumps.csv", as_columns(time, pose, POSE))
    limits = {"velocity": 0.3, "acceleration": 1.0, "jerk": 10.0}
    with pytest.raises(TargetError, match=r"m/s³ where target.limits.jerk is 10; write speed: (0\.\d+) or"):
        reference({"file": {"path": file}}, limits=limits)
