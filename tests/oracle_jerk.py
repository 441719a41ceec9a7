"""A bounded jerk, for the oracle: plain numpy and scipy's roots, by the equations (119) to (124) of the theory.

Nothing here shares code with the compiled law: sums are summed, and roots are bracketed.
"""

import numpy as np
from scipy.optimize import brentq

from oracle_limits import brake, gentle


def root(f, low, high):
    """Return where f crosses zero, to rounding."""
    return brentq(f, low, high, xtol=1e-16 * max(1.0, abs(low), abs(high)), rtol=1e-15, maxiter=500)


def largest(holds, low, high):
    """Return the largest number for which something holds, as it does for low and not for high, to rounding."""
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def shortest_way(rate, change, braking):
    """Return the way of the shortest stop (120), in ticks, this one with it: all in steps of jerk."""
    top, now = max(braking, -change), [rate]
    if rate > 0:
        while now[-1] > 0 and -change > len(now):  # the deceleration falls at once
            now.append(now[-1] + change + len(now))
        if now[-1] <= 0:
            return sum(now[:-1])
    elif rate + sum(change - k for k in range(1, int(max(change, 0.0)) + 1)) <= 0:
        return 0.0

    def decelerations(tau):
        k = np.arange(1, np.floor(tau) + 1)
        return k, np.minimum(np.minimum(k - change, top), tau - k)

    most = abs(change) + 1.0
    while decelerations(most)[1].sum() < rate:
        most *= 2
    k, m = decelerations(root(lambda tau: decelerations(tau)[1].sum() - rate, abs(change), most))
    return k @ m


def steady_stop(distance, braking, jerk, period):
    """Return the rates that can be kept, and stopped from within a distance (122), each as far as a tick leads."""

    def taken(v, b, j):
        return v**2 / (2 * b) + v * b / (2 * j) if v >= b**2 / j else v * np.sqrt(v / j)

    def one(d, b, j):
        if d <= 0 or d == np.inf or taken(d / period, b, j) <= d:
            return max(d, 0.0) / period
        return root(lambda v: taken(v, b, j) - d, 0.0, d / period)

    return np.array([one(*each) for each in zip(distance, braking, jerk, strict=True)])


