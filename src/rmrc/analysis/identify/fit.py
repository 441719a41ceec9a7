"""The delay, lag and gain that explain the positions of one joint best, with their intervals.

The model of the positions y is y = offset + drift t + g x(t; d, L) + noise, with x of `response`. For given d
and L the rest is linear, and is projected out [Golub73]. The best delay at L = 0 is found on a grid of all
delays; from there Gauss-Newton follows the best delay d(L) to larger lags, and a golden section finds the
best lag. An interval is where S(d, L) ≤ S + κ σ² on the profile over L. It needs no inner optimum, because L
= 0 is a bound where d and L act alike. κ is z², or, if that is larger, t² times the variance of the scores of
12 stretches of the log relative to that in white noise [Bester11]: unexplained residuals widen the intervals.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rmrc.analysis.identify.response import Array, Commands, Lagged

Mask = NDArray[np.bool_]

# 95 % of a normal distribution are within this many standard deviations.
Z = 1.959964
# The sums of the scores of this many stretches of the log give the interval of a weight: with 95 % it is
# within this many of their standard deviations, by Student's distribution.
BATCHES, T = 12, 2.200985
# The earliest apparent response: stamps of two clocks differ, or positions are read late [s].
EARLIEST = 0.1
# Number of delays and lags on the grids of the first search, fine enough for the bandwidth of any arm.
DELAYS, LAGS = 300, 14
# A golden section ends when the lag is known to this share of it.
GOLDEN, NEAR = (math.sqrt(5.0) - 1.0) / 2.0, 1e-5
# At the beginning, and behind a gap, this multiple of the delay is left out: it responds to commands that the
# log lacks. The rest of their effect decays with the lag, and is fitted.
SKIPPED = 1.5
# Least number of rows for a fit.
LEAST_ROWS = 30
# A position that differs from its neighbors by this many standard deviations is an error of the log, if the
# difference is this share of the motion as well: smaller ones do no harm, and may be unexplained motion.
OUTLIER, HARM = 8.0, 1e-4


class Interval(NamedTuple):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half the width."""
        return (self.high - self.low) / 2.0


class Point(NamedTuple):
    """The best fit with one lag.

    Attributes:
        lag: L [s].
        delay: The best delay for it [s].
        cost: S, the sum of squares of the residual.
        curvature: Curvature of S over the delay: S + curvature · (d − delay)².
        gain: g.
    """

    lag: float
    delay: float
    cost: float
    curvature: float
    gain: float


@dataclass(frozen=True, eq=False)
class Samples:
    """Positions of a joint, and the commands to which they respond.

    Attributes:
        commands: Commands of the joint.
        time: Time of the positions, increasing, (N,) [s].
        position: (N,) [rad or m].
        parts: Index of the part between two gaps for each position, (N,), ascending.
        begins: Start of each part [s].
    """

    commands: Commands
    time: Array
    position: Array
    parts: NDArray[np.intp]
    begins: Array

    def kept(self, rows: Mask) -> "Samples":
        """Return some of the rows."""
        parts = self.parts[rows]
        return Samples(self.commands, self.time[rows], self.position[rows], parts, self.begins)

    @property
    def since(self) -> Array:
        """Time since the part of each position began, (N,) [s]."""
        return np.asarray(self.time - self.begins[self.parts])


@dataclass(frozen=True, eq=False)
class Fitted:
    """The fit of a joint.

    Attributes:
        samples: The fitted rows.
        best: The best fit.
        delay: d [s].
        lag: L [s].
        total: d + L, which is known better than each [s].
        gain: g: ratio of the joint's rate to the command.
        drift: Additional drift of the positions [rad/s or m/s].
        residual: Residual of each position, (N,) [rad or m].
        explained: Share of the motion's variance that the fit explains.
        outliers: Rows that were left out as errors.
        profile: The best fits at lags within the interval of the lag.
    """

    samples: Samples
    best: Point
    delay: Interval
    lag: Interval
    total: Interval
    gain: Interval
    drift: Interval
    residual: Array
    explained: float
    outliers: int
    profile: tuple[Point, ...]


def fit(samples: Samples, longest: float, resolution: float) -> Fitted | None:
    """Fit delay, lag, gain, drift and offset; None where too few rows remain after the first responses.

    Args:
        samples: Samples of a joint that moves, with commands that change.
        longest: Largest delay and lag of the search [s].
        resolution: Resolution of the positions; 0: none is visible.
    """
    first = _Search(samples, longest).scan()
    rows = samples.since >= SKIPPED * max(first, 0.0)
    if rows.sum() < LEAST_ROWS or not np.ptp(samples.position[rows]):
        return None
    work = _Search(samples.kept(rows), longest)
    best = work.best(first)
    wrong = _spikes(work.residual(best), max(resolution, HARM / OUTLIER * float(np.ptp(work.y))))
    if wrong.any():
        work = _Search(work.samples.kept(~wrong), longest)
        best = work.best(best.delay + best.lag)
    return work.judged(best, int(wrong.sum()))


