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
    written_in,
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


@pytest.mark.parametrize("fault", ["no_turning", "no_writer", "writer_inverted", "omega_in_b"])
def test_a_term_or_frame_that_is_missed_is_seen(fault):
    motion, t = Motion(3), 0.4
    v_origin, v_point = motion.wave_rate(motion.origin, t), motion.wave_rate(motion.point, t)
    R, omega, point = motion.rotation(t), motion.omega(t), motion.wave(motion.point, t)
    arguments = {
        "no_turning": (v_origin, R, v_point, 0 * omega, point),
        "no_writer": (v_origin, np.eye(3), v_point, omega, point),
        "writer_inverted": (v_origin, R.T, v_point, omega, point),
        "omega_in_b": (v_origin, R, v_point, R.T @ omega, point),
    }[fault]
    with pytest.raises(AssertionError):
        assert_allclose(point_velocity(*arguments), difference(motion.seen_from_a, t), atol=DIFFERENCE)


@given(seeds, st.floats(-2, 2))
def test_writing_in_another_frame_changes_numbers_and_not_the_vector(seed, t):
    motion = Motion(seed)
    R, v = motion.rotation(t), motion.wave_rate(motion.point, t)
    # The observer stays in {B}: he differentiates ᴮQ, whoever writes.
    seen_by_b = R @ difference(lambda s: motion.wave(motion.point, s), t)
    assert_allclose(written_in(R, v), seen_by_b, atol=DIFFERENCE)
    assert_allclose(np.linalg.norm(written_in(R, v)), np.linalg.norm(v), atol=ROUNDING)


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


def test_the_matrix_the_other_way_round_is_that_of_the_body_s_own_axes():
    motion, t = Motion(3), 0.4
    R, rate, omega = motion.rotation(t), exact_rate(motion, t), motion.omega(t)
    assert_allclose(vee(R.T @ rate), R.T @ omega, atol=ROUNDING)
    assert np.abs(vee(R.T @ rate) - omega).max() > 1e-3


@given(seeds)
def test_a_family_of_rotations_leaves_the_identity_with_a_skew_derivative(seed):
    """Exercise 6.5: R(0) = I."""
    motion = Motion(seed)
    family = lambda t: motion.rotation(t) @ motion.rotation(0.0).T  # noqa: E731
    leaving = difference(family, 0.0)
    assert_allclose(leaving, rotation_rate(np.eye(3), motion.omega(0.0)), atol=DIFFERENCE)
    assert_allclose(leaving + leaving.T, 0.0, atol=DIFFERENCE)


@given(seeds, st.floats(-2, 2))
def test_instantaneous_axis_is_that_of_the_turn_from_one_instant_to_the_next(seed, t):
    motion = Motion(seed)
    axis, speed = instantaneous_axis(motion.omega(t))
    turn = Rotation.from_matrix(motion.rotation(t + STEP) @ motion.rotation(t - STEP).T).as_rotvec()
    # The turn's vector is a central difference of 2 · 1e-5 in length.
    assert_allclose(speed * axis, turn / (2 * STEP), atol=DIFFERENCE)
    assert_allclose(np.linalg.norm(axis), 1.0, atol=ROUNDING)


def test_a_matrix_that_is_not_skew_holds_no_angular_velocity():
    with pytest.raises(ValueError, match=r".") as caught:
        vee([[0, -2, 0], [1, 0, 0], [0, 0, 0]])  # (1 − 2)/2 beside 2
    assert str(caught.value) == (
        "angular-velocity matrix: its symmetric part is 0.25 of it, at most 1e-09 is rounding; "
        "R and its derivative do not belong together"
    )
    with pytest.raises(ValueError, match="symmetric part is nan"):
        vee(np.full((3, 3), np.nan))
    # A difference quotient is skew as far as its step allows, which its caller must say.
    quotient = (Rotation.from_rotvec([0, 0, 1e-4]).as_matrix() - np.eye(3)) / 1e-4
    with pytest.raises(ValueError, match="symmetric part"):
        vee(quotient)
    assert_allclose(vee(quotient, tolerance=1e-4), [0, 0, 1], atol=1e-8)
    assert_allclose(vee(np.zeros((3, 3))), 0.0, atol=0)
    # The tolerance is what it says: half of it passes, twice of it does not.
    S = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0.0]])
    assert_allclose(vee(S + np.diag([0.5e-9, 0, 0])), [0, 0, 1], atol=0)
    with pytest.raises(ValueError, match="symmetric part is 2e-09"):
        vee(S + np.diag([2e-9, 0, 0]))


def test_each_component_is_the_mean_of_its_two_entries():
    lopsided = [[0, -5, 4], [1, 0, -2], [-2, 0, 0]]
    assert_allclose(vee(lopsided, tolerance=1.0), [1, 3, 3], atol=0)


def test_what_does_not_turn_has_no_axis():
    with pytest.raises(ValueError, match="cannot normalize a vector that is zero or not finite"):
        instantaneous_axis([0.0, 0.0, 0.0])


def test_leading_axes_are_instants():
    rng = np.random.default_rng(2)
    R, rate, omega = rng.normal(size=(5, 1, 3, 3)), rng.normal(size=(4, 3, 3)), rng.normal(size=(4, 3))
    v, velocity, point = rng.normal(size=(3, 4, 3))
    both = [
        (angular_velocity(R, rate), angular_velocity(R[3, 0], rate[2])),
        (angular_velocity_matrix(R, rate), angular_velocity_matrix(R[3, 0], rate[2])),
        (rotation_rate(R, omega), rotation_rate(R[3, 0], omega[2])),
        (
            point_velocity(v, R, velocity, omega, point),
            point_velocity(v[2], R[3, 0], velocity[2], omega[2], point[2]),
        ),
    ]
    for all_of_them, one in both:
        assert all_of_them.shape[:2] == (5, 4)
        assert_allclose(all_of_them[3, 2], one, atol=ROUNDING)
