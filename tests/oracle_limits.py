"""The limits and the pace along the path, for the oracle: plain numpy, each function one equation of the theory."""

import numpy as np
from scipy.optimize import linprog, nnls


def fastest_pace(a, b, rate_limit):
    """Return s*, the largest pace up to 8 at which |a + s b| stays within 95 % of the rate limits (19)."""
    room = 0.95 * rate_limit
    if np.any(np.abs(a) > room):
        return 0.0
    moving = b != 0
    return np.min((room - np.sign(b) * a)[moving] / np.abs(b)[moving], initial=8.0)


def safe_pace(fastest, falling, change):
    """Return the pace from which one that falls by `change` stays below a line that falls by `falling` (20)."""
    x = change / falling if falling > 0 else np.inf
    return fastest if fastest <= x else np.sqrt(x * (2 * fastest - x))


def next_pace(last, fastest, falling, change, period):
    """Return the pace of this tick: 1 or as safe as can be, and not far from the last one."""
    step = change * period
    return max(0.0, np.clip(min(1.0, safe_pace(fastest, falling, change)), last - step, last + step))


def brake(distance, deceleration, period):
    """Return the largest rates from which joints stop within a distance (21)."""
    distance, deceleration = np.broadcast_arrays(np.asarray(distance, float), deceleration)
    rate = np.full(distance.shape, np.inf)
    rate[distance <= 0] = 0.0
    some = (distance > 0) & np.isfinite(distance)
    d, b = distance[some], deceleration[some]
    ticks = np.maximum(1, np.ceil(-0.5 + np.sqrt(0.25 + 2 * d / (b * period**2))))
    rate[some] = d / (ticks * period) + b * period * (ticks - 1) / 2
    return rate


def bounds(q, last, rate, acceleration, deceleration, position, period):
    """Return rest_lo, rest_up, lower and upper (22); `position` is (n, 2)."""
    rest_lo = -np.minimum(rate, brake(q - position[:, 0], deceleration, period))
    rest_up = np.minimum(rate, brake(position[:, 1] - q, deceleration, period))
    least, most = last - acceleration * period, last + acceleration * period
    for j in np.flatnonzero(rest_up < least):  # position comes before acceleration
        least[j] = max(rest_up[j], min(least[j], gentle(last[j], position[j, 1] - q[j], period)))
    for j in np.flatnonzero(rest_lo > most):
        most[j] = min(rest_lo[j], max(most[j], -gentle(-last[j], q[j] - position[j, 0], period)))
    return rest_lo, rest_up, np.clip(rest_lo, least, most), np.clip(rest_up, least, most)


def gentle(rate, distance, period):
    """Return the rate that follows, of the stop within a distance with the least steady deceleration, by halving."""
    if distance <= 0 or rate <= 0:
        return min(rate, 0.0)
    low, high = 0.0, rate
    for _ in range(200):
        fall = 0.5 * (low + high)
        way = np.maximum(0.0, rate - fall * np.arange(1, rate / max(fall, 1e-6 * rate) + 1)).sum() * period
        low, high = (fall, high) if way > distance else (low, fall)
    return rate - high


def slowed_change(rates, last, change, lower, upper):
    """Return rates whose change is scaled until no joint exceeds its acceleration, then each within its bounds."""
    step = rates - last
    rates = last + step * np.min(change[step != 0] / np.abs(step[step != 0]), initial=1.0)
    return np.clip(rates, lower, upper)


def kept_out(slopes, least, rates, scale, A, floor):
    """Return the change of rates with which slopes · rates ≥ least, each softened by 1e-6, and least ‖Az‖² + floor²‖z‖².

    And by how much they may be short of each.

    By Lawson and Hanson's least squares of positive numbers: p ≥ 0 with the least ‖Rᵀ p − R⁻¹ need‖.
    """
    steep = slopes.any(axis=1)
    need, S = (least - slopes @ rates)[steep], slopes[steep] * scale
    if np.all(need <= 0):
        return np.zeros(len(rates)), np.zeros(len(slopes))
    metric = np.linalg.cholesky(A.T @ A + floor**2 * np.eye(len(rates)))
    S = np.linalg.solve(metric, S.T).T
    root = np.linalg.cholesky(S @ S.T + 1e-6 * np.diag(np.sum(S * S, axis=1)))
    p, _ = nnls(root.T, np.linalg.solve(root, need))
    slack = np.zeros(len(slopes))
    slack[steep] = 2e-6 * p * np.sum(S * S, axis=1)
    return scale * np.linalg.solve(metric.T, S.T @ p), slack


def held_off(slopes, least, rates, last, change):
    """Return rates that are scaled until slopes · rates ≥ least, as far as their changes allow."""
    falls = slopes @ rates
    beyond = falls < least
    share = np.min(least[beyond] / falls[beyond], initial=1.0)
    if share > 1 - 1e-9:
        return rates
    less = (1 - share) * rates
    room = change + np.sign(rates) * (rates - last)
    part = np.min(np.maximum(0.0, room)[less != 0] / np.abs(less[less != 0]), initial=1.0)
    return rates - part * less


