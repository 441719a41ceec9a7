"""Exercise 6.1: its Jacobian, its torus, and all postures of a point, which are tried out forwards."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from differences import rounded
from rmrc.textbook.spatial import (
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


def test_a_point_out_of_reach_has_no_posture():
    assert torus_postures(LONG, [2.31, 0, 0]).shape == (0, 3)
    assert torus_postures(LONG, [1.2, 0, 0.09]).shape == (0, 3)  # in the hollow
    assert torus_postures(LONG, [0, 0, 0.3]).shape == (0, 3)  # on the axis


def test_on_the_first_axis_any_first_angle_will_do():
    postures = torus_postures(SHORT, [0, 0, 0.7])
    assert postures.shape == (2, 3)
    assert np.all(np.isnan(postures[:, 0]))
    for q1 in (-2.0, 0.0, 1.0):
        postures[:, 0] = q1
        assert_allclose(torus_position(SHORT, postures), np.tile([0, 0, 0.7], (2, 1)), atol=ROUNDING)
