"""The largest rate from which a joint can stop within a distance, exact for rates constant over each tick.

With a bounded deceleration the distances per tick are an arithmetic series. With a bounded jerk as well, the
deceleration of the shortest stop is a trapezoid over the ticks: it rises as fast as the jerk bound lets it,
holds, and falls so that it ends with the motion. In units of the jerk step δ, from a rate r that changes by a
per tick,

    m_k = min(k − a, top, τ − k),   r = Σ m_k,   way = Σ k m_k,     k = 1, 2, … < τ

because v_i = Σ_{k>i} m_k, and Σ_i v_i, with the rate of this tick, is Σ k m_k.
"""

import math

from rmrc.law.compiling import compiled

# This many halvings reduce any bracket to rounding; Newton's method and the false position need a tenth.
ENOUGH = 60
CLOSE = 1e-13


@compiled
def brake(distance: float, braking: float, period: float) -> float:
    """Return the largest rate from which a joint can brake within a distance, tick by tick.

    N ticks that begin with a rate r, each slower by b T than the one before, cover N T (r − (N − 1) b T/2).
    N is the least number with N (N + 1)/2 · b T² >= distance.
    """
    if distance <= 0.0:
        return 0.0
    if distance == math.inf:
        return math.inf
    ticks = max(1.0, math.ceil(math.sqrt(0.25 + 2.0 * distance / (braking * period * period)) - 0.5))
    return distance / (ticks * period) + 0.5 * braking * period * (ticks - 1.0)


@compiled
def brake_gently(rate: float, distance: float, period: float) -> float:
    """Return the next rate of the stop within a distance that needs the least deceleration.

    N ticks that follow a rate r, each slower by b T, cover T (N r − N (N + 1)/2 · b T). With the least N >=
    2 d/(r T) the last rate is at most b T, and the first is not negative.
    """
    if distance <= 0.0:
        return min(rate, 0.0)
    ticks = max(1.0, math.ceil(2.0 * distance / (rate * period)))
    return rate - 2.0 * (ticks * rate * period - distance) / (period * ticks * (ticks + 1.0))


@compiled
def stops_within(
    distance: float, rate: float, change: float, braking: float, step: float, period: float
) -> bool:
    """Return whether a joint that has a rate in this tick can stop within a distance, from this tick on.

    Args:
        distance: Remaining distance, not negative.
        rate: Rate in this tick, positive towards the limit.
        change: Change of the rate from the last tick to this one.
        braking: Largest decrease of the rate per tick, unless the rate already decreases faster.
        step: Largest change of the change per tick.
        period: Length of a tick.
    """
    return is_far(distance, rate, change, braking, step, period) or (
        way(rate / step, change / step, braking / step) * step * period <= distance
    )


@compiled
def is_far(distance: float, rate: float, change: float, braking: float, step: float, period: float) -> bool:
    """Return whether a joint stops within a distance by an upper bound that needs no root.

    The bound is the rate that the joint coasts to, for half the time v/b + b/j of a stop from there, plus one
    tick for each rounding to ticks. The arguments are those of `stops_within`.
    """
    rises = max(change, 0.0) / step
    coasting = rate + 0.5 * max(change, 0.0) * (rises + 1.0)
    half_time = 0.5 * (coasting / braking + braking / step) + rises + 2.0
    return coasting <= 0.0 or coasting * half_time * period <= distance


@compiled
def steady_stop(distance: float, braking: float, step: float, period: float) -> float:
    """Return the largest rate that a joint may keep at a distance and still stop within it.

    From a steady rate v a stop takes v/b + b/j, or 2 √(v/j) if the deceleration stays below b, at half that
    rate on average. A rate that follows this bound down needs no more than 2/9 of the jerk, so there is a
    reserve. No hard limit depends on the result, so ticks only matter for the last one.

    Args:
        distance: Remaining distance, not negative.
        braking: Largest decrease of the rate per tick.
        step: Largest change of the change per tick.
        period: Length of a tick.
    """
    ticks = distance / period
    bend = 0.5 * braking * braking / step
    if ticks * step * step < braking * braking * braking:
        return min(ticks, float((ticks * ticks * step) ** (1.0 / 3.0)))
    return min(ticks, math.sqrt(bend * bend + 2.0 * braking * ticks) - bend)


