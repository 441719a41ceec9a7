"""Each inverse is what its definition says: normal equations, Penrose conditions, bounds, minimum property."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from oracles import damping, projector, resolve
from rmrc.control.law import resolve as compiled_resolve
from rmrc.control.law import resolve_rates
from rmrc.control.records import Method, Objective, OnExcess, Schedule, Status, tick_type, world_type

matrices = arrays(
    np.float64, st.tuples(st.integers(1, 6), st.integers(1, 8)), elements=st.floats(-2, 2, width=16)
)
seeds = st.integers(0, 2**32 - 1)


def one_world(J, twist, wx, wq, **parameters):
    """Return the record of a world whose task is all rows of J, and its tick after one call of the law."""
    m, n = J.shape
    world, tick = np.zeros(1, world_type(n)), np.zeros(1, tick_type(n))
    world["n"], world["m"], world["k"] = n, m, min(m, n)
    world["row"], world["tolerance"] = np.arange(6), 1e-6
    world["row_scale"][0, :m], world["joint_scale"][0, :n] = np.sqrt(wx), 1 / np.sqrt(wq)
    world["J"][0, :m, :n], world["twist_cmd"][0, :m] = J, twist
    for name, value in parameters.items():
        if np.ndim(value):
            world[name][0, : len(value)] = value
        else:
            world[name] = value
    compiled_resolve(world[0], tick[0])
    return world[0], tick[0]


def draw(J, seed):
    """Return a twist and positive weights for J, and how well conditioned the weighted J is."""
    rng = np.random.default_rng(seed)
    m, n = J.shape
    wx, wq = rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    sigma = np.linalg.svd(np.sqrt(wx)[:, None] * J / np.sqrt(wq), compute_uv=False)
    return rng.normal(size=m), wx, wq, sigma


@given(matrices, seeds, st.sampled_from(["constant", "smallest_singular_value"]))
def test_damped_rates_solve_the_weighted_normal_equations(J, seed, schedule):
    # min ‖v − J qdot‖²_Wx + λ² ‖qdot‖²_Wq; the oracle solves them, so its error grows with 1/λ² = 100: 1e-12
    twist, wx, wq, sigma = draw(J, seed)
    lam = damping(schedule, 0.1, 0.3, sigma[-1])
    assume(lam == 0.1 or (schedule != "constant" and lam > 0.01))
    _, tick = one_world(
        J, twist, wx, wq, method=Method.DAMPED, schedule=Schedule[schedule.upper()],
        damping_maximum=0.1, damping_below=0.3,
    )  # fmt: skip
    assert tick["damping"] == pytest.approx(lam, rel=1e-9)
    want = resolve(J, twist, wx, wq, "damped", lam=lam)
    assert_allclose(tick["qdot_cmd"][: J.shape[1]], want, rtol=0, atol=1e-9 * max(1, np.abs(want).max()))


@given(matrices)
def test_pseudoinverse_satisfies_the_penrose_conditions(J):
    sigma = np.linalg.svd(J, compute_uv=False)
    # Singular values under the tolerance, 1e-6 of the largest, are dropped: no pseudoinverse of J unless they are 0.
    assume(sigma[0] > 0 and not np.any((sigma > 1e-15 * sigma[0]) & (sigma < 1e-4 * sigma[0])))
    m, n = J.shape
    P = np.column_stack([resolve_rates(J, column, "pseudoinverse") for column in np.eye(m)])
    # A condition number of up to 1e4 costs four of the sixteen digits.
    tolerance = 1e-10 * max(1.0, np.abs(P).max())
    assert P.shape == (n, m)
    assert_allclose(J @ P @ J, J, rtol=0, atol=tolerance)
    assert_allclose(P @ J @ P, P, rtol=0, atol=tolerance * max(1.0, np.abs(P).max()))
    assert_allclose(J @ P, (J @ P).T, rtol=0, atol=tolerance)
    assert_allclose(P @ J, (P @ J).T, rtol=0, atol=tolerance)


@given(seeds, st.integers(1, 6))
def test_inverse_gives_exactly_the_twist(seed, n):
    rng = np.random.default_rng(seed)
    J, twist = rng.normal(size=(n, n)), rng.normal(size=n)
    assume(np.linalg.cond(J) < 1e4)
    rates = resolve_rates(J, twist, "inverse")
    # backward stable: the residual is rounding times ‖J‖ ‖rates‖
    assert_allclose(J @ rates, twist, rtol=0, atol=1e-12 * max(1.0, np.abs(J).max() * np.abs(rates).max()))


@given(seeds)
def test_rates_of_a_redundant_arm_are_the_smallest_of_all_that_do_the_task(seed):
    rng = np.random.default_rng(seed)
    J, twist, wq = rng.normal(size=(2, 4)), rng.normal(size=2), rng.uniform(0.2, 5, 4)
    _, tick = one_world(J, twist, np.ones(2), wq, method=Method.PSEUDOINVERSE)
    rates = tick["qdot_cmd"][:4]
    assert_allclose(J @ rates, twist, rtol=0, atol=1e-10 * max(1, np.abs(rates).max()))
    _, _, vt = np.linalg.svd(J)
    for other in rates + rng.normal(size=(20, 2)) @ vt[2:]:
        assert rates @ (wq * rates) <= other @ (wq * other) * (1 + 1e-12)


@given(matrices, seeds, st.floats(1e-3, 10))
def test_damped_rates_are_bounded_by_the_twist_over_twice_lambda(J, seed, lam):
    twist, _, _, _ = draw(J, seed)
    rates = resolve_rates(J, twist, "damped", damping_maximum=lam)
    assert np.linalg.norm(rates) <= np.linalg.norm(twist) / (2 * lam) * (1 + 1e-12)


def test_the_bound_is_reached_where_sigma_equals_lambda():
    # g(σ) = σ/(σ² + λ²) has its maximum 1/(2λ) at σ = λ: so the bound above is sharp, and can fail.
    rates = resolve_rates(np.diag([1.0, 0.1]), np.array([0.0, 1.0]), "damped", damping_maximum=0.1)
    assert rates[1] == pytest.approx(5.0, rel=1e-14)


def test_task_rows_that_never_move_take_nothing_from_the_null_space():
    # x, y and z of a planar arm with three joints: z is a row of zeros, and one joint motion is free.
    J = np.array([[1.0, 0.5, 0.2], [0.3, 1.0, 0.4], [0.0, 0.0, 0.0]])
    wished = np.array([1.0, 2.0, 3.0])
    parameters = {"objective": Objective.POSTURE, "objective_gain": 1.0, "posture": wished}
    _, tick = one_world(
        J, np.zeros(3), np.ones(3), np.ones(3), method=Method.DAMPED, damping_maximum=0.1, **parameters
    )
    free = np.cross(J[0], J[1]) / np.linalg.norm(np.cross(J[0], J[1]))
    assert_allclose(tick["qdot_cmd"][:3], free * (free @ wished), rtol=0, atol=1e-12)


@given(matrices, seeds, st.sampled_from([1.0, 1e-6, 0.0]))
def test_null_space_motion_leaves_the_task_alone_down_to_rank_loss(J, seed, sigma_min):
    twist, wx, wq, _ = draw(J, seed)
    m, n = J.shape
    u, s, vt = np.linalg.svd(J, full_matrices=False)
    s[-1] *= sigma_min
    J = (u * s) @ vt
    wished = np.random.default_rng(seed).normal(size=n)
    parameters = {"objective": Objective.POSTURE, "objective_gain": 1.0, "posture": wished}
    _, still = one_world(J, twist, wx, wq, method=Method.DAMPED, damping_maximum=0.1)
    _, moving = one_world(J, twist, wx, wq, method=Method.DAMPED, damping_maximum=0.1, **parameters)
    extra = (moving["qdot_cmd"] - still["qdot_cmd"])[:n]
    assert_allclose(J @ extra, np.zeros(m), rtol=0, atol=1e-10)
    if np.linalg.matrix_rank(J) == min(m, n):
        # the whole motion N qdot0, not merely some motion that is harmless, such as none
        # Where σ_min is small, rounding turns the null space by 1e-16 κ in either computation.
        turned = 1e-12 + 1e-14 * np.linalg.cond(J)
        assert_allclose(extra, projector(J, wq) @ wished, rtol=0, atol=turned)


def test_null_space_check_finds_the_classical_wrong_projector():
    # I − J*J with a damped J* is no projector: it leaks into the task by λ²/(σ² + λ²).
    J, wished = np.array([[1.0, 0.5, 0.2]]), np.array([1.0, 2.0, 3.0])
    damped = J.T @ np.linalg.inv(J @ J.T + 0.01 * np.eye(1))
    leak = J @ (np.eye(3) - damped @ J) @ wished
    assert abs(leak[0]) > 1e-3


@pytest.mark.parametrize("method", list(Method))
@pytest.mark.parametrize("scale", [0.0, 1e-300, 1e-90, 1e-12, 1.0, 1e12, 1e90, 1e300])
def test_no_method_is_ever_not_a_number(method, scale):
    for J in (np.ones((3, 3)), np.eye(3), np.diag([1.0, 1e-200, 0.0])):
        _, tick = one_world(J * scale, np.ones(3), np.ones(3), np.ones(3), method=method, damping_maximum=0.1)
        for column in ("qdot_cmd", "sigma", "gain", "u_min", "v_min"):
            assert np.all(np.isfinite(tick[column])), (column, tick[column])
        assert not np.isnan(tick["condition"])


def test_exact_rank_loss_is_a_status_and_not_an_error():
    J = np.array([[1.0, 1.0], [1.0, 1.0]])
    for method in Method:
        _, tick = one_world(J, np.ones(2), np.ones(2), np.ones(2), method=method, damping_maximum=0.1)
        assert Status(int(tick["status"])) & Status.SINGULAR


@pytest.mark.parametrize(("sigma_min", "status"), [(0.0101, Status.OK), (0.0099, Status.SINGULAR)])
def test_a_condition_of_a_hundred_is_called_singular(sigma_min, status):
    J = np.diag([2.0, 2.0 * sigma_min])
    _, tick = one_world(J, np.ones(2), np.ones(2), np.ones(2), method=Method.INVERSE)
    assert Status(int(tick["status"])) == status


@given(matrices, seeds)
def test_recorded_measures_are_those_of_the_weighted_jacobian(J, seed):
    twist, wx, wq, sigma = draw(J, seed)
    _, tick = one_world(J, twist, wx, wq, method=Method.DAMPED, damping_maximum=0.1)
    k = len(sigma)
    assert_allclose(tick["sigma"][:k], sigma, rtol=0, atol=1e-12 * max(1, sigma[0]))
    assert tick["manipulability"] == pytest.approx(np.prod(sigma), abs=1e-9 * max(1, sigma[0]) ** k)
    if sigma[-1] > 1e-6:
        A = np.sqrt(wx)[:, None] * J / np.sqrt(wq)
        u, v = tick["u_min"][: J.shape[0]], tick["v_min"][: J.shape[1]]
        assert tick["condition"] == pytest.approx(sigma[0] / sigma[-1], rel=1e-6)
        assert_allclose(A.T @ u, sigma[-1] * v, rtol=0, atol=1e-11 * sigma[0])


@given(seeds, st.sampled_from([OnExcess.SCALE, OnExcess.CLAMP]))
def test_limited_rates_are_within_their_limits_and_say_so(seed, on_excess):
    rng = np.random.default_rng(seed)
    J, twist = rng.normal(size=(3, 3)), rng.normal(size=3)
    limit = rng.uniform(0.1, 10, 3)
    plain = {"method": Method.DAMPED, "damping_maximum": 0.1}
    _, free = one_world(J, twist, np.ones(3), np.ones(3), **plain)
    _, tick = one_world(J, twist, np.ones(3), np.ones(3), **plain, rate_limit=limit, on_excess=on_excess)
    free, rates = free["qdot_cmd"][:3], tick["qdot_cmd"][:3]
    exceeds = bool(np.any(np.abs(free) > limit))
    assert np.all(np.abs(rates) <= limit * (1 + 1e-15))
    assert bool(tick["status"] & Status.RATE_LIMITED) == exceeds
    if on_excess == OnExcess.SCALE:  # the direction of motion is kept
        assert_allclose(np.outer(rates, free), np.outer(free, rates), rtol=0, atol=1e-12 * free @ free)
    else:
        assert_allclose(rates, np.clip(free, -limit, limit), rtol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.ones((7, 2)), np.ones(7)), "J must be (m, n) with m <= 6 and twist (m,), got (7, 2), (7,)"),
        ((np.ones((2, 3)), np.ones(3)), "J must be (m, n) with m <= 6 and twist (m,), got (2, 3), (3,)"),
        ((np.ones((2, 3)), np.ones(2), "inverse"), "method 'inverse' needs a square J, got (2, 3)"),
        (
            (np.eye(2), np.ones(2), "dampd"),
            'method must be one of inverse, pseudoinverse, damped, got "dampd"; did you mean "damped"?',
        ),
        ((np.eye(2), np.array([np.nan, 1.0])), "J and twist must be finite"),
    ],
)
def test_resolve_rates_refuses_what_it_cannot_resolve(arguments, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        resolve_rates(*arguments)
    assert str(caught.value) == message
