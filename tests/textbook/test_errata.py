"""Each slip of docs/errata.md, and its correction: what is printed fails where what holds passes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rmrc.law.jacobian_law import resolve_rates
from rmrc.support.spatial import (
    exp_rotation,
    quat_from_axis_angle,
    quat_to_matrix,
    skew,
    twist_transform,
    wrench_transform,
)
from rmrc.textbook.chains import DHChain
from rmrc.textbook.inverse import (
    newton_raphson,
    resolved_rates,
    weighted_left_inverse,
    weighted_right_inverse,
)
from rmrc.textbook.motion import point_velocity, written_in
from rmrc.textbook.planar import (
    embed_planar_jacobian,
    planar_jacobian,
    planar_position,
    planar_rp_chain,
    planar_rp_determinant,
    three_link_jacobian,
)
from rmrc.textbook.singularity import minors, rank_by_minors, velocity_ellipsoid
from rmrc.textbook.six_joint import stanford_jacobian
from rmrc.textbook.spatial import (
    anthropomorphic_jacobian,
    anthropomorphic_position,
    spherical_wrist_chain,
    torus_chain,
    torus_determinant,
    torus_position,
)
from rmrc.textbook.two_link import two_link_jacobian, two_link_postures, two_link_rates

# All numbers here are of order 1; a dozen operations leave errors of some 1e-16.
ROUNDING = 1e-12

ROTATION = quat_to_matrix(quat_from_axis_angle([1.0, 2.0, 3.0], 0.7))
OFFSET = np.array([0.3, -0.2, 0.5])
Q = np.array([0.4, 0.9, -0.5])
LENGTHS = np.array([1.0, 0.8, 0.6])


def refuted(printed, holds):
    """Whether two values differ by more than any rounding."""
    return np.abs(np.subtract(printed, holds)).max() > 1e-3


# The frames of A are those of standard DH: joint i+1 turns or slides along z of frame i.
STANDARD = DHChain(
    ((0.7, 0.5, 0.1, 0.2), (-0.4, 0.8, 0.2, 0.1), (0.9, 0.3, 0.4, -0.3)),
    ("revolute", "prismatic", "revolute"),
    "standard",
)
RATES = np.array([0.7, -1.1, 0.6])
Z = np.array([0.0, 0.0, 1.0])


def tip_velocity(chain, spin, velocity):
    """[v; ω] of the last frame along {0}, by A's two lines: each takes i, R, P and the twist so far."""
    v, omega = np.zeros((2, 3))
    for i, T in enumerate(chain.link_transforms(Q)):
        R, P = T[:3, :3], T[:3, 3]
        omega_next = spin(i, R, omega)
        v, omega = velocity(i, R, P, v, omega, omega_next), omega_next
    R = chain.frames(Q)[-1, :3, :3]
    return np.concatenate([R @ v, R @ omega])


def theta_rate(i):
    return RATES[i] if STANDARD.kinds[i] == "revolute" else 0.0


def d_rate(i):
    return RATES[i] if STANDARD.kinds[i] == "prismatic" else 0.0


def spin(i, R, omega):
    return R.T @ (omega + theta_rate(i) * Z)


def velocity(i, R, P, v, _, omega_next):
    return R.T @ (v + np.cross(R @ omega_next, P) + d_rate(i) * Z)


def test_example_5_3_takes_rate_and_angular_velocity_of_the_next_link():
    explicit = STANDARD.jacobian(Q) @ RATES
    assert_allclose(tip_velocity(STANDARD, spin, velocity), explicit, atol=ROUNDING)

    def late_spin(i, R, omega):
        return R.T @ (omega + (theta_rate(i - 1) if i else 0.0) * Z)

    def late_velocity(i, R, P, v, omega, _):
        return R.T @ (v + np.cross(omega, P) + d_rate(i) * Z)

    for printed in (
        tip_velocity(STANDARD, late_spin, velocity),
        tip_velocity(STANDARD, spin, late_velocity),
        tip_velocity(STANDARD, late_spin, late_velocity),
    ):
        assert refuted(printed, explicit)