def fit_lag(fitted: Fitted, delay: float, longest: float) -> float:
    """Return the best lag for a given delay, as all joints of an arm share one [s]."""
    work = _Search(fitted.samples, longest)
    lag = max(fitted.best.delay + fitted.best.lag - delay, 0.0)
    low, high = 0.5 * lag, 1.5 * lag + work.period
    return _golden(lambda one: work.point(one, delay, fixed=True), low, high).lag


class _Search:
    """Fits of the positions of one joint, for any delay and lag."""

    def __init__(self, samples: Samples, longest: float) -> None:
        """Project offset and drift out of the positions."""
        self.samples, self.longest = samples, longest
        self.period = float(np.median(np.diff(samples.commands.time)))
        own = [samples.parts == part for part in np.unique(samples.parts)]
        self.own = np.column_stack(own).astype(float)
        self.clock = samples.time - samples.time.mean()
        trend = self.clock / max(float(np.ptp(self.clock)), self.period)
        self.basis = np.linalg.qr(np.column_stack([self.own, trend]))[0]
        self.y = self.free(samples.position)

    def free(self, values: Array) -> Array:
        """Return values, (N,) or (N, k), without offsets and drift."""
        return np.asarray(values - self.basis @ (self.basis.T @ values))

    def scan(self) -> float:
        """Return the best delay of a grid without a lag [s]."""
        lagged = self.samples.commands.lagged(0.0)
        step = max(self.period, self.longest / DELAYS)
        delays = np.arange(-EARLIEST, self.longest + step, step)
        gained = np.zeros(len(delays))
        for i, delay in enumerate(delays):
            x = self.free(lagged.at(self.samples.time - delay)[0])
            square = float(x @ x)
            gained[i] = float(x @ self.y) ** 2 / square if square > 0.0 else 0.0
        return float(delays[np.argmax(gained)])

    def best(self, delay: float) -> Point:
        """Return the best fit, starting from the best delay without a lag."""
        lags = np.array([0.0, *np.geomspace(min(0.2 * self.period, 0.1 * self.longest), self.longest, LAGS)])
        points, at, before = [], delay, 0.0
        for lag in lags:
            points.append(self.point(float(lag), at - (lag - before)))
            at, before = points[-1].delay, lag
        i = int(np.argmin([one.cost for one in points]))
        low, high = lags[max(i - 1, 0)], lags[min(i + 1, LAGS)]
        total = points[i].delay + points[i].lag
        found = _golden(lambda lag: self.point(lag, total - lag), float(low), float(high))
        return min(found, points[i], key=lambda one: one.cost)

    def point(self, lag: float, delay: float, fixed: bool = False) -> Point:
        """Return the best fit with a lag, near a delay or at exactly that delay, by Gauss-Newton."""
        lagged = self.samples.commands.lagged(lag)
        cost, gain, step, curvature = self._step(lagged, delay)
        for _ in range(0 if fixed else 20):
            while abs(step) > 1e-9:  # halve a step that is too long: far from its minimum S is no parabola
                tried = self._step(lagged, delay + step)
                if tried[0] < cost:
                    break
                step /= 2.0
            else:
                break
            delay, gained = delay + step, cost - tried[0]
            cost, gain, step, curvature = tried
            if gained <= 1e-9 * cost:
                break
        return Point(float(lag), float(delay), cost, curvature, gain)

    def columns(self, lagged: Lagged, delay: float) -> tuple[Array, Array]:
        """Return travel and the rest of the rates before each part, (N, k), and the rates, (N,)."""
        travel, rate = lagged.at(self.samples.time - delay)
        columns = [travel]
        if lagged.lag:
            rest = np.exp(-np.maximum(self.samples.since - delay, 0.0) / lagged.lag)[:, None] * self.own
            columns += [one for one in rest.T if one.max() > 1e-6]
        return self.free(np.column_stack(columns)), self.free(rate)

    def _step(self, lagged: Lagged, delay: float) -> tuple[float, float, float, float]:
        """Return S, g, the step to the best delay if x were linear in it, and S's curvature."""
        columns, rate = self.columns(lagged, delay)
        weights = _solved(columns, self.y)
        residual = self.y - columns @ weights
        slope = -weights[0] * (rate - columns @ _solved(columns, rate))
        curvature = float(slope @ slope)
        step = float(slope @ residual) / curvature if curvature > 0.0 else 0.0
        return float(residual @ residual), float(weights[0]), step, curvature

    def residual(self, point: Point) -> Array:
        """Return the residual of a fit."""
        columns, _ = self.columns(self.samples.commands.lagged(point.lag), point.delay)
        return np.asarray(self.y - columns @ _solved(columns, self.y))

    def judged(self, best: Point, outliers: int) -> Fitted:
        """Return the fit with its intervals."""
        residual = self.residual(best)
        columns, rate = self.columns(self.samples.commands.lagged(best.lag), best.delay)
        rate -= columns @ _solved(columns, rate)
        more = max(0.05 * best.lag, 0.25 * self.period)
        later = self.columns(self.samples.commands.lagged(best.lag + more), best.delay - more)[0][:, 0]
        both = np.column_stack([columns, rate])
        later -= both @ _solved(both, later)
        bound = best.cost + max(_spread(residual, one) ** 2 * float(one @ one) for one in (rate, later))
        profile = self.profile(best, bound)
        others = np.column_stack([both[:, 1:], later])
        travel = columns[:, 0] - others @ _solved(others, columns[:, 0])
        spread = _spread(residual, travel)
        gain = Interval(best.gain, best.gain - spread, best.gain + spread)
        reach = [
            (one, float(np.sqrt(max(bound - one.cost, 0.0) / one.curvature)) if one.curvature else np.inf)
            for one in profile
        ]
        ends = [(one.delay - far, one.delay + far, one.lag) for one, far in reach]
        delay = Interval(best.delay, min(low for low, _, _ in ends), max(high for _, high, _ in ends))
        total = Interval(
            best.delay + best.lag,
            min(low + lag for low, _, lag in ends),
            max(high + lag for _, high, lag in ends),
        )
        lag = Interval(best.lag, profile[0].lag, profile[-1].lag)
        explained = 1.0 - best.cost / float(self.y @ self.y)
        return Fitted(
            self.samples, best, delay, lag, total, gain, self._drift(best, residual), residual,
            explained, outliers, profile,
        )  # fmt: skip

    def profile(self, best: Point, bound: float) -> tuple[Point, ...]:
        """Return best fits at lags from the smallest to the largest within a bound of S."""
        total = best.delay + best.lag

        def over(lag: float) -> float:
            return self.point(lag, total - lag).cost - bound

        step = max(0.02 * best.lag, 0.05 * self.period)
        low, high = best.lag, best.lag + step
        while low > 0.0 and over(low) <= 0.0:
            low, step = max(low - step, 0.0), 2.0 * step
        lows = _crossing(over, low, best.lag) if low > 0.0 or over(0.0) > 0.0 else 0.0
        step = high - best.lag
        while high < self.longest and over(high) <= 0.0:
            step *= 2.0
            high += step
        highs = _crossing(over, min(high, self.longest), best.lag)
        lags = np.unique([*np.linspace(lows, highs, 9), best.lag])
        return tuple(best if lag == best.lag else self.point(float(lag), total - lag) for lag in lags)

    def _drift(self, best: Point, residual: Array) -> Interval:
        """Return the drift with its interval."""
        travel, rate = self.samples.commands.lagged(best.lag).at(self.samples.time - best.delay)
        rows = self.samples.position - best.gain * travel
        others = np.column_stack([self.own, travel, rate])
        clock = self.clock - others @ _solved(others, self.clock)
        value = float(clock @ rows) / float(clock @ clock) if clock.any() else 0.0
        spread = _spread(residual, clock)
        return Interval(value, value - spread, value + spread)


