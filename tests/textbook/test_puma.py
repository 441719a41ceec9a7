"""The PUMA 560: wrist point and determinant against the table, singular families, gravity."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from differences import DIFFERENCE, rounded, slopes
from rmrc.textbook.puma import (
    ELBOW_OFFSET,
    FOREARM,
    UPPER_ARM,
    puma_chain,
    puma_determinant,
    puma_factors,
    puma_gravity_torques,
    puma_wrist_position,
)

# Products of six rotations and lengths of order one.
ROUNDING = 1e-12

angle = rounded(-3.1, 3.1)
configurations = st.tuples(*[angle] * 6).map(np.array)


@given(configurations)
def test_wrist_point_is_the_origin_of_the_last_three_frames(q):
    origins = puma_chain().frames(q)[4:, :3, 3]
    assert_allclose(origins, np.tile(puma_wrist_position(q), (3, 1)), atol=ROUNDING)


@given(configurations)
def test_derivative_of_the_wrist_point_is_the_table_s_jacobian(q):
    assert_allclose(puma_chain().jacobian(q)[:3], slopes(puma_wrist_position, q), atol=DIFFERENCE)


@given(configurations)
def test_determinant_is_the_product_of_its_factors(q):
    expected = np.linalg.det(puma_chain().jacobian(q))
    assert_allclose(puma_determinant(q), expected, atol=ROUNDING)
    assert_allclose(UPPER_ARM * np.prod(puma_factors(q)), expected, atol=ROUNDING)


def test_a_determinant_without_the_elbow_s_offset_is_seen():
    """Negative control: with a₃ = 0 the elbow is singular at 90°, 2.7° away from where it is."""
    q = np.radians([10, -50, 90, 20, 30, 40])
    without = UPPER_ARM * np.prod(puma_factors(q) / [1, FOREARM * np.cos(q[2]) - ELBOW_OFFSET, 1])
    assert without * FOREARM * np.cos(q[2]) == pytest.approx(0.0, abs=ROUNDING)
    assert abs(np.linalg.det(puma_chain().jacobian(q))) > 1e-3


def singular(family):
    q = np.radians([10.0, -50, 170, 20, 30, 40])
    if family == "shoulder":
        # a₂ c₂ + R sin(θ₂₃ − δ) = 0, with a₃ = −R sin δ, d₄ = R cos δ
        R, delta = np.hypot(ELBOW_OFFSET, FOREARM), np.arctan2(-ELBOW_OFFSET, FOREARM)
        q[2] = delta - np.arcsin(UPPER_ARM * np.cos(q[1]) / R) - q[1]
    elif family in ("stretched", "folded"):
        q[2] = np.arctan2(FOREARM, ELBOW_OFFSET) - (np.pi if family == "folded" else 0)
    elif family == "wrist":
        q[4] = 0.0
    return q


@pytest.mark.parametrize(
    ("family", "factor"), [("shoulder", 0), ("stretched", 1), ("folded", 1), ("wrist", 2)]
)
def test_each_factor_is_a_family_of_singularities(family, factor):
    q = singular(family)
    J, factors = puma_chain().jacobian(q), puma_factors(q)
    assert np.linalg.matrix_rank(J, tol=1e-9) == 5
    assert_allclose(factors[factor], 0.0, atol=ROUNDING)
    # Folded, the wrist is never more than 2 mm away from the shoulder family: a₂ = 0.4318 is so near to 0.4336.
    assert np.all(np.abs(np.delete(factors, factor)) > (1e-3 if family == "folded" else 1e-2))
    x, y, z = puma_wrist_position(q)
    if family == "shoulder":  # as near to the waist's axis as the offset allows
        assert np.hypot(x, y) == pytest.approx(0.1501, abs=ROUNDING)
    elif family == "stretched":  # upper arm and forearm in one line, the offset across it
        reach = UPPER_ARM + np.hypot(ELBOW_OFFSET, FOREARM)
        assert np.sqrt(x**2 + y**2 + z**2) == pytest.approx(np.hypot(reach, 0.1501), abs=ROUNDING)


def test_away_from_the_families_the_rank_is_full():
    assert np.linalg.matrix_rank(puma_chain().jacobian(singular("none")), tol=1e-3) == 6


@given(configurations)
def test_gravity_torques_are_the_slope_of_a_potential(q):
    """Whatever the constants: this fails for a wrong sign or factor in any one entry."""
    g = np.array([-37.2, -8.44, 1.02, 0.249, -0.0282])

    def potential(q):
        s2, c2 = np.sin(q[..., 1]), np.cos(q[..., 1])
        s23, c23 = np.sin(q[..., 1] + q[..., 2]), np.cos(q[..., 1] + q[..., 2])
        c4, c5, s5 = np.cos(q[..., 3]), np.cos(q[..., 4]), np.sin(q[..., 4])
        hand = -c23 * c5 + s23 * c4 * s5
        terms = np.stack([s2, -c23, -c2, s23, hand], axis=-1)
        return (terms @ g)[..., None]

    # Third derivatives of up to 40 N·m.
    assert_allclose(puma_gravity_torques(g, q), slopes(potential, q)[0], atol=10 * DIFFERENCE)


def test_leading_axes_are_configurations():
    q = np.random.default_rng(3).uniform(0.3, 1.0, (2, 3, 6))
    for f in (puma_wrist_position, puma_factors, puma_determinant):
        assert_allclose(f(q)[1, 2], f(q[1, 2]), atol=0)
    assert_allclose(
        puma_gravity_torques(np.ones(5), q)[1, 2], puma_gravity_torques(np.ones(5), q[1, 2]), atol=0
    )
