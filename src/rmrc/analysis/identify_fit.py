"""The delay, lag and gain that explain the positions of one joint best, with their intervals.

The model of the positions y is y = b + r t + g x(t; d, L) + c exp(−(t − d)/L) + noise, with x of `response`.
Where rows are missing the commands are unknown: positions that respond to those are left out, and behind them
a new part begins, with its own b and c: the sum of all that was commanded before, and what is left of the
rate. For given d and L the rest is linear, and is projected out [Golub73].

The unknowns are d + L and L², because the residual is regular in both, even at L = 0, where d and L act
alike. The best delay without a lag is found on a grid, and from there both by the method of Levenberg and
Marquardt. Their errors are linear in the noise. Of a weight of it, the half-width of the interval is z σ, or,
if that is larger, t times that of the sums over 12 stretches of the log [Bester11]: unexplained residuals
widen the intervals.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rmrc.analysis.identify_response import Array, Commands, Samples

# 95 % of a normal distribution are within this many standard deviations.
Z = 1.959964
# With 95 % a value is within this many standard deviations, by Student's distribution, of this many batches.
BATCHES, T = 12, 2.200985
# The earliest apparent response: stamps of two clocks differ, or positions are read late; the latest [s].
EARLIEST, LATEST = 0.1, 0.5
# The search uses this many positions, delays, and stretches of the log that may drift.
SCANNED, DELAYS, STRETCHES = 2000, 300, 8
# Stamps of computers are no better than this [s].
STAMP = 1e-4
# Positions within this share of a period of an unknown command are left out as well.
MARGIN = 0.15
# Least number of rows for a fit, and for a part.
LEAST_ROWS, LEAST_PART = 30, 4
# A lag without a delay explains the positions as well if its sum of squares is this multiple.
NEAR = 1.1
# Most steps of the search; its differences of d + L, in periods, and of other values, as a share of them. L²
# changes by this many squared periods, at least: a smaller lag is hidden between the rows.
STEPS, SMALL, SHARE, HIDDEN = 30, 1e-6, 1e-3, 0.25


class Interval(NamedTuple):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half the width."""
        return (self.high - self.low) / 2.0


class Fitted(NamedTuple):
    """The fit of a joint.

    Attributes:
        samples: The fitted rows.
        delay: d [s].
        lag: L [s].
        total: d + L, which is known better than each [s].
        gain: g: ratio of the joint's rate to the command.
        size: Of the cause that was fitted as well; 0: none.
        is_ahead: Whether the joint responds before its commands: a lag without a delay does not explain it.
        rate: Rate of the joint, (N,) [rad/s or m/s].
        residual: Residual of each position, (N,) [rad or m].
        rms: Standard deviation of the residual, for the degrees of freedom that are left [rad or m].
        explained: Share of the motion's variance that the fit explains.
    """

    samples: Samples
    delay: Interval
    lag: Interval
    total: Interval
    gain: Interval
    size: float
    is_ahead: bool
    rate: Array
    residual: Array
    rms: float
    explained: float


def scan(samples: Samples, earliest: float) -> float:
    """Return the delay without a lag that fits best, on a grid from this much before the commands [s]."""
    sent = samples.commands
    travel = np.concatenate([[0.0], np.cumsum(np.diff(sent.time) * sent.rate[:-1])])
    rows = np.linspace(0, len(samples.time) - 1, SCANNED).astype(int).reshape(STRETCHES, -1)

    def free(values: Array) -> Array:
        return np.asarray(values - values.mean(axis=1, keepdims=True))

    step, y = max(sent.period, LATEST / DELAYS), free(samples.position[rows])
    delays, explained = np.arange(-earliest, LATEST + step, step), []
    for delay in delays:
        x = free(np.interp(samples.time[rows] - delay, sent.time, travel))
        explained.append(np.sum(x * y) ** 2 / max(np.sum(x * x), 1e-300))
    return float(delays[np.argmax(explained)])


