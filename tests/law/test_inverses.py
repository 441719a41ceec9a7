"""Each inverse is what its definition says: Penrose conditions, least squares, bounds, limits, published forms."""

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from worlds import (
    DEFAULTS,
    NAMES,
    ROUNDING,
    SHAPES,
    SHORT,
    VARIANT,
    VARIANTS,
    Variant,
    along,
    fits,
    formula,
    make_world,
    matrices,
    one_world,
    rates_of,
    seeds,
    with_sigma,
)

from codes import Method, Schedule
from records import resolve
from rmrc.law.bare import resolve_rates

PSEUDOINVERSE, TRUNCATED = Variant(Method.PSEUDOINVERSE), Variant(Method.TRUNCATED)
TRANSPOSE, JPARSE = Variant(Method.TRANSPOSE), Variant(Method.JPARSE)
SELECTIVE, DAMPED, FILTERED = (
    Variant(Method.SELECTIVELY_DAMPED),
    Variant(Method.DAMPED),
    Variant(Method.FILTERED),
)

named = pytest.mark.parametrize("variant", [pytest.param(variant, id=str(variant)) for variant in VARIANTS])
shaped = pytest.mark.parametrize("shape", SHAPES, ids=str)


def matrix_of(J, variant, **parameters):
    """Return the inverse as a matrix: for methods that are linear in the twist."""
    return np.column_stack([rates_of(J, column, variant, **parameters) for column in np.eye(len(J))])


def away_from(sigma, *thresholds):
    """Keep to matrices whose σ are not within rounding of a place where a filter jumps."""
    assume(all(np.all(np.abs(sigma - threshold) > 1e-9) for threshold in thresholds))


def assert_penrose(J, P):
    # P is wrong by rounding, some 1e-15, times its own size and the condition number, which is ‖J‖ ‖P‖.
    size = max(1.0, np.linalg.norm(J)) * max(1.0, np.linalg.norm(P))
    assert_allclose(J @ P @ J, J, rtol=0, atol=1e-13 * size * np.linalg.norm(J))
    assert_allclose(P @ J @ P, P, rtol=0, atol=1e-13 * size * np.linalg.norm(P))
    assert_allclose(J @ P, (J @ P).T, rtol=0, atol=1e-13 * size)
    assert_allclose(P @ J, (P @ J).T, rtol=0, atol=1e-13 * size)


# Every method against its formula -----------------------------------------------------------------------------


@named
@given(shape=st.sampled_from(SHAPES), seed=seeds)
def test_rates_gains_and_damping_are_those_of_the_formulas(variant, shape, seed):
    rng = np.random.default_rng(seed)
    m, n = shape
    assume(fits(variant, shape))
    # From well conditioned through all thresholds to nearly singular; a square that is hardly so for `inverse`.
    sigma = np.sort(10.0 ** rng.uniform(-3, 0.5, min(m, n)))[::-1]
    J, t = with_sigma(rng, m, n, sigma), rng.normal(size=m)
    world, tick = one_world(J, t, variant=variant)
    y, gain, lam = formula(variant, J, t)
    # LAPACK's σ are right to 1e-15 σ_1, so 1/σ to 1e-15 κ of itself, and κ is below 1e4.
    assert_allclose(tick["gain"][: min(m, n)], gain, rtol=1e-10, atol=1e-10 * gain.max())
    assert tick["damping"] == pytest.approx(lam, rel=1e-9, abs=1e-9)
    assert_allclose(
        tick["qdot_cmd"][:n], y, rtol=0, atol=1e-10 * max(1.0, np.abs(gain).max()) * np.linalg.norm(t)
    )


@named
@given(shape=st.sampled_from(SHAPES), seed=seeds)
def test_plain_rates_are_those_of_the_inverse_whatever_the_method(variant, shape, seed):
    rng = np.random.default_rng(seed)
    m, n = shape
    assume(fits(variant, shape))
    sigma = np.sort(10.0 ** rng.uniform(-3, 0.5, min(m, n)))[::-1]
    J, t = with_sigma(rng, m, n, sigma), rng.normal(size=m)
    row, joint = rng.uniform(0.5, 2, m), rng.uniform(0.5, 2, n)
    _, tick = one_world(J, t, row**2, joint**-2, variant)
    P = np.linalg.pinv(row[:, None] * J * joint, rcond=ROUNDING)
    # rounding, 1e-15, times κ < 1e5 of the scaled matrix
    largest = np.linalg.norm(P) * np.linalg.norm(row * t)
    assert_allclose(tick["qdot_plain"][:n], joint * (P @ (row * t)), rtol=0, atol=1e-9 * largest)
    if variant.method == Method.INVERSE:
        assert tick["qdot_plain"].tobytes() == tick["qdot_cmd"].tobytes()


