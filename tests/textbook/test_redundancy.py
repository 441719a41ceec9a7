"""Inverses by normal equations: defining equations, Lagrange's conditions, minimum among random rates."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook.redundancy import (
    null_space_projector,
    resolved_rates,
    weighted_left_inverse,
    weighted_right_inverse,
)

entries = st.floats(-2.0, 2.0)


@st.composite
def wide(draw):
    """J with m <= n and a condition below 1e3, and W of condition up to some 1e2."""
    n = draw(st.integers(1, 6))
    m = draw(st.integers(1, n))
    J = draw(arrays(float, (m, n), elements=entries))
    sigma = np.linalg.svd(J, compute_uv=False)
    assume(sigma[-1] > 1e-3 * sigma[0] and sigma[0] > 0.1)
    root = draw(arrays(float, (n, n), elements=entries))
    return J, root @ root.T + np.eye(n)


# Normal equations square the condition, 1e3² · 1e2 · 1e-16.
SQUARED = 1e-7


@given(wide(), st.integers(0, 1000))
def test_the_right_inverse_meets_lagrange_s_conditions_and_no_feasible_rates_cost_less(case, seed):
    J, W = case
    rng = np.random.default_rng(seed)
    twist = rng.normal(size=len(J))
    rates = weighted_right_inverse(J, W) @ twist
    size = 1 + np.abs(rates).max()
    assert_allclose(J @ rates, twist, atol=SQUARED * size)
    # W q̇ is in the range of Jᵀ: least squares by singular values finds the λ.
    multipliers = np.linalg.lstsq(J.T, W @ rates, rcond=None)[0]
    assert_allclose(J.T @ multipliers, W @ rates, atol=SQUARED * size * np.abs(W).max())
    null = np.linalg.svd(J)[2][len(J) :]
    for _ in range(5):
        other = rates + rng.normal(size=len(null)) @ null
        assert other @ W @ other >= rates @ W @ rates * (1 - SQUARED)


@given(wide(), st.integers(0, 1000))
def test_the_left_inverse_meets_the_normal_equations_and_no_rates_come_nearer(case, seed):
    J = case[0].T
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(len(J), len(J)))
    W = root @ root.T + np.eye(len(J))
    twist = rng.normal(size=len(J))
    inverse = weighted_left_inverse(J, W)
    assert_allclose(inverse @ J, np.eye(J.shape[1]), atol=SQUARED * np.abs(inverse).max() + SQUARED)
    rates = inverse @ twist
    missed = twist - J @ rates
    assert_allclose(J.T @ W @ missed, 0.0, atol=SQUARED * (1 + np.abs(W).max() * np.abs(twist).max()))
    for _ in range(5):
        other = twist - J @ (rates + 0.1 * rng.normal(size=len(rates)))
        assert other @ W @ other >= missed @ W @ missed * (1 - SQUARED)


@given(wide(), st.integers(0, 1000))
def test_the_null_space_keeps_wishes_out_of_the_task_and_grants_what_it_can(case, seed):
    J, W = case
    rng = np.random.default_rng(seed)
    twist, wish = rng.normal(size=len(J)), rng.normal(size=J.shape[1])
    N = null_space_projector(J, W)
    # N is some √cond W large
    assert_allclose(J @ N, 0.0, atol=SQUARED * 10)
    assert_allclose(N @ N, N, atol=SQUARED * 10)
    rates = resolved_rates(J, twist, wish, W)
    expected = weighted_right_inverse(J, W) @ twist + N @ wish
    assert_allclose(rates, expected, atol=SQUARED * (1 + np.abs(expected).max()))
    # the minimum of (q̇ − q̇₀)ᵀ W (q̇ − q̇₀): W (q̇ − q̇₀) is orthogonal to every internal motion
    null = np.linalg.svd(J)[2][len(J) :]
    size = np.abs(W).max() * (1 + np.abs(rates).max())
    assert_allclose(null @ W @ (rates - wish), 0.0, atol=SQUARED * size)


@given(wide())
def test_without_weights_both_are_the_pseudo_inverse(case):
    J, _ = case
    reference = np.linalg.pinv(J)  # by singular values
    atol = SQUARED * np.abs(reference).max()
    assert_allclose(weighted_right_inverse(J), reference, atol=atol)
    assert_allclose(weighted_left_inverse(J.T), reference.T, atol=atol)


@pytest.mark.parametrize(("angle", "is_refused"), [(1e-5, False), (2e-6, False), (5e-7, True), (1e-8, True)])
def test_rows_count_as_dependent_within_a_millionth_of_a_radian(angle, is_refused):
    J = np.array([[1.0, 0.0, 0.0], [np.cos(angle), np.sin(angle), 0.0]])
    if is_refused:
        with pytest.raises(np.linalg.LinAlgError, match="dependent rows"):
            weighted_right_inverse(J)
    else:
        # The squared condition, 4/angle², times rounding, times the inverse's size of 1/angle.
        assert_allclose(angle * (J @ weighted_right_inverse(J) - np.eye(2)), 0.0, atol=1e-15 * 4 / angle**2)