def fit(
    samples: Samples, cause: str = "", sizes: Sequence[float] = (), earliest: float = EARLIEST
) -> Fitted | None:
    """Fit delay, lag, gain, drift and offset; None where too few rows respond to known commands.

    Args:
        samples: Samples of a joint that moves, with commands that change.
        cause: What to fit as well: `"limit"`, a largest acceleration; `"backlash"`; `"drift"`, a growth
            of the delay; or "".
        sizes: First guesses of its size: the inverse of the acceleration [s²/rad or s²/m]; the width [rad or
            m]; the growth [s/s].
        earliest: The search begins this much before the commands [s].
    """
    delay, period = scan(samples, earliest), samples.commands.period
    unit = np.array([period, period**2, *sizes[:1]])
    totals, extra = (delay, 0.4 * delay), [[size] for size in sizes] or [[]]  # a cause delays as well
    starts = [np.array([late, max(0.5 * late, period) ** 2, *size]) for late in totals for size in extra]
    for _ in range(4):
        search, before = _Search(samples, delay, cause, unit), delay
        if len(search.time) < LEAST_ROWS or not np.ptp(search.y):
            return None
        start = min(starts, key=lambda start: float(np.sum(search.residual(start) ** 2)))
        values, slopes = search.best(start)
        starts, delay = [values], float(values[0] - np.sqrt(values[1]))
        if abs(delay - before) <= 0.5 * MARGIN * period:
            break
    return search.judged(values, slopes)


