"""Newton's iterates: the worked example of the notes, its order, and how it fails."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rmrc.textbook.newton import newton_raphson
from rmrc.textbook.planar import three_link_jacobian, three_link_position
from rmrc.textbook.two_link import two_link_postures

LENGTHS = [2.0, 1.0, 1.0]
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