@compiled
def largest_change(
    distance: float, rate: float, least: float, most: float, braking: float, step: float, period: float,
    stretch: float = 1.0, early: float = 0.0,
) -> float:  # fmt: skip
    """Return the largest change of a rate in this tick from which the joint can stop within a distance.

    Between the change that stops the joint at once and a change from which it cannot stop in time, the
    stopping distance is almost linear: the method is the false position.

    Args:
        distance: Remaining distance, not negative.
        rate: Rate of the last tick, positive towards the limit.
        least: A change from which the joint can stop.
        most: A change from which it cannot.
        braking: Largest decrease of the rate per tick, unless the rate already decreases faster.
        step: Largest change of the change per tick.
        period: Length of a tick.
        stretch: Length of the ticks ahead over that of this one. The changes of this tick are `stretch` times
            as large in a tick ahead, of which `braking`, `step` and `period` are.
        early: Steps of jerk that are added to them then.
    """
    r, left, top, now = rate / step, distance / (step * period), braking / step, 1.0 / stretch
    low, high = least * stretch / step, most * stretch / step
    at_once = -r * stretch if r >= 0.0 else brake(-r, 1.0, 1.0)
    if low < at_once < high and way(r + now * at_once, at_once + early, top) <= left:
        low = at_once
    below = way(r + now * low, low + early, top) - left
    above = way(r + now * high, high + early, top) - left
    moved = 0  # which end moved: the value of an end that stays twice is halved from then on [Dowell71]
    for _ in range(ENOUGH):
        if below >= -CLOSE * left:
            break
        a = low - below * (high - low) / (above - below)
        if not low < a < high:
            a = 0.5 * (low + high)
        if not low < a < high:
            break
        more = way(r + now * a, a + early, top) - left
        if more <= CLOSE * left:
            low, below, above, moved = a, more, 0.5 * above if moved < 0 else above, -1
        else:
            high, above, below, moved = a, more, 0.5 * below if moved > 0 else below, 1
    return low * step * now


@compiled
def way(r: float, a: float, top: float) -> float:
    """Return the shortest stopping distance, this tick included; see above for the units.

    If the joint turns back although its deceleration falls as fast as the jerk bound allows, the result is
    the distance until it turns.

    Args:
        r: Rate in this tick.
        a: Change of the rate from the last tick.
        top: Largest deceleration, unless it is larger already.
    """
    top = max(top, -a)
    ticks = math.floor(abs(a))
    coasting = r + math.copysign(ticks * abs(a) - 0.5 * ticks * (ticks + 1.0), a)
    if coasting <= 0.0:
        return until_it_turns(r, -a) if r > 0.0 else 0.0
    tau = trapezoid_end(r, a, top)
    k1, k2 = ramps(tau, a, top)
    n1, n2, n3 = math.floor(k1), math.floor(k2), math.floor(tau)
    held = top * (sum_1(n2) - sum_1(n1))
    return sum_2(n1) - a * sum_1(n1) + held + tau * (sum_1(n3) - sum_1(n2)) - (sum_2(n3) - sum_2(n2))


@compiled
def until_it_turns(r: float, m: float) -> float:
    """Return the distance of a rate that falls by m − 1, m − 2, … until it is no longer positive."""
    b = m - 0.5
    ticks = math.ceil(b - math.sqrt(max(0.0, b * b - 2.0 * r)))
    return ticks * r - m * 0.5 * ticks * (ticks - 1.0) + (ticks - 1.0) * ticks * (ticks + 1.0) / 6.0


@compiled
def trapezoid_end(r: float, a: float, top: float) -> float:
    """Return τ by Newton's method from the value for continuous time: Σ m_k is piecewise linear in τ."""
    area = max(r + 0.5 * a * (a - 1.0), 0.0)
    height = min(top, math.sqrt(area))
    low, high = abs(a), math.inf
    tau = low if height == 0.0 else max(low, a + height + area / height)
    for _ in range(ENOUGH):
        k1, k2 = ramps(tau, a, top)
        n1, n2, n3 = math.floor(k1), math.floor(k2), math.floor(tau)
        total = sum_1(n1) - a * n1 + top * (n2 - n1) + tau * (n3 - n2) - (sum_1(n3) - sum_1(n2))
        missing = r - total
        if abs(missing) <= CLOSE * (abs(r) + 1e-3 * abs(total)):
            break
        if missing > 0.0:
            low = tau
        else:
            high = tau
        following = tau + missing / (n3 - n2) if n3 > n2 else math.nan
        if not low < following < high:
            following = 2.0 * low + 1.0 if high == math.inf else 0.5 * (low + high)
        if following == tau:
            break
        tau = following
    return tau


@compiled
def ramps(tau: float, a: float, top: float) -> tuple[float, float]:
    """Return where the deceleration stops rising and where it begins to fall; equal in a triangle."""
    middle = 0.5 * (a + tau)
    return min(a + top, middle), max(tau - top, middle)


@compiled
def sum_1(n: float) -> float:
    """Return 1 + 2 + … + n."""
    return 0.5 * n * (n + 1.0)


@compiled
def sum_2(n: float) -> float:
    """Return 1² + 2² + … + n²."""
    return n * (n + 1.0) * (2.0 * n + 1.0) / 6.0