class _Search:
    """Fits of the positions of one joint, for any values of d + L, L², and the size of a cause."""

    def __init__(self, samples: Samples, delay: float, cause: str, unit: Array) -> None:
        """Choose the positions that respond to known commands if the delay is about this."""
        sent = self.sent = samples.commands
        self.cause, self.unit, self.period = cause, unit, sent.period
        first = np.flatnonzero(np.concatenate([[True], sent.until[:-1] < sent.time[1:] - 1e-9]))
        begins, ends = sent.time[first], sent.until[np.append(first[1:], len(sent.time)) - 1]
        asked, margin = samples.time - delay, MARGIN * self.period
        part = np.searchsorted(begins, asked, "right") - 1
        known = (part >= 0) & (asked >= begins[part] + margin) & (asked <= ends[part] - margin)
        known &= (np.bincount(part[known], minlength=len(begins)) >= LEAST_PART)[part]
        self.time, self.y, self.begin = samples.time[known], samples.position[known], begins[part[known]]
        self.first = np.flatnonzero(np.diff(part[known], prepend=-1))
        self.counts = np.diff(self.first, append=len(self.time))

    def sums(self, values: Array) -> Array:
        """Return the sums over the part of each row, (N, k)."""
        return np.repeat(np.add.reduceat(values, self.first), self.counts, axis=0)

    def free(self, values: Array) -> tuple[Array, Array]:
        """Return positions, travel and time without the parts' offsets and starts, (N, 3), and the rate."""
        total, square, *size = values.tolist()
        asked = self.time - total + np.sqrt(square)
        if self.cause == "drift":
            asked -= size[0] * (self.time - np.mean(self.time))
        lag = max(float(np.sqrt(square)), 1e-3 * self.period)
        limit = 1.0 / size[0] if self.cause == "limit" and size[0] else np.inf
        travel, rate = self.sent.answer(asked, lag, limit)
        if self.cause == "backlash":
            travel = _loose(travel, size[0])
        tail = np.exp(-np.maximum(asked - self.begin, 0.0) / lag)
        free = np.column_stack([self.y, travel, self.time, tail])
        free -= self.sums(free) / np.repeat(self.counts, self.counts)[:, None]
        free, tail = free[:, :3], free[:, 3:]
        return free - tail * self.sums(tail * free) / np.maximum(self.sums(tail * tail), 1e-12), rate

    def residual(self, values: Array) -> Array:
        """Return what gain and drift leave of the positions, (N,)."""
        free, _ = self.free(values)
        return np.asarray(free[:, 0] - np.einsum("ij,j->i", free[:, 1:], _weights(free[:, 1:], free[:, 0])))

    def best(self, start: Array) -> tuple[Array, Array]:
        """Return the values with the least sum of squares, and the residual's derivatives by them, (N, p).

        It is the method of Levenberg and Marquardt, with differences in place of derivatives.
        """
        least = -np.inf if self.cause == "drift" else 0.0
        values, lower, damping = start / self.unit, np.array([-np.inf, 0.0, least])[: len(start)], 1e-4
        here = self.residual(start)
        for _ in range(STEPS):
            changes = np.array([SMALL, max(HIDDEN, SHARE * values[1]), SHARE])[: len(start)]
            beside = [self.residual((values + change) * self.unit) for change in np.diag(changes)]
            slopes = (np.column_stack(beside) - here[:, None]) / changes
            gram, gradient, before = _gram(slopes), np.einsum("ij,i->j", slopes, here), np.sum(here**2)
            free, step = (values > lower) | (gradient < 0.0), np.zeros(len(start))
            while damping < 1e6:
                damped = gram + damping * np.diag(np.diag(gram))
                step[free] = -_inverse(damped[np.ix_(free, free)]) @ gradient[free]
                trial = np.maximum(values + step, lower)
                there = self.residual(trial * self.unit)
                if np.sum(there**2) < before:
                    break
                damping *= 10.0
            else:
                break
            values, here, damping = trial, there, 0.1 * damping
            if np.sum(here**2) > (1.0 - 1e-9) * before:
                break
        return values * self.unit, slopes / self.unit

    def judged(self, values: Array, slopes: Array) -> Fitted:
        """Return the fit with its intervals."""
        (free, rate), residual, (total, square, *size) = (
            self.free(values),
            self.residual(values),
            values.tolist(),
        )
        columns, count, cost = np.column_stack([slopes, free[:, 1:]]), len(self.y), float(np.sum(residual**2))
        freedom = max(count - columns.shape[1] - 2 * len(self.first), 1)
        inverse = _inverse(_gram(columns))
        turn = inverse[0, 1] / max(inverse[1, 1], 1e-300)  # how the best d + L changes with L²
        influence = np.einsum("ij,jk->ik", columns, inverse)
        influence[:, 0] -= turn * influence[:, 1]
        halves = _halves(residual * np.sqrt(count / freedom), influence)
        squares = np.maximum(square + halves[1] * np.array([0.0, -1.0, 1.0]), 0.0)
        totals, lags, half = total + turn * (squares - square), np.sqrt(squares), np.hypot(STAMP, halves[0])
        delay, gain = _around(totals - lags, half), float(_weights(free[:, 1:], free[:, 0])[0])
        without = self.residual(np.array([total, max(total, 0.0) ** 2, *size]))
        return Fitted(
            Samples(self.sent, self.time, self.y), delay, Interval(*lags.tolist()), _around(totals, half),
            Interval(gain, gain - halves[-2], gain + halves[-2]), size[0] if size else 0.0,
            bool(delay.high < 0.0 and np.sum(without**2) > NEAR * cost), rate, residual,
            float(np.sqrt(cost / freedom)), 1.0 - cost / max(float(np.sum(free[:, 0] ** 2)), 1e-300),
        )  # fmt: skip


def _around(values: Array, half: float) -> Interval:
    """Return the interval of the first value, given half its width for known L², and values at L²'s ends."""
    away = values - values[0]
    low, high = np.hypot(half, away.min()), np.hypot(half, away.max())
    return Interval(float(values[0]), float(values[0] - low), float(values[0] + high))


def _loose(travel: Array, width: float) -> Array:
    """Return the travel behind a backlash, (N,)."""
    place, places = float(travel[0]), []
    for driven in travel.tolist():
        place = min(max(place, driven - 0.5 * width), driven + 0.5 * width)
        places.append(place)
    return np.array(places)