@pytest.mark.parametrize("observer", ["link", "ground"])
def test_a_slide_adds_its_rate_along_the_axis_and_not_the_rate_of_the_axis(observer):
    explicit = STANDARD.jacobian(Q) @ RATES

    def printed(i, R, P, v, omega, omega_next):
        slides = STANDARD.kinds[i] == "prismatic"
        # Seen from its own link, the axis does not change; seen from the ground, it turns with the link.
        axis_rate = np.cross(omega, Z) if observer == "ground" else np.zeros(3)
        return R.T @ (v + np.cross(R @ omega_next, P) + slides * axis_rate)

    assert_allclose(tip_velocity(STANDARD, spin, velocity), explicit, atol=ROUNDING)
    assert refuted(tip_velocity(STANDARD, spin, printed), explicit)


def test_way_to_the_next_frame_is_minus_the_way_back_and_not_to_itself():
    explicit = STANDARD.jacobian(Q) @ RATES

    def with_way(way):
        def carried(i, R, P, v, _, omega_next):
            return R.T @ (v + np.cross(R @ omega_next, way(R, P)) + d_rate(i) * Z)

        return tip_velocity(STANDARD, spin, carried)

    assert_allclose(with_way(lambda R, P: -R @ (-R.T @ P)), explicit, atol=ROUNDING)
    assert refuted(with_way(lambda R, P: R @ (-R.T @ P)), explicit)  # ᶦR_i+1 ᶦ⁺¹P_i without the minus
    assert refuted(with_way(lambda *_: np.zeros(3)), explicit)  # ᶦP_i


def test_only_the_rates_of_slides_move_along_their_axes():
    frames = STANDARD.frames(Q)
    axes, origins = frames[:-1, :3, 2], frames[:-1, :3, 3]
    turning = sum(theta_rate(i) * np.cross(axes[i], frames[-1, :3, 3] - origins[i]) for i in range(3))
    holds = turning + sum(d_rate(i) * axes[i] for i in range(3))
    explicit = (STANDARD.jacobian(Q) @ RATES)[:3]
    assert_allclose(holds, explicit, atol=ROUNDING)
    assert refuted(turning + RATES @ axes, explicit)


def test_velocity_that_b_sees_must_be_turned_for_a_to_write_it():
    step, spin_b = 1e-5, np.array([0.3, -0.2, 0.5])
    rotation = lambda t: quat_to_matrix(exp_rotation(t * spin_b)) @ ROTATION  # noqa: E731
    point = lambda t: np.array([np.sin(t), np.cos(t), t])  # noqa: E731
    seen_by_b = (point(step) - point(-step)) / (2 * step)
    seen_by_a = (rotation(step) @ point(step) - rotation(-step) @ point(-step)) / (2 * step)
    still, turning = np.zeros(3), (spin_b, point(0.0))
    written_by_a = written_in(ROTATION, seen_by_b)
    # What {A} sees is this and what the turning of {B} carries; central differences: 1e-16/1e-5, (1e-5)²/6.
    assert_allclose(written_by_a, seen_by_a - point_velocity(still, ROTATION, still, *turning), atol=1e-8)
    assert refuted(written_by_a, seen_by_b)


def torques_inwards(force, lever):
    """A's statics of the standard chain, for a force at the tip: n_i about joint i, along frame {i}."""
    links, frames = STANDARD.link_transforms(Q), STANDARD.frames(Q)
    f, n, torques = frames[-1, :3, :3].T @ force, np.zeros(3), []
    for i in reversed(range(3)):  # link i+1, whose joint is on z of frame i
        T = links[i]
        if i < 2:
            f, n = links[i + 1, :3, :3] @ f, links[i + 1, :3, :3] @ n
        to_next = links[i + 1, :3, 3] if i < 2 else np.zeros(3)
        n = n + np.cross(lever(-T[:3, :3].T @ T[:3, 3], to_next), f)
        torques.append((n if STANDARD.kinds[i] == "revolute" else f) @ T[:3, :3].T @ Z)
    return torques[::-1]


def test_moment_of_a_link_is_taken_over_the_way_back_to_its_joint():
    force = np.array([0.4, -0.8, 0.3])
    explicit = STANDARD.jacobian(Q)[:3].T @ force
    assert_allclose(torques_inwards(force, lambda back, _: -back), explicit, atol=ROUNDING)
    assert refuted(torques_inwards(force, lambda _, to_next: -to_next), explicit)


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


