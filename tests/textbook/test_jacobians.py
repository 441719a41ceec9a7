"""Matrices of any arm: ellipsoids, ranks, inverses by normal equations, torques, and a parallel platform."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook.chains import joint_torques
from rmrc.textbook.inverse import (
    null_space_projector,
    resolved_rates,
    weighted_left_inverse,
    weighted_right_inverse,
)
from rmrc.textbook.planar import planar_jacobian
from rmrc.textbook.singularity import (
    force_ellipsoid,
    manipulability,
    manipulability_by_minors,
    minors,
    rank_by_minors,
    rank_by_singular_values,
    velocity_ellipsoid,
)
from rmrc.textbook.two_link import two_link_jacobian, two_link_position

# Conditions are at most 1e2: J Jᵀ squares it, 1e4 · 1e-16, some dozen terms.
ROUNDING = 1e-10


@st.composite
def regular(draw):
    m = draw(st.integers(2, 3))
    J = draw(arrays(float, (m, draw(st.integers(m, 6))), elements=st.floats(-2.0, 2.0)))
    sigma = np.linalg.svd(J, compute_uv=False)
    assume(sigma[-1] > 1e-2 * sigma[0] and sigma[0] > 0.1)
    return J


def form(ellipsoid, points):
    """Σ (x·e_i/a_i)²: 1 on the ellipsoid, less than 1 in it."""
    return np.sum((points @ ellipsoid.axes / ellipsoid.half_axes) ** 2, axis=-1)


def directions(n, seed=1):
    d = np.random.default_rng(seed).normal(size=(50, n))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@given(regular())
def test_unit_rates_give_velocities_on_it_or_in_it_and_the_printed_form_is_its_own(J):
    m, n = J.shape
    ellipsoid = velocity_ellipsoid(J)
    velocities = directions(n) @ J.T
    value = form(ellipsoid, velocities)
    printed = np.einsum("ki,ij,kj->k", velocities, np.linalg.inv(J @ J.T), velocities)
    assert_allclose(value, printed, atol=ROUNDING)
    assert np.all(value <= 1 + ROUNDING)
    if m == n:
        assert_allclose(value, 1.0, atol=ROUNDING)
    # rates without internal motion, from the rows of J alone, reach it
    rates = directions(m) @ J
    rates /= np.linalg.norm(rates, axis=1, keepdims=True)
    assert_allclose(form(ellipsoid, rates @ J.T), 1.0, atol=ROUNDING)


@given(regular())
def test_the_two_are_reciprocal_along_the_same_axes(J):
    velocity, force = velocity_ellipsoid(J), force_ellipsoid(J)
    assert_allclose(velocity.half_axes * force.half_axes, 1.0, atol=ROUNDING)
    assert_allclose(force.axes, velocity.axes, atol=0)
    assert_allclose(velocity.axes.T @ velocity.axes, np.eye(len(J)), atol=ROUNDING)
    assert np.all(np.diff(velocity.half_axes) <= 0)
    # as it is printed; the determinant of a square of condition 1e4 in three rows: 1e-16 · 1e8
    assert_allclose(manipulability(J), np.sqrt(np.linalg.det(J @ J.T)), rtol=1e-7)


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


def test_an_absolute_tolerance_would_confuse_units():
    """Negative control of the scale: in micrometers and in megameters the rank is the same."""
    J = two_link_jacobian([1, 1], [0.3, 1.0])
    for scale in (1e-200, 1e-9, 1e9, 1e200):
        assert rank_by_minors(scale * J) == rank_by_singular_values(scale * J) == 2
    assert np.abs(minors(1e-9 * J, 2)).max() < 1e-12  # smaller than the tolerance itself
    singular = two_link_jacobian([1e9, 1e9], [0.3, np.pi])
    assert np.abs(minors(singular, 2)).max() > 1.0
    assert rank_by_minors(singular) == 1


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
def test_the_right_inverse_meets_lagrange_s_conditions(case, seed):
    J, W = case
    twist = np.random.default_rng(seed).normal(size=len(J))
    rates = weighted_right_inverse(J, W) @ twist
    size = 1 + np.abs(rates).max()
    assert_allclose(J @ rates, twist, atol=SQUARED * size)
    # W q̇ is in the range of Jᵀ: least squares by singular values finds the λ.
    multipliers = np.linalg.lstsq(J.T, W @ rates, rcond=None)[0]
    assert_allclose(J.T @ multipliers, W @ rates, atol=SQUARED * size * np.abs(W).max())


@given(wide(), st.integers(0, 1000))
def test_the_left_inverse_meets_the_normal_equations(case, seed):
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


@pytest.mark.parametrize(("angle", "is_refused"), [(1e-5, False), (2e-6, False), (5e-7, True), (1e-8, True)])
def test_rows_count_as_dependent_within_a_millionth_of_a_radian(angle, is_refused):
    J = np.array([[1.0, 0.0, 0.0], [np.cos(angle), np.sin(angle), 0.0]])
    if is_refused:
        with pytest.raises(np.linalg.LinAlgError, match="dependent rows"):
            weighted_right_inverse(J)
    else:
        # The squared condition, 4/angle², times rounding, times the inverse's size of 1/angle.
        assert_allclose(angle * (J @ weighted_right_inverse(J) - np.eye(2)), 0.0, atol=1e-15 * 4 / angle**2)


small = st.floats(-3.0, 3.0)


@given(*[arrays(float, 2, elements=small)] * 2)
def test_torque_of_two_links_is_the_moment_of_the_force_about_each_joint(q, force):
    """n_i = (p − o_i) × f: nothing of a Jacobian is in it."""
    lengths = np.array([1.0, 0.8])
    elbow = np.array([np.cos(q[0]), np.sin(q[0])])
    tip = two_link_position(lengths, q)
    moments = [arm[0] * force[1] - arm[1] * force[0] for arm in (tip, tip - elbow)]
    assert_allclose(joint_torques(two_link_jacobian(lengths, q), force), moments, atol=1e-12)


@given(st.integers(1, 6), st.floats(-3, 3), st.integers(0, 2**32 - 1))
def test_force_along_a_lost_direction_costs_no_torque_and_any_other_does(n, q1, seed):
    rng = np.random.default_rng(seed)
    lengths, folds = rng.uniform(0.5, 1.5, n), rng.integers(0, 2, n - 1) * np.pi
    J = planar_jacobian(lengths, [q1, *folds])[:2]  # all links on one line, stretched out or folded
    along, across = np.array([[np.cos(q1), np.sin(q1)], [-np.sin(q1), np.cos(q1)]])
    # 1000 N times a reach of 9 m, in rounding.
    assert_allclose(joint_torques(J, 1000 * along), 0.0, atol=1e-11)
    assert np.abs(joint_torques(J, across)).max() >= 0.5  # the last joint's lever is its own link
