"""The arm with a helical joint: closed form against a hinge and a slide, and what the pitch changes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from differences import DIFFERENCE, rounded, slopes
from rmrc.textbook.dh import DHChain
from rmrc.textbook.helical import (
    helical_determinant,
    helical_jacobian,
    helical_position,
    helical_singular_crank,
)
from rmrc.textbook.screws import geometric_from_screws, joint_screw, product_of_exponentials, space_jacobian

# Products of a few rotations and lengths of order one.
ROUNDING = 1e-12

angle = rounded(-3.1, 3.1)
configurations = st.tuples(rounded(-7.0, 7.0), rounded(0.1, 2.0), angle).map(np.array)
pitches = rounded(-0.3, 0.3)
cranks = rounded(0.1, 2.0)

# Hinge and slide on one axis instead of the screw, then boom and crank.
HINGE_AND_SLIDE = DHChain(
    table=((0, 0, 0, 0), (0, 0, 0, np.pi / 2), (np.pi / 2, 0, 0, 0), (0, 0, 0, 0)),
    kinds=("revolute", "prismatic", "prismatic", "revolute"),
)


def coupling(pitch):
    """Positions and rates of hinge, slide, boom and crank from those of screw, boom and crank."""
    return np.array([[1, 0, 0], [pitch, 0, 0], [0, 1, 0], [0, 0, 1]])


@given(pitches, cranks, configurations)
def test_a_screw_is_a_hinge_and_a_slide_coupled_by_its_pitch(pitch, crank, q):
    C, tip = coupling(pitch), (crank, 0.0, 0.0)
    pose = HINGE_AND_SLIDE.frames(C @ q)[4]
    assert_allclose(helical_position(pitch, crank, q), (pose @ [*tip, 1.0])[:3], atol=ROUNDING)
    J = HINGE_AND_SLIDE.jacobian(C @ q, point=tip) @ C
    assert_allclose(helical_jacobian(pitch, crank, q), J, atol=ROUNDING)


@given(pitches, cranks, configurations)
def test_jacobian_and_position_are_those_of_the_joint_screws(pitch, crank, q):
    axes = [[0, 0, 1], [1, 0, 0], [1, 0, 0]]
    screws = joint_screw(axes, np.zeros((3, 3)), [pitch, np.inf, 0.0])
    home = np.eye(4)
    home[1, 3] = crank
    tip = product_of_exponentials(screws, q, home)[:3, 3]
    assert_allclose(helical_position(pitch, crank, q), tip, atol=ROUNDING)
    J = geometric_from_screws(space_jacobian(screws, q), tip)
    assert_allclose(helical_jacobian(pitch, crank, q), J, atol=ROUNDING)


@given(pitches, cranks, configurations)
def test_linear_rows_are_the_derivative_of_the_position(pitch, crank, q):
    expected = slopes(lambda q: helical_position(pitch, crank, q), q)
    assert_allclose(helical_jacobian(pitch, crank, q)[:3], expected, atol=DIFFERENCE)


def test_a_screw_without_pitch_is_seen():
    """Negative control: a plain hinge must not pass the checks above."""
    q = np.array([0.4, 0.8, 0.3])
    expected = slopes(lambda q: helical_position(0.1, 0.4, q), q)
    with pytest.raises(AssertionError):
        assert_allclose(helical_jacobian(0.0, 0.4, q)[:3], expected, atol=1e-3)


@given(pitches, cranks, configurations)
def test_determinant_is_its_closed_form(pitch, crank, q):
    expected = np.linalg.det(helical_jacobian(pitch, crank, q)[:3])
    # Products of three entries of at most 4 m.
    assert_allclose(helical_determinant(pitch, crank, q), expected, atol=10 * ROUNDING)


@given(pitches, cranks, configurations, st.sampled_from([0.0, np.pi]))
def test_the_pitch_tilts_the_singular_crank(pitch, crank, q, half_turn):
    q[2] = helical_singular_crank(pitch, q[1]) + half_turn
    sigma = np.linalg.svd(helical_jacobian(pitch, crank, q)[:3], compute_uv=False)
    assert sigma[-1] < 1e-12 < 1e-3 < sigma[1]
    assert abs(np.cos(q[2])) == pytest.approx(abs(pitch) / np.hypot(pitch, q[1]), abs=ROUNDING)


def test_leading_axes_are_configurations():
    q = np.random.default_rng(3).uniform(0.3, 1.0, (2, 3, 3))
    for f in (helical_position, helical_jacobian, helical_determinant):
        assert_allclose(f(0.1, 0.4, q)[1, 2], f(0.1, 0.4, q[1, 2]), atol=0)