def test_moment_block_of_the_force_transform_has_the_way_to_the_origin_of_b():
    def printed(joint):
        return np.block([[ROTATION, np.zeros((3, 3))], [-skew(joint) @ ROTATION, ROTATION]])

    velocity_b_a = twist_transform(ROTATION.T, -ROTATION.T @ OFFSET)  # checked by power in the test above
    assert refuted(printed(OFFSET), velocity_b_a.T)
    assert_allclose(printed(-OFFSET), velocity_b_a.T, atol=ROUNDING)
    assert_allclose(wrench_transform(ROTATION, OFFSET)[3:, :3], skew(OFFSET) @ ROTATION, atol=ROUNDING)


def test_a_slide_adds_no_angular_velocity():
    slide = STANDARD.kinds.index("prismatic")
    turned = np.zeros(3)
    turned[slide] = 1e-3  # by differences, so that no Jacobian is believed
    before, after = STANDARD.frames(Q)[-1], STANDARD.frames(Q + turned)[-1]
    assert_allclose(after[:3, :3], before[:3, :3], atol=ROUNDING)
    assert refuted((after - before)[:3, 3] / 1e-3, np.zeros(3))


def aligned(chain, q):
    """Whether two axes of revolute joints, or one of these and one of a slide, lie on one line."""
    frames = chain.frames(q)[1:]  # joint i acts along z of frame i
    axes, points = frames[:, :3, 2], frames[:, :3, 3]
    apart = [
        max(np.abs(np.cross(axes[i], axes[j])).max(), np.abs(np.cross(points[i] - points[j], axes[i])).max())
        for i in range(len(axes))
        for j in range(i)
    ]
    return min(apart) < 1e-6


def test_an_arm_is_singular_inside_its_workspace_without_aligned_axes():
    assert planar_rp_determinant([0.3, -1.0]) == 0.0  # r = 0; its reach is from -oo to oo: inside
    assert not aligned(planar_rp_chain(), [0.3, -1.0])
    lengths = np.array([0.3, 0.6, 0.4])
    # l1 + l2 c2 + l3 c23 = 0 with the last joint at 90 degrees, well within the reach of l1 + l2 + l3
    elbow = np.arccos(-0.3 / np.hypot(0.6, 0.4)) - np.arctan2(0.4, 0.6)
    q = np.array([0.2, elbow, np.pi / 2])
    assert torus_determinant(lengths, q) == pytest.approx(0.0, abs=ROUNDING)
    assert np.linalg.norm(torus_position(lengths, q)) < 0.6 * lengths.sum()
    assert not aligned(torus_chain(lengths), q)
    # The claim is true of wrists: the first and the third axis are aligned where det = -s2 is 0.
    assert aligned(spherical_wrist_chain(), [0.4, 0.0, 0.7]) and not aligned(
        spherical_wrist_chain(), [0.4, 0.6, 0.7]
    )


def test_height_of_the_shoulder_lifts_the_tip_and_is_in_no_column_of_its_jacobian():
    height, turn = 1.0, np.pi / 2
    table = ((turn, 0.0, height, turn), (0.0, 0.8, 0.0, 0.0), (0.0, 0.6, 0.0, 0.0))  # A's, with d_1 = L_1
    lifted = DHChain(table, ("revolute", "revolute", "revolute"), "standard")
    low, tip = anthropomorphic_position([0.8, 0.6], Q), lifted.frames(Q)[3, :3, 3]
    assert_allclose(tip - low, [0.0, 0.0, height], atol=ROUNDING)
    # Central differences of functions of order 1: 1e-16 / 1e-6 of rounding, (1e-6)² of truncation.
    step = 1e-6 * np.eye(3)
    slope = (lifted.frames(Q + step) - lifted.frames(Q - step))[:, 3, :3, 3].T / 2e-6
    assert_allclose(slope, anthropomorphic_jacobian([0.8, 0.6], Q)[:3], atol=1e-9)
    # Only the velocity at the ground's origin has it, v − ω × p: no column that A means.
    omega = lifted.jacobian(Q)[3:]
    assert refuted(np.cross(omega, tip, axis=0), np.cross(omega, low, axis=0))


