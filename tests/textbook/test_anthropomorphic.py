"""The anthropomorphic arm: printed Jacobian against the printed table, determinant, singular families."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from differences import DIFFERENCE, rounded, slopes
from rmrc.textbook.anthropomorphic import (
    anthropomorphic_chain,
    anthropomorphic_determinant,
    anthropomorphic_jacobian,
    anthropomorphic_position,
)
from rmrc.textbook.torus import torus_jacobian, torus_position

# Products of a few rotations and lengths of order one.
ROUNDING = 1e-12

angle = rounded(-3.1, 3.1)
configurations = st.tuples(angle, angle, angle).map(np.array)
lengths_of_arms = st.tuples(rounded(0.1, 2.0), rounded(0.1, 2.0)).map(np.array)


@given(lengths_of_arms, configurations)
def test_printed_position_and_jacobian_are_those_of_the_printed_table(lengths, q):
    chain = anthropomorphic_chain(lengths)
    assert_allclose(anthropomorphic_position(lengths, q), chain.frames(q)[3, :3, 3], atol=ROUNDING)
    assert_allclose(anthropomorphic_jacobian(lengths, q), chain.jacobian(q), atol=ROUNDING)


@given(lengths_of_arms, configurations)
def test_linear_rows_are_the_derivative_of_the_position(lengths, q):
    expected = slopes(lambda q: anthropomorphic_position(lengths, q), q)
    assert_allclose(anthropomorphic_jacobian(lengths, q)[:3], expected, atol=DIFFERENCE)


def test_without_the_90_degrees_of_theta_1_the_jacobian_is_another():
    """Negative control of the two tests above."""
    q, lengths = np.array([0.3, 0.7, -0.9]), [0.8, 0.6]
    turned = anthropomorphic_jacobian(lengths, q - [np.pi / 2, 0, 0])
    with pytest.raises(AssertionError):
        assert_allclose(turned, anthropomorphic_chain(lengths).jacobian(q), atol=1e-3)


@given(lengths_of_arms, configurations)
def test_determinant_is_its_closed_form(lengths, q):
    expected = np.linalg.det(anthropomorphic_jacobian(lengths, q)[:3])
    assert_allclose(anthropomorphic_determinant(lengths, q), expected, atol=ROUNDING)


@pytest.mark.parametrize(
    ("q", "rank"),
    [
        ([20, 70, -100], 3),
        ([20, 70, 0], 2),  # stretched
        ([20, 70, 180], 2),  # folded
        # The tip on the waist's axis: the upper arm at φ, the forearm where 0.8 cos φ = 0.6 cos ψ.
        ([20, 60, np.degrees(np.arccos(-0.4 / 0.6)) - 60], 2),
        ([20, 90, 0], 1),  # both: stretched straight up, only shoulder and elbow move it, alike
    ],
)
def test_each_factor_is_a_family_of_singularities(q, rank):
    J = anthropomorphic_jacobian([0.8, 0.6], np.radians(q))[:3]
    assert np.linalg.matrix_rank(J, tol=1e-9) == rank
    assert (abs(anthropomorphic_determinant([0.8, 0.6], np.radians(q))) > 1e-9) == (rank == 3)


@given(lengths_of_arms, configurations)
def test_it_is_the_arm_of_the_torus_without_its_first_link(lengths, q):
    first, turned = np.array([0.0, *lengths]), q + np.array([np.pi / 2, 0, 0])
    assert_allclose(anthropomorphic_position(lengths, q), torus_position(first, turned), atol=ROUNDING)
    assert_allclose(anthropomorphic_jacobian(lengths, q), torus_jacobian(first, turned), atol=ROUNDING)


def test_leading_axes_are_configurations():
    q = np.random.default_rng(3).uniform(0.3, 1.0, (2, 3, 3))
    lengths = [0.8, 0.6]
    for f in (anthropomorphic_position, anthropomorphic_jacobian, anthropomorphic_determinant):
        assert_allclose(f(lengths, q)[1, 2], f(lengths, q[1, 2]), atol=0)
