"""The best rates within bounds: against conditions that only the best fulfill, and a solver of linear programs.

The conditions of Karush, Kuhn and Tucker say whether rates are the best and not how to find them. Where λ is 0 there
may be many that are as good for the task, and of these the one of the least norm is unique; that it is the least is
certified by multipliers that a linear program looks for.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import linprog

from codes import Method, OnExcess, Schedule
from oracle_limits import redistributed
from project import examples
from records import blank, put, resolve
from rmrc.scenario.choices import Status

PERIOD = 1e-3
seeds = st.integers(0, 2**32 - 1)
LIMITED = Status.RATE_LIMITED | Status.ACCELERATION_LIMITED | Status.POSITION_LIMITED


def problem(seed):
    """Return J, twist, λ, the middle and half the width of each joint's bounds, and a drift that the task does not feel."""
    rng = np.random.default_rng(seed)
    n, m = rng.integers(2, 9), rng.integers(1, 7)
    r = rng.integers(1, min(m, n) + 1)
    J = rng.normal(size=(m, r)) @ rng.normal(size=(r, n)) if rng.random() < 0.4 else rng.normal(size=(m, n))
    lam = rng.choice([0.0, 0.0, 1e-3, 1e-2, 0.1, 0.5])
    middle = rng.normal(size=n) * rng.choice([0.0, 0.3])
    half = rng.choice([0.0, 1e-3, 0.1, 0.5, 2.0, 1e6], n, p=[0.1, 0.1, 0.2, 0.3, 0.2, 0.1])
    twist = rng.normal(size=m) * 10 ** rng.uniform(-1.5, 1.0)
    wish = rng.normal(size=n) * rng.choice([0.0, 1.0])
    if rng.random() < 0.3:
        J[:, rng.integers(n)] = 0.0  # a joint that does not move the task
    return J, twist, lam, middle, half, wish


def records(J, lam, middle=0.0, half=1e6, **fields):
    """Return the records of a world and its tick, whose bounds are made by the last rates and the accelerations."""
    world, tick = blank(*J.shape)
    n = J.shape[1]
    put(
        world, method=Method.DAMPED, schedule=Schedule.CONSTANT, damping_maximum=lam, J=J, period=PERIOD,
        braking=np.full(n, 10.0), on_excess=OnExcess.OPTIMAL, qdot_cmd_last=np.broadcast_to(middle, n),
        acceleration_limit=np.broadcast_to(half, n) / PERIOD, nullspace_rates=np.zeros(n),
    )  # fmt: skip
    put(world, **fields)
    return world, tick


def answer(world, tick, twist):
    """Return the rates, (n,), their bounds, (2, n), what was wished for in the null space, and the status."""
    n = int(world["n"][0])
    world["twist_cmd"][0, : len(twist)] = twist
    resolve(world, tick)
    span = np.array([world["lower"][0, :n], world["upper"][0, :n]])
    return tick["qdot_cmd"][0, :n].copy(), span, world["drift"][0, :n].copy(), Status(int(tick["status"][0]))


def solved(seed, size=1.0, **fields):
    """Return a problem, the rates, their bounds and the drift; None where no limit is exceeded."""
    J, twist, lam, middle, half, wish = problem(seed)
    J, rank = size * J, np.linalg.matrix_rank(J)
    fields = {"nullspace_objective": 4, "nullspace_rates": wish, "rank": rank, **fields}
    y, span, drift, status = answer(*records(J, lam, middle, half, **fields), twist)
    return (J, twist, lam, y, *span, drift) if status & LIMITED else None


def violation(J, twist, lam, y, lower, upper, drift):
    """Return by how much the conditions do not hold, in shares of what rounding explains."""
    downhill = J.T @ (twist - J @ y) - lam**2 * (y - drift)
    # of two products of up to eight terms
    size = 1e-12 * (1.0 + np.abs(J).T @ (np.abs(twist) + np.abs(J) @ np.abs(y)) + lam**2 * np.abs(drift))
    off = np.select(
        [y <= lower, y >= upper], [np.maximum(downhill, 0), np.maximum(-downhill, 0)], np.abs(downhill)
    )
    return np.max(np.where(lower < upper, off / size, 0.0))


