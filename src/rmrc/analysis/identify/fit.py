"""The delay, lag and gain that explain the positions of one joint best, with their intervals.

The model of the positions y is y = b + r t + g x(t; d, L) + c exp(−(t − d)/L) + noise, with x of `response`.
Where rows are missing the commands are unknown: positions that respond to those are left out, and behind them
a new part begins, with its own b and c: the sum of all that was commanded before, and what is left of the
rate. For given d and L the rest is linear, and is projected out [Golub73]. The best delay without a lag is
found on a grid, and from there d and L by the method of Levenberg and Marquardt. An interval is where
S(d, L) ≤ S + κ σ², along the best d for each L. κ is z², or, if that is larger, t² times the variance of the
scores of 12 stretches of the log relative to that in white noise [Bester11]: unexplained residuals widen the
intervals.
"""

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rmrc.analysis.identify.least import dot, least, solved, times, without
from rmrc.analysis.identify.response import Array, Commands

# 95 % of a normal distribution are within this many standard deviations.
Z = 1.959964
# The sums of the scores of this many stretches of the log give the interval of a weight: with 95 % it is
# within this many of their standard deviations, by Student's distribution.
BATCHES, T = 12, 2.200985
# The earliest apparent response: stamps of two clocks differ, or positions are read late [s].
EARLIEST = 0.1
# The first search uses this many positions, delays, lags, and stretches of the log that may drift.
SCANNED, DELAYS, LAGS, LIMITS, STRETCHES, SLOPES = 2000, 300, 6, 5, 8, 60
# Stamps of computers are no better than this [s].
STAMP = 1e-4
# A lag below this share of a period is none.
NO_LAG = 0.02
# Positions within this share of a period of an unknown command are left out as well.
MARGIN = 0.15
# Least number of rows for a fit, and for a part.
LEAST_ROWS, LEAST_PART = 30, 4
# A position that differs from its neighbors by this many standard deviations is an error of the log, if the
# difference is this share of the motion as well: smaller ones do no harm, and may be unexplained motion.
OUTLIER, HARM = 8.0, 5e-4


