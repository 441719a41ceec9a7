"""How much each schedule damps, what the damped rates solve, and what the damping bounds."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from worlds import SHAPES, Variant, formula, matrices, one_world, rates_of, seeds, with_sigma

from codes import Method, Schedule
from rmrc.law.bare import resolve_rates

SCHEDULES = [Variant(Method.DAMPED, schedule) for schedule in Schedule]
FILTERED = Variant(Method.FILTERED)
RATE_BOUND = Variant(Method.DAMPED, Schedule.RATE_BOUND)

scheduled = pytest.mark.parametrize("variant", [pytest.param(v, id=str(v)) for v in SCHEDULES])


def damping_of(variant, J, t=None, **parameters):
    """Return λ as the law records it."""
    t = np.ones(len(J)) if t is None else t
    return float(one_world(J, t, variant=variant, **parameters)[1]["damping"])


def assert_normal_equations(J, t, wx, wq, lam, rates):
    """(Jᵀ W_x J + λ² W_q) q̇ = Jᵀ W_x t: where the gradient of (10) vanishes.

    It is the gradient that is looked at and not the distance from a solution, so that nothing has to be inverted,
    and λ may be 0. It vanishes to rounding of its terms.
    """
    gradient = J.T @ (wx * (J @ rates - t)) + lam**2 * wq * rates
    A = np.sqrt(wx)[:, None] * J / np.sqrt(wq)
    s1, y, b = np.linalg.norm(A, 2), np.linalg.norm(np.sqrt(wq) * rates), np.linalg.norm(np.sqrt(wx) * t)
    terms = s1**2 * y + s1 * b + lam**2 * y
    assert np.linalg.norm(gradient / np.sqrt(wq)) <= 1e-13 * terms + 1e-300


@scheduled
@given(J=matrices, seed=seeds)
def test_damped_rates_solve_the_weighted_normal_equations(variant, J, seed):
    rng = np.random.default_rng(seed)
    m, n = J.shape
    t, wx, wq = rng.normal(size=m), rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    _, tick = one_world(J, t, wx, wq, variant)
    lam, rates = tick["damping"], tick["qdot_cmd"][:n]
    assert_normal_equations(J, t, wx, wq, lam, rates)
    # and λ is that of its schedule
    A = np.sqrt(wx)[:, None] * J / np.sqrt(wq)
    y, gain, want = formula(variant, A, np.sqrt(wx) * t)
    sigma = np.linalg.svd(A, compute_uv=False)
    if variant.schedule != Schedule.RATE_BOUND or sigma[-1] > 1e-6 * sigma[0]:
        # λ falls like √(1 − …), which is steepest where λ is 0: compare λ²
        assert lam**2 == pytest.approx(want**2, rel=1e-8, abs=1e-13)
    # Minimum: no rates nearby cost less.
    cost = lambda q: (t - J @ q) @ (wx * (t - J @ q)) + lam**2 * q @ (wq * q)  # noqa: E731
    for other in rates + rng.normal(size=(5, n)):
        assert cost(rates) <= cost(other) * (1 + 1e-12) + 1e-300


def test_the_check_of_the_normal_equations_finds_wrong_damping_and_wrong_weights():
    rng = np.random.default_rng(0)
    J, t, wx, wq = rng.normal(size=(2, 3)), rng.normal(size=2), np.array([0.5, 2]), np.array([1, 3, 0.4])
    solve = lambda lam2, wx, wq: np.linalg.solve(J.T @ (wx[:, None] * J) + lam2 * np.diag(wq), J.T @ (wx * t))  # noqa: E731
    assert_normal_equations(J, t, wx, wq, 0.1, solve(0.01, wx, wq))
    one = np.ones(3)
    for wrong in (
        solve(0.1, wx, wq),
        solve(0.01 * (1 + 1e-8), wx, wq),
        solve(0.01, wx, one),
        solve(0.01, one[:2], wq),
    ):
        with pytest.raises(AssertionError):
            assert_normal_equations(J, t, wx, wq, 0.1, wrong)


@scheduled
@given(J=matrices, seed=seeds)
def test_damped_rates_are_bounded_by_the_twist_over_twice_lambda(variant, J, seed):
    rng = np.random.default_rng(seed)
    m, n = J.shape
    t, wx, wq = rng.normal(size=m), rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    _, tick = one_world(J, t, wx, wq, variant)
    scaled = np.sqrt(wq) * tick["qdot_cmd"][:n]
    bound = np.linalg.norm(np.sqrt(wx) * t)
    assert 2 * tick["damping"] * np.linalg.norm(scaled) <= bound * (1 + 1e-12)


def test_the_bound_is_reached_where_sigma_equals_lambda():
    # g(σ) = σ/(σ² + λ²) has its maximum 1/(2λ) at σ = λ: so the bound above is sharp, and can fail.
    rates = resolve_rates(
        np.diag([1.0, 0.1]), np.array([0.0, 1.0]), "damped", schedule="constant", damping_maximum=0.1
    )
    assert rates[1] == pytest.approx(5.0, rel=1e-14)


# Schedules ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sigma", [0.0, 1e-9, 0.2, 0.3, 5.0])
def test_constant_damping_is_the_same_everywhere(sigma):
    assert damping_of(SCHEDULES[Schedule.CONSTANT], np.diag([1.0, sigma]), damping_maximum=0.07) == 0.07


def test_damping_rises_as_the_smallest_singular_value_falls_below_its_threshold():
    variant, p = SCHEDULES[Schedule.SMALLEST_SINGULAR_VALUE], {"damping_maximum": 0.1, "damping_below": 0.3}
    at = lambda s: damping_of(variant, np.diag([1.0, 2.0, s]), **p)  # noqa: E731
    assert at(0.3) == at(0.31) == at(1.0) == 0.0
    assert at(0.0) == pytest.approx(0.1, rel=1e-15)
    # λ² = λ_max² (1 − (σ/ε)²): at σ = ε/2 three quarters of λ_max². λ itself would give another number.
    assert at(0.15) == pytest.approx(0.1 * np.sqrt(0.75), rel=1e-14)
    assert at(0.3 * (1 - 1e-10)) ** 2 == pytest.approx(0.0, abs=1e-11)  # λ² is continuous at ε


def test_damping_rises_as_the_manipulability_falls_below_its_threshold():
    variant, p = SCHEDULES[Schedule.MANIPULABILITY], {"damping_maximum": 0.1, "manipulability_below": 0.4}
    at = lambda *s: damping_of(variant, np.diag(s), **p)  # noqa: E731
    assert at(2.0, 0.2) == at(2.0, 0.3) == at(1.0, 1.0) == 0.0
    # λ = λ_max (1 − w/w₀)
    assert at(2.0, 0.1) == pytest.approx(0.05, rel=1e-14)
    assert at(4.0, 0.25, 0.1) == pytest.approx(0.075, rel=1e-13)
    assert at(1.0, 1.0, 0.0) == pytest.approx(0.1, rel=1e-15)
    assert at(2.0, 0.2 * (1 - 1e-10)) == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("error", [0.0, 1e-6, 0.3, 20.0])
def test_damping_by_the_error_is_proportional_to_it(error):
    variant = SCHEDULES[Schedule.ERROR]
    lam = damping_of(variant, np.diag([1.0, 0.1]), error=error, error_gain=0.7)
    assert lam == pytest.approx(0.7 * error, rel=1e-15)
    rates = rates_of(np.diag([1.0, 0.1]), np.ones(2), variant, error=error, error_gain=0.7)
    assert_allclose(rates, [1 / (1 + lam**2), 0.1 / (0.01 + lam**2)], rtol=1e-14)


@given(seeds, st.sampled_from(SHAPES), st.floats(0.02, 20))
def test_rate_bound_damps_no_more_than_it_takes(seed, shape, bound):
    rng = np.random.default_rng(seed)
    m, n = shape
    sigma = np.sort(10.0 ** rng.uniform(-4, 0.5, min(shape)))[::-1]
    J, t = with_sigma(rng, m, n, sigma), rng.normal(size=m)
    wx, wq = rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    _, tick = one_world(J, t, wx, wq, RATE_BOUND, rate_bound=bound)
    lam, size = tick["damping"], np.linalg.norm(np.sqrt(wq) * tick["qdot_cmd"][:n])
    A = np.sqrt(wx)[:, None] * J / np.sqrt(wq)
    u, s, _ = np.linalg.svd(A, full_matrices=False)
    c = u.T @ (np.sqrt(wx) * t)
    norm = lambda mu: np.linalg.norm(s * c / (s**2 + mu))  # noqa: E731
    assert_least_damping(lam, size, norm, bound)
    assert lam == pytest.approx(formula(RATE_BOUND, A, np.sqrt(wx) * t, rate_bound=bound)[2], rel=1e-9)


def assert_least_damping(lam, size, norm, bound):
    """The rates are within the bound, at it where anything is damped, and any smaller λ would exceed it."""
    assert size <= bound * (1 + 1e-10)
    if norm(0.0) <= bound * (1 - 1e-10):
        assert lam == 0.0
    elif norm(0.0) > bound * (1 + 1e-10):
        assert lam > 0.0
        assert size == pytest.approx(bound, rel=1e-10)
        # φ falls strictly with μ, so one look suffices; of a share 1e-7 of μ the norm feels up to as much
        for share in (0.0, 0.5, 0.99, 1 - 1e-6):
            assert norm(share * lam**2) > norm(lam**2)
        assert norm(0.999 * lam**2) > bound or norm(0.0) < bound * 1.001


def test_the_check_of_the_least_damping_finds_too_much_and_too_little():
    norm = lambda mu: 1.0 / (0.1 + mu / 0.1)  # noqa: E731  # one direction: σ = 0.1, c = 1
    bound = 2.0
    right = np.sqrt(0.1 * (0.5 - 0.1))
    assert_least_damping(right, norm(right**2), norm, bound)
    for wrong in (right * 1.001, right * 0.999, 0.0):
        with pytest.raises(AssertionError):
            assert_least_damping(wrong, norm(wrong**2), norm, bound)
    with pytest.raises(AssertionError):  # damping where none is needed
        assert_least_damping(0.01, norm(0.01**2), norm, 20.0)


@pytest.mark.parametrize("sigma", [1e-2, 1e-5, 1e-8, 1e-12])
def test_rate_bound_of_one_dying_direction_is_solved_exactly(sigma):
    # σ c/(σ² + μ) = b: μ = σ c/b − σ²
    J, t, b = np.diag([1.0, sigma]), np.array([0.0, 1.0]), 2.0
    _, tick = one_world(J, t, variant=RATE_BOUND, rate_bound=b)
    assert tick["damping"] == pytest.approx(np.sqrt(sigma / b - sigma**2), rel=1e-12)
    assert_allclose(tick["qdot_cmd"][:2], [0.0, b], rtol=1e-12, atol=1e-12)


# Filtered -----------------------------------------------------------------------------------------------------


@given(seeds, st.sampled_from(SHAPES))
def test_filtered_damps_each_direction_by_its_own_sigma(seed, shape):
    rng = np.random.default_rng(seed)
    k = min(shape)
    sigma = np.sort(rng.uniform(0.01, 1.0, k))[::-1]
    assume(k == 1 or np.min(-np.diff(sigma)) > 1e-3)
    J, t = with_sigma(rng, *shape, sigma), rng.normal(size=shape[0])
    _, tick = one_world(J, t, variant=FILTERED, damping_maximum=0.1, damping_below=0.3)
    lam2 = np.where(sigma < 0.3, 0.01 * (1 - (sigma / 0.3) ** 2), 0.0)
    assert_allclose(tick["gain"][:k], sigma / (sigma**2 + lam2), rtol=1e-11)
    assert tick["damping"] == pytest.approx(np.sqrt(lam2[-1]), rel=1e-9)  # that of the smallest direction


def first_gain_jump(gain):
    """Return how much the gain of the first dying direction jumps as a second σ crosses ε = 0.3."""
    return abs(gain(np.array([1.0, 0.3 - 1e-9, 0.05])) - gain(np.array([1.0, 0.3 + 1e-9, 0.05])))


def test_a_second_sigma_that_crosses_the_threshold_changes_nothing_of_the_first():
    def of_law(sigma, variant=FILTERED, index=2):
        _, tick = one_world(np.diag(sigma), np.ones(3), variant=variant)
        return tick["gain"][index]

    assert first_gain_jump(of_law) == 0.0
    # nor does its own gain jump
    assert first_gain_jump(lambda sigma: of_law(sigma, index=1)) < 1e-6


def test_the_check_finds_the_filter_that_damps_all_small_sigma_by_the_smallest():
    # The usual slip: λ of σ_min for every σ below ε. The second σ loses λ²/σ² of itself at once.
    def naive(sigma, index):
        lam2 = 0.01 * (1 - (sigma[-1] / 0.3) ** 2)
        return (sigma / (sigma**2 + np.where(sigma < 0.3, lam2, 0.0)))[index]

    assert first_gain_jump(lambda sigma: naive(sigma, 1)) > 0.1
    # And λ by the product of the distances below ε, which is 0 or not by the second σ, moves the first as well.
    product = lambda sigma: sigma[2] / (sigma[2] ** 2 + 0.01 * (2 if sigma[1] < 0.3 else 1))  # noqa: E731
    assert first_gain_jump(product) > 0.1


def test_filtered_is_the_inverse_where_no_sigma_is_below_the_threshold():
    rng = np.random.default_rng(3)
    J, t = with_sigma(rng, 3, 3, [2.0, 1.0, 0.31]), rng.normal(size=3)
    assert_allclose(rates_of(J, t, FILTERED), np.linalg.solve(J, t), rtol=1e-12)
    assert damping_of(FILTERED, J, t) == 0.0