def test_folded_links_of_equal_length_are_at_the_center_and_not_at_the_boundary():
    turns = np.linspace(0.0, 2.0 * np.pi, 9)
    around = 0.01 * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    for point in around:  # on every side of the folded tip there are points that the arm reaches
        for q in two_link_postures([1.0, 1.0], point):
            assert_allclose(planar_position([1.0, 1.0], q)[:2], point, atol=ROUNDING)
    assert_allclose(planar_position([1.0, 1.0], [0.3, np.pi])[:2], 0.0, atol=ROUNDING)
    assert np.isnan(two_link_postures([1.0, 0.8], around[0])).all()  # unequal links leave a hole


def test_jacobian_times_its_right_inverse_is_the_identity_of_the_task():
    J = np.random.default_rng(5).normal(size=(2, 4))
    right_inverse = np.column_stack([resolve_rates(J, twist, "pseudoinverse") for twist in np.eye(2)])
    product = J @ right_inverse
    assert product.shape == (2, 2) != (4, 4)  # I_m; I_n has another size
    assert_allclose(product, np.eye(2), atol=ROUNDING)
    assert refuted(right_inverse @ J, np.eye(4))  # nor is it I_n the other way round


def test_rates_along_x_stay_finite_if_the_arm_points_along_y():
    lengths = np.array([1.0, 0.8])
    elbow = np.array([1e-2, 1e-4, 1e-6])
    along_y = two_link_rates(lengths, np.stack([np.full(3, np.pi / 2), elbow], axis=-1))
    # cos(90°) is 6e-17 in floating point, and is divided by 1e-6
    assert_allclose(along_y, np.broadcast_to([-1 / lengths[0], 1 / lengths[0]], (3, 2)), atol=1e-4)
    elsewhere = two_link_rates(lengths, np.stack([np.full(3, 1.0), elbow], axis=-1))
    assert np.all(np.abs(elsewhere[1:]) > 50 * np.abs(elsewhere[:-1]))


def test_whether_a_twist_has_solutions_is_not_decided_by_the_numbers_of_rows_and_joints():
    tall = planar_jacobian(LENGTHS[:2], Q[:2])  # m = 3 > n = 2
    rates = np.array([0.7, -0.4])
    assert_allclose(weighted_left_inverse(tall) @ (tall @ rates), rates, atol=ROUNDING)
    stretched = planar_jacobian(LENGTHS, [0.0, 0.0, 0.0])[:2]  # m = 2 < n = 3, but of rank 1
    along = np.array([1.0, 0.0])
    nearest = np.linalg.lstsq(stretched, along, rcond=None)[0]
    assert refuted(stretched @ nearest, along)


def test_x_of_a_planar_arm_falls_with_every_angle_where_the_links_point_up():
    # Central differences of functions of order 1: 1e-16 / 1e-6 of rounding, (1e-6)² of truncation.
    step = 1e-6 * np.eye(3)
    slope = (planar_position(LENGTHS, Q + step) - planar_position(LENGTHS, Q - step))[:, 0] / 2e-6
    phi = np.cumsum(Q)
    printed = [(LENGTHS[i:] * np.sin(phi[i:])).sum() for i in range(3)]
    assert_allclose(np.negative(printed), slope, atol=1e-8)
    assert_allclose(planar_jacobian(LENGTHS, Q)[0], slope, atol=1e-8)
    assert refuted(printed, slope)


def test_columns_of_the_regular_posture_are_dependent_too():
    for elbow, rank in ((0.0, 1), (np.pi / 2, 2)):
        J = three_link_jacobian([2.0, 1.0, 1.0], [0.0, elbow, 0.0])[:2]
        assert rank_by_minors(J) == rank
        internal = np.linalg.svd(J)[2][2]
        assert_allclose(J @ internal, 0.0, atol=ROUNDING)  # so the columns are dependent both times
        assert (np.abs(minors(J.T @ J, 3)).max() < ROUNDING) and (rank_by_minors(J.T) == rank)


def test_first_entry_of_the_second_jacobian_is_negative():
    J = three_link_jacobian([2.0, 1.0, 1.0], [0.4491, 2.1576, -0.5123])
    assert J[0, 0] == pytest.approx(-2.2441, abs=2e-4)  # the angles have four decimals
    assert refuted(J[0, 0], 2.2441)


def worked_example(start, steps):
    lengths = [2.0, 1.0, 1.0]
    return newton_raphson(
        lambda q: planar_position(lengths, q),
        lambda q: three_link_jacobian(lengths, q),
        start,
        [0.5, 3.0, 2 * np.pi / 3],
        most_steps=steps,
    )


