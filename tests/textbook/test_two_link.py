"""Two links: what is printed in moving frames against frame {0}, DH and differences; the postures."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook import two_link
from rmrc.textbook.dh import DHChain

# Sums of a few products of order one.
ROUNDING = 1e-12

angles = arrays(float, 2, elements=st.floats(-3.0, 3.0))
arms = st.tuples(arrays(float, 2, elements=st.floats(0.1, 2.0)), angles)


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@given(arms, angles)
def test_the_velocities_of_example_5_3_are_one_vector_and_the_derivative_of_the_position(arm, qdot):
    lengths, q = arm
    in_0 = two_link.two_link_velocity_in_frame_0(lengths, q, qdot)
    in_2 = two_link.two_link_velocity_in_frame_2(lengths, q, qdot)
    h = 1e-5  # central differences: (1e-5)² · |third derivative| <= 100 m, and 1e-16/1e-5
    ahead, behind = (two_link.two_link_position(lengths, q + t * qdot) for t in (h, -h))
    assert_allclose(in_0, (ahead - behind) / (2 * h), atol=1e-6)
    assert_allclose(rotation(q.sum()) @ in_2, in_0, atol=ROUNDING * (1 + np.abs(qdot).sum()))


@given(arms)
def test_the_jacobians_of_all_frames_are_the_dh_chain_s_along_their_axes(arm):
    lengths, q = arm
    chain = DHChain(((0, 0, 0, 0), (0, lengths[0], 0, 0)), ("revolute", "revolute"))
    J = chain.jacobian(q, point=(lengths[1], 0, 0))[:3]
    frames = chain.frames(q)[:, :3, :3]
    for frame, printed in (
        (0, two_link.two_link_jacobian),
        (1, two_link.two_link_jacobian_in_frame_1),
        (2, two_link.two_link_jacobian_in_frame_2),
    ):
        assert_allclose(printed(lengths, q), (frames[frame].T @ J)[:2], atol=ROUNDING)
        # which moreover does not change the determinant
        determinant = two_link.two_link_determinant(lengths, q)
        assert_allclose(np.linalg.det(printed(lengths, q)), determinant, atol=ROUNDING)


@given(arms)
def test_both_postures_reach_the_point_and_one_is_the_arm_s_own(arm):
    lengths, q = arm
    tip = two_link.two_link_position(lengths, q)
    postures = two_link.two_link_postures(lengths, tip)
    # Folded onto its base with equal links, r² is rounding: √1e-16.
    assert_allclose(two_link.two_link_position(lengths, postures), [tip, tip], atol=1e-7)
    assert postures[0, 1] >= 0 >= postures[1, 1]
    assert np.all(np.abs(postures) <= np.pi)
    if np.linalg.norm(tip) > 0.01 and abs(np.sin(q[1])) > 0.01:
        # Away from the singularities r² determines the elbow to 1e-15 / 0.01².
        own = postures[0 if q[1] > 0 else 1]
        assert_allclose(np.exp(1j * own), np.exp(1j * q), atol=1e-9)


def test_full_reach_is_reached_to_the_last_digits():
    """The half angle gives θ₂ = 0 within √ε there, and the position to rounding."""
    angle = np.linspace(-3, 3, 50)
    for radius in (9.0, 3.0):
        point = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        postures = two_link.two_link_postures([6, 3], point)
        found = two_link.two_link_position([6, 3], postures)
        # r² is rounded by 1e-16 · 81: the elbow by its root, the position by the square of that again.
        assert_allclose(found, np.broadcast_to(point[:, None], found.shape), atol=1e-12)
        assert np.abs(np.sin(postures[..., 1])).max() < 1e-7


def test_out_of_reach_is_not_a_number_and_its_neighbors_are():
    postures = two_link.two_link_postures([6, 3], [[9.001, 0], [5, 0], [0, 2.999]])
    assert np.isnan(postures[[0, 2]]).all()
    assert np.isfinite(postures[1]).all()
    # Beyond reach by more than rounding is beyond reach.
    barely = two_link.two_link_postures([6, 3], [[9 * (1 + 1e-12), 0], [0, 3 * (1 - 1e-11)]])
    assert np.isnan(barely).all()


@given(arms.filter(lambda case: abs(np.sin(case[1][1])) > 1e-3))
def test_inverse_times_jacobian_is_the_identity(case):
    lengths, q = case
    J, inverse = two_link.two_link_jacobian(lengths, q), two_link.two_link_jacobian_inverse(lengths, q)
    # Rounding of each factor is relative to its norm.
    tolerance = ROUNDING * np.linalg.norm(J) * np.linalg.norm(inverse)
    assert_allclose(J @ inverse, np.eye(2), atol=tolerance)
    assert_allclose(inverse @ J, np.eye(2), atol=tolerance)


@given(arms.filter(lambda case: abs(np.sin(case[1][1])) > 1e-3), st.floats(-2.0, 2.0))
def test_rates_of_example_5_5_move_the_tip_along_x(case, speed):
    lengths, q = case
    rates = two_link.two_link_rates(lengths, q, speed)
    J = two_link.two_link_jacobian(lengths, q)
    # Terms of size |J||rates| cancel in y.
    tolerance = ROUNDING * (1.0 + np.linalg.norm(J) * np.linalg.norm(rates))
    assert_allclose(J @ rates, [speed, 0.0], atol=tolerance)


def test_rates_of_example_5_5_grow_as_one_over_theta_2():
    """The order of the pole, measured: slope −1 of log rate over log θ₂."""
    theta = np.array([1e-2, 1e-3, 1e-4])
    rates = two_link.two_link_rates([1.0, 0.7], np.stack([np.full(3, 0.4), theta], axis=-1))
    slopes = np.diff(np.log(np.abs(rates)), axis=0) / np.diff(np.log(theta))[:, None]
    # cos(θ₁ + θ₂) is not constant: it bends the slope by about θ₂ = 1e-3.
    assert_allclose(slopes[-1], [-1.0, -1.0], atol=1e-3)
