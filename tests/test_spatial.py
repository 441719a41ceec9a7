"""rmrc.support.spatial against scipy's rotations, matrix exponentials and homogeneous matrices."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from rmrc.support import spatial

# A few dozen roundings of numbers near 1; the arrays below are scaled so.
ROUNDING = 1e-14

numbers = st.floats(-1, 1, allow_subnormal=False)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
quats = st.builds(
    lambda q: q / np.linalg.norm(q),
    st.tuples(numbers, numbers, numbers, numbers).map(np.array).filter(lambda q: np.linalg.norm(q) > 0.1),
)
directions = vectors.filter(lambda v: np.linalg.norm(v) > 0.1).map(lambda v: v / np.linalg.norm(v))
poses = st.builds(lambda p, q: np.concatenate([p, q]), vectors, quats)
six = st.builds(lambda a, b: np.concatenate([a, b]), vectors, vectors)


def assert_near(actual, expected, atol=ROUNDING, rtol=0.0):
    np.testing.assert_allclose(actual, expected, rtol=rtol, atol=atol)


def scipy_rotation(quat):
    return Rotation.from_quat(quat, scalar_first=True)


def homogeneous(R, p):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def twist_matrix(twist):
    """The 4x4 matrix of a twist, written out here: Ṫ = [ω]× T + ... for a moving frame."""
    vx, vy, vz, wx, wy, wz = twist
    return np.array([[0, -wz, wy, vx], [wz, 0, -wx, vy], [-wy, wx, 0, vz], [0, 0, 0, 0.0]])


@given(vectors, vectors)
def test_skew_times_w_is_v_cross_w(v, w):
    assert_near(spatial.skew(v) @ w, np.cross(v, w))


@given(quats, quats, vectors)
def test_quaternions_compose_and_rotate_as_scipys_do(a, b, v):
    both = scipy_rotation(a) * scipy_rotation(b)
    product = spatial.quat_multiply(a, b)
    assert_near(spatial.quat_to_matrix(a), scipy_rotation(a).as_matrix())
    assert_near(spatial.quat_to_matrix(product), both.as_matrix())
    assert_near(spatial.rotate(product, v), both.apply(v))
    identity = spatial.quat_multiply(a, spatial.quat_conjugate(a))
    assert_near(identity, [1, 0, 0, 0])


@given(directions, st.sampled_from([0.0, 1e-300, 1e-12, 1e-6, 1.0, 3.0, np.pi - 1e-12, np.pi]))
def test_exp_is_the_matrix_exponential(axis, angle):
    expected = expm(twist_matrix([0, 0, 0, *(angle * axis)])[:3, :3])
    quat = spatial.exp_rotation(angle * axis)
    assert_near(spatial.quat_to_matrix(quat), expected)
    # a matrix rounds a tiny angle away from 1; the quaternion's vector must keep all its digits
    assert_near(quat[1:], np.sin(angle / 2) * axis, rtol=ROUNDING, atol=1e-320)


@given(directions, st.sampled_from([1e-300, 1e-12, 1e-6, 0.3, 2.0, np.pi - 1e-9]), st.sampled_from([1, -1]))
def test_log_is_the_shortest_rotation_vector_to_all_digits_for_either_sign(axis, angle, sign):
    quat = sign * np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
    rotvec = spatial.log_rotation(quat)
    assert_near(rotvec / angle, axis)
    back = spatial.exp_rotation(rotvec)
    assert_near(back * np.sign(back @ quat), quat)


@given(directions, st.sampled_from([0.0, 1e-12, 1e-6, np.pi - 1e-6, np.pi - 1e-12, np.pi]))
def test_matrix_to_quat_is_accurate_near_half_turns_and_the_identity(axis, angle):
    R = Rotation.from_rotvec(angle * axis).as_matrix()
    quat = spatial.matrix_to_quat(R)
    assert_near(np.linalg.norm(quat), 1)
    assert_near(scipy_rotation(quat).as_matrix(), R)
    assert quat[0] >= 0


@given(poses, poses)
def test_pose_error_closes_the_gap_along_world_axes(pose_ref, pose):
    error = spatial.pose_error(pose_ref, pose)
    assert_near(pose[:3] + error[:3], pose_ref[:3])
    # world axes: the error turns from the left
    closed = Rotation.from_rotvec(error[3:]) * scipy_rotation(pose[3:])
    expected = scipy_rotation(pose_ref[3:]).as_matrix()
    assert_near(closed.as_matrix(), expected)
    assert np.linalg.norm(error[3:]) < np.pi + ROUNDING


@given(poses, six)
def test_twist_transform_is_the_change_of_frame_of_a_homogeneous_matrix(pose_a_b, twist):
    R, p = scipy_rotation(pose_a_b[3:]).as_matrix(), pose_a_b[:3]
    T = homogeneous(R, p)
    # for T_w_b(t) with T⁻¹Ṫ = [twist], and a fixed to b, T_w_a = T_w_b T_b_a has [T twist T⁻¹]
    expected = T @ twist_matrix(twist) @ np.linalg.inv(T)
    actual = spatial.twist_transform(R, p) @ twist
    assert_near(twist_matrix(actual), expected)


@given(vectors, vectors, six)
def test_shift_twist_is_the_velocity_of_the_other_point_of_a_turning_body(old, new, twist):
    v, omega = twist[:3], twist[3:]
    dt = 1e-4  # central differences of a rotation: an error of |ω|³ dt²/6 < 1e-8
    paths = [Rotation.from_rotvec(s * dt * omega).apply(new - old) + s * dt * v for s in (1, -1)]
    moved = (paths[0] - paths[1]) / (2 * dt)
    shifted = spatial.shift_twist(twist, old - new)
    assert_near(shifted, [*moved, *omega], atol=3e-8)
