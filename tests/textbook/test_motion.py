"""Moving frames against differences of smooth motions, whose angular velocity is known in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from rmrc.textbook.motion import (
    angular_velocity,
    angular_velocity_matrix,
    instantaneous_axis,
    point_velocity,
    rotation_rate,
    vee,
)

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
        self.origin, self.point = rng.uniform(-1, 1, (2, 3, 3))

    def rotation(self, t):
        turns = (Rotation.from_rotvec(r) for r in (t * self.first, t * self.second, self.start))
        return np.linalg.multi_dot([turn.as_matrix() for turn in turns])

    def omega(self, t):
        """Angular velocities add up: the second is carried by the first."""
        return self.first + Rotation.from_rotvec(t * self.first).apply(self.second)

    @staticmethod
    def wave(terms, t):
        constant, sine, cosine = terms
        return constant + sine * np.sin(t) + cosine * np.cos(t)

    @staticmethod
    def wave_rate(terms, t):
        return terms[1] * np.cos(t) - terms[2] * np.sin(t)

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


@given(seeds, st.floats(-2, 2))
def test_instantaneous_axis_is_that_of_the_turn_from_one_instant_to_the_next(seed, t):
    motion = Motion(seed)
    axis, speed = instantaneous_axis(motion.omega(t))
    turn = Rotation.from_matrix(motion.rotation(t + STEP) @ motion.rotation(t - STEP).T).as_rotvec()
    # The turn's vector is a central difference of 2 · 1e-5 in length.
    assert_allclose(speed * axis, turn / (2 * STEP), atol=DIFFERENCE)
    assert_allclose(np.linalg.norm(axis), 1.0, atol=ROUNDING)


def test_a_matrix_that_is_not_skew_holds_no_angular_velocity():
    S = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0.0]])
    # The tolerance is what it says: half of it passes, twice of it does not.
    assert_allclose(vee(S + np.diag([0.5e-9, 0, 0])), [0, 0, 1], atol=0)
    for wrong in (S + np.diag([2e-9, 0, 0]), np.full((3, 3), np.nan)):
        with pytest.raises(ValueError, match="symmetric part"):
            vee(wrong)
    # A difference quotient is skew as far as its step allows, which its caller must say; entries are averaged.
    assert_allclose(vee([[0, -5, 4], [1, 0, -2], [-2, 0, 0]], tolerance=1.0), [1, 3, 3], atol=0)
