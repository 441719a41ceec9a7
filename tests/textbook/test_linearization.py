"""Taylor's order, covariances against random samples, and Newton's iterates with the worked example of the notes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook.inverse import newton_raphson
from rmrc.textbook.motion import taylor_remainder, tip_covariance
from rmrc.textbook.planar import planar_jacobian, planar_position, three_link_jacobian, three_link_position

LENGTHS = np.array([2.0, 1.0, 1.0])

angles = arrays(float, 3, elements=st.floats(-3.0, 3.0))


def arm(jacobian=planar_jacobian):
    return (lambda q: planar_position(LENGTHS, q)), (lambda q: jacobian(LENGTHS, q))


@given(angles, angles.filter(lambda d: np.linalg.norm(d) > 0.1))
def test_the_linear_approximation_misses_by_the_second_derivative_of_each_link(q, dq):
    """k'' is exact for a planar arm: each link adds −l (Δφ)² (cos φ, sin φ)/2, plus third order."""
    h = 1e-3
    turn = np.cumsum(h * dq)
    phi = np.cumsum(q)
    second = -0.5 * np.stack([LENGTHS * turn**2 * np.cos(phi), LENGTHS * turn**2 * np.sin(phi)]).sum(axis=1)
    missed = taylor_remainder(*arm(), q, h * dq)
    # Third order: Σ l |Δφ|³/6, here below 4 · (9e-3)³/6.
    assert_allclose(missed[:2], second, atol=(LENGTHS * np.abs(turn) ** 3).sum() / 6 + 1e-14)
    assert missed[2] == pytest.approx(0.0, abs=1e-14)


def test_the_covariance_is_that_of_random_samples():
    rng = np.random.default_rng(7)
    q, deviation = np.array([0.4, 0.9, -0.5]), np.array([1e-3, 3e-3, 2e-3])
    root = np.diag(deviation) @ np.linalg.cholesky([[1, 0.5, 0], [0.5, 1, -0.3], [0, -0.3, 1]])
    covariance = tip_covariance(planar_jacobian(LENGTHS, q), root @ root.T)
    count = 200_000
    tips = planar_position(LENGTHS, q + rng.normal(size=(count, 3)) @ root.T)
    sampled = np.cov(tips.T)
    # An estimated covariance has the standard error √(2/count) = 0.3 %; five of them, and what is of
    # second order, some (3e-3)², is far less.
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert_allclose(sampled / scale, covariance / scale, atol=5 * np.sqrt(2 / count))
    # Negative control: correlations are not free.
    independent = tip_covariance(planar_jacobian(LENGTHS, q), np.diag(deviation**2))
    with pytest.raises(AssertionError):
        assert_allclose(sampled / scale, independent / scale, atol=5 * np.sqrt(2 / count))


START = np.array([np.pi / 3, np.pi / 6, np.pi / 6])
GOAL = np.array([0.5, 3.0, 2 * np.pi / 3])


def position(q):
    return three_link_position(LENGTHS, q)


def jacobian(q):
    return three_link_jacobian(LENGTHS, q)


def test_the_worked_example_begins_as_printed_and_ends_at_the_root():
    found = newton_raphson(position, jacobian, START, GOAL)
    assert_allclose(found.error[0], [0.0, 0.5981, 0.0], atol=5e-5)  # four decimals are printed
    assert_allclose(found.step[0], [0.5981, -1.6340, 1.0359], atol=5e-5)
    assert_allclose(found.q[1], [0.4491, 2.1576, -0.5123], atol=5e-5)
    assert found.status == "converged"
    assert len(found.step) <= 6
    assert_allclose(found.q[-1], [0.698863, 1.431888, -0.036356], atol=5e-7)
    assert_allclose(position(found.q[-1]), GOAL, atol=1e-9)


@pytest.mark.parametrize("elbow", [0.0, np.pi])
def test_a_singular_start_is_a_status(elbow):
    """Also where rounding hides it: sin π is 1e-16."""
    found = newton_raphson(position, jacobian, [0.3, elbow, 0.2], GOAL)
    assert (found.status, len(found.step)) == ("singular", 0)
    assert_allclose(found.error[0], position(np.array([0.3, elbow, 0.2])) - GOAL, atol=0)
