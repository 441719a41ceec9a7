"""Chains: DH tables, screws, propagation from link to link, and other points, each against the others and differences."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.linalg import expm

from rmrc.support.spatial import exp_rotation, quat_to_matrix
from rmrc.textbook.chains import (
    DHChain,
    actuator_torques,
    dh_transform,
    exp_screw,
    inward_wrenches,
    jacobian_by_propagation,
    joint_screw,
    modified_dh_transform,
    outward_velocities,
)
from rmrc.textbook.motion import rotate_jacobian, shift_jacobian
from rmrc.textbook.six_joint import stanford_jacobian

# Products of a dozen matrices of order one.
ROUNDING = 1e-12
# Central differences of step 1e-5: truncation (1e-5)^2/6 times the third derivative, which is a few
# meters; rounding 1e-16/1e-5.
DIFFERENCE = 1e-8
STEP = 1e-5

angles = st.floats(-3.0, 3.0)
lengths = st.floats(-1.0, 1.0)


def elementary(axis, angle=0.0, distance=0.0):
    """Rotate about and move along one coordinate axis; both conventions are built of this."""
    i, j = {"x": (1, 2), "z": (0, 1)}[axis]
    T = np.eye(4)
    T[i, i] = T[j, j] = np.cos(angle)
    T[j, i] = np.sin(angle)
    T[i, j] = -np.sin(angle)
    T["xyz".index(axis), 3] = distance
    return T


def twist_by_differences(chain, q, frame, point):
    """Columns [v; ω] from the poses at q ± step alone."""
    columns = []
    for i in range(len(chain.kinds)):
        step = np.zeros(len(chain.kinds))
        step[i] = STEP
        ahead, behind = chain.frames(q + step)[frame], chain.frames(q - step)[frame]
        derivative = (ahead - behind) / (2 * STEP)
        spin = derivative[:3, :3] @ chain.frames(q)[frame, :3, :3].T
        columns.append([*(derivative @ [*point, 1.0])[:3], spin[2, 1], spin[0, 2], spin[1, 0]])
    return np.array(columns).T


@st.composite
def chains(draw, *conventions):
    n = draw(st.integers(1, 6))
    rows = draw(st.lists(st.tuples(angles, lengths, lengths, angles), min_size=n, max_size=n))
    kinds = draw(st.lists(st.sampled_from(["revolute", "prismatic"]), min_size=n, max_size=n))
    chain = DHChain(tuple(rows), tuple(kinds), draw(st.sampled_from(conventions or ["standard", "modified"])))
    q = np.array(draw(st.lists(lengths, min_size=n, max_size=n)))
    point = np.array(draw(st.lists(lengths, min_size=3, max_size=3)))
    return chain, q, draw(st.integers(0, n)), point


@given(angles, lengths, lengths, angles)
def test_both_transforms_are_their_four_elementary_motions(alpha, a, d, theta):
    about_z, about_x = elementary("z", theta, d), elementary("x", alpha, a)
    assert_allclose(dh_transform(alpha, a, d, theta), about_z @ about_x, atol=ROUNDING)
    assert_allclose(modified_dh_transform(alpha, a, d, theta), about_x @ about_z, atol=ROUNDING)


@given(chains())
def test_jacobian_is_the_derivative_of_the_pose(case):
    chain, q, frame, point = case
    expected = twist_by_differences(chain, q, frame, point)
    assert_allclose(chain.jacobian(q, frame, point), expected, atol=DIFFERENCE)


seeds = st.integers(0, 2**32 - 1)
PITCHES = [0.0, 0.3, -0.2, np.inf]


def matrix_of(screw):
    """The 4x4 matrix of a screw, written out here."""
    wx, wy, wz, vx, vy, vz = screw
    return np.array([[0, -wz, wy, vx], [wz, 0, -wx, vy], [-wy, wx, 0, vz], [0, 0, 0, 0.0]])


@given(seeds, st.sampled_from([0.0, 1e-300, 1e-12, 1e-8, 1e-4, 0.03, 1.0, 3.0, np.pi, 7.0]))
def test_motion_along_a_screw_is_the_matrix_exponential(seed, angle):
    rng = np.random.default_rng(seed)
    for screw in (
        joint_screw(*rng.normal(size=(2, 3)), rng.choice(PITCHES)),
        rng.normal(size=6),
        np.array([0, 0, 0, *rng.normal(size=3)]),
    ):
        assert_allclose(exp_screw(screw, angle), expm(matrix_of(screw) * angle), atol=ROUNDING)


def moved(point):
    T = np.eye(4)
    T[:3, 3] = point
    return T


@given(chains("modified"), seeds)
def test_propagation_is_that_of_the_explicit_jacobian_and_keeps_every_cut_in_equilibrium(case, seed):
    chain, q, _, point = case
    n, rng = len(q), np.random.default_rng(seed)
    links, frames, rates, tip = chain.link_transforms(q), chain.frames(q), rng.normal(size=n), moved(point)
    pitch = np.where(np.equal(chain.kinds, "prismatic"), np.inf, 0.0)
    twists = outward_velocities(links, pitch, rates, tip)
    for row, link, of in [*((i - 1, i, np.zeros(3)) for i in range(1, n + 1)), (n, n, point)]:
        R, explicit = frames[link][:3, :3], chain.jacobian(q, link, of) @ rates
        assert_allclose(twists[row], [*(R.T @ explicit[:3]), *(R.T @ explicit[3:])], atol=ROUNDING)
    J = chain.jacobian(q, n, point)
    assert_allclose(jacobian_by_propagation(links, pitch, tip), J, atol=ROUNDING)
    # What is cut free at a joint bears the same force, and its moment about that joint.
    wrench, R = rng.normal(size=6), frames[-1][:3, :3]
    at, force, moment = R @ point + frames[-1][:3, 3], R @ wrench[:3], R @ wrench[3:]
    reactions = inward_wrenches(links, wrench, tip)
    for frame, reaction in zip(frames[1:], reactions, strict=True):
        about = moment + np.cross(at - frame[:3, 3], force)
        assert_allclose(reaction, [*(frame[:3, :3].T @ force), *(frame[:3, :3].T @ about)], atol=ROUNDING)
    assert_allclose(actuator_torques(reactions, pitch), J.T @ [*force, *moment], atol=ROUNDING)


def test_what_costs_no_torque_at_a_singularity_is_carried_by_the_bearings():
    arm = DHChain(((0, 0, 0, 0), (0, 1.0, 0, 0), (0, 0.8, 0, 0)), ("revolute",) * 3)
    along = np.array([1000.0, 0, 0, 0, 0, 0])  # the links' own direction, stretched out
    reactions = inward_wrenches(arm.link_transforms([0.7, 0, 0]), along, moved([0.6, 0, 0]))
    assert_allclose(reactions, [along] * 3, atol=0)
    assert_allclose(actuator_torques(reactions, np.zeros(3)), 0.0, atol=0)


numbers = st.floats(-2.0, 2.0)
vectors = arrays(float, 3, elements=numbers)
six = arrays(float, 6, elements=numbers)


@example(np.array([1e-310, -2.0, 1e-310, 1e-310, 5e-324, 5e-324]), np.ones(3), np.ones(3))
@given(six, vectors, vectors)
def test_neither_frame_nor_point_change_the_determinant_and_frames_not_even_sigma(q, turn, p):
    J, R = stanford_jacobian(q), quat_to_matrix(exp_rotation(turn))
    turned = rotate_jacobian(J, R)
    determinant = np.linalg.det(J)
    assert_allclose(np.linalg.det(turned), determinant, atol=1e-10)  # of entries up to 2: 2⁶ products
    assert_allclose(np.linalg.det(shift_jacobian(turned, p)), determinant, atol=1e-8)  # and up to 6
    sigma = np.linalg.svd(J, compute_uv=False)
    assert_allclose(np.linalg.svd(turned, compute_uv=False), sigma, atol=ROUNDING)
    assert_allclose(rotate_jacobian(J[3:], R), turned[3:], atol=ROUNDING)
