"""rmrc.simulation.trajectory against closed forms, scipy's rotations and finite differences."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from paths import acceleration, pieces
from rmrc.scenario import Segment, TargetLimitsSection, TargetSection
from rmrc.scenario.target import Arc, Hold, Line, Turn
from rmrc.simulation import trajectory
from rmrc.support.errors import TargetError
from wording import says

# Paths are of a few meters and turns: a few dozen roundings of 1e-16.
ROUNDING = 1e-12

LIMITS = TargetLimitsSection()
START = np.array([0.5, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0])
FULL = 2 * math.pi


def make_reference(segments, limits, pose, period, offset=(0.0, 0.0, 0.0)):
    target = TargetSection.model_construct(path=segments, limits=limits, offset=offset, frame="world")
    return trajectory.make_reference(target, pose, period, trajectory.Places())


def line(by=None, *, to=None, turn=None):
    return Segment(line=Line(by=by, to=to, turn=turn))


def arc(center, angle, axis="z", turn=None):
    return Segment(arc=Arc(center=center, angle=angle, axis=axis, turn=turn))


def turn(**form):
    return Segment(turn=Turn(**form))


def hold(duration):
    return Segment(hold=Hold(**{"for": duration}))


def as_rotation(quat):
    return Rotation.from_quat(quat, scalar_first=True)


def norms(rows):
    return np.linalg.norm(rows, axis=-1)


# Paths of every kind, with the end that scipy gives them -----------------------------------------

coordinates = st.floats(-1, 1)
points = st.tuples(coordinates, coordinates, coordinates)
long_points = points.filter(lambda p: math.hypot(*p) > 0.05)
axes = st.sampled_from(["x", "y", "z"]) | long_points
angles = st.floats(0.05, 8).flatmap(lambda a: st.sampled_from([a, -a]))
orientations = st.tuples(coordinates, coordinates, coordinates, coordinates).filter(
    lambda q: math.hypot(*q) > 0.1
)
turns = st.builds(Turn, axis=axes, angle=angles) | st.builds(Turn, to=orientations)
poses = st.builds(lambda p, q: np.array([*p, *(np.array(q) / np.linalg.norm(q))]), points, orientations)


def up_to(low, high):
    return st.floats(math.log(low), math.log(high)).map(math.exp)


limit_sets = st.builds(
    TargetLimitsSection, velocity=up_to(0.1, 10), acceleration=up_to(0.3, 30), jerk=up_to(1, 1000),
    angular_velocity=up_to(0.3, 10), angular_acceleration=up_to(1, 100), angular_jerk=up_to(3, 3000),
)  # fmt: skip


def unit_axis(axis):
    vector = np.eye(3)["xyz".index(axis)] if isinstance(axis, str) else np.array(axis)
    return vector / np.linalg.norm(vector)


def turned(rotation, turning):
    if turning is None:
        return rotation
    if turning.to is not None:
        return as_rotation(turning.to)
    return Rotation.from_rotvec(turning.angle * unit_axis(turning.axis)) * rotation


@st.composite
def paths(draw):
    """Draw start pose, segments, and the pose at the end of each."""
    pose = draw(poses)
    segments, ends = [], []
    position, rotation = pose[:3], as_rotation(pose[3:])
    for kind in draw(st.lists(st.sampled_from(["line", "arc", "turn", "hold"]), min_size=1, max_size=4)):
        if kind == "line":
            by, way_turn = draw(long_points), draw(st.none() | turns)
            segments.append(line(by, turn=way_turn))
            position, rotation = position + by, turned(rotation, way_turn)
        elif kind == "arc":
            offset, axis = draw(long_points), draw(axes)
            if norms(np.cross(offset, unit_axis(axis))) < 0.01:
                continue
            angle, way_turn = draw(angles), draw(st.none() | turns)
            center = position + offset
            segments.append(arc(tuple(center), angle, axis, way_turn))
            around = Rotation.from_rotvec(angle * unit_axis(axis))
            position = center + around.apply(position - center)
            rotation = turned(rotation, way_turn)
        elif kind == "turn":
            new = draw(turns)
            if norms((turned(rotation, new) * rotation.inv()).as_rotvec()) < 1e-6:
                continue
            segments.append(Segment(turn=new))
            rotation = turned(rotation, new)
        else:
            segments.append(hold(draw(st.floats(0.001, 0.5))))
        ends.append((position, rotation))
    if not segments:
        segments, ends = [hold(0.1)], [(position, rotation)]
    return pose, segments, ends


# The limits --------------------------------------------------------------------------------------


def exceeded(reference, limits):
    """Return the limits that a reference breaks.

    Jerk is the secant of the acceleration, which no bounded jerk can exceed, across phases too.
    The times of the ticks are rounded to 1e-14 s, which over a period of 1 ms is 1e-11 of it.
    """
    over = []
    for prefix, rows in (("", slice(0, 3)), ("angular_", slice(3, 6))):
        rise = acceleration(reference)[:, rows]
        bound = getattr(limits, f"{prefix}acceleration")
        rounding = 1e-13 * bound / reference.period
        peaks = {
            "velocity": norms(reference.twist[:, rows]).max(),
            "acceleration": norms(rise).max(),
            "jerk": norms(np.diff(rise, axis=0)).max() / reference.period - rounding,
        }
        for name, peak in peaks.items():
            if peak > getattr(limits, prefix + name) * (1 + 1e-9):
                over.append(prefix + name)
    return over


@given(paths(), limit_sets, up_to(0.003, 0.03))
def test_no_sample_exceeds_a_limit_on_any_path(path, limits, period):
    pose, segments, _ = path
    assert exceeded(make_reference(segments, limits, pose, period), limits) == []


@pytest.mark.parametrize("name", list(TargetLimitsSection.model_fields))
def test_a_limit_that_is_one_percent_too_large_is_caught(name):
    # long enough that each limit is reached on the line and on the turn
    segments = [line((1.0, 0, 0)), turn(axis="z", angle=4.0)]
    loose = LIMITS.model_copy(update={name: 1.01 * getattr(LIMITS, name)})
    assert exceeded(make_reference(segments, LIMITS, START, 1e-3), LIMITS) == []
    assert exceeded(make_reference(segments, loose, START, 1e-3), LIMITS) == [name]


def fastest(length, v, a, j):
    """Duration from rest to rest by the closed form of the S-curve, with its peak bisected."""

    def ramp(peak):
        return peak / a + a / j if peak * j > a * a else 2 * math.sqrt(peak / j)

    if v * ramp(v) <= length:
        return ramp(v) + length / v
    low, high = 0.0, v
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (low, middle) if middle * ramp(middle) > length else (middle, high)
    return 2 * ramp(low)


@given(up_to(0.01, 10), up_to(0.1, 10), up_to(0.3, 30), up_to(1, 300))
def test_a_line_and_a_turn_take_the_shortest_time_that_the_limits_allow(extent, v, a, j):
    limits = TargetLimitsSection(
        velocity=v, acceleration=a, jerk=j,
        angular_velocity=v, angular_acceleration=a, angular_jerk=j,
    )  # fmt: skip
    best = fastest(extent, v, a, j)
    for segment in (line((0, extent, 0)), turn(axis="y", angle=extent)):
        duration = make_reference([segment], limits, START, best / 1000).duration
        # 0.1 % for the tick, and 0.1 % that target.py gives away for limits of no effect
        assert best * (1 - 1e-6) <= duration <= best * 1.002


def test_limits_for_which_ruckig_itself_fails_can_be_timed():
    # its step 1 fails for these numbers over a way of 1
    limits = TargetLimitsSection(velocity=1.0, acceleration=30680.182456523315, jerk=1e9)
    reference = make_reference([line((1.0, 0, 0))], limits, START, 1e-3)
    assert reference.duration == pytest.approx(1.001)


# Position, twist and acceleration ----------------------------------------------------------------


@given(paths(), limit_sets, up_to(0.003, 0.03))
def test_it_starts_at_the_start_to_the_bit_and_ends_where_geometry_says_both_at_rest(path, limits, period):
    pose, segments, ends = path
    reference = make_reference(segments, limits, pose, period)
    np.testing.assert_array_equal(reference.pose[0], pose)
    quat = reference.pose[:, 3:]
    np.testing.assert_allclose(norms(quat), 1, rtol=0, atol=ROUNDING)
    # never to its negative: half the angle between samples is below 90° as a tick turns less than a half turn
    step = limits.angular_velocity * period
    assert (quat[1:] * quat[:-1]).sum(axis=1).min(initial=1) > math.cos(step / 2) - ROUNDING
    position, rotation = ends[-1]
    np.testing.assert_allclose(reference.pose[-1, :3], position, rtol=0, atol=ROUNDING)
    gap = rotation * as_rotation(reference.pose[-1, 3:]).inv()
    assert gap.magnitude() < ROUNDING
    for rows in (reference.twist, acceleration(reference)):
        assert not rows[[0, -1]].any()


@given(paths(), limit_sets, up_to(0.003, 0.03))
def test_twist_and_acceleration_are_the_derivatives_of_the_pose(path, limits, period):
    pose, segments, _ = path
    reference = make_reference(segments, limits, pose, period)
    p, quat, twist = reference.pose[:, :3], reference.pose[:, 3:], reference.twist
    if len(p) < 3:
        return
    # A function whose third derivative is below j is met by central differences to j·h²/6, across
    # phases and segments too; one whose second derivative is below j to j·h/2. A time is rounded
    # to 1e-14 s and a position to 1e-15 m.
    v = (p[2:] - p[:-2]) / (2 * period)
    assert norms(v - twist[1:-1, :3]).max() < limits.jerk * period**2 / 6 * (1 + 1e-6) + 1e-10
    relative = as_rotation(quat[2:]) * as_rotation(quat[:-2]).inv()
    omega = relative.as_rotvec() / (2 * period)
    within = pieces(reference)[2:] == pieces(reference)[:-2]  # the axis changes from one to the next
    near_pi = relative.magnitude() > 3  # fast and coarse: a shorter way back
    errors = norms(omega - twist[1:-1, 3:])[within & ~near_pi]
    assert errors.max(initial=0) < limits.angular_jerk * period**2 / 6 * (1 + 1e-6) + 1e-10
    a = (twist[2:] - twist[:-2]) / (2 * period) - acceleration(reference)[1:-1]
    assert norms(a[:, :3]).max() < limits.jerk * period / 2 * (1 + 1e-6) + 1e-10
    assert norms(a[:, 3:]).max() < limits.angular_jerk * period / 2 * (1 + 1e-6) + 1e-10


@given(poses, long_points, axes, angles)
def test_an_arc_keeps_its_radius_and_its_height_along_the_axis(pose, offset, axis, angle):
    n = unit_axis(axis)
    if norms(np.cross(offset, n)) < 0.01:
        return
    center = pose[:3] + offset
    reference = make_reference([arc(tuple(center), angle, axis)], LIMITS, pose, 0.01)
    way = reference.pose[:, :3] - center
    np.testing.assert_allclose(way @ n, -np.dot(offset, n), rtol=0, atol=ROUNDING)
    radius = norms(np.cross(offset, n))
    np.testing.assert_allclose(norms(np.cross(way, n)), radius, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(reference.twist[:, :3] @ n, 0, atol=ROUNDING)


# Turns to an orientation -------------------------------------------------------------------------


@given(poses, orientations)
def test_a_turn_to_an_orientation_takes_the_shortest_way_whatever_its_sign_and_length(pose, to):
    rotvec = (as_rotation(to) * as_rotation(pose[3:]).inv()).as_rotvec()
    if not 1e-3 < norms(rotvec) < math.pi - 1e-3:
        return
    limits = TargetLimitsSection()
    for factor in (1.0, -1.0, 1e200):
        turning = turn(to=tuple(factor * np.array(to)))
        omega = make_reference([turning], limits, pose, 1e-2).twist[:, 3:]
        # the integral of ω about one axis, by the trapezoidal rule: an error of h² j/12 a second,
        # 0.003 rad in 10 s; the longer way is 2π from the shorter one
        way = 1e-2 * omega.sum(axis=0)
        np.testing.assert_allclose(way, rotvec, rtol=0, atol=3e-3)


# Time --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pauses", "period", "ticks"),
    [
        ([0.3], 0.1, 4),  # 0.3/0.1 < 3
        ([0.1, 0.2], 0.1, 4),  # 0.1 + 0.2 > 0.3
        ([100.0], 1e-3, 100_001),
        ([0.301], 0.1, 5),
    ],
)
def test_ticks_cover_the_path_and_rounding_adds_none(pauses, period, ticks):
    reference = make_reference([hold(pause) for pause in pauses], LIMITS, START, period)
    np.testing.assert_array_equal(reference.time, period * np.arange(ticks))
    assert reference.duration == reference.time[-1]
    assert reference.period == period
    np.testing.assert_array_equal(reference.pose, np.tile(START, (ticks, 1)))
    assert not reference.twist.any()


# Messages ----------------------------------------------------------------------------------------

TOO_LONG = "target.path: … {} s … {} … 0.001 s … 10000000; … target.limits or control.period … path"


@pytest.mark.parametrize(
    ("segments", "message"),
    [
        ([hold(1), line((0.0, 0, 0))], "target.path[1].line: … 0 … [0.5, 0, 0.3] … hold … turn"),
        (
            [line((0.1, 0)), arc((0.6, 0, 7.0), 1.0)],
            "target.path[1].arc: … [0.6, 0, 0.3] … axis … 0; … center … turn …",
        ),
        ([hold(1e4), hold(0.01)], TOO_LONG.format("10000", "10000010")),
    ],
)
def test_a_path_that_cannot_be_followed_is_refused(segments, message):
    with pytest.raises(TargetError) as caught:
        make_reference(segments, LIMITS, START, 1e-3)
    assert str(caught.value) == says(message)
