"""Planar arms: the printed closed forms against the general sums, DH, and finite differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook import planar, two_link
from rmrc.textbook.dh import DHChain

# Sums of a few products of order one.
ROUNDING = 1e-12
# Central differences, step 1e-5: truncation (1e-5)^2/6 times |third derivative| <= 10 m.
DIFFERENCE = 1e-8
STEP = 1e-5

links = st.integers(1, 6).flatmap(
    lambda n: st.tuples(
        arrays(float, n, elements=st.floats(0.1, 2.0)),
        arrays(float, n, elements=st.floats(-3.0, 3.0)),
    )
)


def fixed(n):
    return st.tuples(
        arrays(float, n, elements=st.floats(0.1, 2.0)),
        arrays(float, n, elements=st.floats(-3.0, 3.0)),
    )


def differences(position, lengths, q):
    steps = STEP * np.eye(len(q))
    return ((position(lengths, q + steps) - position(lengths, q - steps)) / (2 * STEP)).T


def dh(lengths):
    """The same arm as a modified DH table; the tip is a point of the last frame."""
    a = [0.0, *lengths[:-1]]
    return DHChain(tuple((0.0, x, 0.0, 0.0) for x in a), ("revolute",) * len(lengths))


@given(links)
def test_jacobian_is_the_derivative_of_the_position(case):
    lengths, q = case
    expected = differences(planar.planar_position, lengths, q)
    assert_allclose(planar.planar_jacobian(lengths, q), expected, atol=DIFFERENCE)


def test_a_jacobian_of_angles_that_are_not_summed_is_no_derivative():
    """Negative control: absolute instead of relative angles must not pass the check above."""
    lengths, q = np.array([1.0, 0.8, 0.6]), np.array([0.4, -0.9, 0.3])
    absolute = planar.planar_jacobian(lengths, np.diff(q, prepend=0.0))
    with pytest.raises(AssertionError):
        assert_allclose(absolute, differences(planar.planar_position, lengths, q), atol=DIFFERENCE)


@given(links)
def test_centers_of_rotation_give_the_same_jacobian(case):
    lengths, q = case
    origins = dh(lengths).frames(q)[1:, :2, 3]
    tip = planar.planar_position(lengths, q)[:2]
    J = planar.planar_jacobian_from_centers(origins, tip)
    assert_allclose(J, planar.planar_jacobian(lengths, q), atol=ROUNDING)
    # Wherever the drawing lies: all that counts is where the joints are relative to the point.
    assert_allclose(planar.planar_jacobian_from_centers(origins + 1.0, tip + 1.0), J, atol=ROUNDING)


def test_centers_that_are_link_centers_are_no_centers_of_rotation():
    """Negative control of the test above."""
    lengths, q = np.array([1.0, 0.8, 0.6]), np.array([0.4, -0.9, 0.3])
    centers = dh(lengths / 2).frames(q)[1:, :2, 3]
    J = planar.planar_jacobian_from_centers(centers, planar.planar_position(lengths, q)[:2])
    with pytest.raises(AssertionError):
        assert_allclose(J, planar.planar_jacobian(lengths, q), atol=1e-3)


@given(links)
def test_position_and_six_rows_equal_the_dh_chain(case):
    lengths, q = case
    chain, tip = dh(lengths), (lengths[-1], 0.0, 0.0)
    pose = chain.frames(q)[-1]
    x, y, rz = planar.planar_position(lengths, q)
    assert_allclose(pose @ [*tip, 1.0], [x, y, 0.0, 1.0], atol=ROUNDING)
    assert_allclose(pose[:2, 0], [np.cos(rz), np.sin(rz)], atol=ROUNDING)
    six = planar.embed_planar_jacobian(planar.planar_jacobian(lengths, q))
    assert_allclose(six, chain.jacobian(q, point=tip), atol=ROUNDING)


@given(fixed(2))
def test_two_links_as_printed_equal_n_links(case):
    lengths, q = case
    assert_allclose(
        two_link.two_link_position(lengths, q), planar.planar_position(lengths, q)[:2], atol=ROUNDING
    )
    assert_allclose(
        two_link.two_link_jacobian(lengths, q), planar.planar_jacobian(lengths, q)[:2], atol=ROUNDING
    )


@given(fixed(3))
def test_three_links_as_printed_equal_n_links(case):
    lengths, q = case
    assert_allclose(planar.three_link_position(lengths, q), planar.planar_position(lengths, q), atol=ROUNDING)
    assert_allclose(planar.three_link_jacobian(lengths, q), planar.planar_jacobian(lengths, q), atol=ROUNDING)


@given(fixed(3))
def test_wrist_point_is_the_third_frame_of_the_dh_chain(case):
    lengths, q = case
    wrist = planar.embed_planar_jacobian(planar.three_link_jacobian(lengths * [1, 1, 0], q))
    assert_allclose(wrist, dh(lengths).jacobian(q), atol=ROUNDING)


@given(fixed(3))
def test_determinants_are_l1_l2_s2(case):
    lengths, q = case
    expected = lengths[0] * lengths[1] * np.sin(q[1])
    assert_allclose(two_link.two_link_determinant(lengths[:2], q[:2]), expected, atol=ROUNDING)
    two = np.linalg.det(two_link.two_link_jacobian(lengths[:2], q[:2]))
    three = np.linalg.det(planar.three_link_jacobian(lengths, q))
    assert_allclose([two, three], expected, atol=ROUNDING)


@pytest.mark.parametrize(
    ("function", "n"),
    [
        (planar.planar_position, 4),
        (planar.planar_jacobian, 4),
        (two_link.two_link_position, 2),
        (two_link.two_link_jacobian, 2),
        (two_link.two_link_determinant, 2),
        (two_link.two_link_jacobian_inverse, 2),
        (two_link.two_link_rates, 2),
        (planar.three_link_position, 3),
        (planar.three_link_jacobian, 3),
        (lambda arms, q: planar.planar_jacobian_from_centers(np.stack([arms, arms + 1.0], axis=-2), q), 2),
    ],
)
def test_leading_axes_are_arms_and_configurations(function, n):
    rng = np.random.default_rng(2)
    lengths, q = rng.uniform(0.5, 1.5, (5, 1, n)), rng.uniform(0.2, 1.2, (3, n))
    both = function(lengths, q)
    assert both.shape[:2] == (5, 3)
    assert_allclose(both[4, 1], function(lengths[4, 0], q[1]), atol=ROUNDING)
    one_arm = function(lengths[4, 0], q)
    assert_allclose(one_arm, both[4], atol=ROUNDING)
