"""Exercise 6.3: the closed form against its table and finite differences; the pivot is singular."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from differences import DIFFERENCE, rounded, slopes
from rmrc.textbook.planar import embed_planar_jacobian
from rmrc.textbook.planar_rp import (
    planar_rp_chain,
    planar_rp_determinant,
    planar_rp_jacobian,
    planar_rp_position,
)

# Products of two rotations and lengths of order one.
ROUNDING = 1e-12

configurations = st.tuples(rounded(-3.1, 3.1), rounded(-2.0, 2.0)).map(np.array)
reaches = rounded(0.0, 2.0)


@given(configurations, reaches)
def test_position_and_jacobian_are_those_of_the_table(q, reach):
    chain, Q = planar_rp_chain(), (0.0, 0.0, reach)
    x, y = planar_rp_position(q, reach)
    assert_allclose(chain.frames(q)[2] @ [*Q, 1.0], [x, y, 0.0, 1.0], atol=ROUNDING)
    six = embed_planar_jacobian(planar_rp_jacobian(q, reach))
    assert_allclose(six, chain.jacobian(q, point=Q), atol=ROUNDING)


@given(configurations, reaches)
def test_jacobian_is_the_derivative_of_the_position(q, reach):
    expected = slopes(lambda q: planar_rp_position(q, reach), q)
    assert_allclose(planar_rp_jacobian(q, reach)[:2], expected, atol=DIFFERENCE)


def test_a_slide_that_starts_at_the_pivot_is_seen():
    """Negative control: Q is at 1 m when the slide is at 0."""
    q = np.array([0.4, 0.3])
    expected = slopes(planar_rp_position, q)
    with pytest.raises(AssertionError):
        assert_allclose(planar_rp_jacobian(q, home_reach=0.0)[:2], expected, atol=1e-3)


@given(configurations, reaches)
def test_determinant_is_the_distance_from_the_pivot(q, reach):
    expected = np.linalg.det(planar_rp_jacobian(q, reach)[:2])
    assert_allclose(planar_rp_determinant(q, reach), expected, atol=ROUNDING)


def test_on_the_pivot_only_the_rod_moves_the_point():
    assert np.linalg.matrix_rank(planar_rp_jacobian([0.4, -1.0])[:2]) == 1
    assert_allclose(planar_rp_jacobian([0.4, -1.0])[:2, 0], 0.0, atol=0)
    # with the rotation as a third row the arm is never singular: it has two joints and they differ
    assert np.linalg.matrix_rank(planar_rp_jacobian([0.4, -1.0])) == 2


def test_leading_axes_are_configurations():
    q = np.random.default_rng(3).uniform(0.3, 1.0, (2, 3, 2))
    for f in (planar_rp_position, planar_rp_jacobian, planar_rp_determinant):
        assert_allclose(f(q)[1, 2], f(q[1, 2]), atol=0)