def held_at_stops(start, drift, lower, upper, resolve, pull):
    """Return rates within bounds, where joints at their bounds hold and the others do what they can: (23), at stops.

    Args:
        start: Rates, some of which may be out of bounds.
        drift: Rates that the task does not feel, and that are wished for.
        lower: Bounds of the rates.
        upper: The same.
        resolve: Function: held or not, rates of the held, share of its wish that is left to each -> rates, λ.
        pull: Function: rates, λ -> how the residual draws each joint.
    """
    n = len(start)
    x, side, fade, freed = np.clip(start, lower, upper), np.zeros(n), np.ones(n), np.zeros(n, bool)
    out = np.abs(start - x) > 1e-12 * np.abs(start)
    side[out], fade[out] = np.sign(start[out]), np.abs(x[out] / start[out])
    for _ in range(3 * n + 1):
        goal, lam = resolve(side != 0, np.where(side != 0, x, drift), fade)
        goal = np.where(side != 0, x, goal)
        bound = np.clip(goal, lower, upper)
        out = np.abs(goal - bound) > 1e-12 * np.abs(goal)
        if out.any():
            part = np.full(n, np.inf)
            part[out] = np.clip((bound - x)[out] / (goal - x)[out], 0.0, 1.0)
            j = np.lexsort((-np.abs(goal - bound), part))[0]
            x = x + part[j] * (goal - x)
            x[j], side[j] = bound[j], np.sign(goal[j] - bound[j])
            fade[j] = abs(bound[j] / goal[j]) if abs(bound[j]) < abs(goal[j]) else 1.0
            continue
        x = goal
        inwards = np.where((side != 0) & ~freed, -side * pull(x, lam), 0.0)
        j = np.argmax(inwards)
        if inwards[j] <= 1e-12 * np.abs(pull(0.0 * x, lam)).max():
            break
        side[j], fade[j], freed[j] = 0.0, 1.0, True
    return x


def bounding(a, b, lower, upper, free):
    """Return from which s to which s·a + b is within bounds, and which free joint bounds s where."""
    inside = (lower <= b) & (b <= upper)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort([(lower - b) / a, (upper - b) / a], axis=0)
    # a joint that does not depend on s always or never is within its bounds
    still = np.abs(a) <= 1e-12 * np.maximum(1, np.abs(b))
    first = np.where(still, np.where(inside, -np.inf, np.inf), ends[0])[free]
    last = np.where(still, np.where(inside, np.inf, -np.inf), ends[1])[free]
    beyond = np.maximum(lower - (a + b), a + b - upper)[free]
    j = np.flatnonzero(free)[np.lexsort((-beyond, np.where(beyond > 0, last, np.inf)))[0]]
    return first.max(), last.min(), j, upper[j] if (a + b)[j] > upper[j] else lower[j]


def redistributed(J, v, drift, lower, upper, scaled_jacobian, invert):
    """Return rates where the free joints take over what the saturated ones cannot do (24), and their share of the task.

    Without a share that fits: None and -1.

    Args:
        J: Jacobian of the task.
        v: The task's twist.
        drift: Rates N qdot0 that the task does not feel.
        lower: Bounds of the rates.
        upper: The same.
        scaled_jacobian: Function: Jacobian -> A.
        invert: Function: Jacobian -> its generalized inverse.
    """
    m, n = J.shape
    lost = 1e-6 * np.linalg.norm(scaled_jacobian(J), 2)
    drift, free = drift.copy(), np.ones(n, bool)
    best, rates = -1.0, None
    while True:
        J_free = np.where(free, J, 0.0)
        if np.linalg.svd(scaled_jacobian(J_free), compute_uv=False)[-1] <= lost:
            return rates, best
        G = invert(J_free)
        a, b = np.where(free, G @ v, 0.0), np.where(free, drift - G @ (J @ drift), drift)
        if np.all((lower <= a + b) & (a + b <= upper)):
            return a + b, 1.0
        first, last, j, bound = bounding(a, b, lower, upper, free)
        s = min(1.0, last)
        if s >= max(0.0, first) and s > best:
            best, rates = s, s * a + b
        drift[j], free[j] = bound, False
        if free.sum() < m:
            return rates, best


def least_way(rate, change, braking, step):
    """Return the least way, in ticks, on which a rate comes to rest with bounded deceleration and jerk, by a program.

    It turns back nowhere. Infinite if there is no such stop.

    Args:
        rate: In this tick, which counts.
        change: From the last tick to this one.
        braking: Largest fall in a tick.
        step: Largest change of the change.
    """
    count = (
        int(np.ceil(rate / braking + 2 * (braking + abs(change)) / step + 2 * np.sqrt(abs(rate) / step))) + 4
    )
    following, sums = np.eye(count) - np.eye(count, k=-1), np.tril(np.ones((count, count)))
    first = np.zeros(count)
    first[0] = change
    found = linprog(
        count - np.arange(count),
        A_ub=np.vstack([following, -following, -sums, -np.eye(count)[-1:]]),
        b_ub=np.concatenate([step + first, step - first, np.full(count, rate), [step]]),
        A_eq=np.ones((1, count)), b_eq=[-rate], bounds=(-max(braking, -change), None),
    )  # fmt: skip
    return rate * (count + 1) + found.fun if found.status == 0 else np.inf


def ticks_to_rate(rate, step):
    """Return in how few ticks a rate is reached from rest, and kept, with changes that change by a step at the most."""
    ticks = 0
    while ((ticks + 1) // 2) * ((ticks + 2) // 2) * step < rate * (1 - 1e-9):
        ticks += 1
    return ticks
