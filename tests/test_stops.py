"""What a joint at its position limit leaves to the others: as much as any rates within the bounds can do.

The oracle are the conditions of Karush, Kuhn and Tucker, which only the best rates within the bounds fulfill: they
say whether an answer is right and not how to find it.
"""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from numpy.testing import assert_allclose

from chains import seeds
from codes import Method, OnExcess, Schedule, field
from oracle_limits import brake
from project import examples
from records import blank, resolve
from rmrc.scenario.choices import Status

any_fixture = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
PERIOD, BRAKING, LAMBDA = 1e-3, 10.0, 0.1
SHAPES = ((2, 2), (3, 3), (6, 6), (2, 3), (3, 7), (6, 7), (1, 2), (3, 2), (6, 4))


def arm(J, twist, room, rate, **fields):
    """Return the records of a world and of its tick, for an arm with so much room before its limits.

    Args:
        J: Jacobian, (m, n).
        twist: Task, (m,).
        room: How far each joint is from its lower and from its upper limit, (n, 2).
        rate: Rate limits, (n,).
        fields: Other fields of the record.
    """
    m, n = J.shape
    world, tick = blank(m, n)
    parameters = {
        "method": Method.DAMPED, "schedule": Schedule.CONSTANT, "damping_maximum": LAMBDA, "damping_below": 1.0,
        "manipulability_below": 1.0, "rate_bound": 1.0, "tolerance": 1e-9, "cutoff": 0.05, "gamma": 0.1,
        "on_excess": OnExcess.SCALE,
    }  # fmt: skip
    world["period"], world["braking"], world["acceleration_limit"] = PERIOD, BRAKING, np.inf
    world["J"][0, :m, :n], world["twist_cmd"][0, :m] = J, twist
    world["position_limit"][0, :, :n] = np.array([-1.0, 1.0])[:, None] * np.asarray(room).T
    world["rate_limit"][0, :n] = rate
    for name, value in (parameters | fields).items():
        world[field(name)] = value
    return world, tick


def answer(J, twist, room, rate, **fields):
    """Return the rates and the status of one tick."""
    world, tick = arm(J, twist, room, rate, **fields)
    resolve(world, tick)
    return tick["qdot_cmd"][0, : J.shape[1]].copy(), Status(int(tick["status"][0]))


def rest_bounds(room, rate):
    lower, upper = brake(np.asarray(room), BRAKING, PERIOD).T
    return -np.minimum(rate, lower), np.minimum(rate, upper)


def random_task(seed):
    """Return J, a task that may ask for more than the rate limits allow, room and rate limits; some joints stand."""
    rng = np.random.default_rng(seed)
    m, n = SHAPES[seed % len(SHAPES)]
    room = rng.choice([0.0, 1e-5, 1e-3, 0.05, np.inf], (n, 2), p=[0.25, 0.15, 0.15, 0.15, 0.3])
    J, rate = rng.normal(size=(m, n)), rng.uniform(0.2, 3.0, n)
    twist = rng.normal(size=m) * 10 ** rng.uniform(-1.5, 1)
    return J, twist, room, rate


def damped(J, twist, lam=LAMBDA):
    """Return the rates of the damped inverse without limits."""
    return J.T @ np.linalg.solve(J @ J.T + lam**2 * np.eye(len(J)), twist)


def share_given(rates, lower, upper, limit):
    """Return which share of the task is done at stops, and whether a joint meets its stop."""
    share = min(1.0, np.min(limit / np.abs(rates)))
    beyond = np.abs(share * rates - np.clip(share * rates, lower, upper))
    fast = np.minimum(limit, np.abs(share * rates).max())
    stands = np.any(beyond > 1e-12 * share * np.abs(rates))
    return share + (1 - share) * min(1.0, np.max(beyond / fast)), stands


@given(seeds)
@examples(25, 300)
def test_scaled_rates_at_stops_are_the_best_within_the_bounds(seed):
    J, twist, room, limit = random_task(seed)
    rates, status = answer(J, twist, room, limit)
    lower, upper = rest_bounds(room, limit)
    assert np.all(rates >= lower) and np.all(rates <= upper)
    free = damped(J, twist)
    share, stands = share_given(free, lower, upper, limit)
    assert bool(status & Status.POSITION_LIMITED) == stands
    if not stands:
        assert_allclose(rates, share * free, rtol=1e-10)
        return
    # Downhill for ‖share · twist − J q̇‖² + λ² ‖q̇‖²: zero for joints within their bounds, outwards for those at one.
    # Rounding is that of two products of up to seven terms.
    downhill = J.T @ (share * twist - J @ rates) - LAMBDA**2 * rates
    rounding = 1e-10 * (1.0 + np.abs(J).T @ (np.abs(twist) + np.abs(J) @ np.abs(rates)))
    assert np.all((downhill <= rounding) | (rates == upper))
    assert np.all((downhill >= -rounding) | (rates == lower))


# Continuity -------------------------------------------------------------------------------------------------------


def steepest(J, twist, limit, j, steps, **fields):
    """Return the largest change of the rates over that of the bound, as joint j comes to its limit."""
    n, bounds = J.shape[1], np.linspace(1.2 * limit[j], 0.0, steps + 1)
    ticks = np.floor(bounds / (BRAKING * PERIOD))  # (21) turned round
    room = PERIOD * (ticks + 1) * (bounds - BRAKING * PERIOD * ticks / 2)
    world, tick = arm(J, twist, np.full((n, 2), np.inf), limit, **fields)
    rates, edges, sent = np.empty((steps + 1, n)), world["position_limit"][0, :, j], tick["qdot_cmd"][0, :n]
    for i, distance in enumerate(room):
        edges[:] = -distance, distance
        resolve(world, tick)
        rates[i] = sent
    return quotient(rates, bounds)


def quotient(rates, bounds):
    return np.abs(np.diff(rates, axis=0)).max() / (bounds[0] - bounds[1])


@pytest.mark.parametrize(
    ("shape", "schedule"),
    [
        ((3, 3), Schedule.CONSTANT),
        ((2, 3), Schedule.SMALLEST_SINGULAR_VALUE),
        ((6, 7), Schedule.MANIPULABILITY),
    ],
)
def test_rates_do_not_jump_where_a_joint_begins_to_be_held(shape, schedule):
    # Of rates that are continuous in the bound, the quotient hardly changes with a tenth of the step; at a jump it
    # grows tenfold. The steps are so small as some tasks pass from one set of held joints to the next within a
    # hundredth of the way.
    for seed in range(2):
        rng = np.random.default_rng([seed, *shape])
        J, limit = rng.normal(size=shape), rng.uniform(0.5, 3.0, shape[1])
        twist = rng.normal(size=shape[0])
        free = np.abs(damped(J, twist))
        # half of the tasks are too fast for the rate limits
        twist *= [0.9, 5.0][seed % 2] / np.max(free / limit)
        j = int(np.argsort(-free / limit)[seed // 2])
        coarse, fine = (steepest(J, twist, limit, j, steps, schedule=schedule) for steps in (500, 5000))
        assert fine <= 3.0 * coarse, seed
