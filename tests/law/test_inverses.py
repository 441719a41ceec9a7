"""Each inverse is what its definition says: the oracle's matrix, Penrose conditions, minima, bounds, closed forms."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from worlds import (
    NAMES,
    SHAPES,
    SHORT,
    VARIANT,
    along,
    fits,
    formula,
    matrices,
    named,
    one_world,
    rates_of,
    seeds,
    with_sigma,
)

from codes import Method
from oracle_inverse import ROUNDING, jparse_inverse
from rmrc.law.jacobian_law import resolve_rates

JPARSE, SELECTIVE = VARIANT["jparse"], VARIANT["selectively_damped"]
PSEUDOINVERSE = VARIANT["pseudoinverse"]


def drawn(variant, shape, seed):
    """Return a matrix from well conditioned, through all thresholds, to nearly singular, and a twist."""
    assume(fits(variant, shape))
    rng = np.random.default_rng(seed)
    sigma = np.sort(10.0 ** rng.uniform(-3, 0.5, min(shape)))[::-1]
    return with_sigma(rng, *shape, sigma), rng.normal(size=shape[0]), rng


@named
@given(shape=st.sampled_from(SHAPES), seed=seeds)
def test_rates_gains_and_damping_are_those_of_the_oracle(variant, shape, seed):
    J, t, _ = drawn(variant, shape, seed)
    _, tick = one_world(J, t, variant=variant)
    y, gain, lam = formula(variant, J, t)
    # normal equations of a condition of up to 1e6
    assert_allclose(tick["gain"][: len(gain)], gain, rtol=1e-9, atol=1e-9 * gain.max())
    assert tick["damping"] == pytest.approx(lam, rel=1e-9, abs=1e-9)
    largest = max(1.0, np.abs(gain).max()) * np.linalg.norm(t)
    assert_allclose(tick["qdot_cmd"][: shape[1]], y, rtol=0, atol=1e-9 * largest)


@named
@given(shape=st.sampled_from(SHAPES), seed=seeds)
def test_weights_are_other_units_and_plain_rates_those_of_the_inverse_in_them(variant, shape, seed):
    J, t, rng = drawn(variant, shape, seed)
    row, joint = rng.uniform(0.3, 3, shape[0]), rng.uniform(0.3, 3, shape[1])
    _, tick = one_world(J, t, row**2, joint**-2, variant)
    # rates(J, t; S_x, S_q) = S_q rates(S_x J S_q, S_x t; 1, 1): the same numbers, but for rounding times κ
    A, t = row[:, None] * J * joint, row * t
    scaled = rates_of(A, t, variant)
    assert_allclose(tick["qdot_cmd"][: shape[1]], joint * scaled, rtol=0, atol=1e-10 * np.abs(scaled).max())
    P = np.linalg.pinv(A, rcond=ROUNDING)
    largest = np.linalg.norm(P) * np.linalg.norm(t)
    assert_allclose(tick["qdot_plain"][: shape[1]], joint * (P @ t), rtol=0, atol=1e-9 * largest)


@named
def test_what_is_zero_to_rounding_is_left_out_of_plain_rates(variant):
    for vanishing in (0.0, 1e-16):
        _, tick = one_world(np.diag([2.0, vanishing]), np.array([1.0, 1.0]), variant=variant)
        assert_allclose(tick["qdot_plain"][:2], [0.5, 0.0], rtol=0, atol=1e-15)
    _, tick = one_world(np.diag([2.0, 1e-9]), np.array([1.0, 1.0]), variant=variant)
    assert_allclose(tick["qdot_plain"][:2], [0.5, 1e9], rtol=1e-12)
    assert (np.abs(tick["qdot_cmd"]).max() > 1e8) == (variant.method == Method.INVERSE)  # all others save it


# Definitions --------------------------------------------------------------------------------------------------


def assert_penrose(J, P):
    # P is wrong by rounding, some 1e-15, times its own size and the condition number, which is ‖J‖ ‖P‖.
    size = max(1.0, np.linalg.norm(J)) * max(1.0, np.linalg.norm(P))
    assert_allclose(J @ P @ J, J, rtol=0, atol=1e-13 * size * np.linalg.norm(J))
    assert_allclose(P @ J @ P, P, rtol=0, atol=1e-13 * size * np.linalg.norm(P))
    assert_allclose(J @ P, (J @ P).T, rtol=0, atol=1e-13 * size)
    assert_allclose(P @ J, (P @ J).T, rtol=0, atol=1e-13 * size)


@given(matrices)
def test_pseudoinverse_satisfies_the_penrose_conditions_and_a_damped_inverse_does_not(J):
    sigma = np.linalg.svd(J, compute_uv=False)
    # σ under the tolerance, 1e-6 of the largest, are dropped: no pseudoinverse of J unless they are 0.
    assume(sigma[0] > 0 and not np.any((sigma > 1e-15 * sigma[0]) & (sigma < 1e-4 * sigma[0])))
    matrix = lambda variant: np.column_stack([rates_of(J, t, variant) for t in np.eye(len(J))])  # noqa: E731
    assert_penrose(J, matrix(PSEUDOINVERSE))
    with pytest.raises(AssertionError):
        assert_penrose(J, matrix(VARIANT["damped-constant"]))


def test_selectively_damped_damps_only_the_direction_that_asks_for_too_much():
    # Of two directions one dies; the healthy one keeps its inverse. One λ for all would take from both.
    _, tick = one_world(np.diag([1.0, 1e-3]), np.array([0.3, 0.3]), variant=SELECTIVE, rate_bound=1.0)
    # ρ = (1, 1e-3): for i = 2, γ = b min(1, σ_2/ρ_2) = b, and h = γ σ_2/|c_2|
    assert_allclose(tick["qdot_cmd"][:2], [0.3, 1.0], rtol=1e-14)


@given(seeds)
def test_jparse_weighs_what_is_asked_of_fading_directions_as_published(seed):
    """J_s⁺ J_p J_p⁺ t + J_s⁺ Φ K t [Guptasarma25]: what K = 1 adds is replaced by what K adds."""
    rng, gamma = np.random.default_rng(seed), 0.25
    A = with_sigma(rng, 6, int(rng.integers(6, 9)), np.array([2.0, 1.3, 0.9, 0.6, 0.3, 0.02]))
    t, (position, rotation) = rng.normal(size=6), rng.uniform(0, 3, 2)
    u, sigma, vt = np.linalg.svd(A, full_matrices=False)
    least = gamma * sigma[0]
    fading, K = sigma < least, np.diag([position] * 3 + [rotation] * 3)
    push = (u[:, fading] * (sigma[fading] / least)) @ u[:, fading].T @ (K - np.eye(6)) @ t
    want = jparse_inverse(A, gamma) @ t + np.linalg.pinv((u * np.maximum(sigma, least)) @ vt) @ push
    rates = rates_of(A, t, JPARSE, gamma=gamma, push_position=position, push_rotation=rotation)
    # gains of up to 1/(γ σ₁) of two decompositions
    assert_allclose(rates, want, rtol=0, atol=1e-12)
    # gains of 1, the defaults, are the method without them, to the bit; what does not fade stays
    plain = rates_of(A, t, JPARSE, gamma=gamma)
    assert np.abs(rates - plain).max() > 1e-6
    assert_array_equal(rates_of(A, t, JPARSE, gamma=gamma, push_position=1.0, push_rotation=1.0), plain)
    assert_allclose(vt[:4] @ rates, vt[:4] @ plain, rtol=0, atol=1e-12)


# Bounds -------------------------------------------------------------------------------------------------------

R = 1 - (0.1 / 0.3) ** 2


@pytest.mark.parametrize(
    ("name", "parameters", "largest", "where"),
    [
        ("damped-constant", {"damping_maximum": 0.1}, 5.0, 0.1),  # 1/(2λ) at σ = λ
        ("truncated", {"cutoff": 0.05}, 20.0, 0.05),
        ("jparse", {"gamma": 0.1}, 10.0, 0.1),  # 1/(γ σ_1)
        # σ/(r σ² + λ²) with r = 1 − (λ/ε)² peaks at λ/√r, if that is below ε; else g rises up to ε
        ("filtered", {"damping_maximum": 0.1, "damping_below": 0.3}, 5 / np.sqrt(R), 0.1 / np.sqrt(R)),
        ("filtered", {"damping_maximum": 0.29, "damping_below": 0.3}, 1 / 0.3, 0.3),
    ],
)
def test_the_largest_gain_is_that_of_the_theory_and_where_it_says(name, parameters, largest, where):
    grid, variant = np.geomspace(1e-3, 1, 4001), VARIANT[name]
    J = np.array([np.diag([1.0, s]) for s in grid])
    gains = along(J, [0.0, 1.0], method=variant.method, schedule=variant.schedule, **parameters)[:, 1]
    # steps of 0.17 %
    assert largest * (1 - 2e-3) < gains.max() <= largest * (1 + 1e-12)
    assert grid[gains.argmax()] == pytest.approx(where, rel=3e-3)


# Schedules ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("schedule", "parameters", "sigma", "wanted"),
    [
        ("constant", {"damping_maximum": 0.07}, (1.0, 5.0), 0.07),
        ("constant", {"damping_maximum": 0.07}, (1.0, 0.0), 0.07),
        # λ² = λ_max² (1 − (σ/ε)²): at σ = ε/2 three quarters of λ_max²
        ("smallest_singular_value", {"damping_below": 0.3}, (1.0, 0.3), 0.0),
        ("smallest_singular_value", {"damping_below": 0.3}, (1.0, 2.0, 0.15), 0.1 * np.sqrt(0.75)),
        ("smallest_singular_value", {"damping_below": 0.3}, (1.0, 0.0), 0.1),
        # λ = λ_max (1 − w/w₀)
        ("manipulability", {"manipulability_below": 0.4}, (2.0, 0.2), 0.0),
        ("manipulability", {"manipulability_below": 0.4}, (2.0, 0.1), 0.05),
        ("manipulability", {"manipulability_below": 0.4}, (4.0, 0.25, 0.1), 0.075),
        ("error", {"error": 0.3, "error_gain": 0.7}, (1.0, 0.1), 0.21),
        ("error", {"error": 0.0, "error_gain": 0.7}, (1.0, 0.1), 0.0),
    ],
)
def test_a_schedule_damps_as_its_formula_says(schedule, parameters, sigma, wanted):
    variant, most = VARIANT[f"damped-{schedule}"], {"damping_maximum": 0.1} | parameters
    _, tick = one_world(np.diag(sigma), np.ones(len(sigma)), variant=variant, **most)
    assert tick["damping"] == pytest.approx(wanted, rel=1e-13, abs=1e-15)


@pytest.mark.parametrize("sigma", [1e-2, 1e-5, 1e-8, 1e-12])
def test_rate_bound_of_one_dying_direction_is_solved_exactly(sigma):
    # σ c/(σ² + μ) = b: μ = σ c/b − σ²
    J, t, b = np.diag([1.0, sigma]), np.array([0.0, 1.0]), 2.0
    _, tick = one_world(J, t, variant=VARIANT["damped-rate_bound"], rate_bound=b)
    assert tick["damping"] == pytest.approx(np.sqrt(sigma / b - sigma**2), rel=1e-12)
    assert_allclose(tick["qdot_cmd"][:2], [0.0, b], rtol=1e-12, atol=1e-12)


# Notebook -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_the_notebook_gives_what_the_law_gives(name):
    variant, rng = VARIANT[name], np.random.default_rng(5)
    J, t = with_sigma(rng, 3, 3, [1.5, 0.2, 0.004]), rng.normal(size=3)
    parameters = {
        "tolerance": 0.01, "cutoff": 0.3, "gamma": 0.2, "rate_bound": 0.7, "damping_maximum": 0.05,
        "damping_below": 0.25, "manipulability_below": 0.1, "error_gain": 0.6, "error": 0.3,
    }  # fmt: skip
    long = {short: name for name, short in SHORT.items()}
    keys = {long.get(name, name): value for name, value in parameters.items()}
    got = resolve_rates(J, t, variant.method.name.lower(), schedule=variant.schedule.name.lower(), **keys)
    assert_allclose(got, rates_of(J, t, variant, **parameters), rtol=1e-15)
    # other numbers than the defaults' give other rates
    assert variant.method in (Method.INVERSE, Method.TRANSPOSE) or np.any(got != rates_of(J, t, variant))
