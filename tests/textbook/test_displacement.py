"""Taylor's order, the printed errors of the tip, and covariances against random samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook.displacement import taylor_order, taylor_remainder, tip_covariance, tip_error
from rmrc.textbook.planar import planar_jacobian, planar_position, three_link_jacobian
from rmrc.textbook.stanford import stanford_chain, stanford_jacobian

LENGTHS = np.array([2.0, 1.0, 1.0])
ROUNDING = 1e-12

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


@pytest.mark.parametrize("seed", range(5))
def test_the_order_is_two(seed):
    rng = np.random.default_rng(seed)
    q, dq = rng.uniform(-2, 2, 3), rng.normal(size=3)
    assert taylor_order(*arm(), q, dq) == pytest.approx(2.0, abs=0.1)
    # in space, with a sliding joint
    chain, q, dq = stanford_chain(), rng.uniform(0.3, 1.2, 6), rng.normal(size=6)
    order = taylor_order(lambda q: chain.frames(q)[..., 6, :3, 3], lambda q: stanford_jacobian(q)[:3], q, dq)
    assert order == pytest.approx(2.0, abs=0.1)


def test_the_printed_errors_of_the_tip():
    """B, section 6.2, with l₂ + l₃ = 2."""
    joint_error = np.array([0.0, 0.1, 0.0])
    home = three_link_jacobian(LENGTHS, [0, 0, 0])
    assert_allclose(tip_error(home, joint_error)[:2], [0.0, 0.1 * 2], atol=ROUNDING)
    assert_allclose(home[0], 0.0, atol=ROUNDING)  # so no joint error at all shows in x
    bent = three_link_jacobian(LENGTHS, [0, np.pi / 2, 0])
    assert_allclose(tip_error(bent, joint_error)[:2], [-2 / 10, 0.0], atol=ROUNDING)
    # "to first order": the real error differs by (0.1)²/2 of 2 m
    moved = planar_position(LENGTHS, [0, np.pi / 2 + 0.1, 0]) - planar_position(LENGTHS, [0, np.pi / 2, 0])
    assert_allclose(moved[:2], [-0.2, 0.0], atol=0.01)


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
