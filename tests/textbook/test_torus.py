"""Exercise 6.1: its Jacobian, its torus, and all postures of a point, which are tried out forwards."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from differences import rounded
from rmrc.textbook.torus import (
    torus_factors,
    torus_jacobian,
    torus_position,
    torus_postures,
    torus_tube,
)

# Products of a few rotations and lengths of order one.
ROUNDING = 1e-12

LONG = np.array([1.2, 0.6, 0.5])  # l1 > l2 + l3
SHORT = np.array([0.4, 0.6, 0.5])

angle = rounded(-3.1, 3.1)
configurations = st.tuples(angle, angle, angle).map(np.array)
lengths_of_arms = st.tuples(*[rounded(0.2, 2.0)] * 3).map(np.array)
cases = st.sampled_from([LONG, SHORT])


@given(cases, angle, angle, st.sampled_from([0.0, np.pi]))
def test_where_s3_is_0_the_tip_is_on_a_torus_or_its_hollow(lengths, q1, q2, q3):
    q = np.array([q1, q2, q3])
    tube = lengths[1] + lengths[2] if q3 == 0 else lengths[1] - lengths[2]
    # With ρ < 0 the tip is beyond the axis, on the torus' inner part: the circle is that of the other side.
    x, y, z = torus_position(lengths, q)
    rho = torus_factors(lengths, q)[1]
    assert abs(np.hypot(x, y) - abs(rho)) < ROUNDING
    assert np.hypot(rho - lengths[0], z) == pytest.approx(tube, abs=ROUNDING)
    if rho >= 0:
        assert torus_tube(lengths, [x, y, z]) == pytest.approx(tube, abs=ROUNDING)
    assert np.linalg.svd(torus_jacobian(lengths, q)[:3], compute_uv=False)[-1] < 1e-12


def spread(postures):
    """Unit vectors of the angles: equal for angles that differ by full turns."""
    return np.concatenate([np.cos(postures), np.sin(postures)], axis=-1)


@given(cases, configurations)
def test_postures_reach_the_point_and_the_one_it_came_from_is_among_them(lengths, q):
    s3, rho = torus_factors(lengths, q)
    assume(abs(s3) > 1e-3)  # else two postures are one
    assume(abs(rho) > 1e-3)
    point = torus_position(lengths, q)
    postures = torus_postures(lengths, point)
    assert_allclose(torus_position(lengths, postures), np.tile(point, (len(postures), 1)), atol=1e-10)
    assert np.all((postures > -np.pi) & (postures <= np.pi))
    # arccos loses half the digits as s3 goes to 0, here up to 1/1e-3.
    assert np.min(np.abs(spread(postures) - spread(q)).max(axis=-1)) < 1e-9
    different = np.linalg.norm(spread(postures)[:, None] - spread(postures), axis=-1)
    assert np.all(different + 10 * np.eye(len(postures)) > 1e-4)


def count_by_search(lengths, point):
    """The number of postures from sign changes over θ₂, with neither arccos nor a choice of sides."""
    theta2 = np.linspace(-np.pi, np.pi, 20001)[:-1]
    count = 0
    for rho in (np.hypot(*point[:2]), -np.hypot(*point[:2])):
        outward = rho - lengths[0] - lengths[1] * np.cos(theta2)
        miss = np.hypot(outward, point[2] - lengths[1] * np.sin(theta2)) - lengths[2]
        count += np.count_nonzero(np.sign(miss) != np.sign(np.roll(miss, 1)))
    return count


@given(cases, rounded(0.05, 2.4), angle, rounded(-1.2, 1.2))
def test_the_number_of_postures_is_what_a_search_finds(lengths, r, turn, z):
    point = np.array([r * np.cos(turn), r * np.sin(turn), z])
    for rho in (r, -r):  # not too near to a boundary for the search's grid
        tube = np.hypot(rho - lengths[0], z)
        assume(abs(tube - lengths[1] - lengths[2]) > 1e-3)
        assume(abs(tube - lengths[1] + lengths[2]) > 1e-3)
    assert len(torus_postures(lengths, point)) == count_by_search(lengths, point)


def test_a_point_out_of_reach_has_no_posture():
    assert torus_postures(LONG, [2.31, 0, 0]).shape == (0, 3)
    assert torus_postures(LONG, [1.2, 0, 0.09]).shape == (0, 3)  # in the hollow
    assert torus_postures(LONG, [0, 0, 0.3]).shape == (0, 3)  # on the axis


@pytest.mark.parametrize(("tip", "bend"), [([2.3, 0, 0], 0.0), ([1.2, 0, 0.1], np.pi)])
def test_on_a_singular_surface_two_postures_are_one(tip, bend):
    (posture,) = torus_postures(LONG, tip)
    assert posture[2] == bend
    assert_allclose(torus_position(LONG, posture), tip, atol=1e-12)


def test_on_the_first_axis_any_first_angle_will_do():
    postures = torus_postures(SHORT, [0, 0, 0.7])
    assert postures.shape == (2, 3)
    assert np.all(np.isnan(postures[:, 0]))
    for q1 in (-2.0, 0.0, 1.0):
        postures[:, 0] = q1
        assert_allclose(torus_position(SHORT, postures), np.tile([0, 0, 0.7], (2, 1)), atol=ROUNDING)