def excess_of_norm(J, twist, y, lower, upper, drift):
    """Return by how much multipliers miss that would certify the least ‖y − drift‖ of those with this J y.

    ν with a_jᵀ ν = y_j − drift_j within bounds, no less at an upper one and no more at a lower one; of joints that what
    is missing of the task holds at their bounds nothing is asked.
    """
    m, pulled = len(twist), np.abs(J.T @ (twist - J @ y))
    asked = (lower < upper) & (pulled <= 1e-10 * (1 + np.abs(twist).max()))
    below, above = asked & (y < upper), asked & (y > lower)
    if not asked.any():
        return 0.0
    rows = np.vstack([J.T[below], -J.T[above]])
    found = linprog(
        np.append(np.zeros(m), 1.0), A_ub=np.column_stack([rows, -np.ones(len(rows))]),
        b_ub=np.append((y - drift)[below], (drift - y)[above]), bounds=[*[(None, None)] * m, (0, None)],
    )  # fmt: skip
    assert found.status == 0
    return found.fun


@pytest.mark.parametrize("size", [1.0, 0.1])
def test_rates_are_the_best_of_all_within_the_bounds(size):
    """With singular values far above the damping, and below it, where the slopes at bounds depend on it."""
    for seed in range(150):
        if (case := solved(seed, size)) is None:
            continue
        J, twist, lam, y, lower, upper, drift = case
        assert np.all(y >= lower) and np.all(y <= upper)
        assert violation(*case) <= 1.0, seed
        if lam == 0.0:
            # the linear program is feasible to 1e-7
            assert excess_of_norm(J, twist, y, lower, upper, drift) <= 1e-6, seed


@pytest.mark.parametrize("other", [OnExcess.SCALE, OnExcess.CLAMP])
def test_the_conditions_tell_the_best_from_others(other):
    # The negative control: what the other policies make of the same problems is hardly ever the best.
    problems = [seed for seed in range(80) if solved(seed)]
    assert np.mean([violation(*solved(seed, on_excess=other)) > 1e3 for seed in problems]) > 0.4


# The direction kept ---------------------------------------------------------------------------------------------------


def share_within(J, done, lower, upper, inwards=0.0):
    """Return the largest share of what rates do that rates within tightened bounds can do; None if they can none."""
    low, up = lower + inwards, upper - inwards
    if np.any(low > up):
        return None
    found = linprog(
        np.append(np.zeros(len(low)), -1.0), A_eq=np.column_stack([J, -done]), b_eq=np.zeros(len(J)),
        bounds=[*zip(low, up, strict=True), (0.0, 1.0)],
    )  # fmt: skip
    return -found.fun if found.status == 0 else None


def kept(seed, lam=None, **fields):
    """Return a task of full rank with what the inverse makes of it, rate limits, and the rates within them."""
    rng = np.random.default_rng(seed)
    m, n = [(1, 2), (2, 3), (3, 7), (6, 7), (2, 5), (6, 8), (3, 3)][seed % 7]
    J, twist, limit = rng.normal(size=(m, n)), rng.normal(size=m), rng.uniform(0.2, 2.0, n)
    twist *= rng.uniform(0.8, 3.0) / np.max(np.abs(np.linalg.pinv(J) @ twist) / limit)
    lam = rng.choice([0.0, 0.1]) if lam is None else lam
    free, *_ = answer(*records(J, lam, on_excess=OnExcess.NONE), twist)
    y, *_ = answer(*records(J, lam, rate_limit=limit, **fields), twist)
    return J, free, limit, y