@named
def test_what_is_zero_to_rounding_is_left_out_of_plain_rates(variant):
    if not fits(variant, (2, 2)):
        return
    for vanishing in (0.0, 1e-16):
        _, tick = one_world(np.diag([2.0, vanishing]), np.array([1.0, 1.0]), variant=variant)
        assert_allclose(tick["qdot_plain"][:2], [0.5, 0.0], rtol=0, atol=1e-15)
    _, tick = one_world(np.diag([2.0, 1e-9]), np.array([1.0, 1.0]), variant=variant)
    assert_allclose(tick["qdot_plain"][:2], [0.5, 1e9], rtol=1e-12)
    assert (np.abs(tick["qdot_cmd"]).max() > 1e8) == (variant.method == Method.INVERSE)  # all others save it


@named
@shaped
def test_weights_are_nothing_but_other_units(variant, shape):
    # rates(J, t; S_x, S_q) = S_q rates(S_x J S_q, S_x t; 1, 1), for every method, and not for unweighted ones.
    if not fits(variant, shape):
        pytest.skip("inverse is for square matrices")
    m, n = shape
    for seed in range(4):
        rng = np.random.default_rng(seed)
        J, t = rng.normal(size=shape), rng.normal(size=m)
        row, joint = rng.uniform(0.3, 3, m), rng.uniform(0.3, 3, n)
        parameters = {"method": variant.method, "schedule": variant.schedule}
        world, tick = make_world(J, t, row, joint, **parameters)
        resolve(world, tick)
        scaled = rates_of(row[:, None] * J * joint, row * t, variant)
        # The same numbers in the same order but for the multiplications: rounding times κ < 1e4.
        assert_allclose(tick["qdot_cmd"][0, :n], joint * scaled, rtol=0, atol=1e-11 * np.abs(scaled).max())
        # and y of the formula, so that both do not merely agree
        y = formula(variant, row[:, None] * J * joint, row * t)[0]
        assert_allclose(scaled, y, rtol=0, atol=1e-10 * max(1, np.abs(y).max()))


@named
def test_the_check_of_weights_finds_weights_that_are_left_out(variant):
    rng = np.random.default_rng(0)
    J, t, row, joint = rng.normal(size=(2, 2)), rng.normal(size=2), np.array([0.3, 3]), np.array([2, 0.4])
    right = joint * rates_of(row[:, None] * J * joint, row * t, variant)
    without = rates_of(J, t, variant)
    one_sided = rates_of(row[:, None] * J, row * t, variant)
    if variant.method not in (Method.INVERSE, Method.PSEUDOINVERSE, Method.TRUNCATED):
        # An inverse proper is the same whatever the weights; so is what acts as one here.
        y, gain, _ = formula(variant, row[:, None] * J * joint, row * t)
        if np.any(gain * np.linalg.svd(row[:, None] * J * joint, compute_uv=False) < 0.99):
            assert np.abs(without - right).max() > 1e-6 and np.abs(one_sided - right).max() > 1e-6


# Inverse, pseudoinverse, truncated ----------------------------------------------------------------------------


@given(matrices)
def test_pseudoinverse_satisfies_the_penrose_conditions(J):
    sigma = np.linalg.svd(J, compute_uv=False)
    # σ under the tolerance, 1e-6 of the largest, are dropped: no pseudoinverse of J unless they are 0.
    assume(sigma[0] > 0 and not np.any((sigma > 1e-15 * sigma[0]) & (sigma < 1e-4 * sigma[0])))
    assert_penrose(J, matrix_of(J, PSEUDOINVERSE))


