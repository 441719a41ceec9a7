"""Screws against scipy's matrix exponential, against DH chains, and against differences of poses."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from rmrc.textbook.dh import DHChain
from rmrc.textbook.screws import (
    exp_screw,
    geometric_from_screws,
    joint_screw,
    product_of_exponentials,
    space_jacobian,
    transform_screw,
)

# A few dozen products of order ten.
ROUNDING = 1e-12
# Central differences of step 1e-5: truncation (1e-5)²/6 times a third derivative of a few meters, rounding 1e-16/1e-5.
DIFFERENCE = 1e-8
STEP = 1e-5

seeds = st.integers(0, 2**32 - 1)
PITCHES = [0.0, 0.3, -0.2, np.inf]


def matrix_of(screw):
    """The 4x4 matrix of a screw, written out here."""
    wx, wy, wz, vx, vy, vz = screw
    return np.array([[0, -wz, wy, vx], [wz, 0, -wx, vy], [-wy, wx, 0, vz], [0, 0, 0, 0.0]])


def random_arm(seed, pitches=PITCHES):
    rng = np.random.default_rng(seed)
    n = rng.integers(1, 7)
    axes, points = rng.normal(size=(n, 3)), rng.uniform(-1, 1, (n, 3))
    home = np.eye(4)
    home[:3, :3], home[:3, 3] = Rotation.from_rotvec(rng.normal(size=3)).as_matrix(), rng.uniform(-1, 1, 3)
    return joint_screw(axes, points, rng.choice(pitches, n)), rng.uniform(-2, 2, n), home


@given(seeds, st.sampled_from([0.0, 1e-300, 1e-12, 1e-8, 1e-4, 0.03, 1.0, 3.0, np.pi, 7.0]))
def test_motion_along_a_screw_is_the_matrix_exponential(seed, angle):
    rng = np.random.default_rng(seed)
    for screw in (
        joint_screw(*rng.normal(size=(2, 3)), rng.choice(PITCHES)),
        rng.normal(size=6),
        np.array([0, 0, 0, *rng.normal(size=3)]),
    ):
        assert_allclose(exp_screw(screw, angle), expm(matrix_of(screw) * angle), atol=ROUNDING)


@given(seeds, st.sampled_from(PITCHES))
def test_transformed_screw_is_that_of_the_joint_where_it_was_moved_to(seed, pitch):
    rng = np.random.default_rng(seed)
    axis, u, t, turn = rng.normal(size=(4, 3))
    R = Rotation.from_rotvec(turn).as_matrix()
    moved = transform_screw(joint_screw(axis, u, pitch), R, t)
    assert_allclose(moved, joint_screw(R @ axis, R @ u + t, pitch), atol=ROUNDING)


def space_columns_by_differences(pose, q):
    """[ω; v at the origin] of each joint: Ṫ T⁻¹ by central differences."""
    columns = []
    for step in STEP * np.eye(len(q)):
        spin = (pose(q + step) - pose(q - step)) / (2 * STEP) @ np.linalg.inv(pose(q))
        columns.append([spin[2, 1], spin[0, 2], spin[1, 0], *spin[:3, 3]])
    return np.transpose(columns)


@given(seeds)
def test_space_jacobian_is_the_derivative_of_the_product_of_exponentials(seed):
    screws, q, home = random_arm(seed)
    expected = space_columns_by_differences(lambda x: product_of_exponentials(screws, x, home), q)
    # Six screws of reach 2 with pitches: third derivatives of up to 100 meters.
    assert_allclose(space_jacobian(screws, q), expected, atol=5e-8)


def random_table(seed):
    """A modified DH chain, a tip in its last frame, and a configuration."""
    rng = np.random.default_rng(seed)
    n = rng.integers(1, 7)
    rows = rng.uniform(-1, 1, (n, 4)) * [np.pi, 1, 1, np.pi]
    kinds = rng.choice(["revolute", "prismatic"], n)
    return tuple(map(tuple, rows)), tuple(map(str, kinds)), rng.uniform(-2, 2, n), rng.uniform(-1, 1, 3)


def as_screws(chain, pitch):
    """The screws of a modified DH chain and its last frame, both at q = 0."""
    frames = chain.frames(np.zeros(len(chain.kinds)))
    return joint_screw(frames[1:, :3, 2], frames[1:, :3, 3], pitch), frames[-1]


@given(seeds)
def test_screws_give_pose_and_jacobian_of_a_dh_chain(seed):
    table, kinds, q, point = random_table(seed)
    chain = DHChain(table, kinds)
    screws, home = as_screws(chain, np.where(np.equal(kinds, "prismatic"), np.inf, 0.0))
    T = product_of_exponentials(screws, q, home)
    assert_allclose(T, chain.frames(q)[-1], atol=ROUNDING)
    tip = T[:3, :3] @ point + T[:3, 3]
    J = geometric_from_screws(space_jacobian(screws, q), tip)
    assert_allclose(J, chain.jacobian(q, point=point), atol=ROUNDING)
