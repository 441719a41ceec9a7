"""Logs of an arm that nothing of rmrc made: steps of rate, each answered by the closed form of delay and lag."""

from itertools import pairwise

import numpy as np


def commands(rng, period, duration=12.0, top=0.5, ramp=0.05):
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
    changes = np.flatnonzero(steps)
    total = np.zeros(len(time))
    for k in changes:
        since = np.maximum(time - sent_at[k] - delay, 0.0)
        total += steps[k] * (since + (lag * np.expm1(-since / lag) if lag else 0.0))
    return total


def log(seed, period=0.008, delay=0.018, lag=0.01, noise=2e-5, duration=12.0, joints=2, **how):
    """Return the columns of a log, by name, joints numbered from 0."""
    rng = np.random.default_rng(seed)
    columns, rates = {}, {}
    for j in range(joints):
        time, rate = commands(rng, period, duration, **how)
        columns["t"] = time
        position = answer(time, time, rate, delay, lag) + 0.3 - j
        columns[f"q{j}"] = position + noise * rng.standard_normal(len(time))
        rates[f"qdot_cmd{j}"] = rate
    return columns | rates


def written(path, columns, digits=9, mark=",", head=""):
    """Write columns as CSV, NaN as an empty cell; return the path."""
    cells = [["" if np.isnan(one) else f"{one:.{digits}f}" for one in values] for values in columns.values()]
    rows = [mark.join(row) for row in zip(*cells, strict=True)]
    path.write_text(head + "\n".join([mark.join(columns), *rows]) + "\n", "utf-8")
    return path


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


# What each of these arms is.
PERIOD, DELAY, LAG, NOISE, RESOLUTION = 0.008, 0.012, 0.009, 2e-5, 2 * np.pi / 2**17


def arm_log(seed, spoil=None, size=0.0):  # noqa: C901 - a list of what happens to logs
    """Return a log of two joints of this arm, spoiled in a way that real logs are, and by how much."""
    rng = np.random.default_rng([38, seed])
    positions, rates = {}, {}
    for name in "ab":
        time, rate = commands(rng, PERIOD, top=0.7, ramp=0.05)
        when = time
        if spoil == "clocks":
            when = time * (1.0 + size)
        if spoil == "readings":
            when = time + size * rng.standard_normal(len(time))
        q = (
            saturated(when, time, rate, DELAY, LAG, size)
            if spoil == "limit"
            else answer(when, time, rate, DELAY, LAG)
        )
        if spoil == "backlash":
            for i in range(1, len(q)):  # the joint follows the actuator at either side of its play
                q[i] = min(max(q[i - 1], q[i] - size / 2), q[i] + size / 2)
        q += 2.0 * (name == "b") + NOISE * rng.standard_normal(len(q))
        positions[f"q_{name}"] = np.round(q / RESOLUTION) * RESOLUTION
        rates[f"qdot_cmd_{name}"] = rate
    columns = {"t": time} | positions | rates
    if spoil == "wrapped":
        columns |= {name: (q + size + np.pi) % (2 * np.pi) - np.pi for name, q in positions.items()}
    if spoil == "missing":
        sound = rng.random(len(time)) > size
        columns = {name: values[sound] for name, values in columns.items()}
    if spoil == "stamps":
        columns["t"] = time + rng.uniform(-size, size, len(time))
    if spoil == "index":
        sound = np.flatnonzero(rng.random(len(time)) > size)
        columns = {
            name: values[sound] if name in positions else values[: len(sound)]
            for name, values in columns.items()
        }
    if spoil == "late":
        columns = {
            name: values[size:] if name in positions else values[:-size] for name, values in columns.items()
        }
    if spoil == "slow":
        columns = {name: values[::size] for name, values in columns.items()}
    return columns
