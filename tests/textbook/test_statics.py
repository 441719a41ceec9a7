"""Joint torques against virtual work and against the moment of the force about each joint."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook.planar import planar_jacobian
from rmrc.textbook.statics import equilibrium_torques, joint_torques
from rmrc.textbook.two_link import two_link_jacobian, two_link_position

# A few products of order ten.
ROUNDING = 1e-12

shapes = st.tuples(st.integers(1, 6), st.integers(1, 7))
small = st.floats(-3.0, 3.0)


@given(shapes.flatmap(lambda s: st.tuples(*(arrays(float, k, elements=small) for k in (s, *s)))))
def test_equivalent_torques_do_the_work_of_the_wrench_and_balancing_ones_undo_it(case):
    J, wrench, rates = case
    power = wrench @ (J @ rates)
    # Up to 42 products of size 27.
    assert_allclose(joint_torques(J, wrench) @ rates, power, atol=1e-10)
    assert_allclose(equilibrium_torques(J, wrench) @ rates, -power, atol=1e-10)


@given(*[arrays(float, 2, elements=small)] * 2)
def test_torque_of_two_links_is_the_moment_of_the_force_about_each_joint(q, force):
    """n_i = (p − o_i) × f: nothing of a Jacobian is in it."""
    lengths = np.array([1.0, 0.8])
    elbow = np.array([np.cos(q[0]), np.sin(q[0])])
    tip = two_link_position(lengths, q)
    moments = [arm[0] * force[1] - arm[1] * force[0] for arm in (tip, tip - elbow)]
    assert_allclose(joint_torques(two_link_jacobian(lengths, q), force), moments, atol=ROUNDING)


@pytest.mark.parametrize(
    ("degrees", "force", "tau"),
    [((0, 60), (0, -1), (-1.5, -0.5)), ((90, 0), (0, -1000), (0, 0))],
)
def test_the_two_examples_of_the_notes(degrees, force, tau):
    J = two_link_jacobian([1.0, 1.0], np.radians(degrees))
    # 1000 N times cos 90° = 6e-17.
    assert_allclose(joint_torques(J, force), tau, atol=1e-12)
    assert_allclose(equilibrium_torques(J, force), np.negative(tau), atol=1e-12)


@given(st.integers(1, 6), st.floats(-3, 3), st.integers(0, 2**32 - 1))
def test_force_along_a_lost_direction_costs_no_torque_and_any_other_does(n, q1, seed):
    rng = np.random.default_rng(seed)
    lengths, folds = rng.uniform(0.5, 1.5, n), rng.integers(0, 2, n - 1) * np.pi
    J = planar_jacobian(lengths, [q1, *folds])[:2]  # all links on one line, stretched out or folded
    along, across = np.array([[np.cos(q1), np.sin(q1)], [-np.sin(q1), np.cos(q1)]])
    # 1000 N times a reach of 9 m, in rounding.
    assert_allclose(joint_torques(J, 1000 * along), 0.0, atol=1e-11)
    assert np.abs(joint_torques(J, across)).max() >= 0.5  # the last joint's lever is its own link
