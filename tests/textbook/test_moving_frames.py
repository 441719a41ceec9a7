"""Moving frames against differences of smooth motions, and Z-Y-Z angles against scipy's."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from rmrc.textbook.motion import (
    analytic_jacobian,
    angular_velocity,
    angular_velocity_matrix,
    point_velocity,
    rotation_rate,
    vee,
    zyz_angles,
    zyz_determinant,
    zyz_matrix,
    zyz_rate_matrix,
)
from rmrc.textbook.six_joint import stanford_chain

# A few dozen products of order ten.
ROUNDING = 1e-12
# Central differences of step 1e-5: truncation (1e-5)²/6 times a third derivative of some hundred at most
# (three speeds of up to 3 multiply), and rounding 1e-16/1e-5.
DIFFERENCE = 1e-8
STEP = 1e-5

seeds = st.integers(0, 2**32 - 1)


class Motion:
    """Frame {B} turns about an axis that itself turns; its origin and the point Q in it oscillate."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.first, self.second, self.start = rng.uniform(-1, 1, (3, 3))
        self.origin, self.point = rng.uniform(-1, 1, (2, 2, 3))

    def rotation(self, t):
        first, second = Rotation.from_rotvec(t * self.first), Rotation.from_rotvec(t * self.second)
        return (first * second * Rotation.from_rotvec(self.start)).as_matrix()

    def omega(self, t):
        """Angular velocities add up: the second is carried by the first."""
        return self.first + Rotation.from_rotvec(t * self.first).apply(self.second)

    @staticmethod
    def wave(terms, t):
        return terms.T @ [np.sin(t), np.cos(t)]

    @staticmethod
    def wave_rate(terms, t):
        return terms.T @ [np.cos(t), -np.sin(t)]

    def seen_from_a(self, t):
        return self.wave(self.origin, t) + self.rotation(t) @ self.wave(self.point, t)


def difference(path, t):
    return (path(t + STEP) - path(t - STEP)) / (2 * STEP)


def exact_rate(motion, t):
    """Ṙ column by column: each axis of {B} is a vector of constant length that turns, ė = Ω × e."""
    return np.cross(motion.omega(t), motion.rotation(t).T).T


@given(seeds, st.floats(-2, 2))
def test_velocity_of_a_point_in_a_moving_frame_is_the_derivative_of_its_way(seed, t):
    motion = Motion(seed)
    v_origin, v_point = motion.wave_rate(motion.origin, t), motion.wave_rate(motion.point, t)
    R, omega, point = motion.rotation(t), motion.omega(t), motion.wave(motion.point, t)
    seen = difference(motion.seen_from_a, t)
    assert_allclose(point_velocity(v_origin, R, v_point, omega, point), seen, atol=DIFFERENCE)


@given(seeds, st.floats(-2, 2))
def test_angular_velocity_matrix_is_skew_and_holds_the_angular_velocity(seed, t):
    motion = Motion(seed)
    R, rate, omega = motion.rotation(t), exact_rate(motion, t), motion.omega(t)
    S = angular_velocity_matrix(R, rate)
    assert_allclose(S + S.T, 0.0, atol=ROUNDING)
    assert_allclose(vee(S), omega, atol=ROUNDING)
    assert_allclose(angular_velocity(R, rate), omega, atol=ROUNDING)
    assert_allclose(rotation_rate(R, omega), rate, atol=ROUNDING)
    quotient = difference(motion.rotation, t)
    assert_allclose(angular_velocity(R, quotient), omega, atol=DIFFERENCE)


angle = st.floats(-3.1, 3.1)
triples = st.tuples(angle, angle, angle).map(np.array)


@given(triples)
def test_matrix_is_scipys_of_intrinsic_z_y_z(angles):
    assert_allclose(zyz_matrix(angles), Rotation.from_euler("ZYZ", angles).as_matrix(), atol=ROUNDING)


DEGENERATE = [0.0, -0.0, np.pi, -np.pi, 1e-15, np.pi - 1e-15]


@given(
    angle,
    st.one_of(angle, st.sampled_from([*DEGENERATE, 1e-13, 1e-9, -1e-6, np.pi - 1e-9])),
    angle,
    st.booleans(),
)
def test_both_branches_give_the_rotation_back_also_where_the_angles_are_not_unique(alpha, beta, gamma, flip):
    R = Rotation.from_euler("Z", alpha) * Rotation.from_euler("Y", beta) * Rotation.from_euler("Z", gamma)
    found = zyz_angles(R.as_matrix(), flip=flip)
    # Where sin β is below 1e-12, α = 0 leaves out that much.
    assert_allclose(Rotation.from_euler("ZYZ", found).as_matrix(), R.as_matrix(), atol=2e-12)
    assert (-np.pi <= found[1] <= 0) if flip else (0 <= found[1] <= np.pi)
    assert (np.abs(found) <= np.pi).all()


@pytest.mark.parametrize("beta", DEGENERATE)
def test_where_only_the_sum_or_the_difference_is_known_alpha_is_zero(beta):
    sign = np.sign(np.cos(beta))
    alpha, _, gamma = zyz_angles(zyz_matrix([0.5, beta, 0.3]))
    assert alpha == 0
    assert gamma == pytest.approx(0.3 + sign * 0.5, abs=ROUNDING)


def spin(rotation, angles, rates):
    """Ω from a difference quotient of R alone."""
    quotient = (rotation(angles + STEP * rates) - rotation(angles - STEP * rates)) / (2 * STEP)
    S = quotient @ rotation(angles).T
    return np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]]) / 2


@given(triples, st.tuples(*[st.floats(-1, 1)] * 3).map(np.array))
def test_rate_matrix_makes_the_angular_velocity_of_the_rates(angles, rates):
    def rotation(a):
        return Rotation.from_euler("ZYZ", a).as_matrix()

    E = zyz_rate_matrix(angles)
    assert_allclose(E @ rates, spin(rotation, angles, rates), atol=DIFFERENCE)
    assert_allclose(zyz_determinant(angles), np.linalg.det(E), atol=ROUNDING)


ARM = stanford_chain()


def posture(q):
    pose = ARM.frames(q)[-1]
    return np.concatenate([pose[:3, 3], zyz_angles(pose[:3, :3])])


@given(st.tuples(*[st.floats(-2, 2)] * 6).map(np.array))
def test_analytic_jacobian_is_the_derivative_of_position_and_angles(q):
    angles = posture(q)[3:]
    assume(np.abs(np.sin(angles[1])) > 0.2)
    columns = []
    for step in STEP * np.eye(6):
        change = posture(q + step) - posture(q - step)
        change[3:] = (change[3:] + np.pi) % (2 * np.pi) - np.pi  # a full turn is no change
        columns.append(change / (2 * STEP))
    J_a = analytic_jacobian(ARM.jacobian(q), angles)
    # Near the singularity third derivatives grow like 2 sin⁻³ β = 250: (1e-5)²/6 · 250, and as much for the rest.
    assert_allclose(J_a, np.transpose(columns), atol=5e-8)
