"""Rank by minors and by singular values, held against matrices whose rank is known by construction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from rmrc.textbook.ellipsoid import manipulability
from rmrc.textbook.planar import planar_jacobian
from rmrc.textbook.singularity import (
    manipulability_by_minors,
    minors,
    rank_by_minors,
    rank_by_singular_values,
)
from rmrc.textbook.stanford import stanford_jacobian
from rmrc.textbook.two_link import two_link_jacobian

BOTH = [rank_by_minors, rank_by_singular_values]


@st.composite
def ranked(draw):
    """J = Σ σ_i u_i v_iᵀ with r singular values between 1e-3 and 1, at some scale."""
    m, n = draw(st.integers(1, 6)), draw(st.integers(1, 6))
    r = draw(st.integers(0, min(m, n)))
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    u, v = (np.linalg.qr(rng.normal(size=(k, k)))[0][:, :r] for k in (m, n))
    sigma = np.sort(10.0 ** rng.uniform(-3, 0, r))[::-1]
    scale = draw(st.sampled_from([1e-6, 1.0, 1e6]))
    return scale * (u * sigma) @ v.T, r, scale * sigma


@pytest.mark.parametrize("rank", BOTH)
@given(case=ranked())
def test_the_rank_is_that_of_the_construction(rank, case):
    # rounding leaves singular values of 1e-16, the tolerance is 1e-12, and the smallest is 1e-3
    J, r, sigma = case
    assert rank(J) == r
    wide = J if J.shape[0] <= J.shape[1] else J.T
    product = np.prod(sigma) if len(sigma) == len(wide) else 0.0
    # a product of as many lengths, each at most σ₁
    atol = 1e-12 * np.linalg.norm(J) ** len(wide)
    assert_allclose(
        [manipulability(wide), manipulability_by_minors(wide), manipulability_by_minors(wide.T)],
        product,
        atol=atol,
    )


def test_minors_are_the_determinants_of_their_rows_and_columns():
    J = np.random.default_rng(2).normal(size=(3, 4))
    assert_allclose(minors(J, 1), J, atol=0)
    pairs = minors(J, 2)
    assert pairs.shape == (3, 6)
    # rows (0, 2) are the second choice, columns (1, 3) the fifth
    assert pairs[1, 4] == pytest.approx(J[0, 1] * J[2, 3] - J[0, 3] * J[2, 1])
    assert minors(np.eye(3), 3) == pytest.approx(1.0)
    # Compound matrices multiply, again Cauchy and Binet's.
    B = np.random.default_rng(3).normal(size=(4, 3))
    assert_allclose(minors(J @ B, 2), pairs @ minors(B, 2), atol=1e-12)


@pytest.mark.parametrize("rank", BOTH)
@pytest.mark.parametrize(
    ("J", "expected"),
    [
        (planar_jacobian([2, 1, 1], [0, 0, 0])[:2], 1),  # the home position of the notes: a row of zeros
        (planar_jacobian([2, 1, 1], [0, np.pi / 2, 0])[:2], 2),
        (two_link_jacobian([6, 3], [0.4, np.pi]), 1),  # sin π is 1e-16, not 0
        (stanford_jacobian([0.3, 1.0, 0.6, 0.7, 0.9, 0.2]), 6),
        (stanford_jacobian([0.3, 1.0, 0.6, 0.7, np.pi, 0.2]), 5),
        (stanford_jacobian([0.3, 0.0, 0.6, 0.0, 0.0, 0.2]), 4),
        (np.zeros((2, 3)), 0),
    ],
)
def test_both_find_the_singular_configurations(rank, J, expected):
    assert rank(J) == expected


def test_an_absolute_tolerance_would_confuse_units():
    """Negative control of the scale: in micrometers and in megameters the rank is the same."""
    J = two_link_jacobian([1, 1], [0.3, 1.0])
    for scale in (1e-200, 1e-9, 1e9, 1e200):
        assert rank_by_minors(scale * J) == rank_by_singular_values(scale * J) == 2
    assert np.abs(minors(1e-9 * J, 2)).max() < 1e-12  # smaller than the tolerance itself
    singular = two_link_jacobian([1e9, 1e9], [0.3, np.pi])
    assert np.abs(minors(singular, 2)).max() > 1.0
    assert rank_by_minors(singular) == 1