def _halves(residual: Array, influence: Array) -> Array:
    """Return half the widths of the intervals of weighted sums, (k,), for any autocorrelation."""
    parts = np.array_split(residual[:, None] * influence, BATCHES)
    sums = np.sum([part.sum(axis=0) ** 2 for part in parts], axis=0)
    plain = Z * np.sqrt(np.mean(residual**2) * np.sum(influence**2, axis=0))
    return np.asarray(np.maximum(plain, T * np.sqrt(sums * BATCHES / (BATCHES - 1))))


def _weights(columns: Array, y: Array) -> Array:
    """Return the weights of columns that explain values best, (k,)."""
    return np.asarray(_inverse(_gram(columns)) @ np.einsum("ij,i->j", columns, y))


def _gram(columns: Array) -> Array:
    """Return the products of columns, (k, k): without threads, which cost more than they save here."""
    return np.asarray(np.einsum("ij,ik->jk", columns, columns))


def _inverse(gram: Array) -> Array:
    """Return the inverse of products of columns of any units, (k, k)."""
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    return np.asarray(
        np.linalg.pinv(gram / scale / scale[:, None], 1e-13, hermitian=True) / scale / scale[:, None]
    )


# The residual -------------------------------------------------------------------------------------
#
# What a fit leaves: noise and resolution of encoders, jitter of stamps, and causes beside delay and lag.
#
# These causes are a largest acceleration, a backlash, and two clocks that drift apart.

# A residual above this multiple of the noise has a cause; it is named if it leaves less than this share of
# the excess.
POOR, NAMED = 2.0, 0.25
# A cause is looked for in so many commands, or rows.
STRETCH = 4000


class Noise(NamedTuple):
    """Noise of the positions of a joint.

    Attributes:
        value: Standard deviation of the white noise of its encoder [rad or m].
        resolution: Step of its positions; 0: none is visible [rad or m].
        jitter: Standard deviation of the time at which they are read [s].
        total: Standard deviation of all these together, in the mean [rad or m].
    """

    value: float
    resolution: float
    jitter: float
    total: float


class Cause(NamedTuple):
    """What a joint has besides delay and lag.

    Attributes:
        name: `"limit"`, a largest acceleration; `"backlash"`; `"drift"`, of two clocks; `"unknown"`; or `""`.
        size: The acceleration [rad/s² or m/s²]; the width [rad or m]; the growth of the delay [s/s]; or 0.
    """

    name: str
    size: float = 0.0


def resolution(position: Array) -> float:
    """Return the step that divides all differences of positions; 0 if none is visible.

    Args:
        position: (N,) [rad or m].

    Example:
        >>> round(resolution(0.25 * np.arange(20) ** 2 % 7), 9)
        0.25
    """
    values = np.unique(position)
    steps = np.diff(values)
    steps = steps[steps > 1e-12 * max(float(np.abs(values).max()), 1e-6)]  # smaller ones are rounding
    if len(steps) < 4:
        return 0.0
    unit = float(steps.min())
    for units in (1.5, 5.0, 15.0, 50.0):  # a file with few digits rounds each step
        near = steps[steps < units * unit]
        whole = np.maximum(np.round(near / unit), 1.0)
        unit = float(near @ whole / (whole @ whole))
    agreement = abs(complex(np.exp(2j * np.pi * near / unit).mean()))
    return unit if len(near) >= 4 and agreement > 0.95 else 0.0


