"""How far workspaces go and where arms move worst in them: closed forms of arms of two and three joints."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from spaces import found

from project import ROOT, examples
from rmrc import arm as arms
from rmrc.analysis.workspace.joint_map import joint_map
from rmrc.analysis.workspace.workspace import workspace

# What the search promises: Newton's method ends at rounding.
REACHED = 1e-9


def assert_extents(reach, first, second):
    for extent, expected in zip(reach.extents, (first, second), strict=True):
        assert_allclose([extent.low, extent.high], expected, atol=REACHED)
        assert extent.accuracy <= REACHED


def assert_reached(space, reach):
    """By MuJoCo, within the limits, and in the slice."""
    arm, part = space.task.arm, space.part
    for axis, extent in enumerate(reach.extents):
        for q, value in zip(extent.q, (extent.low, extent.high), strict=True):
            position = arm.pose(q)[:3]
            # An arm that reaches over its axis is on it somewhere, and not at the nearest node of a grid.
            if not (part.is_round and axis == 0 and value == 0.0):
                assert_allclose(part.coordinates(position)[axis], value, atol=REACHED)
            assert abs(part.offset(position)) <= REACHED
            if reach is space.limited:
                low, high = arm.position_limit[part.joints].T
                turns = (q[part.joints] - low) % (2 * np.pi)
                turns = np.where(turns > 2 * np.pi - 1e-8, 0.0, turns)
                is_slide = arm.is_slide[part.joints]
                assert (np.where(is_slide, q[part.joints] - low, turns) <= high - low + 1e-8).all()


def test_extents_of_the_arm_of_6_and_3_are_those_of_its_circles_and_limits():
    space = found("planar_6_3")
    assert_extents(space.free, [-9, 9], [-9, 9])
    # q1 = 135 deg with the forearm level and backward; q1 = q2 = 0; straight along x, and along y.
    assert_extents(space.limited, [6 * np.cos(np.radians(135)) - 3, 9], [0, 9])
    for reach in (space.free, space.limited):
        assert_reached(space, reach)
        # On the circle of radius 9 there is one posture, straight, in which nothing moves outward.
        assert reach.ends["sigma_min"][0] == reach.ends["manipulability"][0] == 0.0
        assert reach.ends["condition"][1] == np.inf
        assert set(reach.source.values()) == {"singular"}


def test_extents_of_two_equal_links_within_limits():
    space = found("planar_2link")
    # Backward the upper arm stops at 170 deg, and the forearm goes on level.
    assert_extents(space.limited, [np.cos(np.radians(170)) - 1, 2], [-2, 2])
    assert_extents(space.free, [-2, 2], [-2, 2])
    assert_reached(space, space.limited)


@pytest.mark.parametrize(("name", "l1", "inner"), [("torus_3r", 1.2, 0.1), ("torus_3r_short", 0.4, 0.0)])
def test_extents_of_the_torus_are_its_tubes(name, l1, inner):
    space = found(name)
    tube = 0.6 + 0.5
    assert_extents(space.free, [inner, l1 + tube], [1.2 - tube, 1.2 + tube])
    # Within limits joint 2 stops at 170 deg, short of the axis of the hollow; the last link is level there.
    within = max(0.0, l1 + 0.6 * np.cos(np.radians(170)) - 0.5)
    assert_extents(space.limited, [within, l1 + tube], [1.2 - tube, 1.2 + tube])
    assert_reached(space, space.limited)
    assert space.free.ends["sigma_min"][0] == 0.0


def test_extents_of_a_cut_through_the_torus_are_those_of_the_circle_in_it():
    # The plane y = 0.5 cuts the outermost circle, of 2.3 m, and has its heights from the circle of 1.2 m.
    space = found("torus_3r", None, "xz", (0.0, 0.5, 0.0), cells=30)
    across = np.sqrt(2.3**2 - 0.5**2)
    assert_extents(space.free, [-across, across], [0.1, 2.3])
    assert_reached(space, space.free)
    assert_reached(space, space.limited)


def test_extents_of_sampled_arms_are_reached_to_rounding():
    space = found("planar_3link", cells=12, samples=5000)
    assert_extents(space.free, [-2.4, 2.4], [-2.4, 2.4])
    # Backward the upper arm stops at 170 deg, and the others go on level.
    assert_extents(space.limited, [np.cos(np.radians(170)) - 1.4, 2.4], [-2.4, 2.4])
    assert_reached(space, space.limited)
    assert space.limited.ends["sigma_min"][0] == 0.0


def test_a_singular_posture_counts_only_if_no_better_one_reaches_its_point():
    space = found("torus_3r_short")
    assert space.free.ends["sigma_min"][0] == 0.0 and space.free.source["sigma_min"] == "singular"
    # The Stanford arm is singular at many points of its inside, which other postures reach as well.
    best = found("stanford", cells=6, samples=300)
    assert len(best.singular[0].q) > 500
    assert best.free.ends["sigma_min"][0] > 0.02


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("torus_3r_short", {}),
        pytest.param("stanford", {"cells": 12, "samples": 2000}, marks=pytest.mark.long),
    ],
)
def test_of_the_worst_postures_a_singular_one_counts(name, options):
    worst = found(name, worst=True, **options)
    assert worst.free.ends["sigma_min"][0] == 0.0 and worst.free.source["sigma_min"] == "singular"


def two_links(folder, lengths, ranges):
    (a, b), ((c, d), (e, f)) = lengths, ranges
    path = folder.mktemp("two") / "arm.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><default><geom contype="0" conaffinity="0" size="0.1"/></default>'
        f'<worldbody><body><joint name="one" axis="0 0 1" range="{c:.17g} {d:.17g}"/><geom/>'
        f'<body pos="{a:.17g} 0 0"><joint name="two" axis="0 0 1" range="{e:.17g} {f:.17g}"/><geom/>'
        f'<site name="tip" pos="{b:.17g} 0 0"/></body></body></worldbody></mujoco>'
    )
    return arms.load(path)


def farthest(lengths, ranges, direction):
    """Largest a cos(q1 − δ) + b cos(q1 + q2 − δ) in a box: where both links, one of them, or a limit point to δ."""
    (a, b), ((c, d), (e, f)) = lengths, ranges
    turns = 2.0 * np.pi * np.arange(-3, 4)
    places = [(one, two) for one in direction + turns for two in turns]
    for one in (c, d):
        places += [(one, two) for two in direction - one + turns] + [(one, two) for two in (e, f)]
    for two in (e, f):
        ahead = np.arctan2(b * np.sin(two), a + b * np.cos(two))
        places += [(one, two) for one in direction - ahead + turns]
    # Rounding must not lose a place that is at a limit.
    inside = [
        (one, two) for one, two in places if c - 1e-12 <= one <= d + 1e-12 and e - 1e-12 <= two <= f + 1e-12
    ]
    return max(a * np.cos(one - direction) + b * np.cos(one + two - direction) for one, two in inside)


lengths_of_links = st.tuples(st.floats(0.2, 2.0), st.floats(0.2, 2.0))
starts, spans = st.floats(-3.0, 2.0), st.floats(0.3, 3.0)


@given(lengths_of_links, starts, spans, starts, spans)
@examples(2, 6)
def test_extents_and_worst_points_of_any_two_links_within_any_limits(tmp_path_factory, lengths, c, d, e, f):
    ranges = ((c, min(c + d, np.pi)), (e, min(e + f, np.pi)))
    space = workspace(two_links(tmp_path_factory, lengths, ranges), q=np.array([c, e]), cells=20)
    expected = [
        [-farthest(lengths, ranges, w + np.pi), farthest(lengths, ranges, w)] for w in (0.0, np.pi / 2)
    ]
    for extent, own in zip(space.limited.extents, expected, strict=True):
        assert_allclose([extent.low, extent.high], own, atol=REACHED)
    assert_reached(space, space.limited)
    # σ_min depends on the elbow alone, and rises from 0 where it is straight.
    low, high = ranges[1]
    a, b = lengths
    worst = space.limited.ends["sigma_min"][0]
    if low <= 0.0 <= high:
        assert worst == 0.0
    elif low > 0.05 and high < 3.0:  # bent one way only: a point has one posture, and the ends are the worst
        elbows = np.array([low, high])
        sigma = [
            np.linalg.svd([[-b * np.sin(x), -b * np.sin(x)], [a + b * np.cos(x), b * np.cos(x)]])[1][-1]
            for x in elbows
        ]
        assert_allclose(worst, min(sigma), rtol=1e-9)
        assert space.limited.source["sigma_min"] == "limits"


def test_a_map_over_two_joints_is_searched_between_its_steps():
    arm = arms.load(ROOT / "models/planar_2link.xml")
    # 37 steps have no node at 0, where det J = sin q2 is 0.
    space = joint_map(arm, ("shoulder", "elbow"), np.zeros(2), cells=37)
    assert space.values["sigma_min"].min() > 1e-3
    assert space.ends["sigma_min"][0] == space.ends["manipulability"][0] == 0.0
    assert space.ends["condition"][1] == np.inf
    # w = |sin q2| is 1 at a right angle; κ + 1/κ = (σ_1² + σ_2²)/w = (3 + 2 cos q2)/|sin q2| is least at its zero
    # slope, cos q2 = −2/3, where it is √5: κ = (√5 + 1)/2.
    assert_allclose(space.ends["manipulability"][1], 1.0, atol=REACHED)
    assert_allclose(space.ends["condition"][0], (np.sqrt(5.0) + 1.0) / 2.0, atol=REACHED)
    # On the side of its range where the arm of 6 and 3 is straight, and nowhere else.
    side = joint_map(ROOT / "models/planar_6_3.xml", ("q1", "q2"), np.zeros(2), cells=20)
    assert len(side.singular) == 1 and (side.singular[0][:, 1] == 0.0).all()