@given(seeds, st.integers(1, 6))
def test_inverse_satisfies_the_penrose_conditions_and_gives_exactly_the_twist(seed, n):
    rng = np.random.default_rng(seed)
    J, t = rng.normal(size=(n, n)), rng.normal(size=n)
    assume(np.linalg.cond(J) < 1e4)
    assert_penrose(J, matrix_of(J, Variant(Method.INVERSE)))
    rates = resolve_rates(J, t, "inverse")
    # backward stable: the residual is rounding times ‖J‖ ‖rates‖
    assert_allclose(J @ rates, t, rtol=0, atol=1e-12 * max(1.0, np.abs(J).max() * np.abs(rates).max()))


@given(matrices, st.floats(0.05, 1.0))
def test_truncated_is_the_pseudoinverse_of_the_truncated_matrix(J, cutoff):
    u, sigma, vt = np.linalg.svd(J, full_matrices=False)
    away_from(sigma, cutoff)
    truncated = (u * np.where(sigma > cutoff, sigma, 0)) @ vt
    P = matrix_of(J, TRUNCATED, cutoff=cutoff)
    assert_penrose(truncated, P)
    if np.any((sigma > 1e-6) & (sigma < cutoff)):  # the check finds the inverse of another matrix
        with pytest.raises(AssertionError):
            assert_penrose(J, P)


def test_the_penrose_check_finds_each_condition_broken():
    J = np.array([[1.0, 0.5, 0.2], [0.3, 1.0, 0.4]])
    weighted = np.linalg.inv(np.diag([1.0, 2.0, 3.0])) @ J.T
    broken = (
        np.zeros((3, 2)),  # J P J = J
        np.vstack([np.linalg.inv(J[:, :2]), np.zeros(2)]),  # P J not symmetric
        weighted @ np.linalg.inv(J @ weighted),  # the weighted right inverse: P J not symmetric
        J.T @ np.linalg.inv(J @ J.T + 1e-8 * np.eye(2)),  # damped
    )
    assert_penrose(J, np.linalg.pinv(J))
    for P in broken:
        with pytest.raises(AssertionError):
            assert_penrose(J, P)
    with pytest.raises(AssertionError):  # of a lost direction: P J P = P is all that is broken
        assert_penrose(np.diag([1.0, 0.0]), np.eye(2))


def assert_smallest(J, t, rates, wq, rng):
    """`rates` do the task, and none of the others that do it is smaller in the metric of W_q."""
    assert_allclose(J @ rates, t, rtol=0, atol=1e-10 * max(1, np.abs(rates).max()))
    free = np.linalg.svd(J)[2][len(J) :]
    for size in (1.0, 1e-3):  # far, and near enough to feel the slope
        for other in rates + size * rng.normal(size=(20, len(free))) @ free:
            assert rates @ (wq * rates) <= other @ (wq * other) * (1 + 1e-12)


def assert_least(J, t, rates, wx, rng):
    """No other rates leave less of the twist undone in the metric of W_x."""
    cost = lambda q: (t - J @ q) @ (wx * (t - J @ q))  # noqa: E731
    for size in (1.0, 1e-3):
        for other in rates + size * rng.normal(size=(20, len(rates))):
            assert cost(rates) <= cost(other) * (1 + 1e-12)


@given(seeds, st.sampled_from([(1, 2), (2, 4), (3, 7), (6, 7), (6, 8)]))
def test_rates_of_a_redundant_arm_are_the_smallest_of_all_that_do_the_task(seed, shape):
    rng = np.random.default_rng(seed)
    J, t, wq = rng.normal(size=shape), rng.normal(size=shape[0]), rng.uniform(0.2, 5, shape[1])
    assume(np.linalg.cond(J) < 1e4)
    rates = one_world(J, t, 1.0, wq, PSEUDOINVERSE)[1]["qdot_cmd"][: shape[1]]
    assert_smallest(J, t, rates, wq, rng)


@given(seeds, st.sampled_from([(2, 1), (4, 2), (6, 3), (6, 5)]))
def test_rates_of_an_arm_with_too_few_joints_leave_the_least_undone(seed, shape):
    rng = np.random.default_rng(seed)
    J, t, wx = rng.normal(size=shape), rng.normal(size=shape[0]), rng.uniform(0.2, 5, shape[0])
    rates = one_world(J, t, wx, 1.0, PSEUDOINVERSE)[1]["qdot_cmd"][: shape[1]]
    assert_least(J, t, rates, wx, rng)


