"""Logs of an arm that nothing of rmrc made: steps of rate, each answered by the closed form of delay and lag."""

from itertools import pairwise

import numpy as np

# What the arm is, if nothing else is asked for.
PERIOD, DELAY, LAG, NOISE, RESOLUTION = 0.008, 0.012, 0.009, 2e-5, 2 * np.pi / 2**17


def commands(rng, period, duration=12.0, top=0.7, ramp=0.05):
    """Return times and rates: levels within `top` for 0.3 to 0.8 s each, and ramps of `ramp` s between them."""
    knots, levels = [0.1], [0.0]
    while knots[-1] < duration:
        knots += [knots[-1] + ramp, knots[-1] + ramp + rng.uniform(0.3, 0.8)]
        levels += [rng.uniform(-top, top)] * 2
    time = period * np.arange(round(duration / period))
    return time, np.interp(time, knots, levels)


def answer(time, sent_at, rate, delay, lag):
    """Return the positions of a joint that answers each step of the rate, in closed form, and their sum.

    A step of 1 at 0 gives s - L (1 - exp(-s/L)) at s = t - delay, and 0 before.
    """
    steps = np.diff(rate, prepend=0.0)
    total = np.zeros(len(time))
    for k in np.flatnonzero(steps):
        since = np.maximum(time - sent_at[k] - delay, 0.0)
        total += steps[k] * (since + (lag * np.expm1(-since / lag) if lag else 0.0))
    return total


def saturated(time, sent_at, rate, delay, lag, limit, step=4e-4):
    """Return the positions of a joint with a largest acceleration, in small steps: w' = (u - w)/L within limits."""
    now = step * np.arange(round((time[-1] + 0.01) / step))
    row = np.searchsorted(sent_at, now - delay + 1e-9, "right") - 1
    rates = [0.0]
    for asked in np.where(row >= 0, rate[row], 0.0):
        free = (asked - rates[-1]) * -np.expm1(-step / lag)  # exact while the asked rate holds
        rates.append(rates[-1] + min(max(free, -limit * step), limit * step))
    travel = np.cumsum([0.0, *(0.5 * step * (a + b) for a, b in pairwise(rates))])
    return np.interp(time, np.append(now, now[-1] + step), travel)


def log(  # noqa: C901 - a list of what happens to logs
    seed, spoil="", size=0.0, period=PERIOD, delay=DELAY, lag=LAG, noise=NOISE, joints=2, duration=12.0, **how
):
    """Return the columns of a log by name, joints numbered from 0, spoiled in a way that real logs are, by how much."""
    rng, q, rates = np.random.default_rng([38, seed]), [], []
    for j in range(joints):
        time, rate = commands(rng, period, duration, **how)
        when = time * (1.0 + size) if spoil == "clocks" else time
        if spoil == "readings":
            when = time + size * rng.standard_normal(len(time))
        if spoil == "limit":
            exact = saturated(when, time, rate, delay, lag, size)
        else:
            exact = answer(when, time, rate, delay, lag)
        if spoil == "backlash":
            for i in range(1, len(exact)):  # the joint follows the actuator at either side of its play
                exact[i] = min(max(exact[i - 1], exact[i] - size / 2), exact[i] + size / 2)
        q.append(exact + 2.0 * j + noise * rng.standard_normal(len(exact)))
        rates.append(rate)
    q, rates = np.round(np.array(q).T / RESOLUTION) * RESOLUTION, np.array(rates).T
    rows = np.arange(len(time))
    if spoil == "wrapped":
        q = (q + size + np.pi) % (2 * np.pi) - np.pi
    if spoil in ("missing", "index"):
        rows = np.flatnonzero(rng.random(len(time)) > size)
    if spoil == "stamps":
        time = time + rng.uniform(-size, size, len(time))
    if spoil == "slow":
        rows = rows[::size]
    if spoil == "late":
        rows = rows[size:]
    sent = rows if spoil not in ("index", "late") else np.arange(len(rows))
    columns = {"t": time[sent]} | {f"q{j}": q[rows, j] for j in range(joints)}
    return columns | {f"qdot_cmd{j}": rates[sent, j] for j in range(joints)}
