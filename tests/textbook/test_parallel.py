"""The 3-RPR platform: its inverse Jacobian against differences, screws, and its two kinds of singularity."""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook.parallel import platform_inverse_jacobian, platform_leg_lengths

BASE = np.array([[0.0, 0.0], [6.0, 0.0], [3.0, 5.0]])
PLATFORM = np.array([[-1.0, -0.6], [1.0, -0.6], [0.0, 1.2]])

points = arrays(float, (3, 2), elements=st.floats(-3.0, 3.0))
poses = arrays(float, 3, elements=st.floats(-3.0, 3.0))


def differences(base, platform, pose):
    h = 1e-5
    steps = h * np.eye(3)
    ahead, behind = (platform_leg_lengths(base, platform, pose + sign * steps) for sign in (1, -1))
    return ((ahead - behind) / (2 * h)).T


@given(points, points, poses)
def test_the_leg_lines_are_the_derivative_of_the_leg_lengths(base, platform, pose):
    # The third derivative of a length is some (5 m)²/d²: with d > 0.5 m, (1e-5)²/6 · 1e3 = 2e-8.
    assume(platform_leg_lengths(base, platform, pose).min() > 0.5)
    K = platform_inverse_jacobian(base, platform, pose)
    assert_allclose(K, differences(base, platform, pose), atol=1e-7)


@given(poses, st.floats(0.3, 3.0))
def test_rank_is_lost_where_the_lines_meet_in_a_point(pose, stretch):
    """The hinges on the ground are put on the lines from one point through those of the platform."""
    meeting = pose[:2] + np.array([0.4, 0.3])
    c, s = np.cos(pose[2]), np.sin(pose[2])
    hinges = PLATFORM @ np.array([[c, s], [-s, c]]) + pose[:2]
    base = hinges + stretch * np.array([1.0, 1.5, 2.0])[:, None] * (hinges - meeting)
    K = platform_inverse_jacobian(base, PLATFORM, pose)
    assert np.linalg.svd(K, compute_uv=False)[2] < 1e-12
    # The motion that no leg feels is the turn about that point: v = −ω × (meeting − p).
    turn = np.array([0.3, -0.4, 1.0])
    assert_allclose(K @ turn, 0.0, atol=1e-12)
    # If one line misses that point, where the other two meet alone, the platform is held.
    across = 0.3 * np.array([hinges[0, 1] - meeting[1], meeting[0] - hinges[0, 0]])
    base[0] += across
    moved = platform_inverse_jacobian(base, PLATFORM, pose)
    assert np.linalg.svd(moved, compute_uv=False)[2] > 1e-3


@given(poses, st.floats(-3.0, 3.0))
def test_rank_is_lost_where_the_lines_are_parallel(pose, heading):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    hinges = PLATFORM @ np.array([[c, s], [-s, c]]) + pose[:2]
    along = np.array([np.cos(heading), np.sin(heading)])
    base = hinges - np.array([1.0, 1.5, 2.0])[:, None] * along
    K = platform_inverse_jacobian(base, PLATFORM, pose)
    assert np.linalg.svd(K, compute_uv=False)[2] < 1e-12
    assert_allclose(K @ [-along[1], along[0], 0.0], 0.0, atol=1e-12)  # it slips across the legs