def test_the_checks_of_minima_find_inverses_with_other_weights():
    rng = np.random.default_rng(0)
    weights = np.array([0.2, 1.0, 5.0])
    J, t = rng.normal(size=(2, 3)), rng.normal(size=2)
    with pytest.raises(AssertionError):
        assert_smallest(J, t, np.linalg.pinv(J) @ t, weights, rng)
    J, t = rng.normal(size=(3, 2)), rng.normal(size=3)
    with pytest.raises(AssertionError):
        assert_least(J, t, np.linalg.pinv(J) @ t, weights, rng)


# Bounds -------------------------------------------------------------------------------------------------------


def largest_gain(variant, **parameters):
    """Return sup g by the law for σ_2 from 1e-3 to 1 beside σ_1 = 1, with the σ_2 where it is."""
    grid = np.geomspace(1e-3, 1, 4001)
    J = np.array([np.diag([1.0, s]) for s in grid])
    gains = along(J, [0.0, 1.0], cold=True, method=variant.method, schedule=variant.schedule, **parameters)[
        :, 1
    ]
    return gains.max(), grid[gains.argmax()]


@pytest.mark.parametrize("lam", [0.02, 0.1, 0.4])
def test_the_largest_damped_gain_is_half_of_the_inverse_of_lambda_where_sigma_is_lambda(lam):
    gain, at = largest_gain(DAMPED, damping_maximum=lam)
    # steps of 0.17 %, at a flat top: g falls by half of the square of that
    assert 1 / (2 * lam) * (1 - 1e-5) < gain <= 1 / (2 * lam) * (1 + 1e-14)
    assert at == pytest.approx(lam, rel=2e-3)


@pytest.mark.parametrize("cutoff", [0.005, 0.05, 0.4])
def test_the_largest_truncated_gain_is_the_inverse_of_the_cutoff(cutoff):
    gain, at = largest_gain(TRUNCATED, cutoff=cutoff)
    assert 1 / cutoff * (1 - 2e-3) < gain < 1 / cutoff
    assert at == pytest.approx(cutoff, rel=2e-3) and at > cutoff


@pytest.mark.parametrize("gamma", [0.01, 0.1, 0.5])
def test_the_largest_gain_of_jparse_is_at_gamma_times_the_largest_sigma(gamma):
    gain, at = largest_gain(JPARSE, gamma=gamma)
    assert 1 / gamma * (1 - 2e-3) < gain <= 1 / gamma * (1 + 1e-14)
    assert at == pytest.approx(gamma, rel=2e-3)
    three = rates_of(np.diag([3.0, 3 * gamma]), np.array([0.0, 1.0]), JPARSE, gamma=gamma)[1]
    assert three == pytest.approx(1 / (3 * gamma), rel=1e-14)  # in units of σ_1


@pytest.mark.parametrize(("lam", "below"), [(0.02, 0.3), (0.1, 0.3), (0.2, 0.3), (0.25, 0.3), (0.29, 0.3)])
def test_the_largest_filtered_gain_is_where_its_derivative_vanishes_or_at_the_threshold(lam, below):
    gain, at = largest_gain(FILTERED, damping_maximum=lam, damping_below=below)
    # g = σ/(r σ² + λ²) with r = 1 − (λ/ε)² peaks at λ/√r, if that is below ε, else g rises up to ε
    r = 1 - (lam / below) ** 2
    peak = lam / np.sqrt(r)
    want, where = (1 / (2 * lam * np.sqrt(r)), peak) if peak < below else (1 / below, below)
    assert want * (1 - 2e-3) < gain <= want * (1 + 1e-12)
    assert at == pytest.approx(where, rel=3e-3)
    assert gain <= max(1 / below, 1 / lam)  # the plain bound of the theory


def assert_bounded(gains, variant, sigma, parameters):
    p = {**DEFAULTS, **parameters}
    bound = {
        "truncated": 1 / p["cutoff"],
        "jparse": 1 / (p["gamma"] * sigma[0]) if sigma[0] else np.inf,
        "filtered": max(1 / p["damping_below"], 1 / p["damping_maximum"]),
        "damped-constant": 1 / (2 * p["damping_maximum"]),
    }[str(variant)]
    assert gains.max() <= bound * (1 + 1e-12)