class Easing:
    """What eases the rates of a loop, and remembers what was sent; called once a tick."""

    def __init__(self, n, jerk, acceleration, braking, rate, position, period, is_clamped):
        self.T, self.is_clamped, self.rate, self.position = period, is_clamped, rate, position
        self.jerk = np.broadcast_to(np.asarray(jerk, float), n)
        self.step, self.most, self.braking = self.jerk * period**2, acceleration * period, braking
        self.last, self.course, self.lag, self.slope = (np.zeros(n) for _ in range(4))
        self.sent_to, self.strayed = None, np.zeros(n, bool)
        self.coast, self.sent, self.rates = np.zeros(n), [], []

    def rest_bounds(self, q, position):
        """Return the rates at rest, lower and upper, that end before some positions, (n, 2)."""
        up, down = (
            np.minimum(self.rate, steady_stop(left, self.braking, self.jerk, self.T))
            for left in self.left(q, position)
        )
        return -down, up

    def watch(self, rate):
        """Judge by the measured rates, (n,), how far joints go on after their commands."""
        self.rates.append(rate)
        self.sent.append(self.last)
        fade = max(0.0, 1 - self.T / 2)
        from scipy.signal import lfilter  # which takes a second to load

        # what is behind, and the changes of rates, each less the longer it was ago
        behind = lfilter([self.T], [1, -fade], np.subtract(self.sent, self.rates), axis=0)
        rates = lfilter([1], [1, -fade], np.diff(self.rates, axis=0, prepend=0.0), axis=0)
        age = fade ** np.arange(len(rates))[::-1, None]
        both, square = (age * behind * rates).sum(axis=0), (age * rates**2).sum(axis=0)
        lag = np.divide(both, square, out=np.zeros(len(rate)), where=square > 0)
        self.coast = np.clip(lag, 0.0, 0.5) * rate

    def left(self, q, position=None):
        """Return the ways up and down to some positions, (n, 2), or the limits, less what joints go on by."""
        position = self.position if position is None else position
        there = np.maximum(q, q + self.coast), np.minimum(q, q + self.coast)
        return position[:, 1] - there[0], there[1] - position[:, 0]

    def ahead(self, side):
        """Return the largest changes that can come to zero before the rate limit (119)."""
        return brake(self.rate - side * self.last, self.step, 1.0)

    def lets_pass(self, q, rates):
        """Say whether rates are within all limits, and none is near, so that nothing is eased."""
        change = rates - self.last
        ahead = np.where(change > 0, self.ahead(1), self.ahead(-1))
        reach = [np.abs(self.lag), np.abs(change - self.course), np.abs(change)]
        if any(np.any(x > most) for x, most in zip(reach, (self.step, self.step, self.most), strict=True)):
            return False
        if np.any(np.abs(change) > ahead):
            return False
        b = self.braking * self.T
        for left, side in zip(self.left(q), (1, -1), strict=True):
            rising = np.maximum(side * change, 0.0)
            coasting = side * rates + rising * (rising / self.step + 1) / 2
            ticks = (coasting / b + b / self.step) / 2 + rising / self.step + 2
            if np.any((coasting > 0) & (coasting * ticks * self.T > left)):
                return False
        return True

    def ease(self, q, rates, rest_lo, rest_up, choose=None):
        """Return rates that acceleration and jerk allow, and whether a position limit ahead took from them.

        Args:
            q: Positions.
            rates: Wished for.
            rest_lo: Smallest rates at rest.
            rest_up: Largest.
            choose: Function: rates by common factors, by those of each joint -> what is sent; None: by the scenario's.
        """
        if choose is None:
            eased, is_held = self.eased(q, rates, rest_lo, rest_up, self.is_clamped)
        else:
            (one, is_held), (other, _) = (
                self.eased(q, rates, rest_lo, rest_up, way) for way in (False, True)
            )
            eased = choose(one, other)
        self.look_back(q, rates, eased)
        return eased, is_held

    def eased(self, q, rates, rest_lo, rest_up, is_clamped):
        """Return what `ease` sends, with factors of each joint alone or not."""
        held = (rates >= rest_up) & (rest_up < self.rate) | (rates <= rest_lo) & (rest_lo > -self.rate)
        alone = held | is_clamped
        last, course, step, most = self.last, self.course, self.step, self.most
        up = np.maximum(course - step, np.minimum(course + step, self.ahead(1)))
        down = np.clip(-self.ahead(-1), course - step, course + step)
        lower, upper = last + np.clip(down, -most, most), last + np.clip(up, -most, most)
        eased = rates.copy()
        for group in [np.flatnonzero(~alone), *([j] for j in np.flatnonzero(alone))]:
            if len(group):
                eased[group] = self.approach(np.array(group), rates, lower, upper)
        eased = np.clip(eased, lower, upper)
        top, bottom = self.stopping_rates(q, 1), -self.stopping_rates(q, -1)
        bounded = np.where(
            last > 0, np.minimum(np.maximum(eased, bottom), top), np.maximum(np.minimum(eased, top), bottom)
        )
        return bounded, bool(np.any(np.minimum(top, -bottom) < self.rate))

    def approach(self, i, wish, lower, upper):
        """Return the rates of some joints, eased by the same factors (123), (124)."""
        last, lag, step, wish = self.last[i], self.lag[i], self.step[i], wish[i]
        moves = np.all(np.abs(wish - last - lag - self.slope[i]) <= step * (1 + 1e-9))
        e = lag if moves else wish - last
        far = np.abs(e) > step
        s = np.min(brake(np.abs(e[far]), step[far], 1.0) / np.abs(e[far]), initial=1.0)
        change = wish - (1 - s) * e - last
        ahead = np.where(change > 0, self.ahead(1)[i], self.ahead(-1)[i])
        allowed = (
            np.minimum(self.most[i], ahead) + 1e-9 * step
        )  # third differences of rates are mostly rounding
        moved = change != 0
        change = change * np.min(allowed[moved] / np.abs(change[moved]), initial=1.0)
        c = self.course[i]
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort([(lower[i] - last) / c, (upper[i] - last) / c], axis=0)[:, c != 0]
        first, final = ends[0].max(initial=-np.inf), ends[1].min(initial=np.inf)
        f = np.clip(1.0, first, final) if first <= final else 1.0
        kept = np.clip(last + f * c, lower[i], upper[i])
        wanted = last + change - kept
        room = np.where(wanted > 0, upper[i] - kept, kept - lower[i]) + 1e-9 * step
        over = np.abs(wanted) > room
        return kept + wanted * np.min(room[over] / np.abs(wanted[over]), initial=1.0)

    def stopping_rates(self, q, side):
        """Return the largest rates towards one end of the range from which joints can stop before it (121)."""
        surprise = np.zeros(len(q)) if self.sent_to is None else side * (q + self.coast - self.sent_to)
        lefts = np.maximum(0.0, self.left(q)[0 if side > 0 else 1])
        return np.array([self.stopping_rate(j, side, lefts[j], max(0.0, surprise[j])) for j in range(len(q))])

    def stopping_rate(self, j, side, left, surprise):
        """Return that of one joint."""
        limit, T, step = self.rate[j], self.T, self.step[j]
        if not np.isfinite(left):
            return limit
        v, c, b = side * self.last[j], side * self.course[j], self.braking[j] * T

        def way(change, braking=b):
            return shortest_way((v + change) / step, change / step, braking / step) * step * T

        most, least = c + step, max(c - step, min(c, -self.most[j]))
        if way(most) <= left:
            return limit
        if way(least) <= left:
            return min(limit, v + largest(lambda change: way(change) <= left * (1 + 1e-13), least, most))
        self.strayed[j] = True
        left += surprise
        if way(least, min(self.most[j], 1e9 * step)) <= left:
            return min(limit, v + least)
        steady = brake(left, max(self.braking[j], -c / T), T)
        return min(limit, v + least, max(steady, min(v - self.most[j], gentle(v, left, T))))

    def look_back(self, q, wish, rates):
        """Keep what was wished for, and where the joints should be if they do what they are told."""
        self.slope, self.lag = wish - self.last - self.lag, wish - rates
        there = q + self.coast
        base = there if self.sent_to is None else np.where(self.strayed, self.sent_to, there)
        self.sent_to, self.strayed = base + self.T * rates, np.zeros(len(q), bool)

    def remember(self, rates):
        """Keep what is sent."""
        change = rates - self.last
        most = np.maximum(self.braking * self.T, np.abs(self.course))
        gave_way = np.abs(change - self.course) > self.step * (1 + 1e-9)
        self.last, self.course = rates, np.where(gave_way, np.clip(change, -most, most), change)
