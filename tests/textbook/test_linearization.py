"""Taylor's order, covariances against random samples, and Newton's iterates with the worked example of the notes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook.displacement import taylor_order, taylor_remainder, tip_covariance
from rmrc.textbook.newton import newton_raphson
from rmrc.textbook.planar import planar_jacobian, planar_position, three_link_jacobian, three_link_position
from rmrc.textbook.stanford import stanford_chain, stanford_jacobian
from rmrc.textbook.two_link import two_link_postures

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


def root():
    """The exact solution: the wrist is one link behind the tip, and two links reach it."""
    heading = GOAL[2]
    postures = two_link_postures(LENGTHS[:2], GOAL[:2] - [np.cos(heading), np.sin(heading)])
    return np.array([[*q, heading - q.sum()] for q in postures])


def test_the_worked_example_begins_as_printed_and_ends_at_the_root():
    found = newton_raphson(position, jacobian, START, GOAL)
    assert_allclose(found.error[0], [0.0, 0.5981, 0.0], atol=5e-5)  # four decimals are printed
    assert_allclose(found.step[0], [0.5981, -1.6340, 1.0359], atol=5e-5)
    assert_allclose(found.q[1], [0.4491, 2.1576, -0.5123], atol=5e-5)
    assert found.status == "converged"
    assert len(found.step) <= 6
    assert_allclose(found.q[-1], [0.698863, 1.431888, -0.036356], atol=5e-7)
    assert_allclose(found.q[-1], root()[0], atol=1e-9)


def order(jacobian):
    found = newton_raphson(position, jacobian, START, GOAL, tolerance=1e-13, most_steps=60)
    e = np.linalg.norm(found.q - root()[0], axis=1)
    e = e[(e < 0.1) & (e > 1e-11)]  # near the root, and above rounding
    return np.log(e[-1] / e[-2]) / np.log(e[-2] / e[-3])


def test_convergence_is_quadratic():
    # Of three errors the order is known to some tenths only, as the constants before the square vary.
    assert order(jacobian) == pytest.approx(2.0, abs=0.3)


def test_with_a_jacobian_that_is_kept_convergence_is_not_quadratic():
    """Negative control of the order."""
    fixed = jacobian(root()[0] + 0.05)
    assert order(lambda _: fixed) < 1.5


def test_one_step_is_whitney_s_tick():
    """θ⁺ = θ + J⁻¹ (x_d − x)."""
    found = newton_raphson(position, jacobian, START, GOAL, most_steps=1)
    tick = START + np.linalg.inv(jacobian(START)) @ (GOAL - position(START))
    assert_allclose(found.q[1], tick, atol=1e-12)
    assert found.status == "not converged"


@pytest.mark.parametrize("elbow", [0.0, np.pi])
def test_a_singular_start_is_a_status(elbow):
    """Also where rounding hides it: sin π is 1e-16."""
    found = newton_raphson(position, jacobian, [0.3, elbow, 0.2], GOAL)
    assert (found.status, len(found.step)) == ("singular", 0)
    assert_allclose(found.error[0], position(np.array([0.3, elbow, 0.2])) - GOAL, atol=0)


def test_a_singularity_on_the_way_keeps_what_was_done():
    """f = x³ − 3x + 3 has the slope −3 at 0: the step leads to 1, where the slope is 0."""
    found = newton_raphson(lambda x: x**3 - 3 * x, lambda x: np.diag(3 * x**2 - 3), [0.0], [-3.0])
    assert (found.status, found.q.ravel().tolist()) == ("singular", [0.0, 1.0])