@pytest.mark.parametrize("fields", [{"keep_direction": 1}, {"on_excess": OnExcess.SNS}], ids=["kept", "sns"])
@given(seed=seeds)
@examples(8, 40)
def test_the_largest_share_of_the_task_is_done_in_its_direction_by_the_least_rates(seed, fields):
    J, free, limit, y = kept(seed, **fields)
    assert np.all(np.abs(y) <= limit)
    wanted, done = J @ free, J @ y
    share = done @ wanted / (wanted @ wanted)
    assert_allclose(done, share * wanted, rtol=0, atol=1e-10 * np.linalg.norm(wanted))
    # to what a linear program is solved to
    assert share == pytest.approx(share_within(J, wanted, -limit, limit), abs=1e-7)
    assert excess_of_norm(J, done, y, -limit, limit, np.zeros(len(y))) <= 1e-6


# The direction kept by all bounds ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("fields", [{"keep_direction": 1}, {"on_excess": OnExcess.SNS}], ids=["kept", "sns"])
@given(seed=seeds)
@examples(8, 80)
def test_the_largest_share_within_all_bounds_is_done_by_the_least_rates_and_scaled_where_none_fits(
    seed, fields
):
    found = solved(seed, **fields)
    if found is None:
        return
    J, twist, lam, y, lower, upper, drift = found
    assert np.all(y >= lower) and np.all(y <= upper)
    wish = problem(seed)[5]
    free, *_ = answer(
        *records(J, lam, on_excess=OnExcess.NONE, nullspace_objective=4, nullspace_rates=wish,
                 rank=np.linalg.matrix_rank(J)), twist
    )  # fmt: skip
    wanted, done = J @ free, J @ y
    size = np.linalg.norm(wanted)
    share = done @ wanted / size**2
    if (
        np.linalg.norm(done - share * wanted) > 1e-9 * (size + np.linalg.norm(done))
        or not -1e-9 <= share <= 1 + 1e-9
    ):
        # to the bit: it is the same function
        assert_array_equal(y, solved(seed, on_excess=OnExcess.SCALE)[3])
        assert share_within(J, wanted, lower, upper, 1e-6) is None
        return
    best = share_within(J, wanted, lower, upper)
    assert best is None or share == pytest.approx(best, abs=1e-6)
    if best is not None:
        assert excess_of_norm(J, done, y, lower, upper, drift) <= 1e-6


def test_redistributed_rates_are_those_of_a_plain_loop_over_the_saturated_joints():
    compared = 0
    for seed in range(200):
        if (case := solved(seed, on_excess=OnExcess.REDISTRIBUTE)) is None:
            continue
        J, twist, lam, y, *bounds, drift = case

        def invert(J, lam=lam):
            return (
                np.linalg.pinv(J, 1e-14)
                if lam == 0
                else J.T @ np.linalg.inv(J @ J.T + lam**2 * np.eye(len(J)))
            )

        rates, _ = redistributed(J, twist, drift, *bounds, lambda J: J, invert)
        if rates is not None:  # or all are scaled
            compared += 1
            # by two ways to the inverse, which λ keeps bounded
            assert_allclose(y, rates, rtol=0, atol=1e-9 * (1.0 + np.abs(rates).max()), err_msg=str(seed))
    assert compared > 60


def test_the_limits_of_all_joints_that_are_held_are_named():
    """Of a task of 3, joints at 0.5 and 1.1 leave 1.4 to the last one, which does 1.2; its share is a rate's."""
    y, *_, status = answer(
        *records(
            np.ones((1, 3)), 0.0, half=[1e6, 1.1, 1e6], method=Method.PSEUDOINVERSE, rank=1,
            on_excess=OnExcess.REDISTRIBUTE, rate_limit=np.array([0.5, 1e3, 1.2]),
        ),
        np.array([3.0]),
    )  # fmt: skip
    assert_allclose(y, [0.5, 1.1, 1.2], rtol=1e-12)
    assert status & LIMITED == Status.RATE_LIMITED | Status.ACCELERATION_LIMITED


# Limits first -------------------------------------------------------------------------------------------------------