def test_second_step_of_the_worked_example_solves_no_equations_at_all():
    step = np.array([-0.1606, 0.5493, -0.3887])
    found = worked_example([0.4491, 2.1576, -0.5123], 1)
    assert_allclose(found.step[0], [-0.2011, 0.6586, -0.4576], atol=1e-4)  # from angles of four decimals
    J = three_link_jacobian([2.0, 1.0, 1.0], found.q[0])
    printed = np.array([[2.2441, -1.3758, -0.8660], [0.4413, -1.4603, -0.5000], [1, 1, 1]])
    values = np.array([-0.059, -0.756, 0.0])  # three decimals
    assert_allclose(found.error[0], values, atol=5e-4)
    for matrix in (J, printed, printed * [[-1, 1, 1], [1, 1, 1], [1, 1, 1]]):
        assert refuted(matrix @ step, values)


def test_third_iterate_does_not_follow_from_the_second_but_the_fourth_does_from_the_third():
    second, third, fourth = [0.6097, 1.6083, -0.1236], [0.6789, 1.4106, 0.0049], [0.6984, 1.4329, -0.0369]
    assert_allclose(worked_example(second, 1).q[1], [0.6970, 1.4417, -0.0443], atol=1e-4)
    assert refuted(worked_example(second, 1).q[1], third)
    assert_allclose(worked_example(third, 1).q[1], fourth, atol=1e-4)


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
    # The root has six decimals, the print four.
    assert np.abs(root - [0.6984, 1.4329, -0.0369]).max() == pytest.approx(1.01e-3, abs=5e-6)


def test_near_full_reach_both_terms_of_the_elbow_are_negative():
    l1, l2, elbow = 1.0, 0.8, 1e-4
    # Frame {1} is the base frame when the first angle is zero.
    rates = np.linalg.solve(two_link_jacobian([l1, l2], [0.0, elbow]), np.eye(2))
    holds = np.array([-(l1 + l2) / (l1 * l2 * elbow), -1 / l1])
    # The approximation is of first order in the elbow: 1e-4, and so is what it neglects.
    assert_allclose(rates[1], holds, rtol=2e-4)
    assert_allclose(rates[0], [1 / (l1 * elbow), 1 / l1], rtol=2e-4)
    assert refuted(rates[1], -holds)


def test_full_jacobian_of_two_links_has_three_rows_of_zeros():
    arm = DHChain(((0.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)), ("revolute", "revolute"))
    J = arm.jacobian(Q[:2], point=(0.8, 0.0, 0.0))
    assert len(J) == 6 != 5
    assert np.flatnonzero(~J.any(axis=1)).tolist() == [2, 3, 4]
    assert_allclose(embed_planar_jacobian(planar_jacobian(LENGTHS[:2], Q[:2])), J, atol=ROUNDING)
    # Its determinant is that of the two rows that are left when they and the angle are dropped.
    assert np.linalg.det(J[:2]) == pytest.approx(0.8 * np.sin(Q[1]))


def test_only_the_reduced_matrix_has_a_determinant():
    arm = DHChain(((0.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)), ("revolute", "revolute"))
    J = np.delete(arm.jacobian(Q[:2], point=(0.8, 0.0, 0.0)), 2, axis=0)
    assert J.shape == (5, 2)  # as it is printed
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.det(J)
    assert np.linalg.det(J[:2]) == pytest.approx(0.8 * np.sin(Q[1]))
    assert refuted(np.sqrt(np.linalg.det(J.T @ J)), 0.8 * abs(np.sin(Q[1])))


def test_three_joints_give_any_velocity_in_three_dimensions():
    J = anthropomorphic_jacobian([0.5, 0.8, 0.6], Q)[:3]
    assert J.shape == (3, 3) != (6, 6)
    for v in np.random.default_rng(5).normal(size=(20, 3)):
        qdot = np.linalg.solve(J, v)
        # central differences of the position: their error is of second order in 1e-5
        ahead, behind = (anthropomorphic_position([0.5, 0.8, 0.6], Q + h * qdot) for h in (1e-5, -1e-5))
        assert_allclose((ahead - behind) / 2e-5, v, atol=1e-6)


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


