"""Logs of an arm that nothing of rmrc made: steps of rate, each answered by the closed form of delay and lag."""

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
