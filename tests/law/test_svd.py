"""The decomposition that serves the whole law, held against numpy's (LAPACK's)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from records import blank, put, resolve

# Rounding: a few tens of operations an entry, so some 1e-15, and sweeps end at cosines of 1e-13 (SMALL²).
ROUNDING = 1e-12

SHAPES = [(m, n) for m in range(1, 7) for n in range(1, 9)]


def decomposed(world, a):
    """Return u (k, m), sigma (k,), v (k, n) of a matrix (m, n), vectors as rows, as the law decomposes it."""
    (m, n), k = a.shape, min(a.shape)
    put(world, J=a)
    resolve(world)
    return world["u"][0, :k, :m].copy(), world["sigma"][0, :k].copy(), world["v"][0, :k, :n].copy()


def cold_svd(a):
    return decomposed(blank(*a.shape)[0], a)


def assert_decomposes(a, u, sigma, v):
    """A = Σ σ uᵀ v, u and v orthonormal, σ falling and numpy's."""
    k, scale = len(sigma), max(np.abs(a).max(), np.finfo(float).tiny)
    assert np.all(np.isfinite(u)) and np.all(np.isfinite(v)) and np.all(np.isfinite(sigma))
    assert np.all(np.diff(sigma) <= 0)
    assert_allclose(sigma / scale, np.linalg.svd(a / scale, compute_uv=False), rtol=0, atol=ROUNDING)
    assert_allclose((u.T * (sigma / scale)) @ v, a / scale, rtol=0, atol=ROUNDING)
    assert_allclose(u @ u.T, np.eye(k), rtol=0, atol=ROUNDING)
    assert_allclose(v @ v.T, np.eye(k), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(("m", "n"), SHAPES)
def test_svd_decomposes_matrices_of_every_shape_and_rank(m, n):
    rng = np.random.default_rng(100 * m + n)
    for rank in range(min(m, n) + 1):
        a = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))
        assert_decomposes(a, *cold_svd(a))


@given(
    arrays(np.float64, st.tuples(st.integers(1, 6), st.integers(1, 8)), elements=st.floats(-1, 1)),
    st.sampled_from([1e-300, 1e-160, 1e-90, 1e-50, 1e-8, 1.0, 1e8, 1e50, 1e90, 1e160, 1e300]),
)
def test_svd_is_finite_and_right_for_tiny_huge_zero_and_defective_matrices(a, scale):
    assert_decomposes(a * scale, *cold_svd(a * scale))


def test_small_singular_values_keep_their_relative_accuracy():
    # The reason for one-sided Jacobi: of a graded matrix D·B, with B well conditioned, every singular value
    # is accurate to rounding relative to itself. The oracle is exact: the columns are orthogonal.
    q, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(5, 5)))
    sigma = np.array([1.0, 1e-3, 1e-6, 1e-9, 1e-12])
    _, got, _ = cold_svd(sigma[:, None] * q)
    assert_allclose(got, sigma, rtol=1e-12)


@pytest.mark.parametrize(("m", "n"), [(2, 2), (2, 3), (3, 2), (6, 6), (6, 7), (6, 4)])
def test_warm_start_follows_a_path_through_rank_loss(m, n):
    # Along a smooth path the decomposition stays right at every step, whatever it started from.
    rng = np.random.default_rng(1)
    a0, da = rng.normal(size=(m, n)), rng.normal(size=(m, n))
    a0[-1] = a0[0] if m > 1 else a0[-1]  # rank loss at s = 0
    world = blank(m, n)[0]
    for s in np.linspace(-0.2, 0.2, 201):
        a = a0 + s * da
        assert_decomposes(a, *decomposed(world, a))
