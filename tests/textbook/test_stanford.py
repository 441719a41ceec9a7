"""The Stanford arm: printed Jacobian against DH table, determinant, singular families."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from rmrc.textbook.stanford import stanford_chain, stanford_determinant, stanford_jacobian

# Products of six rotations and lengths of order one.
ROUNDING = 1e-12

angle = st.floats(-3.1, 3.1)
configurations = st.tuples(angle, angle, st.floats(0.3, 1.3), angle, angle, angle).map(np.array)
offsets = st.floats(-0.5, 0.5)


@given(configurations, offsets)
def test_printed_jacobian_equals_the_columns_of_the_printed_table(q, d2):
    assert_allclose(stanford_jacobian(q, d2), stanford_chain(d2).jacobian(q), atol=ROUNDING)


def test_a_wrong_sign_of_d2_is_seen():
    """Negative control of the test above."""
    q = np.array([0.3, 1.0, 0.6, 0.2, 0.5, 0.1])
    with pytest.raises(AssertionError):
        assert_allclose(stanford_jacobian(q, 0.154), stanford_chain(-0.154).jacobian(q), atol=1e-3)


@given(configurations, offsets)
def test_determinant_is_d3_squared_s2_s5(q, d2):
    expected = np.linalg.det(stanford_jacobian(q, d2))
    assert_allclose(stanford_determinant(q), expected, atol=ROUNDING)


@given(configurations)
def test_wrist_point_is_d2_z2_plus_d3_z3(q):
    (c1, c2), (s1, s2), d3 = np.cos(q[:2]), np.sin(q[:2]), q[2]
    expected = [c1 * s2 * d3 - s1 * 0.154, s1 * s2 * d3 + c1 * 0.154, c2 * d3]
    origins = stanford_chain().frames(q)[:, :3, 3]
    # Frames 3 to 6 share their origin: the wrist point.
    assert_allclose(origins[3:], np.broadcast_to(expected, (4, 3)), atol=ROUNDING)


@pytest.mark.parametrize(("k", "sign"), [(-1, -1), (0, 1), (1, -1)])
def test_at_theta_5_k_pi_the_sixth_axis_is_the_fourth_up_to_the_sign_of_cos_k_pi(k, sign):
    """The notes print the sixth column for θ₅ = kπ with the sign of even k only."""
    J = stanford_jacobian([0.3, 1.0, 0.6, 0.7, k * np.pi, 0.2])
    assert_allclose(J[:, 5], sign * J[:, 3], atol=ROUNDING)
    assert np.linalg.matrix_rank(J) == 5


@pytest.mark.parametrize(
    ("q", "rank"),
    [
        ([0.3, 1.0, 0.6, 0.7, 0.9, 0.2], 6),
        ([0.3, 0.0, 0.6, 0.7, 0.9, 0.2], 5),
        ([0.3, 1.0, 0.6, 0.7, 0.0, 0.2], 5),
        # d₃² is a double zero, but only one column, ∂p/∂θ₂, vanishes: d₂ keeps the other.
        ([0.3, 1.0, 0.0, 0.7, 0.9, 0.2], 5),
        # Two families at once cost two ranks only where z₅ is parallel to z₂; else the shoulder
        # turns about the axis that the wrist has lost.
        ([0.3, 0.0, 0.6, 0.0, 0.0, 0.2], 4),
        ([0.3, 0.0, 0.6, 0.7, 0.0, 0.2], 5),
    ],
)
def test_each_factor_of_the_determinant_is_a_family_of_singularities(q, rank):
    assert np.linalg.matrix_rank(stanford_jacobian(q)) == rank


def test_leading_axes_are_configurations():
    q = np.random.default_rng(3).uniform(0.3, 1.0, (2, 3, 6))
    assert stanford_jacobian(q).shape == (2, 3, 6, 6)
    assert_allclose(stanford_jacobian(q)[1, 2], stanford_jacobian(q[1, 2]), atol=0)
    assert_allclose(stanford_determinant(q)[1, 2], stanford_determinant(q[1, 2]), atol=0)