def test_velocity_by_the_fourth_joint_is_the_fourth_and_not_the_first():
    # Three hinges and a slide, as in the figure; the velocities by all joints add up to that of the tip.
    arm = DHChain(
        ((0, 0, 0, 0), (0.5, 0.4, 0, 0), (0.3, 0.6, 0, 0), (0.2, 0.5, 0, 0)),
        ("revolute",) * 3 + ("prismatic",),
    )
    q, rates = np.array([*Q, 0.2]), np.array([0.7, -1.1, 0.6, 0.9])
    frames = arm.frames(q)
    turning = [
        rates[i] * np.cross(frames[i + 1, :3, 2], frames[4, :3, 3] - frames[i + 1, :3, 3]) for i in range(3)
    ]
    sliding = rates[3] * frames[4, :3, 2]
    tip = (arm.jacobian(q) @ rates)[:3]
    assert_allclose(sum(turning) + sliding, tip, atol=ROUNDING)
    assert refuted(sliding + sum(turning[1:]), tip)  # with u₁ = z₄ q̇₄


def test_way_to_the_tip_ends_at_the_frame_after_the_last_joint():
    l1, l2 = 1.0, 0.8
    arm = DHChain(((0, 0, 0, 0), (0, l1, 0, 0)), ("revolute", "revolute"))  # D's frames: {3} is the tip
    frames, q = arm.frames(Q[:2]), Q[:2]
    origins = [*frames[1:, :3, 3], (frames[-1] @ [l2, 0, 0, 1])[:3]]
    J = arm.jacobian(q, point=(l2, 0, 0))[:3]
    columns = lambda end: np.transpose([np.cross(Z, end - origins[i]) for i in range(2)])  # noqa: E731
    assert_allclose(columns(origins[2]), J, atol=ROUNDING)
    assert refuted(columns(origins[1]), J)  # o_n
    assert not columns(origins[1])[:, 1].any()  # which would leave nothing for the last joint to move


def test_normal_matrix_of_a_redundant_arm_has_no_inverse_at_a_singularity():
    for elbow, rank in ((0.0, 1), (0.9, 2)):
        J = planar_jacobian(LENGTHS, [0.0, elbow, 0.0])[:2]
        assert J.shape == (2, 3)
        assert np.linalg.matrix_rank(J @ J.T) == rank
    with pytest.raises(np.linalg.LinAlgError):
        weighted_right_inverse(planar_jacobian(LENGTHS, [0.0, 0.0, 0.0])[:2])


def test_right_inverse_is_not_for_fewer_joints_than_rows():
    J = embed_planar_jacobian(planar_jacobian(LENGTHS[:2], Q[:2]))  # two joints, six rows
    assert np.linalg.matrix_rank(J @ J.T) == 2 < 6
    with pytest.raises(np.linalg.LinAlgError):
        weighted_right_inverse(J)
    assert_allclose(weighted_left_inverse(J) @ J, np.eye(2), atol=ROUNDING)


def test_velocity_ellipse_is_of_unit_rates_not_of_unit_positions():
    rates = np.array([0.6, -0.8])
    for q, is_unit in (([0.6, 0.8], True), ([1.4, 2.0], False)):
        J = two_link_jacobian(LENGTHS[:2], q)
        assert (np.dot(q, q) == pytest.approx(1.0)) == is_unit
        # Unit rates are on it whatever the positions, and others are not.
        assert (J @ rates) @ np.linalg.solve(J @ J.T, J @ rates) == pytest.approx(1.0)
        slow = J @ (0.5 * rates)
        assert slow @ np.linalg.solve(J @ J.T, slow) == pytest.approx(0.25)


def test_unit_rates_of_a_redundant_arm_fill_its_ellipse():
    J = planar_jacobian(LENGTHS, Q)[:2]
    ellipse = velocity_ellipsoid(J)
    for internal in (0.0, 0.5, 1.0):
        rates = resolved_rates(J, 0.1 * ellipse.axes[:, 0])
        unit = np.sqrt(1 - internal**2) * rates / np.linalg.norm(rates) + internal * np.linalg.svd(J)[2][2]
        assert np.linalg.norm(unit) == pytest.approx(1.0)
        value = (J @ unit) @ np.linalg.solve(J @ J.T, J @ unit)
        assert value == pytest.approx(1 - internal**2, abs=1e-9)
        assert refuted(value, 1.0) == (internal > 0)