def noise_of(fitted: Fitted) -> Noise:
    """Return the noise of the positions of a fit.

    Second differences of the residual cancel smooth parts. Their mean square is 6 σ² + τ² (w₋² + 4 w² + w₊²)
    with the rates w and a jitter τ of the times.
    """
    step = resolution(fitted.samples.position)
    steps, squares = np.diff(fitted.samples.time), fitted.rate**2
    near = np.maximum(steps[1:], steps[:-1]) < 1.5 * np.median(steps)  # without gaps
    second = np.diff(fitted.residual, 2)[near] ** 2
    grown = (squares[:-2] + 4.0 * squares[1:-1] + squares[2:])[near]
    # a joint that moves by less than its resolution repeats its reading, whatever the noise
    pace = np.median(steps) * np.sqrt(grown / 6.0)
    moving = pace >= step if (pace >= step).sum() > 0.1 * len(pace) else pace >= 0.0
    columns = np.column_stack([np.full(moving.sum(), 6.0), grown[moving]])
    second, weight = second[moving], np.ones(moving.sum())
    for _ in range(8):
        scaled = columns * weight[:, None]
        square, jitter = np.linalg.lstsq(scaled.T @ columns, scaled.T @ second, rcond=None)[0]
        square, jitter = max(square, 0.0), max(jitter, 0.0)
        weight = 1.0 / np.maximum(columns @ (square, jitter), 1e-3 * second.mean() + 1e-300) ** 2
    if jitter * grown.mean() < 3.0 * square or jitter < (0.5 * STAMP) ** 2:
        square, jitter = float(second.mean()) / 6.0, 0.0
    rounding = step**2 / 12.0
    total = float(np.sqrt(max(square, rounding) + jitter * squares.mean()))
    return Noise(float(np.sqrt(max(square - rounding, 0.0))), step, float(np.sqrt(jitter)), total)


def explained(samples: Samples, plain: Fitted, noise: Noise) -> tuple[Fitted, Cause]:
    """Return the fit with what explains a residual above the noise, and its cause.

    Args:
        samples: Samples of the joint.
        plain: The fit of delay and lag.
        noise: Its noise.
    """
    part = _stretch(samples)
    sharpest = float(np.max(np.abs(np.diff(part.commands.rate)) / np.diff(part.commands.time)))
    growth = _drift(samples)
    corrected = samples._replace(time=samples.time - growth * (samples.time - np.mean(samples.time)))
    fits = {
        "limit": fit(part, "limit", [each / sharpest for each in (1.5, 5.0, 20.0)]),
        "backlash": fit(part, "backlash", [each * plain.rms for each in (2.0, 6.0)]),
        "drift": fit(corrected, "drift", [1e-6], LATEST),
    }
    name, fitted = min(fits.items(), key=lambda item: item[1].rms if item[1] else np.inf)
    if not fitted or fitted.rms**2 - noise.total**2 > NAMED * (plain.rms**2 - noise.total**2):
        return plain, Cause("unknown")
    sizes = {"limit": 1.0 / max(fitted.size, 1e-9), "backlash": fitted.size, "drift": growth + fitted.size}
    return fitted, Cause(name, sizes[name])


def _drift(samples: Samples) -> float:
    """Return the growth of the delay from stretch to stretch of a log [s/s]."""
    rows = np.array_split(np.arange(0, len(samples.time), -(-len(samples.time) // STRETCH)), STRETCHES)
    parts = [Samples(samples.commands, samples.time[part], samples.position[part]) for part in rows]
    fits = [each for part in parts if (each := fit(part, earliest=LATEST))]
    if len(fits) < 3:
        return 0.0
    times, totals = np.array([(np.mean(each.samples.time), each.total.value) for each in fits]).T
    first, second = np.triu_indices(len(fits), 1)
    return float(np.median((totals[second] - totals[first]) / (times[second] - times[first])))


def _stretch(samples: Samples) -> Samples:
    """Return the part of a long log in which the commands change most."""
    sent = samples.commands
    if len(sent.time) <= STRETCH:
        return samples
    changes = np.concatenate([[0.0], np.cumsum(np.diff(sent.rate, append=sent.rate[-1]) ** 2)])
    first = int(np.argmax(changes[STRETCH:] - changes[:-STRETCH]))
    commands = Commands(*(values[first : first + STRETCH] for values in (sent.time, sent.rate, sent.until)))
    rows = (samples.time >= commands.time[0]) & (samples.time <= commands.until[-1])
    return Samples(commands, samples.time[rows], samples.position[rows])
