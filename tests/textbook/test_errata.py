"""Each slip of docs/errata.md, and its correction: what is printed fails where what holds passes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rmrc.control.law import resolve_rates
from rmrc.spatial import quat_from_axis_angle, quat_to_matrix, skew, twist_transform, wrench_transform
from rmrc.textbook.dh import DHChain
from rmrc.textbook.planar import planar_jacobian, planar_position, three_link_jacobian, two_link_jacobian
from rmrc.textbook.stanford import stanford_jacobian

# All numbers here are of order 1; a dozen operations leave errors of some 1e-16.
ROUNDING = 1e-12

ROTATION = quat_to_matrix(quat_from_axis_angle([1.0, 2.0, 3.0], 0.7))
OFFSET = np.array([0.3, -0.2, 0.5])
Q = np.array([0.4, 0.9, -0.5])
LENGTHS = np.array([1.0, 0.8, 0.6])


def refuted(printed, holds):
    """Whether two values differ by more than any rounding."""
    return np.abs(np.subtract(printed, holds)).max() > 1e-3


def test_force_transform_is_the_transpose_of_the_velocity_transform_the_other_way():
    velocity_a_b = twist_transform(ROTATION, OFFSET)
    velocity_b_a = twist_transform(ROTATION.T, -ROTATION.T @ OFFSET)
    assert_allclose(velocity_a_b @ velocity_b_a, np.eye(6), atol=ROUNDING)
    twist_b, wrench_b = np.random.default_rng(5).normal(size=(2, 6))
    power = wrench_b @ twist_b
    # force and moment in {A} from each candidate; the power in {A} must be that in {B}
    assert (velocity_b_a.T @ wrench_b) @ (velocity_a_b @ twist_b) == pytest.approx(power, abs=ROUNDING)
    assert refuted((velocity_a_b.T @ wrench_b) @ (velocity_a_b @ twist_b), power)
    assert_allclose(wrench_transform(ROTATION, OFFSET), velocity_b_a.T, atol=ROUNDING)


def test_jacobian_times_its_right_inverse_is_the_identity_of_the_task():
    J = np.random.default_rng(5).normal(size=(2, 4))
    right_inverse = np.column_stack([resolve_rates(J, twist, "pseudoinverse") for twist in np.eye(2)])
    product = J @ right_inverse
    assert product.shape == (2, 2) != (4, 4)  # I_m; I_n has another size
    assert_allclose(product, np.eye(2), atol=ROUNDING)
    assert refuted(right_inverse @ J, np.eye(4))  # nor is it I_n the other way round


def test_x_of_a_planar_arm_falls_with_every_angle_where_the_links_point_up():
    # Central differences of functions of order 1: 1e-16 / 1e-6 of rounding, (1e-6)² of truncation.
    step = 1e-6 * np.eye(3)
    slope = (planar_position(LENGTHS, Q + step) - planar_position(LENGTHS, Q - step))[:, 0] / 2e-6
    phi = np.cumsum(Q)
    printed = [(LENGTHS[i:] * np.sin(phi[i:])).sum() for i in range(3)]
    assert_allclose(np.negative(printed), slope, atol=1e-8)
    assert_allclose(planar_jacobian(LENGTHS, Q)[0], slope, atol=1e-8)
    assert refuted(printed, slope)


def test_second_newton_step_of_the_worked_example_has_minus_1_3603():
    J = three_link_jacobian([2.0, 1.0, 1.0], [0.4491, 2.1576, -0.5123])
    assert J[1, 1] == pytest.approx(-1.3603, abs=1e-3)  # the angles have four decimals
    assert refuted(J[1, 1], -1.4603)


def test_printed_root_of_the_worked_example_misses_its_goal_by_more_than_its_decimals():
    goal = np.array([0.5, 3.0, 2 * np.pi / 3])
    lengths = [2.0, 1.0, 1.0]
    root = np.array([0.698863, 1.431888, -0.036356])
    assert_allclose(planar_position(lengths, root), goal, atol=3e-6)  # six decimals, reach 4
    miss = np.abs(planar_position(lengths, [0.6984, 1.4329, -0.0369]) - goal)
    # Four correct decimals would leave at most 4 · 3 · 0.5e-4 = 6e-4.
    assert 6e-4 < miss.max() < 2e-3


def test_near_full_reach_both_terms_of_the_elbow_are_negative():
    l1, l2, elbow = 1.0, 0.8, 1e-4
    # Frame {1} is the base frame when the first angle is zero.
    rates = np.linalg.solve(two_link_jacobian([l1, l2], [0.0, elbow]), np.eye(2))
    holds = np.array([-(l1 + l2) / (l1 * l2 * elbow), -1 / l1])
    # The approximation is of first order in the elbow: 1e-4, and so is what it neglects.
    assert_allclose(rates[1], holds, rtol=2e-4)
    assert_allclose(rates[0], [1 / (l1 * elbow), 1 / l1], rtol=2e-4)
    assert refuted(rates[1], -holds)


def test_jacobian_at_the_end_effector_from_frame_n_needs_no_trailing_rotation():
    arm = DHChain(((0.1, 0.2, 0.3, 0.4), (-1.2, 0.5, 0.1, 0.2), (0.8, 0.3, 0.2, 0.1)), ("revolute",) * 3)
    R, zero = arm.frames(Q)[-1][:3, :3], np.zeros((3, 3))
    J_n = np.block([[R.T, zero], [zero, R.T]]) @ arm.jacobian(Q)  # along the axes of frame n
    P = skew(OFFSET)
    holds = np.block([[R, -R @ P], [zero, R]]) @ J_n
    printed = np.block([[R, -R @ P @ R.T], [zero, R]]) @ J_n
    assert_allclose(holds, arm.jacobian(Q, point=OFFSET), atol=ROUNDING)
    assert refuted(printed, holds)


@pytest.mark.parametrize("k", [-1, 0, 1, 2])
def test_sixth_column_at_theta_5_k_pi_has_the_sign_of_cos_k_pi(k):
    J = stanford_jacobian([0.3, 1.0, 0.6, 0.7, k * np.pi, 0.2])
    printed = J[:, 3]
    assert_allclose(J[:, 5], np.cos(k * np.pi) * printed, atol=ROUNDING)
    assert refuted(J[:, 5], printed) == (k % 2 == 1)  # so it is right for even k only


def test_velocity_of_the_tip_needs_brackets_around_the_way_to_it():
    arm = DHChain(((0.0, 0.0, 0.0, 0.0), (0.5, 0.4, 0.2, 0.0)), ("revolute", "revolute"), "standard")
    q = Q[:2]
    frames = arm.frames(q)
    shift = np.array([0.1, 0.2, 0.3])  # of the world's origin, which changes no velocity
    axis, origin, tip = frames[1, :3, 2], frames[1, :3, 3] + shift, frames[2, :3, 3] + shift
    column = arm.jacobian(q)[:3, 1]
    assert_allclose(np.cross(axis, tip - origin), column, atol=ROUNDING)
    assert refuted(np.cross(axis, tip) - origin, column)