@pytest.mark.parametrize("name", ["truncated", "jparse", "filtered", "damped-constant"])
@given(J=matrices, seed=seeds)
def test_gains_are_within_their_bound_for_any_matrix(name, J, seed):
    rng = np.random.default_rng(seed)
    parameters = {
        "cutoff": rng.uniform(1e-3, 1), "gamma": rng.uniform(1e-3, 0.9),
        "damping_maximum": rng.uniform(0.01, 0.2), "damping_below": rng.uniform(0.4, 1),
    }  # fmt: skip
    _, tick = one_world(J, rng.normal(size=len(J)), variant=VARIANT[name], **parameters)
    assert_bounded(tick["gain"], VARIANT[name], tick["sigma"], parameters)


def test_the_check_of_bounds_finds_an_inverse():
    sigma = np.array([1.0, 1e-4])
    for name in ("truncated", "jparse", "filtered", "damped-constant"):
        with pytest.raises(AssertionError):
            assert_bounded(1 / sigma, VARIANT[name], sigma, {})


# Limits -------------------------------------------------------------------------------------------------------


@given(seeds, st.sampled_from(SHAPES))
def test_damped_rates_become_the_pseudoinverse_as_lambda_vanishes(seed, shape):
    # 1/σ − σ/(σ² + λ²) = λ²/(σ (σ² + λ²)) ≤ λ²/σ³: not merely the limit, but how fast
    rng = np.random.default_rng(seed)
    J, t = with_sigma(rng, *shape, rng.uniform(0.5, 2, min(shape))), rng.normal(size=shape[0])
    exact = np.linalg.pinv(J) @ t
    for lam in (1e-1, 1e-2, 1e-3, 1e-8):
        gap = np.linalg.norm(rates_of(J, t, DAMPED, damping_maximum=lam) - exact)
        assert gap <= lam**2 / 0.5**3 * np.linalg.norm(t) + 1e-13 * np.linalg.norm(t)


@given(seeds, st.sampled_from(SHAPES))
def test_damped_rates_become_the_direction_of_the_transpose_as_lambda_grows(seed, shape):
    # λ² g = σ/(1 + (σ/λ)²), short of σ by less than σ (σ/λ)²
    rng = np.random.default_rng(seed)
    J, t = with_sigma(rng, *shape, rng.uniform(0, 2, min(shape))), rng.normal(size=shape[0])
    for lam in (1e1, 1e2, 1e4):
        gap = np.linalg.norm(lam**2 * rates_of(J, t, DAMPED, damping_maximum=lam) - J.T @ t)
        assert gap <= (2 / lam) ** 2 * 2 * np.linalg.norm(t) + 1e-13 * np.linalg.norm(t)


@pytest.mark.parametrize(
    ("variant", "parameters"),
    [
        (JPARSE, {"gamma": 1e-12}),
        (TRUNCATED, {"cutoff": 1e-12}),
        (FILTERED, {"damping_below": 1e-9, "damping_maximum": 1e-9}),
        (SELECTIVE, {"rate_bound": 1e12}),
        (PSEUDOINVERSE, {"tolerance": 1e-13}),
        (Variant(Method.DAMPED, Schedule.SMALLEST_SINGULAR_VALUE), {"damping_below": 1e-9}),
        (Variant(Method.DAMPED, Schedule.MANIPULABILITY), {"manipulability_below": 1e-60}),
        (Variant(Method.DAMPED, Schedule.ERROR), {"error_gain": 1e-12}),
        (Variant(Method.DAMPED, Schedule.RATE_BOUND), {"rate_bound": 1e12}),
    ],
    ids=lambda value: str(value) if isinstance(value, Variant) else "",
)
@given(seed=seeds, shape=st.sampled_from(SHAPES))
def test_every_method_becomes_the_inverse_as_its_parameter_vanishes(variant, parameters, seed, shape):
    rng = np.random.default_rng(seed)
    sigma = 10.0 ** rng.uniform(-3, 0.3, min(shape))
    J, t = with_sigma(rng, *shape, sigma), rng.normal(size=shape[0])
    exact = np.linalg.pinv(J, rcond=1e-13) @ t
    got = rates_of(J, t, variant, **parameters)
    assert_allclose(got, exact, rtol=0, atol=1e-11 * sigma.max() / sigma.min() ** 2 * np.linalg.norm(t))