def _solved(columns: Array, values: Array) -> Array:
    """Return the least-squares weights of columns, by scaled normal equations."""
    scale = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    scale[scale == 0.0] = 1.0
    scaled = columns / scale
    return np.asarray(np.linalg.lstsq(scaled.T @ scaled, scaled.T @ values, rcond=1e-13)[0] / scale)


def _golden(point: Callable[[float], Point], low: float, high: float) -> Point:
    """Return the best point at a lag between two."""
    inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)]
    points, near = [point(one) for one in inner], NEAR * high
    while high - low > near:
        if points[0].cost < points[1].cost:
            high, points[1] = points[1].lag, points[0]
            points[0] = point(high - GOLDEN * (high - low))
        else:
            low, points[0] = points[0].lag, points[1]
            points[1] = point(low + GOLDEN * (high - low))
    return min(points, key=lambda one: one.cost)


def _crossing(over: Callable[[float], float], outside: float, inside: float) -> float:
    """Return where a function changes its sign, to a hundredth of the interval."""
    for _ in range(7):
        middle = 0.5 * (outside + inside)
        outside, inside = (outside, middle) if over(middle) <= 0.0 else (middle, inside)
    return inside


def _spread(residual: Array, column: Array) -> float:
    """Return half the width of the interval of a column's weight, whatever the residual's autocorrelation."""
    square = float(column @ column)
    if not square > 0.0:
        return 0.0
    sums = np.array([part.sum() for part in np.array_split(residual * column, BATCHES)])
    plain = Z * float(np.sqrt(residual @ residual / len(residual) * square))
    return max(plain, T * float(np.sqrt(sums @ sums * BATCHES / (BATCHES - 1)))) / square


def _spikes(residual: Array, least: float) -> Mask:
    """Return which rows differ from their four neighbors as no arm can move.

    Args:
        residual: (N,).
        least: Lower bound of their standard deviation.
    """
    padded = np.pad(residual, 2, mode="edge")
    off = residual - np.median(sliding_window_view(padded, 5), axis=1)
    size = 1.4826 * float(np.median(np.abs(off - np.median(off))))
    return np.asarray(np.abs(off) > OUTLIER * max(size, least))
