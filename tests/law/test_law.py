"""The law as a whole: measures, status bits, limits, numbers at the edge of the range, and what it refuses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from worlds import (
    NAMES,
    SHAPES,
    VARIANT,
    VARIANTS,
    Variant,
    fits,
    formula,
    matrices,
    one_world,
    rates_of,
    seeds,
    with_sigma,
)

from codes import Method, Objective, OnExcess, Schedule
from project import mostly_long
from rmrc.law.bare import resolve_rates
from rmrc.scenario.choices import Status
from wording import says

named = pytest.mark.parametrize("variant", [pytest.param(variant, id=str(variant)) for variant in VARIANTS])

DAMPED, INVERSE = Variant(Method.DAMPED), Variant(Method.INVERSE)
WRITTEN = ("qdot_cmd", "sigma", "gain", "damping", "manipulability", "condition", "u_min", "v_min")


def status_of(tick):
    return Status(int(tick["status"]))


# Numbers at the edge ------------------------------------------------------------------------------------------


def assert_numbers(tick, case=None):
    for column in WRITTEN:
        assert not np.any(np.isnan(tick[column])), (case, column, tick[column])


@named
@pytest.mark.parametrize("scale", mostly_long([1e-300, 1e-90, 0.0, 1e-12, 1.0, 1e12, 1e300, 1e90, 1e150], 2))
def test_no_method_is_ever_not_a_number(variant, scale):
    for J in (np.ones((3, 3)), np.eye(3), np.diag([1.0, 1e-200, 0.0]), np.zeros((3, 3))):
        for t in (np.ones(3), np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([1.0, -1.0, 0.0])):
            _, tick = one_world(J * scale, t, variant=variant)
            assert_numbers(tick)
            # a twist of order 1 over a σ of 1e-300 is a large number and no more
            assert np.all(np.isfinite(tick["qdot_cmd"])) and np.all(np.isfinite(tick["gain"]))


def extreme(seed, powers):
    """Return J of any shape, whose entries are zero or of these powers of ten, and a twist."""
    # By a generator of numpy and not of hypothesis: to shrink matrices takes it minutes.
    rng = np.random.default_rng(seed)
    m, n = SHAPES[seed % len(SHAPES)]
    some = rng.choice(powers, size=rng.integers(1, 4))
    J = rng.choice([-1.0, 0.0, 1.0], (m, n)) * rng.choice([1.0, rng.uniform(1, 9)], (m, n))
    J *= 10.0 ** rng.choice(some, (m, n))
    return J, rng.choice([0.0, 1.0, -3.0, 1e-9, 1e6], m)


POWERS = (-300, -170, -90, -8, 0, 8, 90, 150)


BOUNDED = {
    "damped-constant",
    "damped-error",
    "filtered",
    "truncated",
    "selectively_damped",
    "damped-rate_bound",
}


@named
def test_entries_of_any_size_give_numbers(variant):
    for seed in range(70):
        J, twist = extreme(seed, POWERS)
        if not fits(variant, J.shape):
            continue
        _, tick = one_world(J, twist, variant=variant)
        assert_numbers(tick, seed)
        rates = tick["qdot_cmd"]
        if (
            str(variant) in BOUNDED
        ):  # largest of their gains: 1/cutoff = 100, times the twist; or the rate bound
            most = max(100 * np.linalg.norm(twist), 2.0 * np.sqrt(J.shape[1]))
            assert np.linalg.norm(rates) <= most * (1 + 1e-9), seed
        if not twist.any():
            assert not rates.any(), seed


@pytest.mark.parametrize("objective", list(Objective), ids=lambda objective: objective.name.lower())
def test_objectives_give_numbers_for_entries_of_any_size(objective):
    # The slope of w is a product of seven σ: beyond 1e40 it is out of range.
    powers = [power for power in POWERS if power < 40] if objective == Objective.MANIPULABILITY else POWERS
    for seed in range(70):
        J, twist = extreme(seed, powers)
        n = J.shape[1]
        rng = np.random.default_rng(seed)
        _, tick = one_world(
            J, twist, variant=DAMPED, objective=objective, nullspace_gain=1.0, posture=rng.normal(size=n),
            nullspace_rates=rng.normal(size=n), position_range=np.array([-np.ones(n), np.ones(n)]), m_2=1, row_scale_2=[1.0],
            moves_2=np.ones(n, int), J_2=rng.normal(size=(1, n)), pose_2=[0, 0, 0, 1, 0, 0, 0],
            pose_ref_2=[1, 0, 0, 1, 0, 0, 0], feedback_2=1.0, nullspace_secondary_damping=0.1,
        )  # fmt: skip
        assert_numbers(tick, seed)


def test_a_command_into_the_lost_direction_alone_is_not_followed_at_the_singularity():
    # The best multiple of Jᵀ t is unknown where Jᵀ t = 0; it is none. Just beside it, it is as large as 1/σ.
    lost = np.array([0.0, 1.0])
    for variant in VARIANTS:
        assert_allclose(rates_of(np.diag([1.0, 0.0]), lost, variant), 0.0)
        assert_allclose(rates_of(np.zeros((2, 2)), lost, variant), 0.0)
    assert_allclose(rates_of(np.diag([1.0, 1e-6]), lost, Variant(Method.TRANSPOSE)), [0.0, 1e6], rtol=1e-12)


@pytest.mark.parametrize("factor", [0.5, 2.0])
@named
def test_a_sigma_that_is_rounding_gets_no_gain(variant, factor):
    # σ_2 on either side of 1e-14 σ_1, exact in a diagonal matrix; by their own thresholds some drop both.
    parameters = {"tolerance": 1e-16, "cutoff": 1e-16, "rate_bound": 1e30}
    _, tick = one_world(np.diag([4.0, factor * 4e-14]), np.ones(2), variant=variant, **parameters)
    assert tick["gain"][0] > 0
    assert (tick["gain"][1] > 0) == (factor > 1)


# Measures -----------------------------------------------------------------------------------------------------


@given(matrices, seeds)
def test_recorded_measures_are_those_of_the_weighted_jacobian(J, seed):
    rng = np.random.default_rng(seed)
    m, n = J.shape
    wx, wq = rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    A = np.sqrt(wx)[:, None] * J / np.sqrt(wq)
    sigma = np.linalg.svd(A, compute_uv=False)
    _, tick = one_world(J, rng.normal(size=m), wx, wq, DAMPED)
    k = len(sigma)
    assert_allclose(tick["sigma"][:k], sigma, rtol=0, atol=1e-12 * max(1, sigma[0]))
    assert tick["manipulability"] == pytest.approx(np.prod(sigma), abs=1e-9 * max(1, sigma[0]) ** k)
    if sigma[-1] > 1e-6:
        u, v = tick["u_min"][:m], tick["v_min"][:n]
        assert tick["condition"] == pytest.approx(sigma[0] / sigma[-1], rel=1e-6)
        assert np.linalg.norm(u) == pytest.approx(1) and np.linalg.norm(v) == pytest.approx(1)
        assert_allclose(A.T @ u, sigma[-1] * v, rtol=0, atol=1e-11 * sigma[0])


# Status -------------------------------------------------------------------------------------------------------


def test_exact_rank_loss_is_a_status_and_not_an_error():
    for variant in VARIANTS:
        for J in (np.ones((2, 2)), np.zeros((2, 2))):
            _, tick = one_world(J, np.ones(2), variant=variant)
            assert status_of(tick) & Status.SINGULAR


@pytest.mark.parametrize(
    ("largest", "smallest", "status"),
    [
        (2.0, 0.0202, Status.OK),
        (2.0, 0.0198, Status.SINGULAR),
        (100.0, 1.0, Status.SINGULAR),
        (1.0, 1.0, Status.OK),
    ],
)
def test_a_condition_of_a_hundred_is_called_singular(largest, smallest, status):
    _, tick = one_world(np.diag([largest, smallest]), np.ones(2), variant=INVERSE)
    assert status_of(tick) == status


@named
def test_damped_says_that_some_direction_gets_less_than_it_asks_for(variant):
    seen = set()
    for seed in range(70):
        rng = np.random.default_rng(seed)
        shape = SHAPES[seed % len(SHAPES)]
        if not fits(variant, shape):
            continue
        sigma = 10.0 ** rng.uniform(-2.5, 0.5, min(shape)) * rng.choice([1.0, 1.0, 1.0, 0.0], min(shape))
        J, t = with_sigma(rng, *shape, sigma), rng.normal(size=shape[0])
        _, tick = one_world(J, t, variant=variant)
        _, gain, lam = formula(variant, J, t)
        sigma = np.linalg.svd(J, compute_uv=False)
        share = (sigma * gain)[sigma > 1e-14 * sigma[0]]
        if lam > 1e-9 or np.any(share < 1 - 1e-9):
            assert status_of(tick) & Status.DAMPED, (seed, lam, share)
            seen.add(True)
        elif lam == 0 and np.all(share > 1 - 1e-13):  # rounding of σ · (1/σ) is no damping
            assert not status_of(tick) & Status.DAMPED, (seed, share)
            seen.add(False)
    # Both were seen, but of methods that always damp, and of those that never do.
    always = {Variant(Method.DAMPED), Variant(Method.DAMPED, Schedule.ERROR)}
    never = {INVERSE, Variant(Method.PSEUDOINVERSE)}
    assert seen == ({True} if variant in always else {False} if variant in never else {True, False})


def test_an_inverse_is_never_called_damped_by_rounding():
    # σ · (1/σ) is below 1 for every seventh number or so, first for 49.
    for sigma in range(1, 500):
        _, tick = one_world(np.diag([float(sigma), sigma / 2]), np.ones(2), variant=INVERSE)
        assert status_of(tick) == Status.OK, sigma


@pytest.mark.parametrize(
    ("name", "parameters", "sigma", "damped"),
    [
        ("pseudoinverse", {"tolerance": 0.1}, 0.11, False),
        ("pseudoinverse", {"tolerance": 0.1}, 0.09, True),
        ("truncated", {"cutoff": 0.1}, 0.11, False),
        ("truncated", {"cutoff": 0.1}, 0.09, True),
        ("jparse", {"gamma": 0.1}, 0.11, False),
        ("jparse", {"gamma": 0.1}, 0.09, True),
        ("filtered", {"damping_below": 0.1}, 0.11, False),
        ("filtered", {"damping_below": 0.1}, 0.09, True),
        ("selectively_damped", {"rate_bound": 10.0}, 0.11, False),
        ("selectively_damped", {"rate_bound": 10.0}, 0.09, True),
        ("damped-smallest_singular_value", {"damping_below": 0.1}, 0.11, False),
        ("damped-smallest_singular_value", {"damping_below": 0.1}, 0.09, True),
        ("damped-manipulability", {"manipulability_below": 0.1}, 0.11, False),
        ("damped-manipulability", {"manipulability_below": 0.1}, 0.09, True),
        ("damped-rate_bound", {"rate_bound": 10.0}, 0.11, False),
        ("damped-rate_bound", {"rate_bound": 10.0}, 0.09, True),
        ("damped-error", {"error": 0.0}, 0.11, False),
        ("damped-error", {"error": 1e-3}, 0.11, True),
        ("damped-constant", {"damping_maximum": 1e-9}, 0.11, True),
        ("transpose", {}, 1.0, False),
        ("transpose", {}, 0.99, True),
        ("inverse", {}, 0.09, False),
        # A direction that is lost gets nothing and asks for nothing that anything could give: SINGULAR says so.
        ("pseudoinverse", {}, 0.0, False),
        ("jparse", {}, 0.0, False),
    ],
)
def test_damped_begins_where_each_method_begins_to_damp(name, parameters, sigma, damped):
    _, tick = one_world(np.diag([1.0, sigma]), np.ones(2), variant=VARIANT[name], **parameters)
    assert bool(status_of(tick) & Status.DAMPED) == damped


# Limits -------------------------------------------------------------------------------------------------------

UNLIMITED = {"period": 0.001, "acceleration_limit": np.full(8, np.inf), "braking": np.full(8, np.inf)}


@given(seeds, st.sampled_from([OnExcess.SCALE, OnExcess.CLAMP]))
def test_limited_rates_are_within_their_limits_and_say_so(seed, on_excess):
    rng = np.random.default_rng(seed)
    J, twist = rng.normal(size=(3, 3)), rng.normal(size=3)
    limit = rng.uniform(0.1, 10, 3)
    free = rates_of(J, twist, DAMPED)
    _, tick = one_world(J, twist, variant=DAMPED, **UNLIMITED, rate_limit=limit, on_excess=on_excess)
    rates = tick["qdot_cmd"][:3]
    exceeds = bool(np.any(np.abs(free) > limit))
    assert np.all(np.abs(rates) <= limit * (1 + 1e-15))
    assert bool(tick["status"] & Status.RATE_LIMITED) == exceeds
    if on_excess == OnExcess.SCALE:  # the direction of motion is kept
        assert_allclose(np.outer(rates, free), np.outer(free, rates), rtol=0, atol=1e-12 * free @ free)
    else:
        assert_allclose(rates, np.clip(free, -limit, limit), rtol=1e-15)


# Notebook -----------------------------------------------------------------------------------------------------

METHODS = ", ".join(method.name.lower() for method in Method)
SCHEDULES = ", ".join(schedule.name.lower() for schedule in Schedule)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.ones((7, 2)), np.ones(7)), "J … (m, n) … 6 … twist (m,) … (7, 2), (7,)"),
        ((np.ones((2, 3)), np.ones(3)), "J … (m, n) … 6 … twist (m,) … (2, 3), (3,)"),
        ((np.ones((2, 3)), np.ones(2), "inverse"), "method 'inverse' needs a square J, got (2, 3)"),
        ((np.eye(2), np.ones(2), "dampd"), f'method … {METHODS} … "dampd" … "damped"…'),
        ((np.eye(2), np.array([np.nan, 1.0])), "J and twist must be finite"),
    ],
)
def test_resolve_rates_refuses_what_it_cannot_resolve(arguments, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        resolve_rates(*arguments)
    assert str(caught.value) == says(message)


def test_resolve_rates_refuses_a_schedule_that_there_is_not():
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        resolve_rates(np.eye(2), np.ones(2), schedule="constnt")
    assert str(caught.value) == says(f'schedule … {SCHEDULES} … "constnt" … "constant"…')


def test_every_variant_runs_in_these_tests():
    assert {variant.method for variant in VARIANTS} == set(Method)
    assert {variant.schedule for variant in VARIANTS if variant.method == Method.DAMPED} == set(Schedule)
    assert len(NAMES) == len(set(NAMES))