# Transpose ----------------------------------------------------------------------------------------------------


def assert_best_multiple(J, t, rates):
    """`rates` are a multiple of Jᵀ t, and no other multiple leaves less of t undone."""
    direction = J.T @ t
    alpha = rates @ direction / (direction @ direction)
    size = np.linalg.norm(rates)
    assert_allclose(rates, alpha * direction, rtol=0, atol=1e-12 * max(1e-3, size))
    residual = lambda a: np.linalg.norm(t - a * J @ direction)  # noqa: E731
    for factor in (0, 0.5, 0.9, 0.999, 1.001, 1.1, 2, -1):
        # at 1.001 the residual grows by 5e-7 of what the best multiple does: far above rounding unless t is lost
        assert residual(alpha) <= residual(factor * alpha) + 1e-14 * np.linalg.norm(t)
    best = direction @ direction / np.sum((J @ direction) ** 2)
    assert alpha == pytest.approx(best, rel=1e-9)


@given(seeds, st.sampled_from(SHAPES))
def test_no_other_multiple_of_the_transpose_leaves_less_undone(seed, shape):
    rng = np.random.default_rng(seed)
    J, t = with_sigma(rng, *shape, rng.uniform(0.1, 2, min(shape))), rng.normal(size=shape[0])
    assert_best_multiple(J, t, rates_of(J, t, TRANSPOSE))


def test_the_check_of_the_transpose_finds_other_multiples_and_directions():
    rng = np.random.default_rng(0)
    J, t = rng.normal(size=(3, 4)), rng.normal(size=3)
    sigma = np.linalg.svd(J, compute_uv=False)
    for wrong in (J.T @ t / sigma[0] ** 2, 1.01 * rates_of(J, t, TRANSPOSE), np.linalg.pinv(J) @ t):
        with pytest.raises(AssertionError):
            assert_best_multiple(J, t, wrong)


# Selectively damped -------------------------------------------------------------------------------------------


@given(matrices, seeds, st.floats(0.01, 10), st.sampled_from([1.0, 1e-9, 0.0]))
@example(np.eye(2), 0, 1.0, 0.0)
def test_selectively_damped_joint_rates_never_exceed_their_bound(J, seed, bound, sigma_min):
    rng = np.random.default_rng(seed)
    m, n = J.shape
    u, sigma, vt = np.linalg.svd(J, full_matrices=False)
    J = (u * np.append(sigma[:-1], sigma[-1] * sigma_min)) @ vt
    wx, wq = rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    for size in (1.0, 1e6):
        t = size * rng.normal(size=m)
        rates = one_world(J, t, wx, wq, SELECTIVE, rate_bound=bound)[1]["qdot_cmd"][:n]
        assert np.all(np.abs(np.sqrt(wq) * rates) <= bound * (1 + 1e-12))


@given(seeds, st.sampled_from(SHAPES))
def test_selectively_damped_is_the_pseudoinverse_for_small_commands(seed, shape):
    rng = np.random.default_rng(seed)
    sigma = rng.uniform(0.05, 2, min(shape))
    J, t = with_sigma(rng, *shape, sigma), rng.normal(size=shape[0])
    exact = np.linalg.pinv(J) @ t
    # γ_i/b ≥ σ_i / Σ_j ρ_j ≥ 0.05/(8 · 2): no direction is clamped where b is this many times what it asks for
    bound = np.linalg.norm(t) / 0.05 * 320
    got = rates_of(J, t, SELECTIVE, rate_bound=bound)
    assert_allclose(got, exact, rtol=0, atol=1e-12 * np.linalg.norm(t) / 0.05**2)
    clamped = rates_of(J, t, SELECTIVE, rate_bound=0.1 * np.abs(exact).max())
    assert np.abs(clamped - exact).max() > 0.1 * np.abs(exact).max()  # the bound acts, so the above can fail