class Interval(NamedTuple):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half the width."""
        return (self.high - self.low) / 2.0


class Samples(NamedTuple):
    """Positions of a joint, and the commands to which they respond.

    Attributes:
        commands: Commands of the joint.
        time: Time of the positions, increasing, (N,) [s].
        position: (N,) [rad or m].
    """

    commands: Commands
    time: Array
    position: Array


class Cause(NamedTuple):
    """What else may act, and is fitted beside delay and lag.

    Attributes:
        limit: Inverse of the largest acceleration [s²/rad or s²/m].
        drift: Growth of the delay [s/s].
        play: Width of a backlash [rad or m].
    """

    limit: float = 0.0
    drift: float = 0.0
    play: float = 0.0


class Fitted(NamedTuple):
    """The fit of a joint.

    Attributes:
        samples: The fitted rows.
        parts: Index of the part of each row, (N,).
        delay: d [s].
        lag: L [s].
        total: d + L, which is known better than each [s].
        gain: g: ratio of the joint's rate to the command.
        drift: Additional drift of the positions [rad/s or m/s].
        cause: What else was fitted.
        play: Width of the backlash [rad or m].
        rate: Rate of the joint, (N,) [rad/s or m/s].
        residual: Residual of each position, (N,) [rad or m].
        variance: Of the residual, for the degrees of freedom that are left.
        explained: Share of the motion's variance that the fit explains.
        outliers: Rows that were left out as errors.
    """

    samples: Samples
    parts: NDArray[np.intp]
    delay: Interval
    lag: Interval
    total: Interval
    gain: Interval
    drift: Interval
    cause: Cause
    play: float
    rate: Array
    residual: Array
    variance: float
    explained: float
    outliers: int

    @property
    def rms(self) -> float:
        """Standard deviation of the residual."""
        return float(np.sqrt(self.variance))


def scan(samples: Samples, longest: float, slopes: int = 0) -> tuple[float, float]:
    """Return the delay without a lag in the middle of the log, and its growth, that fit best [s], [s/s].

    Args:
        samples: Samples of a joint that moves, with commands that change.
        longest: Largest delay of the search [s].
        slopes: Number of slopes to either side; 0: the delay is constant.
    """
    sent, count = samples.commands, len(samples.time)
    travel = np.concatenate([[0.0], np.cumsum(np.diff(sent.time) * sent.rate[:-1])])
    rows = np.linspace(0, count - 1, min(SCANNED, count)).astype(int)
    first = np.linspace(0, len(rows), STRETCHES, endpoint=False).astype(int)
    counts = np.diff(first, append=len(rows))

    def free(values: Array) -> Array:
        return np.asarray(values - np.repeat(np.add.reduceat(values, first) / counts, counts))

    y, time = free(samples.position[rows]), samples.time[rows]
    step = max(sent.period, longest / DELAYS)
    delays = np.arange(-longest if slopes else -EARLIEST, longest + step, step)
    x = [free(np.interp(time - delay, sent.time, travel)) for delay in delays]
    both, square = (
        np.array([np.add.reduceat(row * other, first) for row, other in pairs])
        for pairs in (((row, y) for row in x), ((row, row) for row in x))
    )
    away = np.arange(-slopes, slopes + 1)[:, None] * np.linspace(-1.0, 1.0, STRETCHES)
    place = np.arange(len(delays))[:, None, None] + np.round(away).astype(int)
    inside = ((place >= 0) & (place < len(delays))).all(axis=2)
    place = np.clip(place, 0, len(delays) - 1), np.arange(STRETCHES)
    explained = both[place].sum(axis=2) ** 2 / np.maximum(square[place].sum(axis=2), 1e-300) * inside
    middle, slope = np.unravel_index(np.argmax(explained), explained.shape)
    ends = time[first[-1] + counts[-1] // 2] - time[counts[0] // 2]
    return float(delays[middle]), float(2.0 * (slope - slopes) * step / ends)


def fit(
    samples: Samples,
    longest: float,
    resolution: float,
    cause: Cause | None = None,
    start: tuple[float, float] | None = None,
) -> Fitted | None:
    """Fit delay, lag, gain, drift and offset; None where too few rows respond to known commands.

    Args:
        samples: Samples of a joint that moves, with commands that change.
        longest: Largest delay and lag of the search [s].
        resolution: Resolution of the positions; 0: none is visible.
        cause: What else to fit, with a first guess of it; None: nothing.
        start: A first guess of delay and lag [s]; None: they are searched.
    """
    cause, outliers = cause or Cause(), 0
    if start is None:
        delay, drift = scan(samples, longest, SLOPES if cause.drift else 0)
        start, cause = (delay, 0.0), cause._replace(drift=drift or cause.drift)
    delay, lag = start
    for _ in range(4):
        search, before = _Search(samples, delay, cause, longest), delay
        if len(search.time) < LEAST_ROWS or not np.ptp(search.y):
            return None
        delay, lag, cause, slopes = search.best(delay, lag, cause)
        residual = search.residual(delay, lag, cause).values
        wrong = search.rows[_spikes(residual, max(resolution, HARM / OUTLIER * float(np.ptp(search.y))))]
        outliers += len(wrong)
        samples = Samples(samples.commands, *(np.delete(values, wrong) for values in samples[1:]))
        if not len(wrong) and abs(delay - before) <= 0.5 * MARGIN * search.period:
            break
    return search.judged(delay, lag, cause, slopes, outliers)


def fit_lag(fitted: Fitted, delay: float) -> tuple[float, float]:
    """Return the best lag for a given delay, as all joints of an arm share one [s], and the variance left."""
    search = _Search(fitted.samples, delay, fitted.cause, np.inf)

    def residual(values: Array) -> Array:
        return search.residual(delay, values[0] * search.period, fitted.cause).values

    start = np.array([max(fitted.total.value - delay, 0.1 * search.period) / search.period])
    values, end, _ = least(residual, start, np.zeros(1))
    return float(values[0] * search.period), dot(end, end) / len(end)


class _Residual(NamedTuple):
    """What is left of the positions, and what explains them, without offsets and lagged starts of the parts.

    Attributes:
        values: The residual, (N,) [rad or m].
        weights: Of the columns: the gain, the drift, and the width of a backlash.
        columns: Travel, time and side of the backlash, (N, k).
        free_rate: Rate of the joint, (N,) [rad/s or m/s].
        rate: The same with all its parts.
        position: (N,) [rad or m].
    """

    values: Array
    weights: Array
    columns: Array
    free_rate: Array
    rate: Array
    position: Array


class _Search:
    """Fits of the positions of one joint, for any delay and lag."""

    def __init__(self, samples: Samples, delay: float, cause: Cause, longest: float) -> None:
        """Choose the positions that respond to known commands if the delay is about this."""
        sent = self.sent = samples.commands
        self.period, self.longest = sent.period, longest
        self.middle = float(np.mean(samples.time[[0, -1]]))
        first = np.flatnonzero(np.concatenate([[True], sent.until[:-1] < sent.time[1:] - 1e-9]))
        begins, ends = sent.time[first], sent.until[np.append(first[1:], len(sent.time)) - 1]
        asked = samples.time - delay - cause.drift * (samples.time - self.middle)
        part = np.searchsorted(begins, asked, "right") - 1
        margin = MARGIN * self.period
        known = (part >= 0) & (asked >= begins[part] + margin) & (asked <= ends[part] - margin)
        known &= (np.bincount(part[known], minlength=len(begins)) >= LEAST_PART)[part]
        self.rows = np.flatnonzero(known)
        self.time, self.y, self.begin = samples.time[known], samples.position[known], begins[part[known]]
        self.first = np.flatnonzero(np.diff(part[known], prepend=-1))
        self.counts = np.diff(self.first, append=len(self.time))
        self.clock = self.time - self.middle

    def spread(self, sums: Array) -> Array:
        """Return a value of each part, (P, k), for each of its rows, (N, k)."""
        return np.repeat(sums, self.counts, axis=0)

    def residual(self, delay: float, lag: float, cause: Cause) -> "_Residual":
        """Return the residual and what it consists of."""
        asked = self.time - delay - cause.drift * self.clock
        travel, rate = self.sent.response(lag, 1.0 / cause.limit if cause.limit else np.inf).at(asked)
        columns = [self.y, travel, self.clock, rate, *([_side(travel, cause.play)] if cause.play else [])]
        free = np.column_stack(columns)
        free -= self.spread(np.add.reduceat(free, self.first) / self.counts[:, None])
        if lag > NO_LAG * self.period:
            tail = np.exp(-np.maximum(asked - self.begin, 0.0) / lag)[:, None]
            tail -= self.spread(np.add.reduceat(tail, self.first) / self.counts[:, None])
            square = np.maximum(np.add.reduceat(tail * tail, self.first), 1e-12)
            free -= tail * self.spread(np.add.reduceat(tail * free, self.first) / square)
        others = free[:, [1, 2, *range(4, free.shape[1])]]
        weights = solved(others, free[:, 0])
        return _Residual(free[:, 0] - times(others, weights), weights, others, free[:, 3], rate, free[:, 0])

    def step(
        self, delay: float, lag: float, cause: Cause, slopes: Array | None = None
    ) -> tuple[float, float]:
        """Return S and the delay, where they are best if the residual is linear in the delay.

        Args:
            delay: A first guess.
            lag: The lag.
            cause: What is fitted as well.
            slopes: Derivatives of the residual by the delay, and others that are free too, (N, k); None:
                those by the delay here.
        """
        here = self.residual(delay, lag, cause)
        if slopes is None:
            slopes = here.weights[0] * without(here.free_rate, here.columns)[:, None]
        steps = solved(slopes, here.values)
        residual = here.values - times(slopes, steps)
        return dot(residual, residual), delay - float(steps[0])

    def best(self, delay: float, lag: float, cause: Cause) -> tuple[float, float, Cause, Array]:
        """Return the best delay, lag and causes, and the residual's derivatives by them, (N, p).

        Args:
            delay: A first guess; that without a lag, if `lag` is 0.
            lag: A first guess; 0: it is searched.
            cause: First guesses of what is fitted as well.
        """
        if not lag:
            trials = []
            for guess in np.geomspace(0.25 * self.period, max(1.2 * delay, 2.0 * self.period), LAGS).tolist():
                for limit in (cause.limit * np.geomspace(1.0, 30.0, LIMITS if cause.limit else 1)).tolist():
                    changed = cause._replace(limit=limit)
                    _, near = self.step(delay - guess, guess, changed)
                    trials.append((*self.step(near, guess, changed), guess, changed))
            _, delay, lag, cause = min(trials, key=lambda trial: trial[0])
        moving = [name for name in ("limit", "drift") if getattr(cause, name)]
        units = {"limit": cause.limit, "drift": self.period / float(np.ptp(self.time))}
        unit = np.array([self.period, self.period, *(units[name] for name in moving)])
        start = np.array([delay, lag, *(getattr(cause, name) for name in moving)]) / unit

        def meaning(values: Array) -> tuple[float, float, Cause]:
            delay, lag, *others = (values * unit).tolist()
            changed = cause._replace(**dict(zip(moving, others, strict=True)))
            return min(max(delay, -self.longest), self.longest), min(lag, self.longest), changed

        lower = np.array([-np.inf, 0.0, *(0.01 if name == "limit" else -np.inf for name in moving)])
        values, _, slopes = least(lambda values: self.residual(*meaning(values)).values, start, lower)
        return *meaning(values), slopes / unit

    def judged(self, delay: float, lag: float, cause: Cause, slopes: Array, outliers: int) -> Fitted:
        """Return the fit with its intervals."""
        here = self.residual(delay, lag, cause)
        count, others, parts = len(here.values), slopes.shape[1] + len(here.weights), len(self.first)
        freedom = max(count - others - parts * (2 if lag > NO_LAG * self.period else 1), 1)
        scores = here.values * np.sqrt(count / freedom)
        columns = np.column_stack([slopes, here.columns])
        alone = [without(columns[:, i], np.delete(columns, i, axis=1)) for i in range(others)]
        halves = [_spread(scores, column) for column in alone]
        cost, excess = (
            dot(here.values, here.values),
            max(halves[i] ** 2 * dot(alone[i], alone[i]) for i in (0, 1)),
        )
        free = np.delete(slopes, 1, axis=1)
        fixed = without(free[:, 0], free[:, 1:])  # of the delay with this lag
        half = float(np.hypot(STAMP, np.sqrt(excess / max(dot(fixed, fixed), 1e-300))))
        ends = [(delay, lag)]
        for side in (-1.0, 1.0):
            far = min(max(halves[1], 0.05 * self.period), self.longest)
            for _ in range(8):
                end = min(max(lag + side * far, 0.0), self.longest)
                _, near = self.step(delay + lag - end, end, cause, free)
                over, near = self.step(near, end, cause, free)
                ratio = float(np.sqrt(excess / max(over - cost, excess / 16.0, 1e-300)))
                if abs(ratio - 1.0) < 0.02 or (ratio > 1.0 and end in (0.0, self.longest)):
                    break
                far = abs(end - lag) * ratio
            ends.append((near, end))
        delays, lags = np.array(ends).T
        totals = delays + lags
        gain, drift, *play = [
            Interval(weight, weight - far, weight + far)
            for weight, far in zip(here.weights.tolist(), halves[slopes.shape[1] :], strict=True)
        ]
        return Fitted(
            Samples(self.sent, self.time, self.y), np.repeat(np.arange(parts), self.counts),
            _around(delays, half), Interval(lag, float(lags.min()), float(lags.max())), _around(totals, half),
            gain, drift, cause, play[0].value if play else 0.0, here.rate, here.values,
            cost / freedom, 1.0 - cost / max(dot(here.position, here.position), 1e-300), outliers,
        )  # fmt: skip


def _around(values: Array, half: float) -> Interval:
    """Return the interval of a value with others on its profile, and half the width without those."""
    value, low, high = float(values[0]), float(values.min()), float(values.max())
    return Interval(
        value, value - float(np.hypot(half, value - low)), value + float(np.hypot(half, high - value))
    )


def _side(travel: Array, width: float) -> Array:
    """Return where in a backlash a joint is, from -1/2 to 1/2 of its width, (N,)."""
    place, places = 0.0, []
    for step in np.diff(travel / width, prepend=travel[0] / width).tolist():
        place = min(max(place + step, -0.5), 0.5)
        places.append(place)
    return np.array(places)


def _spread(residual: Array, column: Array) -> float:
    """Return half the width of the interval of a column's weight, whatever the residual's autocorrelation."""
    square = float(dot(column, column))
    if not square > 0.0:
        return 0.0
    sums = np.array([part.sum() for part in np.array_split(residual * column, BATCHES)])
    plain = Z * float(np.sqrt(dot(residual, residual) / len(residual) * square))
    return max(plain, T * float(np.sqrt(sums @ sums * BATCHES / (BATCHES - 1)))) / square


def _spikes(residual: Array, least: float) -> NDArray[np.bool_]:
    """Return which rows differ from their four neighbors as no arm can move.

    Args:
        residual: (N,).
        least: Lower bound of their standard deviation.
    """
    near = sliding_window_view(np.pad(residual, 2, mode="edge"), 5)
    off = np.abs(residual - np.median(near, axis=1))
    size = 1.4826 * float(np.median(off))
    return np.asarray(
        (off > OUTLIER * max(size, least)) & (off > 2.0 * np.ptp(near[:, [0, 1, 3, 4]], axis=1))
    )