def by_reverse_priority(J, first, lower, upper):
    """Return rates by the reverse priority of two tasks: those in `first`, then the limits that they break.

    q̇ = q̇_2 + T (b − S q̇_2) with the rows S of the joints that are put at their bounds b. T = (S P)⁺, P = 1 − J⁺ J, where
    limits and task do not depend on each other; else what the task loses is least.
    """
    n, held, rates = len(first), np.zeros(len(first), bool), first
    P = np.eye(n) - np.linalg.pinv(J) @ J
    while np.any(out := ~held & (np.abs(rates - np.clip(rates, lower, upper)) > 1e-12 * np.abs(rates))):
        bounds = np.where(held, rates, np.clip(rates, lower, upper))
        held[np.argmax(np.where(out, np.abs(rates - bounds), 0.0))] = True
        S, b = np.eye(n)[held], bounds[held]
        if np.linalg.matrix_rank(S @ P, tol=1e-9) == len(S):
            rates = first + np.linalg.pinv(S @ P) @ (b - S @ first)
        else:
            rates = first.copy()
            rates[held] = b
            lost = J[:, held] @ (b - first[held])
            rates[~held] -= np.linalg.pinv(J[:, ~held], rcond=1e-9) @ lost
    return rates, held


@given(seeds)
@examples(10, 100)
def test_limits_come_first_by_the_closed_form_of_reverse_priority(seed):
    rng = np.random.default_rng(seed)
    m, n = [(1, 2), (2, 3), (3, 7), (6, 7), (2, 5), (6, 8), (3, 3)][seed % 7]
    J, twist, wish = rng.normal(size=(m, n)), rng.normal(size=m), rng.normal(size=n)
    fields = {"method": Method.PSEUDOINVERSE, "nullspace_objective": 4, "nullspace_rates": wish, "rank": m}
    first, *_ = answer(*records(J, 0.0, on_excess=OnExcess.NONE, **fields), twist)
    middle, half = 0.5 * first, np.abs(first) * rng.uniform(0.3, 2.0, n) + 0.01
    y, (lower, upper), _, status = answer(
        *records(J, 0.0, middle, half, on_excess=OnExcess.REVERSE_PRIORITY, **fields), twist
    )
    if not status & LIMITED:
        assert_array_equal(y, first)
        return
    want, held = by_reverse_priority(J, first, lower, upper)
    condition = np.linalg.cond(J[:, ~held]) if not held.all() else 1.0
    if condition > 1e6:
        return
    # rounding, times what the joints that are left make of it
    assert_allclose(y, want, rtol=0, atol=1e-13 * condition**2 * (1 + np.abs(first).max()) + 1e-12)
    assert np.all((y >= lower) & (y <= upper))
    assert held.any()
    assert np.all((y[held] == lower[held]) | (y[held] == upper[held]))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("part", [0.4, 0.9])
def test_a_joint_that_is_held_damps_the_others_by_the_share_of_its_rate_that_is_left(seed, part):
    """λ is that of the columns times these shares, so that it does not jump where a joint begins to be held."""
    rng, most, below = np.random.default_rng(seed), 0.3, 2.0
    J, twist = rng.normal(size=(2, 3)), 4.0 * rng.normal(size=2)

    def damping(J):
        return most * np.sqrt(max(0.0, 1.0 - (np.linalg.svd(J)[1][-1] / below) ** 2))

    def damped(J, twist, lam):
        return J.T @ np.linalg.solve(J @ J.T + lam**2 * np.eye(2), twist)

    free = damped(J, twist, damping(J))
    held = np.argmax(np.abs(free))
    share, others = np.where(np.arange(3) == held, part, 1.0), np.arange(3) != held
    y, *_ = answer(
        *records(
            J, most, schedule=Schedule.SMALLEST_SINGULAR_VALUE, damping_below=below, rank=2,
            on_excess=OnExcess.REVERSE_PRIORITY, rate_limit=np.where(others, 1e3, part * np.abs(free[held])),
        ),
        twist,
    )  # fmt: skip
    lam = max(damping(J), damping(J * share))
    assert y[held] == pytest.approx(part * free[held], rel=1e-12)
    left = twist - J[:, held] * y[held]
    assert_allclose(y[others], damped(J[:, others], left, lam), rtol=0, atol=1e-11)
    assert lam > damping(J) + 1e-5  # or nothing would be tested