def test_selectively_damped_damps_only_the_direction_that_asks_for_too_much():
    # Of two directions one dies; the healthy one keeps its inverse. One λ for all would take from both.
    J, t = np.diag([1.0, 1e-3]), np.array([0.3, 0.3])
    _, tick = one_world(J, t, variant=SELECTIVE, rate_bound=1.0)
    # ρ = (1, 1e-3): for i = 2, γ = b min(1, σ_2/ρ_2) = b, and h = γ σ_2/|c_2|
    assert_allclose(tick["qdot_cmd"][:2], [0.3, 1.0], rtol=1e-14)


# J-PARSE ------------------------------------------------------------------------------------------------------


def published_jparse(J, t, gamma):
    """J-PARSE as its authors write it: q̇ = J_s⁺ J_p J_p⁺ t + J_s⁺ Φ t.

    J_s has σ < γ σ_1 raised to γ σ_1, J_p keeps only σ ≥ γ σ_1, Φ passes σ_i/(γ σ_1) of each fading direction.
    """
    u, sigma, vt = np.linalg.svd(J, full_matrices=False)
    least = gamma * sigma[0]
    dying = sigma < least
    safe = (u * np.maximum(sigma, least)) @ vt
    kept = (u[:, ~dying] * sigma[~dying]) @ vt[~dying]
    push = (u[:, dying] * (sigma[dying] / least)) @ u[:, dying].T
    inverse = np.linalg.pinv(safe)
    return inverse @ kept @ np.linalg.pinv(kept) @ t + inverse @ push @ t


@given(seeds, st.sampled_from(SHAPES), st.floats(0.02, 0.9))
def test_jparse_is_the_construction_of_its_authors(seed, shape, gamma):
    rng = np.random.default_rng(seed)
    sigma = np.sort(10.0 ** rng.uniform(-3, 0.5, min(shape)))[::-1]
    away_from(sigma[1:], gamma * sigma[0])
    J, t = with_sigma(rng, *shape, sigma), rng.normal(size=shape[0])
    want = published_jparse(J, t, gamma)
    # pinv twice of a matrix of condition 1/γ ≤ 50
    assert_allclose(
        resolve_rates(J, t, "jparse", gamma=gamma), want, rtol=0, atol=1e-11 * max(1, np.abs(want).max())
    )


@pytest.mark.parametrize("largest", [0.5, 1.0, 40.0])
def test_jparse_inverts_above_its_threshold_and_fades_below_and_is_continuous_at_it(largest):
    gamma, t = 0.1, np.array([0.0, 1.0])
    at = lambda share: largest * rates_of(np.diag([largest, largest * share]), t, JPARSE, gamma=gamma)[1]  # noqa: E731
    for share in (0.1000001, 0.3, 1.0):
        assert at(share) == pytest.approx(1 / share, rel=1e-14)
    for share in (0.0999999, 0.03, 1e-9):
        assert at(share) == pytest.approx(share / gamma**2, rel=1e-12)
    assert at(0.1 * (1 - 1e-9)) == pytest.approx(at(0.1 * (1 + 1e-9)), rel=3e-9)
    assert at(0.1) == pytest.approx(10.0, rel=1e-12)


# Notebook -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_the_notebook_gives_what_the_law_gives(name):
    variant = VARIANT[name]
    rng = np.random.default_rng(5)
    J, t = with_sigma(rng, 3, 3, [1.5, 0.2, 0.004]), rng.normal(size=3)
    parameters = {
        "tolerance": 0.01, "cutoff": 0.02, "gamma": 0.2, "rate_bound": 0.7, "damping_maximum": 0.05,
        "damping_below": 0.25, "manipulability_below": 0.1, "error_gain": 0.6, "error": 0.3,
    }  # fmt: skip
    long = {short: name for name, short in SHORT.items()}
    keys = {long.get(name, name): value for name, value in parameters.items()}
    got = resolve_rates(J, t, variant.method.name.lower(), schedule=variant.schedule.name.lower(), **keys)
    assert_allclose(
        got, formula(variant, J, t, **parameters)[0], rtol=0, atol=1e-10 * max(1, np.abs(got).max())
    )
    assert_allclose(got, rates_of(J, t, variant, **parameters), rtol=1e-15)
