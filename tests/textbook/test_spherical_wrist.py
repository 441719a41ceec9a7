"""Wrists: printed axes against the table and against rotations, determinants, singular families."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from differences import rounded
from rmrc.textbook.spherical_wrist import (
    spherical_wrist_chain,
    spherical_wrist_determinant,
    spherical_wrist_jacobian,
    three_roll_determinant,
    three_roll_jacobian,
)

# Products of three rotations.
ROUNDING = 1e-12
# Central differences of rotations, step 1e-6: 1e-16 / 1e-6 of rounding, (1e-6)² of truncation.
DIFFERENCE = 1e-8

angle = rounded(-3.1, 3.1)
configurations = st.tuples(angle, angle, angle).map(np.array)
tilts = st.tuples(rounded(0.1, 3.0), rounded(0.1, 3.0)).map(np.array)


def spherical(q):
    return Rotation.from_euler("ZYZ", q)


def three_roll(q, tilt):
    second, third = Rotation.from_euler("ZYZ", [q[0], tilt[0], q[1]]), [-tilt[1], q[2]]
    return second * Rotation.from_euler("YZ", third)


def angular_velocities(rotation, q):
    """ω of a unit rate of each joint, from the rotation a little later and a little before."""
    steps = 1e-6 * np.eye(3)
    turns = [rotation(q + step) * rotation(q - step).inv() for step in steps]
    return np.array([turn.as_rotvec() for turn in turns]).T / 2e-6


@given(configurations)
def test_printed_columns_are_the_axes_of_the_table_and_turn_the_hand(q):
    chain = spherical_wrist_chain()
    assert_allclose(chain.frames(q)[3, :3, :3], spherical(q).as_matrix(), atol=ROUNDING)
    J = spherical_wrist_jacobian(q)
    assert_allclose(chain.jacobian(q), np.vstack([np.zeros((3, 3)), J]), atol=ROUNDING)
    assert_allclose(J, angular_velocities(spherical, q), atol=DIFFERENCE)


@given(configurations, tilts)
def test_columns_of_the_three_roll_wrist_turn_its_hand(q, tilt):
    expected = angular_velocities(lambda q: three_roll(q, tilt), q)
    assert_allclose(three_roll_jacobian(q, tilt), expected, atol=DIFFERENCE)


def test_a_third_axis_tilted_on_instead_of_back_is_seen():
    """Negative control of the test above."""
    q = np.array([0.3, 0.7, -0.9])
    expected = angular_velocities(lambda q: three_roll(q, [1.0, 0.8]), q)
    with pytest.raises(AssertionError):
        assert_allclose(three_roll_jacobian(q, [1.0, -0.8]), expected, atol=1e-3)


@given(configurations, tilts)
def test_determinants_are_their_closed_forms(q, tilt):
    assert_allclose(spherical_wrist_determinant(q), np.linalg.det(spherical_wrist_jacobian(q)), atol=ROUNDING)
    assert_allclose(
        three_roll_determinant(q, tilt), np.linalg.det(three_roll_jacobian(q, tilt)), atol=ROUNDING
    )


@pytest.mark.parametrize(("theta2", "rank"), [(0.0, 2), (np.pi, 2), (-np.pi, 2), (1.0, 3)])
def test_wrists_are_singular_where_theta_2_is_k_pi(theta2, rank):
    q = np.array([0.3, theta2, 0.7])
    for J in (spherical_wrist_jacobian(q), three_roll_jacobian(q), three_roll_jacobian(q, [1.0, 0.8])):
        assert np.linalg.matrix_rank(J, tol=1e-9) == rank


def test_only_equal_tilts_align_two_axes_of_the_three_roll_wrist():
    first, _, third = three_roll_jacobian([0.3, 0.0, 0.2], [1.0, 1.0]).T
    assert_allclose(third, first, atol=ROUNDING)
    # else the first and the third axis are |β − γ| apart at θ₂ = 0, β + γ at π
    for theta2, apart in ((0.0, 0.2), (np.pi, 1.8)):
        first, _, third = three_roll_jacobian([0.3, theta2, 0.2], [1.0, 0.8]).T
        assert first @ third == pytest.approx(np.cos(apart), abs=ROUNDING)


@given(configurations)
def test_the_3r_wrist_is_a_three_roll_wrist_with_square_tilts(q):
    square = [np.pi / 2, np.pi / 2]
    turned = q + np.array([np.pi / 2, 0, 0])
    assert_allclose(three_roll_jacobian(turned, square), spherical_wrist_jacobian(q), atol=ROUNDING)


def test_leading_axes_are_configurations():
    q = np.random.default_rng(3).uniform(0.3, 1.0, (2, 3, 3))
    for f in (
        spherical_wrist_jacobian,
        spherical_wrist_determinant,
        three_roll_jacobian,
        three_roll_determinant,
    ):
        assert_allclose(f(q)[1, 2], f(q[1, 2]), atol=0)
